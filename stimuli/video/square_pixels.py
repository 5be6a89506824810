"""Pixels that are wider than high, or higher than wide: frames are resampled to square ones, as players do.

The model, the window and all files written know square pixels only (docs/decisions/colour-conversion.md).
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from av.video.stream import VideoStream

    from evenlight.stimuli.video.video_locations import VideoPath
    from evenlight.stimuli.video.video_source import VideoSource

SQUARE = Fraction(1)
NEARLY = Fraction(1, 100)  # below it is the rounding of a picture's size to whole pixels (1216:1215)
LONGEST = 4  # half of a 16:9 picture's width in PAL is 128:45, the longest pixel of any format in use


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

    What is stretched becomes even, as a sample of chroma mostly stands for two pixels.

    >>> square_size(720, 576, Fraction(64, 45)), square_size(720, 480, Fraction(8, 9))
    ((1024, 576), (720, 540))
    """
    if aspect == SQUARE:
        return width, height
    return (2 * round(width * aspect / 2), height) if aspect > 1 else (width, 2 * round(height / aspect / 2))
