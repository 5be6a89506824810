"""Draws an image, dimmed, into a window's back buffer: pixel by pixel, in the middle of a uniform ground.

Of an image larger than the window its middle is drawn.

numpy says, for each level that a pixel may have, which two codes make its dimmed luminance and in what mix
(`stimuli.dithering`), and the shader takes one of the two for each channel of each pixel. It works in whole
numbers only, so it draws exactly the codes of numpy's reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import LumaChroma, Pixels
from evenlight.data_schema.recordings.rig import Dither
from evenlight.method.gpu.context import is_software, renderer_name
from evenlight.stimuli.dithering import (
    DEEP_LEVELS,
    level_mixtures,
    levels_of,
    neighbouring_codes,
)
from evenlight.stimuli.field_renderer import CodeRenderer
from evenlight.stimuli.plane_uploads import PlaneUploads

if TYPE_CHECKING:
    import moderngl

TABLE_WIDTH = 256  # of the mixtures, which would be too long for one row


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An image in the graphics memory."""

    texture: moderngl.Texture  # whole numbers, three or more channels
    levels: int  # how many levels they are from 0 on: 256, 1024 or 65536
    from_below: bool = False  # whether its first row is the lowest one, as in textures that were drawn to


@dataclass(frozen=True, slots=True, eq=False)
class EyeImages:
    """An image for each view of a headset."""

    views: Sequence[Image]


@dataclass(frozen=True, slots=True, eq=False)
class DimmedImage:
    """An image as it is shown.

    Attributes
    ----------
    image : Image or EyeImages
        The image; of several a screen shows the first one, the left eye's.
    factor : float
        Brightness factor b that its pixels are dimmed by, in (0, 1].
    ground : float
        L around the image, reflected light included [cd/m^2].
    ink : float
        L of text over it [cd/m^2].
    coverage : array of uint8, (height, width), or None
        How much of each pixel the text covers, row 0 on top; as large as the window.
    """

    image: Image | EyeImages
    factor: float
    ground: float
    ink: float = 0.0
    coverage: NDArray[np.uint8] | None = None

    def of_view(self, index: int) -> Image:
        """Return the image that a view shows, 0 the left eye's."""
        return self.image.views[index] if isinstance(self.image, EyeImages) else self.image


class ImageUploads:
    """Puts images into the graphics memory of a context.

    Attributes
    ----------
    takes_planes : bool
        Whether pictures of Y, Cb, Cr are best uploaded as they are: not where no graphics card draws.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._uploaded: moderngl.Texture | None = None
        self._planes: PlaneUploads | None = None
        self.takes_planes = not is_software(renderer_name(context))

    def image(self, pixel_values: NDArray[Any]) -> Image:
        """Return the image of pixel values L', (height, width, 3), of any kind of `Frame`; see `upload`."""
        return self.upload(*levels_of(pixel_values))

    def upload(self, levels: Pixels, count: int) -> Image:
        """Return the image of an array of levels; it holds until the next one is uploaded.

        Parameters
        ----------
        levels : array of uint8 or uint16, (height, width, 3), or LumaChroma
            Row 0 on top.
        count : int
            How many levels there are.
        """
        if isinstance(levels, LumaChroma):
            self._planes = self._planes or PlaneUploads(self._context)
            return Image(self._planes.rgb(levels), count)
        height, width, channels = levels.shape
        kind = "u1" if levels.dtype == np.uint8 else "u2"
        texture = self._uploaded
        if texture is None or (texture.size, texture.dtype) != ((width, height), kind):
            if texture is not None:
                texture.release()
            texture = self._context.texture((width, height), channels, alignment=1, dtype=kind)
            self._uploaded = texture
        texture.write(np.ascontiguousarray(levels), alignment=1)
        return Image(texture, count)


class ImageRenderer(CodeRenderer, ImageUploads):
    """Draws images with the codes of one display; parameters as of `CodeRenderer`."""

    SHADER = "image"

    def __init__(self, context: moderngl.Context, display: Display, bits: int, dither: Dither) -> None:
        ImageUploads.__init__(self, context)
        CodeRenderer.__init__(self, context, display, bits, dither)
        self._mixtures = context.texture((TABLE_WIDTH, DEEP_LEVELS // TABLE_WIDTH), 2, dtype="u4")
        self._mixed: tuple[int, float] | None = None  # what the mixtures are for
        self._set(image=0, mixtures=1, thresholds=2, coverage=3)

    def draw(
        self, framebuffer: moderngl.Framebuffer, picture: DimmedImage, frame: int = 0, seed: int = 0
    ) -> None:
        """Draw a picture over the whole framebuffer.

        Parameters
        ----------
        framebuffer : moderngl.Framebuffer
            Where to.
        picture : DimmedImage
            What.
        frame, seed : int
            Number of the frame, and seed of the dithering noise; both in [0, 2^32).
        """
        image = picture.of_view(0)
        (width, height), (whole, high) = image.texture.size, framebuffer.size
        self._take_mixtures(image.levels, picture.factor)
        self._take_text(picture.coverage)
        ink = picture.ground if picture.coverage is None else picture.ink
        self._set(ground=self._mixture(picture.ground), ink=self._mixture(ink))
        self._set(height=high, corner=((whole - width) // 2, (high - height) // 2))
        self._set(from_below=image.from_below, frame=frame, seed=seed)
        self._begin(framebuffer)
        self._render(image.texture, self._mixtures, self._thresholds, self._text)

    def _take_mixtures(self, levels: int, factor: float) -> None:
        if self._mixed != (levels, factor):
            mixtures = level_mixtures(levels, factor, self._display, self._bits)
            viewport = (0, 0, TABLE_WIDTH, levels // TABLE_WIDTH)
            self._mixtures.write(np.ascontiguousarray(mixtures), viewport=viewport)
            self._mixed = levels, factor

    def _mixture(self, luminance: float) -> tuple[int, int]:
        lower, share = neighbouring_codes(luminance, self._display, self._bits)
        return int(lower), int(share)
