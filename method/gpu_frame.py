"""Frames as the graphics processor reads them: textures that are there, and arrays that are uploaded."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import moderngl


class TextureContent(enum.Enum):
    """What the numbers in a texture mean."""

    LEVELS = "levels"  # whole numbers from 0 on, gamma-encoded: read with a usampler2D
    ENCODED = "encoded"  # pixel values L' in [0, 1], normalized or floats
    LINEAR = "linear"  # linear channel values, of which 1 is the display's peak; held within [0, 1]


@dataclass(frozen=True, slots=True, eq=False)
class FrameTexture:
    """A frame in the memory of the graphics processor.

    Attributes
    ----------
    texture : moderngl.Texture
        R, G, B in the first three of its channels; of the context that analyses it.
    content : TextureContent
        What its numbers mean.
    levels : int
        How many levels `LEVELS` has: 256, 1024 or 65536; of no meaning otherwise.
    from_below : bool
        Whether its first row is the lowest one, as in textures that were drawn to.
    """

    texture: moderngl.Texture
    content: TextureContent
    levels: int = 256
    from_below: bool = False

    def __post_init__(self) -> None:
        kind, channels = self.texture.dtype, self.texture.components
        if channels < 3 or kind.startswith("u") is not (self.content is TextureContent.LEVELS):
            raise ValueError(
                f"need a texture of three or more channels, of whole numbers (u1, u2) for levels alone, "
                f"got {channels} of {kind} for {self.content.value}"
            )
        if self.levels not in (256, 1024, 65536):
            raise ValueError(f"levels must be 256, 1024 or 65536, got {self.levels}")


class Source(enum.Enum):
    """What the first shader reads; the names are those of `method/shaders/channels.glsl`."""

    LEVELS = "SOURCE_LEVELS"
    ENCODED = "SOURCE_ENCODED"
    LINEAR = "SOURCE_LINEAR"
    PACKED_8 = "SOURCE_PACKED_8"  # uint8, three to a pixel, no gaps: less to upload than a texture of four
    PACKED_16 = "SOURCE_PACKED_16"
    FLOATS = "SOURCE_FLOATS"


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """An array as the bytes that are uploaded.

    Attributes
    ----------
    source : Source
        How the shader reads them.
    words : array
        The numbers, rows without gaps.
    """

    source: Source
    words: NDArray[Any]


def packed(pixel_values: NDArray[Any]) -> Packed:
    """Return a frame as it is uploaded.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        Gamma-encoded R, G, B: uint8 or uint16 over the full range, or floats in [0, 1].

    >>> packed(np.zeros((8, 8, 3), np.float64)).words.dtype
    dtype('float32')
    """
    if pixel_values.dtype == np.uint8:
        return Packed(Source.PACKED_8, np.ascontiguousarray(pixel_values))
    if pixel_values.dtype == np.uint16:
        return Packed(Source.PACKED_16, np.ascontiguousarray(pixel_values))
    if np.issubdtype(pixel_values.dtype, np.integer):
        pixel_values = pixel_values / np.iinfo(pixel_values.dtype).max
    return Packed(Source.FLOATS, np.ascontiguousarray(pixel_values, dtype=np.float32))
