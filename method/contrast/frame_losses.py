"""The loss curves of a video's frames, in order: which bands are counted, in several threads.

Frames are asked for in the calling thread, because a source may be tied to it (graphics are) and because an
interruption arrives there. Decoding runs ahead of the analysis by a bounded number of frames; the loops of
the analysis run outside Python's lock. What a frame gives does not depend on the thread or on the moment, so
that the result is the same for any number of threads.

Decision (docs/decisions/curves-of-a-video.md): the two finest bands hold 94 % of the pixels, and their shares
of visible pixels change little and smoothly from frame to frame; what makes loss jump is single pixels of the
coarse bands, and those are counted in every frame. A stretch of frames is halved again and again: where the
count in the middle is as the ends predict, nothing in between shows signs of another change
(`frame_analysis.difference_shares`), and in a long stretch the count of the frame with the strongest signs is
as predicted too, the rest is interpolated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame import LumaChroma, Pixels
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.frame_analysis import (
    FrameAnalysis,
    FrameAnalyzer,
    FrameCounts,
    FrameLoss,
    SpareArrays,
)

LONGEST_STRETCH = 16  # frames from one that is counted whole to the next
_STRETCH_MEMORY = 350_000_000  # bytes that the frames of a stretch take at most, but for the least length
_SHORTEST_STRETCH = 4  # below, nothing could be saved
_AHEAD = 2  # frames decoded beyond those that are being analysed, where each is a task of its own
Task = Future[list[FrameLoss]]
# Of the tolerance, what a count may miss by: among those that are not made, some will be worse. White noise
# and grain decide: with a half the worst of their frames takes all of it, with a third two thirds of it.
_ACCEPTED = 1 / 3
_APART = 1.0  # of the tolerance, what shares may miss by, in units of all that is visible
_SIGNS = 0.5  # of the tolerance, the change of loss that signs may stand for in a short stretch
_LONG = 6  # steps from which on a stretch is worth a second count


def frame_losses(
    analysis: FrameAnalyzer, frames: Iterable[Pixels], effort: AnalysisEffort, spare: SpareArrays
) -> Iterator[FrameLoss]:
    """Yield what the analysis of each frame gives, in order.

    Parameters
    ----------
    analysis : FrameAnalyzer
        For frames of their size.
    frames : iterable of array, (height, width, 3), or of LumaChroma
        Gamma-encoded; arrays that nothing else writes to. Their errors are passed on, at once.
    effort : AnalysisEffort
        How much is counted, and in how many threads.
    spare : SpareArrays
        Gets each array that has been analysed.
    """
    pool = ThreadPoolExecutor(effort.threads, thread_name_prefix="frames")
    try:
        if isinstance(analysis, FrameAnalysis) and effort.tolerance > 0 and len(analysis.fine_bands) > 0:
            stretches = _StretchTasks(analysis, pool, spare, effort.tolerance)
            tasks, most = stretches.of(frames), effort.threads
        else:
            tasks, most = _singles(analysis, frames, pool, spare), effort.threads + _AHEAD
        under_way: deque[Task] = deque()
        for task in tasks:
            under_way.append(task)
            if len(under_way) > most:
                yield from under_way.popleft().result()
        while under_way:
            yield from under_way.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def stretch_length(analysis: FrameAnalysis) -> int:
    """Return how many frames it is from one that is counted whole to the next, by what memory they take."""
    length = LONGEST_STRETCH
    while length > _SHORTEST_STRETCH and length * analysis.held_bytes > _STRETCH_MEMORY:
        length //= 2
    return length


def _singles(
    analysis: FrameAnalyzer, frames: Iterable[Pixels], pool: ThreadPoolExecutor, spare: SpareArrays
) -> Iterator[Task]:
    """Yield a task for each frame: to count all of it."""

    def counted(pixels: Pixels) -> list[FrameLoss]:
        found = analysis.of(pixels)
        _let_go(pixels, spare)
        return [found]

    for pixels in frames:
        yield pool.submit(counted, pixels)


def _let_go(pixels: Pixels, spare: SpareArrays) -> None:
    """Give back an array that has been analysed; planes are the decoder's."""
    if not isinstance(pixels, LumaChroma):
        spare.give_back(pixels)


@dataclass(frozen=True, slots=True)
class _StretchTasks:
    """Tasks that count the fine bands of stretches of frames where they change."""

    analysis: FrameAnalysis
    pool: ThreadPoolExecutor
    spare: SpareArrays
    tolerance: float

    def of(self, frames: Iterable[Pixels]) -> Iterator[Task]:
        """Yield a task for each stretch of frames; where one ends, the next begins."""
        length = stretch_length(self.analysis)
        stretch: list[Future[FrameCounts]] = []
        for number, pixels in enumerate(frames):
            if len(stretch) > length:
                yield self.pool.submit(self._settled, stretch, False)
                stretch = stretch[-1:]
            stretch.append(self.pool.submit(self._begun, pixels, number % length == 0))
        if stretch:
            yield self.pool.submit(self._settled, stretch, True)

    def _begun(self, pixels: Pixels, whole: bool) -> FrameCounts:
        """Count all of a frame, or all but its fine bands."""
        counts = self.analysis.begin(pixels)
        _let_go(pixels, self.spare)
        return self.analysis.complete(counts) if whole else counts

    def _settled(self, stretch: list[Future[FrameCounts]], is_last: bool) -> list[FrameLoss]:
        """Settle a stretch, and return what its frames give, but for the last, which begins the next one.

        This waits for tasks that a thread took on before it took on this one, so that none waits for ever.
        """
        counts = [begun.result() for begun in stretch]
        if is_last:
            self.analysis.complete(counts[-1])
        settle_fine_bands(self.analysis, counts, self.tolerance)
        return [self.analysis.loss_of(one) for one in (counts if is_last else counts[:-1])]


def settle_fine_bands(analysis: FrameAnalysis, stretch: Sequence[FrameCounts], tolerance: float) -> None:
    """Count or interpolate the fine bands of a stretch of frames, of which the first and last are complete.

    Parameters
    ----------
    analysis : FrameAnalysis
        That began them.
    stretch : sequence of FrameCounts
        In order of time; the shares of all but the ends are filled in.
    tolerance : float
        Largest error of contrast loss that is accepted.
    """
    left = tolerance
    for band in reversed(analysis.fine_bands):
        # The finest gets what the coarser, with its fewer and less steady pixels, had no use for.
        part = left if band == analysis.fine_bands.start else left / 2
        if _BandInterpolation(analysis, stretch, band, part).interpolated():
            left -= part
    for counts in stretch[1:-1]:
        analysis.release(counts)


class _BandInterpolation:
    """The settling of one band of a stretch, with the share of the tolerance that it has."""

    def __init__(
        self, analysis: FrameAnalysis, stretch: Sequence[FrameCounts], band: int, tolerance: float
    ) -> None:
        self._analysis, self._stretch, self._band, self._tolerance = analysis, stretch, band, tolerance
        self._known = [k for k in range(len(stretch[0].shares)) if k not in analysis.fine_bands]
        number = band - analysis.fine_bands.start
        self._signs = np.array([counts.differences[number] for counts in stretch])

    def interpolated(self) -> bool:
        """Settle the band, and return whether any frame of it was interpolated."""
        any_was, parts = False, [(0, len(self._stretch) - 1)]
        while parts:
            first, last = parts.pop()
            if last - first < 2:
                continue
            middle = (first + last) // 2
            counted = self._counted_frames(first, middle, last)
            if counted:
                any_was |= self._fill(counted)
            else:
                parts += [(middle, last), (first, middle)]
        return any_was

    def _counted_frames(self, first: int, middle: int, last: int) -> list[int]:
        """Return the frames between which to interpolate, none if counts or signs are against it."""
        if not self._expected(middle, first, last):
            return []
        departure = self._departure(first, middle, last)
        if last - first < _LONG:
            counted = [first, middle, last]
            visible = min(float(np.nansum(self._stretch[k].shares[:, -1])) for k in counted)
            return counted if departure.max() <= _SIGNS * self._tolerance * visible else []
        strangest = first + int(departure.argmax())
        if strangest in (first, middle, last):  # no signs at all
            strangest = (first + middle) // 2
        ends = (first, middle) if strangest < middle else (middle, last)
        return sorted((first, middle, last, strangest)) if self._expected(strangest, *ends) else []

    def _expected(self, k: int, begin: int, end: int) -> bool:
        """Count a frame, and return whether it is as two others predict."""
        counts = self._stretch[k]
        if np.isnan(counts.shares[self._band, 0]):
            self._analysis.count(counts, self._band)
        missed = counts.shares[self._band] - self._between(k, begin, end)
        visible = counts.shares[[*self._known, self._band]].sum(axis=0)
        if visible[-1] == 0:
            return not missed.any()
        # To first order in the loss 1 - C(b) / C(1); bands not yet counted would only make it smaller.
        error = np.abs(missed - missed[-1] * visible / visible[-1]).max() / visible[-1]
        # Shares that all miss in proportion cancel in the loss of this frame, but not in that of the next.
        apart = np.abs(missed).max() / visible[-1]
        return bool(error <= _ACCEPTED * self._tolerance and apart <= _APART * self._tolerance)

    def _departure(self, first: int, middle: int, last: int) -> Array:
        """Return how far the signs of each frame are from those interpolated over the ends and the middle."""
        frames = np.arange(first, last + 1)
        near = [first, middle, last]
        expected = np.array([np.interp(frames, near, column[near]) for column in self._signs.T])
        return np.asarray(np.abs(self._signs[frames] - expected.T).max(axis=1))

    def _between(self, k: int, begin: int, end: int) -> Array:
        """Return the shares of frame k, interpolated between two others."""
        first, last = (self._stretch[i].shares[self._band] for i in (begin, end))
        return np.asarray(first + (k - begin) / (end - begin) * (last - first))

    def _fill(self, counted: list[int]) -> bool:
        """Interpolate what lies between counted frames, and return whether there is any."""
        any_was = False
        for begin, end in pairwise(counted):
            for k in range(begin + 1, end):
                self._stretch[k].shares[self._band] = self._between(k, begin, end)
                any_was = True
        return any_was
