"""The factor of each frame in a headset: towards the track's, no faster than the track itself goes there.

Decision (docs/decisions/frame-timing.md): a frame that is drawn too late appears later than predicted,
and the next one perhaps a refresh after it. So a step counts from when the last one really appeared.
"""

from __future__ import annotations

import numpy as np

from evenlight.experiments.stage import Clip

ROUNDING = 1e-8  # [s] of the difference of two times


class TrackPace:
    """Follows the track of a clip.

    Parameters
    ----------
    clip : Clip
        The clip; if its factors become other ones meanwhile, these are taken at once.

    >>> clip = Clip(None, np.array([0.0, 0.1, 0.2]), 0.3, np.array([1.0, 0.8, 0.8]), 0)
    >>> pace = TrackPace(clip)
    >>> pace.factor(0.0, due=0.0)
    1.0
    >>> pace.shown(0.08)  # late
    >>> round(pace.factor(0.1, due=0.1), 6)  # 2 a second for 0.02 s
    0.96
    """

    def __init__(self, clip: Clip) -> None:
        self._clip = clip
        self._moment, self._goal = -1.0, np.nan  # the moment of the track that was shown last, its factor
        self._factor, self._since = np.nan, 0.0  # what was shown for it, and since when [s]
        self._fastest = 0.0  # [1/s] of the track, where the factor is behind it
        self._new = True  # whether moment or factor are others than at the refresh before

    def factor(self, moment: float, due: float) -> float:
        """Return the factor of a refresh.

        Parameters
        ----------
        moment : float
            Of the track, that the refresh shows [s].
        due : float
            When it is to appear, since the first [s].
        """
        before, goal = self._factor, self._at(moment)
        if self._at(self._moment) == self._goal:
            self._fastest = max(self._fastest, self._fastest_between(self._moment, moment))
            room = self._fastest * max(due - self._since + ROUNDING, 0.0)
            self._factor += min(max(goal - before, -room), room)
        else:  # the first, or another track
            self._factor = goal
        if abs(goal - self._factor) <= self._fastest * ROUNDING:
            self._factor, self._fastest = goal, 0.0
        self._new = moment != self._moment or self._factor != before
        self._moment, self._goal = moment, goal
        return self._factor

    def shown(self, flip: float) -> None:
        """Take note of when the refresh appeared, since the first [s]."""
        if self._new:
            self._since = flip

    def _at(self, moment: float) -> float:
        """Return the factor of a moment, evenly from frame to frame."""
        return float(np.interp(moment, self._clip.times, self._clip.factors))

    def _fastest_between(self, begin: float, end: float) -> float:
        """Return the largest rate of the track between two moments [1/s]."""
        times, factors = self._clip.times, self._clip.factors
        first = max(int(np.searchsorted(times, begin, side="right")) - 1, 0)
        last = int(np.searchsorted(times, end, side="left")) + 1
        steps, seconds = np.diff(factors[first:last]), np.diff(times[first:last])
        return float(np.max(np.abs(steps) / seconds, initial=0.0))
