"""The refreshes of the display while something is shown: when each came, when the next is due, and drops."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

DECIMALS = 9  # of a time [s]: what a clock's reading says, without the rounding of a difference of two


class Refreshes:
    """Notes when each refresh appeared.

    Parameters
    ----------
    refresh_rate : float
        Of the display [Hz].

    >>> refreshes = Refreshes(refresh_rate=50.0)
    >>> for flip in (10.0, 10.02, 10.08):
    ...     refreshes.note(flip)
    >>> refreshes.times(), refreshes.dropped()
    ((0.0, 0.02, 0.08), 2)
    """

    def __init__(self, refresh_rate: float) -> None:
        self._refresh_rate = refresh_rate
        self._flips: list[float] = []

    def __len__(self) -> int:
        """Return how many there were."""
        return len(self._flips)

    @property
    def onset(self) -> float:
        """When the first appeared [s]."""
        return self._flips[0]

    def note(self, flip: float) -> None:
        """Note when a refresh appeared [s]."""
        self._flips.append(flip)

    def due(self, now: Callable[[], float]) -> Iterator[float]:
        """Yield when the next refresh is due, since the first [s]; note it before the one after is asked for.

        Parameters
        ----------
        now : callable
            The clock of the flips [s].
        """
        yield 0.0
        period = 1 / self._refresh_rate
        while True:
            last = self._flips[-1]
            missed = math.floor((now() - last) / period)
            yield round(last + (missed + 1) * period - self.onset, DECIMALS)

    def times(self) -> tuple[float, ...]:
        """Return when each appeared, since the first [s]."""
        return tuple(round(flip - self.onset, DECIMALS) for flip in self._flips)

    def dropped(self) -> int:
        """Return how many passed without a new frame."""
        missed = np.rint(np.diff(self._flips) * self._refresh_rate).astype(int) - 1
        return int(np.maximum(missed, 0).sum())
