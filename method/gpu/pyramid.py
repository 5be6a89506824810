"""Frames as the graphics processor reads them, and the Gaussian pyramid of their luminance in its memory.

A frame is a texture that is there already, or an array that is uploaded.
"""

from __future__ import annotations

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


@dataclass(frozen=True, slots=True, eq=False)
class FrameTexture:
    """A frame in the memory of the graphics processor, of whole numbers from 0 on, gamma-encoded."""

    texture: moderngl.Texture  # R, G, B in the first three of its channels; of the context that analyses it
    levels: int = 256  # how many there are: 256, 1024 or 65536
    from_below: bool = False  # whether its first row is the lowest one, as in textures that were drawn to

    def __post_init__(self) -> None:
        kind, channels = self.texture.dtype, self.texture.components
        if channels < 3 or not kind.startswith("u"):
            raise ValueError(
                "need a texture of three or more channels, of whole numbers (u1, u2), "
                f"got {channels} of {kind}"
            )
        if self.levels not in (256, 1024, 65536):
            raise ValueError(f"levels must be 256, 1024 or 65536, got {self.levels}")


def packed(pixel_values: NDArray[Any]) -> NDArray[Any]:
    """Return a frame as it is uploaded: uint8, uint16 or float32, rows without gaps.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        Gamma-encoded R, G, B: uint8 or uint16 over the full range, or floats in [0, 1].

    >>> packed(np.zeros((8, 8, 3), np.float64)).dtype
    dtype('float32')
    """
    if pixel_values.dtype in (np.uint8, np.uint16):
        return np.ascontiguousarray(pixel_values)
    if np.issubdtype(pixel_values.dtype, np.integer):
        pixel_values = pixel_values / np.iinfo(pixel_values.dtype).max
    return np.ascontiguousarray(pixel_values, dtype=np.float32)


# What the first shader reads, as `shaders/channels.glsl` calls it. Whole numbers are uploaded three to a
# pixel, without gaps: less than a texture of four.
_OF_TEXTURE = "SOURCE_LEVELS"
_OF_ARRAY = {"uint8": "SOURCE_PACKED_8", "uint16": "SOURCE_PACKED_16", "float32": "SOURCE_FLOATS"}
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
        self._from_frame: dict[str, moderngl.ComputeShader] = {}
        self._linear: dict[int, moderngl.Buffer] = {}
        self._uploaded: moderngl.Buffer | None = None

    def fill(self, frame: FrameTexture | NDArray[Any], results: moderngl.Buffer) -> None:
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
        height, width = self.shapes[0]
        if frame.texture.size != (width, height):
            got = "{} x {}".format(*frame.texture.size)
            raise InputError(f"the texture has {got} pixels; need {width} x {height}")
        reading = self._program(_OF_TEXTURE)
        self._take_levels(reading, frame.levels)
        _set(reading, "from_below", frame.from_below)
        frame.texture.use(0)
        return reading

    def _upload(self, frame: NDArray[Any]) -> moderngl.ComputeShader:
        if frame.shape[:2] != self.shapes[0]:
            raise InputError(f"expected a frame of the shape {self.shapes[0]}, got {frame.shape[:2]}")
        reading = self._program(_OF_ARRAY[frame.dtype.name])
        size = -(-frame.nbytes // 4) * 4 + 4  # the shader reads one word ahead
        if self._uploaded is None or self._uploaded.size != size:
            if self._uploaded is not None:
                self._uploaded.release()
            self._uploaded = _buffer(self._context, size)
        self._uploaded.orphan()  # the frame before may still be read
        self._uploaded.write(frame)
        self._uploaded.bind_to_storage_buffer(FRAME)
        if frame.dtype != np.float32:
            self._take_levels(reading, np.iinfo(frame.dtype).max + 1)
        return reading

    def _take_levels(self, reading: moderngl.ComputeShader, levels: int) -> None:
        if levels not in self._linear:
            encoded = np.arange(levels) / (levels - 1)
            linear: NDArray[Any] = (encoded**self._display.gamma).astype(np.float32)
            self._linear[levels] = self._context.buffer(linear.tobytes())
        self._linear[levels].bind_to_storage_buffer(LINEAR)
        _set(reading, "top", float(levels - 1))

    def _program(self, source: str) -> moderngl.ComputeShader:
        if source not in self._from_frame:
            defined: dict[str, object] = {source: "", "FROM_FRAME": ""}
            if self._order is PixelToLuminance.LUMA_FIRST:
                defined["LUMA_FIRST"] = ""
            self._from_frame[source] = program(self._context, ("mirror", "channels", "reduce"), defined)
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
    if reading.get(name, None) is not None:
        reading[name] = value
