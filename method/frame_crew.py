"""Threads that analyse the frames of a video in order, with few of them in memory.

The frames are asked for in the calling thread, because a source may be tied to it (graphics are) and because
an interruption arrives there. Decoding runs ahead of the analysis by a bounded number of frames; the loops of
the analysis run outside Python's lock. What a frame gives does not depend on the thread or on the moment, so
that the result is the same for any number of threads.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from evenlight.method.analysis_device import FrameAnalyzer
from evenlight.method.fine_bands import settle
from evenlight.method.frame_analysis import FrameAnalysis, FrameCounts, FrameLoss
from evenlight.method.spare_arrays import SpareArrays
from evenlight.method.thrift import Thrift

LONGEST_STRETCH = 16  # frames from one that is counted whole to the next
_STRETCH_MEMORY = 350_000_000  # bytes that the frames of a stretch take at most, but for the least length
_SHORTEST_STRETCH = 4  # below, nothing could be saved
_AHEAD = 2  # frames decoded beyond those that are being analysed, where each is a task of its own

Pixels = NDArray[Any]
Task = Future[list[FrameLoss]]


def frame_losses(
    analysis: FrameAnalyzer, frames: Iterable[Pixels], thrift: Thrift, spare: SpareArrays
) -> Iterator[FrameLoss]:
    """Yield what the analysis of each frame gives, in order.

    Parameters
    ----------
    analysis : FrameAnalyzer
        For frames of their size.
    frames : iterable of array, (height, width, 3)
        Gamma-encoded; arrays that nobody else writes to. Their errors are passed on, at once.
    thrift : Thrift
        How much is counted, and in how many threads.
    spare : SpareArrays
        Gets each array that has been analysed.
    """
    pool = ThreadPoolExecutor(thrift.threads, thread_name_prefix="frames")
    try:
        if isinstance(analysis, FrameAnalysis) and thrift.tolerance > 0 and len(analysis.fine_bands) > 0:
            crew = _Crew(analysis, pool, spare, thrift.tolerance)
            tasks, most = crew.stretches(frames), thrift.threads
        else:
            tasks, most = _singles(analysis, frames, pool, spare), thrift.threads + _AHEAD
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
        spare.give_back(pixels)
        return [found]

    for pixels in frames:
        yield pool.submit(counted, pixels)


@dataclass(frozen=True, slots=True)
class _Crew:
    """Threads that count fine bands where they change."""

    analysis: FrameAnalysis
    pool: ThreadPoolExecutor
    spare: SpareArrays
    tolerance: float

    def stretches(self, frames: Iterable[Pixels]) -> Iterator[Task]:
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
        self.spare.give_back(pixels)
        return self.analysis.complete(counts) if whole else counts

    def _settled(self, stretch: list[Future[FrameCounts]], is_last: bool) -> list[FrameLoss]:
        """Settle a stretch, and return what its frames give, but for the last, which begins the next one.

        This waits for tasks that a thread took on before it took on this one, so that none waits for ever.
        """
        counts = [begun.result() for begun in stretch]
        if is_last:
            self.analysis.complete(counts[-1])
        settle(self.analysis, counts, self.tolerance)
        return [self.analysis.loss_of(one) for one in (counts if is_last else counts[:-1])]
