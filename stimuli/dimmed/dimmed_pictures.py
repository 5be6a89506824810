"""The pictures of a video, dimmed, in a format that an encoder takes.

Planar Y', Cb, Cr of files are dimmed as they are decoded; their tags of rotation, pixel shape and colour go
on to the new file. All other videos (R, G, B, image folders, built-in sequences, unusual formats) are dimmed
as the analysis sees them: upright, in square pixels.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import ColorRange, ColorTrc

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.stimuli.dimmed.dimmed_samples import (
    Codes,
    Codings,
    cut_above_white,
    dimmed_codes,
    dithered,
    fixed,
    luma_chroma_codings,
    rgb_codings,
    ycbcr_of,
)
from evenlight.stimuli.dimmed.encoders import Encoder
from evenlight.stimuli.dimmed.track_fit import wrong_count
from evenlight.stimuli.dithering import GRID_LEVELS, levels_of
from evenlight.stimuli.video.frame_conversion import (
    BT709,
    LUMA_WEIGHTS,
    ColourConverter,
    matrix_of,
    planes_of,
)
from evenlight.stimuli.video.square_pixels import SQUARE
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource, closing_frames

if TYPE_CHECKING:
    from av.video.stream import VideoStream

    from evenlight.data_schema.arrays import Array

PLANAR = re.compile(r"yuvj?(420|422|444)p(9|10|12|14|16)?(le|be)?")
# Of ITU-T H.273, table 3: what displays with a gamma show; not HDR (PQ, HLG), linear or logarithmic ones.
GAMMA_ENCODED = (
    ColorTrc.BT709, ColorTrc.UNSPECIFIED, ColorTrc.GAMMA22, ColorTrc.GAMMA28, ColorTrc.SMPTE170M,
    ColorTrc.SMPTE240M, ColorTrc.IEC61966_2_4, ColorTrc.BT1361_ECG, ColorTrc.IEC61966_2_1,
    ColorTrc.BT2020_10, ColorTrc.BT2020_12, 0, 3,
)  # fmt: skip
HDR = {ColorTrc.SMPTE2084: "HDR (PQ)", ColorTrc.ARIB_STD_B67: "HDR (HLG)"}


@dataclass(frozen=True, slots=True)
class PictureKind:
    """What all pictures of a video have in common."""

    # how Y', Cb, Cr are sampled ("420", "422", "444") or "rgb", and the bits of a sample
    layout: str
    bits: int
    width: int  # [pixels]
    height: int
    # range, matrix, primaries and transfer function of the colours (ITU-T H.273)
    tags: tuple[int, int, int, int]
    aspect: Fraction = SQUARE  # width of a pixel over its height
    turned: tuple[int, ...] | None = None  # the display matrix

    @property
    def pixel_format(self) -> str:
        """FFmpeg's name."""
        deep = "" if self.bits == 8 else f"{self.bits}le"
        return f"gbrp{deep}" if self.layout == "rgb" else f"yuv{self.layout}p{deep}"

    @property
    def codings(self) -> Codings:
        """How its planes are coded."""
        if self.layout == "rgb":
            return rgb_codings(self.bits)
        return luma_chroma_codings(self.bits, full=self.tags[0] == ColorRange.JPEG)


class DimmedPlanes:
    """Pictures of planar Y', Cb, Cr, dimmed as they are decoded.

    Parameters
    ----------
    video, first, encoder : VideoFile, VideoFrame, Encoder
        The video, its first picture, and what takes the dimmed ones.
    """

    def __init__(self, video: VideoFile, stream: VideoStream, first: VideoFrame, encoder: Encoder) -> None:
        self._video, self._first = video, _looks(first)
        full = first.color_range == ColorRange.JPEG or first.format.name.startswith("yuvj")
        bits = first.format.components[0].bits
        self._source = luma_chroma_codings(bits, full=full)
        self._weights = LUMA_WEIGHTS[matrix_of(first)]
        self.kind = PictureKind(
            layout=_layout(first) or "",
            bits=encoder.bits_for(bits),
            width=first.width,
            height=first.height,
            tags=(
                ColorRange.JPEG if full else first.color_range,
                first.colorspace, first.color_primaries, first.color_trc,
            ),
            aspect=stream.sample_aspect_ratio or SQUARE,
            turned=ColourConverter().display_matrix(first),
        )  # fmt: skip

    def dimmed(self, scales: Sequence[Array]) -> Iterator[tuple[float, list[list[Codes]]]]:
        """Yield the time of each picture [s] and its planes by each of the scales (frames,)."""
        times = self._video.timeline.times
        for number, (k, picture) in enumerate(self._video.pictures()):
            if _looks(picture) != self._first:
                raise InputError(
                    f"{self._video.path} changes the size or the format of its pictures at frame {k}; "
                    "encode it again with one"
                )
            require_gamma_encoded(self._video.name, picture)
            planes = cut_above_white(planes_of(picture), self._source, self._weights)
            yield float(times[k]), [self._dimmed(planes, float(scale[number])) for scale in scales]

    def _dimmed(self, planes: Sequence[Codes], scale: float) -> list[Codes]:
        both = zip(planes, self._source, self.kind.codings, strict=True)
        return [dithered(dimmed_codes(scale, a, b)[plane], b.bits) for plane, a, b in both]


class DimmedPixels:
    """Pictures dimmed as R', G', B', upright and in square pixels.

    Parameters
    ----------
    video, first, encoder : VideoSource, Frame, Encoder
        The video, its first frame, and what takes the dimmed ones.
    """

    def __init__(self, video: VideoSource, first: Frame, encoder: Encoder) -> None:
        self._video = video
        height, width = first.shape
        count = levels_of(first.pixel_values)[1]
        lossless = encoder.name == "ffv1"
        bits = encoder.bits_for(8 if count == 256 else 10 if count == GRID_LEVELS else 16)
        # Players know 4:2:0 best; where it cannot be, in odd sizes, nothing is lost.
        subsampled = "420" if width % 2 == height % 2 == 0 or "444" not in encoder.layouts else "444"
        self.kind = PictureKind(
            layout="rgb" if lossless else subsampled,
            bits=bits,
            width=width,
            height=height,
            tags=(ColorRange.JPEG, 0, 1, 1) if lossless else (ColorRange.MPEG, BT709, 1, 1),
        )

    def dimmed(self, scales: Sequence[Array]) -> Iterator[tuple[float, list[list[Codes]]]]:
        """Yield the time of each picture [s] and its planes by each of the scales (frames,)."""
        with closing_frames(self._video.frames()) as frames:
            for number, frame in enumerate(frames):
                if number == len(scales[0]):
                    raise wrong_count(self._video.name, number + 1, number)
                pixels = frame.pixel_values
                yield frame.time, [self._dimmed(pixels, float(scale[number])) for scale in scales]

    def _dimmed(self, pixels: Codes, scale: float) -> list[Codes]:
        codings = self.kind.codings
        if self.kind.layout == "rgb":
            codes = pixels if pixels.dtype.kind == "u" else np.rint(pixels * 65535).astype(np.uint16)
            table = dimmed_codes(scale, rgb_codings(8 * codes.dtype.itemsize)[0], codings[0])
            return [dithered(table[codes[..., channel]], self.kind.bits) for channel in (1, 2, 0)]
        planes = ycbcr_of(pixels, scale, half=self.kind.layout == "420")
        return [
            dithered(fixed(plane * coding.span + coding.zero, coding.bits), coding.bits)
            for plane, coding in zip(planes, codings, strict=True)
        ]


def dimmed_pictures(
    video: VideoSource, stream: VideoStream | None, encoder: Encoder, *, one_beside_other: bool
) -> DimmedPlanes | DimmedPixels:
    """Return what dims the pictures of a video for an encoder.

    Parameters
    ----------
    video, stream : VideoSource, VideoStream or None
        The video, and the stream of its file, if it is one.
    encoder : Encoder
        Takes them.
    one_beside_other : bool
        Whether two versions are to be seen beside each other, so that pictures must be upright.

    Raises
    ------
    InputError
        If the video is not gamma-encoded, or has no frame.
    """
    if isinstance(video, VideoFile) and stream is not None:
        _, first = next(video.pictures())
        require_gamma_encoded(video.name, first)
        whole = encoder.name == "ffv1" or first.width % 2 == first.height % 2 == 0
        fits = not one_beside_other or (
            ColourConverter().display_matrix(first) is None and first.width % 2 == 0
        )
        # Matroska has the shape of pixels from the stream of H.264 and HEVC alone.
        square = (stream.sample_aspect_ratio or SQUARE) == SQUARE or encoder.name in ("libx264", "libx265")
        known = _layout(first) in encoder.layouts and matrix_of(first) in LUMA_WEIGHTS
        # Chroma of 4:2:0 lies elsewhere in interlaced pictures, and encoders are told of none.
        if known and whole and square and fits and not first.interlaced_frame:
            return DimmedPlanes(video, stream, first, encoder)
    with closing_frames(video.frames()) as frames:
        frame = next(frames, None)
    if frame is None:
        raise InputError(f"the video {video.name!r} has no frames")
    return DimmedPixels(video, frame, encoder)


def _layout(picture: VideoFrame) -> str | None:
    match = PLANAR.fullmatch(picture.format.name)
    return match and match[1]


def _looks(picture: VideoFrame) -> tuple[Any, ...]:
    return picture.width, picture.height, picture.format.name, picture.color_range


def require_gamma_encoded(video: str, picture: VideoFrame) -> None:
    """Refuse a picture whose light is no power of its values: a scale would dim it wrongly."""
    if picture.color_trc not in GAMMA_ENCODED:
        known = picture.color_trc in HDR
        encoded = HDR[ColorTrc(picture.color_trc)] if known else f"transfer function {picture.color_trc}"
        raise InputError(
            f"the video {video!r} is encoded in {encoded}, and only gamma-encoded video can be dimmed in a "
            "file: convert it to standard range (BT.709), and make a track of that"
        )


def picture_of(planes: list[Codes], kind: PictureKind) -> VideoFrame:
    """Return planes as a picture of their kind."""
    picture = VideoFrame(planes[0].shape[1], planes[0].shape[0], kind.pixel_format)
    for place, plane in zip(planes_of(picture), planes, strict=True):
        place[:] = plane
    picture.color_range, picture.colorspace, picture.color_primaries, picture.color_trc = kind.tags
    return picture
