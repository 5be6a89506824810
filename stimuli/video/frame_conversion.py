"""Decoded frames as gamma-encoded R, G, B (docs/decisions/colour-conversion.md), and with fewer pixels.

A pixel of a display that cannot show all pixels of a video gives the mean light of those that lie in it. So
light is averaged by area, not pixel values: a fine checkerboard of black and white is half as bright as
white, not 22 %.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import ColorRange, ColorTrc, Interpolation, VideoReformatter
from numpy.typing import NDArray
from scipy import sparse

from evenlight.data_schema.frame import Frame
from evenlight.stimuli.video.square_pixels import SQUARE, square_size

if TYPE_CHECKING:
    from av.sidedata.sidedata import SideData
    from av.video.format import VideoFormat

# Without these two flags FFmpeg's conversion of 8-bit video is up to 3 codes wrong, with them 0.5.
EXACT = Interpolation.BILINEAR | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
# ITU-T H.273, table 4: code of the matrix -> K_R, K_B.
LUMA_WEIGHTS = {
    1: (0.2126, 0.0722),  # BT.709
    4: (0.30, 0.11),  # FCC 73.682
    5: (0.299, 0.114),  # BT.601, 625 lines
    6: (0.299, 0.114),  # BT.601, 525 lines
    7: (0.212, 0.087),  # SMPTE 240M
    9: (0.2627, 0.0593),  # BT.2020, non-constant luminance
}
BT709, BT601, RGB = 1, 6, 0
PLANES = ("yuv", "gray", "ya")  # beginnings of the names of formats that are interpolated as they are
UNTAGGED = (2, 3)  # unspecified, reserved
DEEP = (9, 10, 12, 14, 16)  # bits that FFmpeg knows planar formats of
NOT_GAMMA_ENCODED = {ColorTrc.LINEAR: "linear light", ColorTrc.SMPTE2084: "HDR (PQ)"}


class UnsupportedColourError(ValueError):
    """Pixels that cannot be taken as gamma-encoded R, G, B; the message says what they are."""


class ColourConverter:
    """Turns decoded frames into R, G, B; keeps FFmpeg's conversion tables from frame to frame.

    Parameters
    ----------
    pixel_aspect : Fraction
        Width of the frames' pixels over their height; what comes out has square ones.
    """

    def __init__(self, pixel_aspect: Fraction = SQUARE) -> None:
        self._aspect = pixel_aspect
        self._reformatter, self._resampler = VideoReformatter(), VideoReformatter()
        self._matrices: dict[float, tuple[int, ...] | None] = {}

    def rgb(self, frame: VideoFrame) -> NDArray[Any]:
        """Return gamma-encoded R, G, B over the full range of the integer type, upright, without alpha.

        Parameters
        ----------
        frame : VideoFrame
            A decoded frame; its colour tags are completed where it has none.

        Returns
        -------
        array, (height, width, 3)
            uint8 for up to 8 bits a channel, else uint16.

        Raises
        ------
        UnsupportedColourError
            If the pixels are not gamma-encoded, or of a format or colour matrix that is not understood.
        """
        depth, part = _depth(frame.format), self.shown_part(frame)
        require_gamma_encoded(frame)
        complete_tags(frame)
        frame = self.with_square_pixels(frame)
        if frame.format.name.startswith(("gray", "ya")):
            pixels = _gray(frame, depth)
        elif depth > 8 or frame.format.name.startswith("yuva"):
            pixels = self._deep(frame, depth)
        else:
            pixels = self._shallow(frame)
        if self._aspect != SQUARE and not frame.format.name.startswith(PLANES):
            kind = "yuv444p" if pixels.dtype == np.uint8 else "yuv444p16le"
            channels = VideoFrame.from_ndarray(np.ascontiguousarray(pixels.transpose(2, 0, 1)), kind)
            pixels = self.with_square_pixels(channels).to_ndarray().transpose(1, 2, 0)
        return upright(pixels[part], self.display_matrix(frame))

    def shown_part(self, frame: VideoFrame) -> tuple[slice, slice]:
        """Return rows and columns of a frame in square pixels, without added samples of chroma."""
        rows = slice(frame.height if self._aspect >= 1 else None)
        return rows, slice(frame.width if self._aspect <= 1 else None)

    def with_square_pixels(self, frame: VideoFrame) -> VideoFrame:
        """Return a frame with whole samples of chroma, its planes interpolated by cubics to square pixels.

        R, G, B stays as it is: FFmpeg would take it by way of Y, Cb, Cr, and white would no longer be white.
        """
        frame = _with_whole_chroma(frame)
        if self._aspect == SQUARE or not frame.format.name.startswith(PLANES):
            return frame
        width, height = square_size(frame.width, frame.height, self._aspect)
        # In one thread: FFmpeg writes beyond the ends of rows, into those that another thread has done. Along
        # rows it is as exact without accurate rounding, and takes 0.4 times as long.
        cubic = Interpolation.BICUBIC | (0 if self._aspect > 1 else Interpolation.ACCURATE_RND)
        return self._resampler.reformat(frame, width=width, height=height, interpolation=cubic, threads=1)

    def display_matrix(self, frame: VideoFrame) -> tuple[int, ...] | None:
        """Return how a picture is turned or mirrored to be seen, None if it is not.

        It is asked once of one video for each angle: the answer keeps its frame in memory.
        """
        if frame.rotation not in self._matrices:
            self._matrices[frame.rotation] = None
            with suppress(ValueError):  # PyAV does not know all kinds of side data, such as an image's EXIF
                side = cast("SideData | None", frame.side_data.get("DISPLAYMATRIX"))
                matrix = () if side is None else tuple(np.frombuffer(bytes(side), np.int32).tolist())
                if matrix and not (matrix[1] == matrix[3] == 0 < min(matrix[0], matrix[4])):
                    self._matrices[frame.rotation] = matrix
        return self._matrices[frame.rotation]

    def _shallow(self, frame: VideoFrame) -> NDArray[Any]:
        packed = "rgb24" if frame.format.is_rgb else "gbrp"  # to planes is 3 times as fast, and as exact
        target = "rgba" if _has_alpha(frame.format) else packed
        pixels: NDArray[Any] = self._reformat(frame, target).to_ndarray()
        for k, channel in enumerate(frame.format.components if frame.format.is_rgb else ()):
            if channel.bits < 8:  # FFmpeg repeats bits, or takes 252 for the white of 3 bits
                top = 2**channel.bits - 1
                pixels[..., k] = np.rint((pixels[..., k] >> 8 - channel.bits) * (255 / top))
        return _over_black(pixels) if target == "rgba" else pixels

    def _deep(self, frame: VideoFrame, depth: int) -> NDArray[Any]:
        """Convert more than 8 bits, or Y, Cb, Cr and alpha, which are rounded once.

        FFmpeg unpacks and upsamples chroma, the matrix is applied here: FFmpeg's own conversion to 16 bits
        maps white to 65283 instead of 65535.
        """
        levels, depth = (np.uint8, 16) if depth <= 8 else (np.uint16, depth)
        alpha = "a" if _has_alpha(frame.format) else ""
        kind = f"gbr{alpha}p" if frame.format.is_rgb else f"yuv{alpha}444p"
        try:
            planes = planes_of(self._reformat(frame, f"{kind}{depth}le"))
        except ValueError as error:  # FFmpeg has no such format
            raise UnsupportedColourError(f"pixel format {frame.format.name}") from error
        top = 2**depth - 1
        if frame.format.is_rgb and not alpha:
            return _over_16_bits(np.stack([planes[2], planes[0], planes[1]], axis=-1), top)
        if frame.format.is_rgb:
            pixels = np.stack([planes[2], planes[0], planes[1]], axis=-1) / np.float32(top)
        else:
            pixels = np.clip(_from_luma_and_chroma(planes, depth, frame), 0, 1)
        if (
            alpha and not frame.format.is_rgb
        ):  # as it is in the frame: more bits of it would be scaled otherwise
            planes, top = planes_of(frame), 2 ** _depth(frame.format) - 1
        if alpha:
            pixels *= (planes[3] / np.float32(top))[..., np.newaxis]
        return np.asarray(np.rint(pixels * np.float32(np.iinfo(levels).max)).astype(levels))

    def _reformat(self, frame: VideoFrame, target: str) -> VideoFrame:
        wanted = ColorRange(frame.color_range) if target.startswith("yuv") else ColorRange.JPEG
        return self._reformatter.reformat(
            frame,
            format=target,
            interpolation=EXACT,
            src_color_range=frame.color_range,
            dst_color_range=wanted,
        )


def _with_whole_chroma(frame: VideoFrame) -> VideoFrame:
    """Repeat the last row and column where chroma stands for more pixels: FFmpeg would stretch it."""
    form = frame.format
    across, down = (8 // form.chroma_width(8), 8 // form.chroma_height(8))
    width, height = frame.width + -frame.width % across, frame.height + -frame.height % down
    if (width, height) == (frame.width, frame.height) or not form.name.startswith("yuv"):
        return frame
    larger = VideoReformatter().reformat(frame, width=width, height=height)  # with all tags of the frame
    larger.make_writable()
    for new, old in zip(planes_of(larger), planes_of(frame), strict=True):
        rows, columns = (many - few for many, few in zip(new.shape, old.shape, strict=True))
        new[:] = np.pad(old, ((0, rows), (0, columns)), mode="edge")
    return larger


def upright(pixels: NDArray[Any], matrix: tuple[int, ...] | None) -> NDArray[Any]:
    """Return pixels as a display matrix shows them, where that keeps rows and columns."""
    a, b, _, c, d = np.sign((matrix or (1, 0, 0, 0, 1))[:5])
    if a and d and not (b or c):
        return np.ascontiguousarray(pixels[::d, ::a])
    if b and c and not (a or d):
        return np.ascontiguousarray(pixels.swapaxes(0, 1)[::b, ::c])
    return pixels  # by another angle than quarter turns


def _depth(pixel_format: VideoFormat) -> int:
    depth = max(component.bits for component in pixel_format.components)
    unknown = pixel_format.name.startswith("xyz") or "f16" in pixel_format.name  # half-precision floats
    if unknown or (depth > 8 and depth not in DEEP):
        raise UnsupportedColourError(f"pixel format {pixel_format.name}")
    return depth


def _has_alpha(pixel_format: VideoFormat) -> bool:
    return pixel_format.has_palette or any(component.is_alpha for component in pixel_format.components)


def require_gamma_encoded(frame: VideoFrame) -> None:
    """Refuse pixels that are encoded otherwise."""
    if frame.color_trc in NOT_GAMMA_ENCODED:
        raise UnsupportedColourError(f"{NOT_GAMMA_ENCODED[ColorTrc(frame.color_trc)]} pixels")


def complete_tags(frame: VideoFrame) -> None:
    """Give a frame without colour tags the customary matrix and range."""
    gray = frame.format.name.startswith(("gray", "ya"))
    if not frame.format.is_rgb and not gray:
        frame.colorspace = matrix_of(frame)
        if frame.colorspace not in LUMA_WEIGHTS:
            raise UnsupportedColourError(f"colour matrix {frame.colorspace} of ITU-T H.273")
    if frame.color_range not in (ColorRange.MPEG, ColorRange.JPEG):
        full = gray or frame.format.is_rgb or frame.format.name.startswith("yuvj")
        frame.color_range = ColorRange.JPEG if full else ColorRange.MPEG


def _over_16_bits(codes: NDArray[Any], top: int) -> NDArray[np.uint16]:
    if top == 65535:
        return codes.astype(np.uint16)
    table = ((np.arange(top + 1) * 65535 + top // 2) // top).astype(np.uint16)
    return np.take(table, codes)


def _from_luma_and_chroma(planes: list[NDArray[Any]], depth: int, frame: VideoFrame) -> NDArray[Any]:
    """Return R, G, B in about [0, 1] from Y, Cb, Cr of some bit depth (ITU-T H.273, section 8.3)."""
    weight_red, weight_blue = LUMA_WEIGHTS[frame.colorspace]
    offset, luma_span, chroma_span = quantization(depth, full=frame.color_range == ColorRange.JPEG)
    luma = (planes[0] - offset) / luma_span
    middle = np.float32(2 ** (depth - 1))
    red = luma + (planes[2] - middle) * np.float32(2 * (1 - weight_red) / chroma_span)
    blue = luma + (planes[1] - middle) * np.float32(2 * (1 - weight_blue) / chroma_span)
    green = (luma - np.float32(weight_red) * red - np.float32(weight_blue) * blue) / np.float32(
        1 - weight_red - weight_blue
    )
    return np.stack([red, green, blue], axis=-1)


def matrix_of(frame: VideoFrame) -> int:
    """Return the colour matrix of a frame of Y, Cb, Cr (ITU-T H.273), the customary one without a tag."""
    if frame.colorspace in UNTAGGED or frame.colorspace == RGB:
        # The rule of mpv and of most players: high definition is BT.709, all below is BT.601.
        return BT709 if frame.width >= 1280 or frame.height > 576 else BT601
    return int(frame.colorspace)


def quantization(depth: int, full: bool) -> tuple[np.float32, np.float32, np.float32]:
    """Return the code of black, and the codes that luma and chroma span (ITU-T H.273, equations 20-31)."""
    if full:
        span = np.float32(2**depth - 1)
        return np.float32(0), span, span
    scale = 2 ** (depth - 8)
    return np.float32(16 * scale), np.float32(219 * scale), np.float32(224 * scale)


def _gray(frame: VideoFrame, depth: int) -> NDArray[Any]:
    """Return R = G = B from one channel of gray, which FFmpeg would treat as full range always."""
    packed = frame.format.name.startswith("ya")
    (plane, *_) = planes_of(frame)
    values, alpha = (plane[:, 0::2], plane[:, 1::2]) if packed else (plane, None)
    black, span, _ = quantization(depth, full=frame.color_range == ColorRange.JPEG)
    light = np.clip((values - black) / span, 0, 1)
    if alpha is not None:
        light = light * alpha / np.float32(2**depth - 1)
    kind = np.uint8 if depth <= 8 else np.uint16
    levels = np.rint(light * np.float32(np.iinfo(kind).max)).astype(kind)
    return np.repeat(levels[..., np.newaxis], 3, axis=-1)


def planes_of(frame: VideoFrame) -> list[NDArray[Any]]:
    """Return the planes of a frame as they lie in its memory, without the padding at the ends of rows."""
    name = frame.format.name
    bits = _depth(frame.format)
    kind = np.dtype(np.uint8) if bits <= 8 else np.dtype(">u2" if name.endswith("be") else "<u2")
    samples = 2 if name.startswith("ya") else 1
    arrays = []
    for plane in frame.planes:
        rows = np.frombuffer(memoryview(plane), kind)[: plane.height * plane.line_size // kind.itemsize]
        rows = rows.reshape(plane.height, plane.line_size // kind.itemsize)
        arrays.append(rows[:, : plane.width * samples])
    return arrays


def _over_black(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    product = pixels[..., :3] * pixels[..., 3:].astype(np.uint16)
    return ((product + 127) // 255).astype(np.uint8)


def coarser(frames: Iterable[Frame], shape: tuple[int, int], gamma: float) -> Iterator[Frame]:
    """Yield frames averaged to fewer pixels, in linear light.

    Parameters
    ----------
    frames : iterable of Frame
        All of one size.
    shape : (height, width)
        What they become, neither side longer than it was.
    gamma : float
        Of the display: linear light is pixel value to the power of gamma.

    Yields
    ------
    Frame
        Pixel values as float32 in [0, 1].
    """
    rows = columns = None
    for frame in frames:
        height, width = frame.shape
        if rows is None or columns is None or (rows.shape[1], columns.shape[1]) != (height, width):
            rows, columns = area_weights(height, shape[0]), area_weights(width, shape[1])
        light = linear_light(frame.pixel_values, gamma)
        flat = (rows @ light.reshape(height, -1)).reshape(shape[0], width, 3)
        across = np.ascontiguousarray(flat.transpose(1, 0, 2)).reshape(width, -1)
        small = (columns @ across).reshape(shape[1], shape[0], 3).transpose(1, 0, 2)
        encoded = np.clip(small, 0.0, 1.0) ** np.float32(1 / gamma)
        yield Frame(frame.time, frame.duration, np.ascontiguousarray(encoded, dtype=np.float32))


def linear_light(pixel_values: NDArray[Any], gamma: float) -> NDArray[np.float32]:
    """Return pixel values to the power of gamma, integers as shares of their range."""
    if pixel_values.dtype.kind == "u":
        steps = np.iinfo(pixel_values.dtype).max
        table = ((np.arange(steps + 1) / steps) ** gamma).astype(np.float32)
        return np.asarray(table[pixel_values])
    return np.asarray(pixel_values, dtype=np.float32) ** np.float32(gamma)


def area_weights(many: int, few: int) -> sparse.csr_array[Any]:
    """Return the share that each of many pixels in a row has in each of few, (few, many).

    >>> area_weights(4, 2).toarray().tolist()
    [[0.5, 0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 0.5]]
    """
    if not 0 < few <= many:
        raise ValueError(f"need 1 to {many} pixels in place of {many}, got {few}")
    scale = many / few
    edges = np.union1d(np.arange(many + 1), np.arange(few + 1) * scale)
    middles = (edges[:-1] + edges[1:]) / 2
    cells, pixels = np.minimum(middles / scale, few - 1), np.minimum(middles, many - 1)
    places = cells.astype(np.intp), pixels.astype(np.intp)
    weights = sparse.coo_array((np.diff(edges) / scale, places), shape=(few, many), dtype=np.float32)
    return sparse.csr_array(weights)
