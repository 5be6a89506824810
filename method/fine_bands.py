"""The finest frequency bands of a video, counted where they change and interpolated in between.

Decision (docs/decisions/curves-of-a-video.md): the two finest bands hold 94 % of the pixels, and their shares
of visible pixels change little and smoothly from frame to frame; what makes loss jump is single pixels of the
coarse bands, and those are counted in every frame. A stretch of frames is halved again and again: where the
count in the middle is what the ends had let expect, nothing in between shows signs of another change
(`method.fine_differences`), and in a long stretch the count of the frame with the strongest signs is as
expected too, the rest is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.method.frame_analysis import FrameAnalysis, FrameCounts

# Of the tolerance, what a count may miss by: among those that are not made, some will be worse. White noise
# and grain decide: with a half the worst of their frames takes all of it, with a third two thirds of it.
_ACCEPTED = 1 / 3
_APART = 1.0  # of the tolerance, what shares may miss by, in units of all that is visible
_SIGNS = 0.5  # of the tolerance, the change of loss that signs may stand for in a short stretch
_LONG = 6  # steps from which on a stretch is worth a second count


def settle(analysis: FrameAnalysis, stretch: Sequence[FrameCounts], tolerance: float) -> None:
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
        if _Settling(analysis, stretch, band, part).interpolated():
            left -= part
    for counts in stretch[1:-1]:
        analysis.release(counts)


class _Settling:
    """The settling of one band of a stretch.

    Parameters
    ----------
    analysis, stretch, band, tolerance
        As of `settle`; the band's share of the tolerance.
    """

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
            counted = self._counted_well(first, middle, last)
            if counted:
                any_was |= self._fill(counted)
            else:
                parts += [(middle, last), (first, middle)]
        return any_was

    def _counted_well(self, first: int, middle: int, last: int) -> list[int]:
        """Return the frames between which to interpolate, none if counts or signs are against it."""
        if not self._expected(middle, first, last):
            return []
        odd = self._oddness(first, middle, last)
        if last - first < _LONG:
            counted = [first, middle, last]
            visible = min(float(np.nansum(self._stretch[k].shares[:, -1])) for k in counted)
            return counted if odd.max() <= _SIGNS * self._tolerance * visible else []
        oddest = first + int(odd.argmax())
        if oddest in (first, middle, last):  # no signs at all
            oddest = (first + middle) // 2
        ends = (first, middle) if oddest < middle else (middle, last)
        return sorted((first, middle, last, oddest)) if self._expected(oddest, *ends) else []

    def _expected(self, k: int, begin: int, end: int) -> bool:
        """Count a frame, and return whether two others had let expect it."""
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

    def _oddness(self, first: int, middle: int, last: int) -> Array:
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
