"""Pixels that are wider than high, or higher than wide: frames are resampled to square ones, as players do.

The model, the window and all files written know square pixels only (docs/decisions/colour-conversion.md).
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import Interpolation, VideoReformatter
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from av.video.stream import VideoStream

    from evenlight.stimuli.video.video_locations import VideoPath
    from evenlight.stimuli.video.video_source import VideoSource

SQUARE = Fraction(1)
NEARLY = Fraction(1, 100)  # below it is the rounding of a picture's size to whole pixels (1216:1215)
LONGEST = 4  # half of a 16:9 picture's width in PAL is 128:45, the longest pixel of any format in use
CUBIC = Interpolation.BICUBIC | Interpolation.BITEXACT  # a third of the time of ACCURATE_RND, and as exact


def pixel_aspect_of(path: VideoPath, stream: VideoStream) -> Fraction:
    """Return how wide the pixels of a stream are over their height; 1 where its file does not say.

    Raises
    ------
    InputError
        If no format has such pixels.
    """
    aspect = stream.sample_aspect_ratio or SQUARE
    if not Fraction(1, LONGEST) <= aspect <= LONGEST:
        raise InputError(
            f"{path}: says that its pixels are {in_words(aspect)} (width:height), which no format has; need "
            f"1:{LONGEST} to {LONGEST}:1, so write it again with the right shape of the picture"
        )
    return SQUARE if abs(aspect - 1) < NEARLY else aspect


def pixel_aspect(video: VideoSource) -> Fraction:
    """Return how wide the pixels of a video's file are over their height; its frames have square ones."""
    return Fraction(getattr(video, "pixel_aspect", SQUARE))


def in_words(aspect: Fraction) -> str:
    """Return width to height.

    >>> in_words(Fraction(64, 45))
    '64:45'
    """
    return f"{aspect.numerator}:{aspect.denominator}"


def square_size(width: int, height: int, aspect: Fraction) -> tuple[int, int]:
    """Return width and height in square pixels: the shorter side of a pixel decides, so that none is lost.

    >>> square_size(720, 576, Fraction(64, 45)), square_size(720, 480, Fraction(8, 9))
    ((1024, 576), (720, 540))
    """
    return (round(width * aspect), height) if aspect > 1 else (width, round(height / aspect))


class SquarePixels:
    """Scales frames to square pixels by cubics, in the format that they have; keeps FFmpeg's tables.

    R, G, B and palettes, which FFmpeg would scale by way of Y, Cb, Cr, go through as they are: `of_rgb` is
    for these. Colour tags must be complete: what is customary without them depends on the size.
    """

    def __init__(self, aspect: Fraction) -> None:
        self._aspect, self._reformatter = aspect, VideoReformatter()

    def of_frame(self, frame: VideoFrame) -> VideoFrame:
        """Return a frame in square pixels, itself if it has them or is R, G, B."""
        if self._aspect == SQUARE or frame.format.is_rgb or frame.format.has_palette:
            return frame
        width, height = square_size(frame.width, frame.height, self._aspect)
        return self._reformatter.reformat(
            frame,
            width=width,
            height=height,
            interpolation=CUBIC,
            src_color_range=frame.color_range,
            dst_color_range=frame.color_range,
        )

    def of_rgb(self, pixels: NDArray[Any], frame: VideoFrame) -> NDArray[Any]:
        """Return R, G, B of a frame in square pixels, (height, width, 3)."""
        if self._aspect == SQUARE or not (frame.format.is_rgb or frame.format.has_palette):
            return pixels
        width, height = square_size(pixels.shape[1], pixels.shape[0], self._aspect)
        # As if they were Y, Cb, Cr, of which each is scaled for itself.
        kind = "yuv444p" if pixels.dtype == np.uint8 else "yuv444p16le"
        planes = VideoFrame.from_ndarray(np.ascontiguousarray(pixels.transpose(2, 0, 1)), kind)
        scaled = self._reformatter.reformat(planes, width=width, height=height, interpolation=CUBIC)
        return np.ascontiguousarray(scaled.to_ndarray().transpose(1, 2, 0))
