"""A video, as the model and the player see it, and when each of its frames appears.

Times are uniform where the stream is uniform, else as its file says.
"""

from __future__ import annotations

import bisect
import contextlib
import itertools
import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.film_reading import FilmReading

COMMON_RATES = (
    *(Fraction(n) for n in (10, 12, 15, 24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 144, 240)),
    *(Fraction(1000 * n, 1001) for n in (24, 30, 48, 60, 120)),
)
ASSUMED_RATE = Fraction(25)  # of a stream without any time stamps
ROUNDING_TICKS = 1.5  # one for a truncated time stamp, one half for a rounded first one


@runtime_checkable
class VideoSource(Protocol):
    """A video, as the model and the player see it."""

    @property
    def name(self) -> str:
        """Short name for titles."""

    @property
    def n_frames(self) -> int | None:
        """How many frames it has, None if that is not known beforehand."""

    def frames(self) -> Iterator[Frame]:
        """Yield its frames in order, one at a time, from the first one on at every call.

        A frame's pixel values are the reader's until the next frame is asked for: a source may fill the same
        array again, and who keeps pixel values for longer copies them.
        """

    def sha256(self) -> str:
        """Return the SHA-256 of its content: of the file, of the folder, or of the sequence's definition."""


class FramesInALoop:
    """A video whose frames `for frame in video` yields."""

    __slots__ = ()

    def __iter__(self: VideoSource) -> Iterator[Frame]:
        """Yield its frames in order, as `frames` does."""
        return self.frames()


def field_of_view_of(video: VideoSource) -> float | None:
    """Return the horizontal angle that a video was rendered for [deg], None if that is not known."""
    known: float | None = getattr(video, "field_of_view", None)
    return known


def film_reading(video: VideoSource) -> FilmReading | None:
    """Return how a video is read: what is no film begins at 0; None where it is not at hand."""
    known: FilmReading | None = getattr(video, "reading", FilmReading())
    return known


def size_of(video: VideoSource) -> tuple[int, int]:
    """Return width and height of a video [pixels], those of its first frame."""
    with closing_frames(video.frames()) as frames:
        height, width = next(frames).shape
    return width, height


@contextlib.contextmanager
def closing_frames(frames: Iterator[Frame]) -> Iterator[Iterator[Frame]]:
    """Yield frames, and close what they come from."""
    try:
        yield frames
    finally:
        if isinstance(frames, Generator):
            frames.close()


@runtime_checkable
class SeekableVideo(VideoSource, Protocol):
    """A video that can show any of its frames, bit for bit as from its beginning."""

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Yield the frames of rising numbers, from 0 on."""


def frames_from(video: VideoSource, first: int) -> Iterator[Frame]:
    """Yield the frames of a video from one on, making no more than it takes."""
    if isinstance(video, SeekableVideo) and video.n_frames is not None:
        return video.frames_at(range(first, video.n_frames))
    return itertools.islice(video.frames(), first, None)


def frames_at(video: VideoSource, numbers: Sequence[int]) -> Iterator[Frame]:
    """Yield some frames of a video, by their rising numbers from 0 on."""
    if isinstance(video, SeekableVideo):
        yield from video.frames_at(numbers)
        return
    with closing_frames(video.frames()) as frames:
        begin = 0
        for number in numbers:
            yield next(itertools.islice(frames, number - begin, None))
            begin = number + 1


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """When the frames of a stream appear and for how long, in the order of presentation.

    Attributes
    ----------
    times : array, (frames,)
        When each frame appears, the first at 0 [s].
    durations : array, (frames,)
        For how long; 0 marks a frame that the next one replaces at once, so that it is never seen [s].
    """

    times: NDArray[np.float64]
    durations: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("times", "durations"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def shown(self) -> int:
        """How many frames are seen."""
        return int(np.count_nonzero(self.durations))


def frame_times(
    stamps: ArrayLike, tick: Fraction, last: int = 0, rates: Sequence[Fraction] = ()
) -> FrameTimes:
    """Return when frames appear, from the time stamps of their packets (docs/decisions/frame-times.md).

    Parameters
    ----------
    stamps : array_like of int, (frames,)
        Presentation time stamps in any order [ticks].
    tick : Fraction
        What one tick lasts [s].
    last : int
        Duration of the last frame, 0 if unknown [ticks].
    rates : sequence of Fraction
        Frame rates that the file claims, the most trusted first [Hz].

    >>> frame_times([0, 33, 67, 100], Fraction(1, 1000), rates=[Fraction(30)]).times.tolist()
    [0.0, 0.03333333333333333, 0.06666666666666667, 0.1]
    """
    ticks = np.sort(np.asarray(stamps, dtype=np.int64))
    ticks -= ticks[0]
    claimed = [rate for rate in rates if rate > 0]
    if len(ticks) == 1:
        alone = last * tick if last > 0 else 1 / (claimed[0] if claimed else ASSUMED_RATE)
        return FrameTimes(np.zeros(1), np.array([float(alone)]))
    rate = _uniform_rate(ticks, tick, claimed)
    if rate is not None:
        return uniform_times(len(ticks), rate)
    steps = np.diff(ticks).astype(np.float64)
    final = float(last) if last > 0 else float(np.median(steps[steps > 0]))
    seconds = np.float64(tick)
    return FrameTimes(ticks * seconds, np.append(steps, final) * seconds)


def rising(stamps: Sequence[int]) -> NDArray[np.bool_]:
    """Return which of the stamps rise: as many as can, of equal ones the last.

    >>> rising([0, 1, 5, 2, 3, 3]).tolist()
    [True, True, False, True, False, True]
    """
    ends: list[int] = []  # of the rising rows of 1, 2, ... stamps, the lowest last stamp
    places: list[int] = []  # of these, in `stamps`
    before = np.full(len(stamps), -1)
    for k, stamp in enumerate(stamps):
        n = bisect.bisect_left(ends, stamp)
        before[k] = places[n - 1] if n else -1
        ends[n:], places[n:] = [stamp, *ends[n + 1 :]], [k, *places[n + 1 :]]
    found, k = np.zeros(len(stamps), dtype=bool), places[-1] if places else -1
    while k >= 0:
        found[k], k = True, int(before[k])
    return found


def rate_from_number(frames_per_second: float) -> Fraction:
    """Return a frame rate as a ratio, so that 29.97 is the 30000/1001 that is meant [Hz].

    >>> rate_from_number(29.97)
    Fraction(30000, 1001)
    """
    if not (math.isfinite(frames_per_second) and 0.01 <= frames_per_second <= 10000):
        raise ValueError(f"need a frame rate from 0.01 to 10000 Hz, got {frames_per_second:g}")
    ratio = Fraction(frames_per_second).limit_denominator(1001)
    broadcast = Fraction(round(ratio * 1001 / 1000) * 1000, 1001)
    return broadcast if ratio.denominator > 1 and abs(broadcast / ratio - 1) < Fraction(1, 5000) else ratio


def uniform_times(frames: int, rate: Fraction) -> FrameTimes:
    """Return the times of so many frames at a constant rate [Hz].

    >>> uniform_times(3, Fraction(25)).times.tolist()
    [0.0, 0.04, 0.08]
    """
    seconds = np.arange(frames, dtype=np.float64) * rate.denominator / rate.numerator
    return FrameTimes(seconds, np.full(frames, float(1 / rate)))


def _uniform_rate(ticks: NDArray[np.int64], tick: Fraction, claimed: Sequence[Fraction]) -> Fraction | None:
    """Return the frame rate whose grid explains every time stamp within its rounding, None if none does.

    The claimed rates come first, then the common ones close to the mean rate, the nearest first, then the
    mean rate itself. A quarter of a frame is the most that counts as rounding: where the tick is coarser
    than that, a varying rate could not be told from a constant one.
    """
    if ticks[-1] == 0:
        raise ValueError("need at least two different time stamps")
    mean = (len(ticks) - 1) / (int(ticks[-1]) * tick)
    near = sorted((r for r in COMMON_RATES if abs(r / mean - 1) < 0.01), key=lambda r: abs(r - mean))
    index = np.arange(len(ticks))
    for rate in (*claimed, *near, mean):
        step = float(1 / (rate * tick))
        if np.abs(ticks - index * step).max() <= min(ROUNDING_TICKS, step / 4):
            return rate
    return None
