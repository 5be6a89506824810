"""Frames as the graphics processor reads them, and the Gaussian pyramid of their luminance in its memory.

A frame is a texture that is there already, or an array that is uploaded.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.pyramid import level_shapes
from evenlight.method.gpu.context import program

if TYPE_CHECKING:
    import moderngl


class TextureContent(enum.Enum):
    """What the numbers in a texture mean."""

    LEVELS = "levels"  # whole numbers from 0 on, gamma-encoded: read with a usampler2D
    ENCODED = "encoded"  # pixel values L' in [0, 1], normalized or floats
    LINEAR = "linear"  # linear channel values, of which 1 is the display's peak; held within [0, 1]


@dataclass(frozen=True, slots=True, eq=False)
class FrameTexture:
    """A frame in the memory of the graphics processor."""

    texture: moderngl.Texture  # R, G, B in the first three of its channels; of the context that analyses it
    content: TextureContent  # what its numbers mean
    levels: int = 256  # how many levels `LEVELS` has: 256, 1024 or 65536; of no meaning otherwise
    from_below: bool = False  # whether its first row is the lowest one, as in textures that were drawn to

    def __post_init__(self) -> None:
        kind, channels = self.texture.dtype, self.texture.components
        if channels < 3 or kind.startswith("u") is not (self.content is TextureContent.LEVELS):
            raise ValueError(
                f"need a texture of three or more channels, of whole numbers (u1, u2) for levels alone, "
                f"got {channels} of {kind} for {self.content.value}"
            )
        if self.levels not in (256, 1024, 65536):
            raise ValueError(f"levels must be 256, 1024 or 65536, got {self.levels}")


class FrameSource(enum.Enum):
    """What the first shader reads; named as in `shaders/channels.glsl` and `TextureContent`."""

    LEVELS = "SOURCE_LEVELS"
    ENCODED = "SOURCE_ENCODED"
    LINEAR = "SOURCE_LINEAR"
    PACKED_8 = "SOURCE_PACKED_8"  # uint8, three to a pixel, no gaps: less to upload than a texture of four
    PACKED_16 = "SOURCE_PACKED_16"
    FLOATS = "SOURCE_FLOATS"


@dataclass(frozen=True, slots=True, eq=False)
class PackedFrame:
    """An array as the bytes that are uploaded."""

    source: FrameSource  # how the shader reads them
    words: NDArray[Any]  # the numbers, rows without gaps


def packed(pixel_values: NDArray[Any]) -> PackedFrame:
    """Return a frame as it is uploaded.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        Gamma-encoded R, G, B: uint8 or uint16 over the full range, or floats in [0, 1].

    >>> packed(np.zeros((8, 8, 3), np.float64)).words.dtype
    dtype('float32')
    """
    if pixel_values.dtype == np.uint8:
        return PackedFrame(FrameSource.PACKED_8, np.ascontiguousarray(pixel_values))
    if pixel_values.dtype == np.uint16:
        return PackedFrame(FrameSource.PACKED_16, np.ascontiguousarray(pixel_values))
    if np.issubdtype(pixel_values.dtype, np.integer):
        pixel_values = pixel_values / np.iinfo(pixel_values.dtype).max
    return PackedFrame(FrameSource.FLOATS, np.ascontiguousarray(pixel_values, dtype=np.float32))


PYRAMID, LINEAR, FRAME, RESULTS = 0, 1, 2, 3  # places of buffers in `channels.glsl` and `reduce.glsl`
SUM_WORDS = 8  # at the beginning of the results: sums of R, G, B and luminance, low and high words
SUM_UNIT = 2.0**-21  # `FIXED_POINT` of `reduce.glsl`
_MADE = 16  # pixels across and down that a group makes


class GpuPyramid:
    """Makes the luminance of frames of one size, and its Gaussian levels.

    Parameters
    ----------
    context : moderngl.Context
        With compute shaders.
    shape : (height, width)
        Of the frames [pixels].
    display : Display
        The display that shows them.
    order : PixelToLuminance
        Whether channels are linearized before they are weighed.
    n_levels : int
        How many levels.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shape: tuple[int, int],
        display: Display,
        order: PixelToLuminance,
        n_levels: int,
    ) -> None:
        self._context, self._display, self._order = context, display, order
        self.shapes = level_shapes(shape)[:n_levels]
        sizes = [height * width for height, width in self.shapes]
        self.begins = [0, *np.cumsum(sizes).tolist()]
        self.buffer = _buffer(context, 4 * self.begins[-1])
        self._reduce = program(context, ("mirror", "reduce"), {})
        self._from_frame: dict[FrameSource, moderngl.ComputeShader] = {}
        self._linear: dict[int, moderngl.Buffer] = {}
        self._uploaded: moderngl.Buffer | None = None

    def fill(self, frame: FrameTexture | PackedFrame, results: moderngl.Buffer) -> None:
        """Make the levels of a frame, and add its channels to the sums at the beginning of the results."""
        reading = self._bound(frame) if isinstance(frame, FrameTexture) else self._upload(frame)
        self.buffer.bind_to_storage_buffer(PYRAMID)
        results.bind_to_storage_buffer(RESULTS)
        self._run(reading, 0)
        for level in range(1, len(self.shapes) - 1):
            self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)
            self._run(self._reduce, level)
        self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)

    def _run(self, making: moderngl.ComputeShader, level: int) -> None:
        """Make level + 1 from a level."""
        (fine_height, fine_width), (height, width) = self.shapes[level : level + 2]
        for name, value in (
            ("fine_size", (fine_width, fine_height)),
            ("coarse_size", (width, height)),
            ("fine_at", self.begins[level]),
            ("coarse_at", self.begins[level + 1]),
        ):
            making[name] = value
        making.run(-(-width // _MADE), -(-height // _MADE))

    def _bound(self, frame: FrameTexture) -> moderngl.ComputeShader:
        """Return the program that reads a texture, with the texture bound."""
        height, width = self.shapes[0]
        if frame.texture.size != (width, height):
            got = "{} x {}".format(*frame.texture.size)
            raise InputError(f"the texture has {got} pixels; need {width} x {height}")
        reading = self._program(FrameSource[frame.content.name])
        if frame.content is TextureContent.LEVELS:
            self._take_levels(reading, frame.levels)
        _set(reading, "from_below", frame.from_below)
        frame.texture.use(0)
        return reading

    def _upload(self, frame: PackedFrame) -> moderngl.ComputeShader:
        """Return the program that reads an array, with the array uploaded."""
        if frame.words.shape[:2] != self.shapes[0]:
            raise InputError(f"expected a frame of the shape {self.shapes[0]}, got {frame.words.shape[:2]}")
        reading = self._program(frame.source)
        size = -(-frame.words.nbytes // 4) * 4 + 4  # the shader reads one word ahead
        if self._uploaded is None or self._uploaded.size != size:
            if self._uploaded is not None:
                self._uploaded.release()
            self._uploaded = _buffer(self._context, size)
        self._uploaded.orphan()  # the frame before may still be read
        self._uploaded.write(frame.words)
        self._uploaded.bind_to_storage_buffer(FRAME)
        if frame.source in (FrameSource.PACKED_8, FrameSource.PACKED_16):
            self._take_levels(reading, np.iinfo(frame.words.dtype).max + 1)
        return reading

    def _take_levels(self, reading: moderngl.ComputeShader, levels: int) -> None:
        """Bind the table of linear values of whole numbers."""
        if levels not in self._linear:
            encoded = np.arange(levels) / (levels - 1)
            linear: NDArray[Any] = (encoded**self._display.gamma).astype(np.float32)
            self._linear[levels] = self._context.buffer(linear.tobytes())
        self._linear[levels].bind_to_storage_buffer(LINEAR)
        _set(reading, "top", float(levels - 1))

    def _program(self, source: FrameSource) -> moderngl.ComputeShader:
        """Return the program that reads frames of one kind, compiled when it is first asked for."""
        if source not in self._from_frame:
            luma_first = self._order is PixelToLuminance.LUMA_FIRST
            if luma_first and source is FrameSource.LINEAR:
                raise InputError(
                    "a texture of linear values has no luma: need pixel_to_luminance 'linear_first', or a "
                    "texture of gamma-encoded values"
                )
            defined: dict[str, object] = {source.value: "", "FROM_FRAME": ""}
            self._from_frame[source] = program(
                self._context,
                ("mirror", "channels", "reduce"),
                defined | ({"LUMA_FIRST": ""} if luma_first else {}),
            )
        black, peak = self._display.black_level, self._display.peak_luminance
        for name, value in (("gamma", self._display.gamma), ("black", black), ("span", peak - black)):
            _set(self._from_frame[source], name, value)
        return self._from_frame[source]


def sums_of(words: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return the sums of R, G, B and luminance share from the first words of the results, (4,)."""
    low, high = words[0:SUM_WORDS:2].astype(np.float64), words[1:SUM_WORDS:2].astype(np.float64)
    return np.asarray((low + high * 2.0**32) * SUM_UNIT)


def _buffer(context: moderngl.Context, size: int) -> moderngl.Buffer:
    """Return a buffer, or refuse one that the driver has no room for in a shader."""
    largest = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
    if size > largest:
        raise InputError(
            f"the frames need a buffer of {size / 2**20:.0f} MiB on the graphics processor, whose driver "
            f"allows {largest / 2**20:.0f} MiB: take smaller frames, or the processor (device cpu)"
        )
    return context.buffer(reserve=size, dynamic=True)


def _set(reading: moderngl.ComputeShader, name: str, value: Any) -> None:
    """Set a uniform, if the program uses it."""
    if reading.get(name, None) is not None:
        reading[name] = value
