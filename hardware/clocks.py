"""The clock of a rehearsal: it goes with the frames drawn, not with the time of day."""

from __future__ import annotations


class RefreshClock:
    """A clock that each flip moves on by one refresh of the display.

    A session that runs on it is as fast as the machine draws, and the same each time.

    Parameters
    ----------
    refresh_rate : float
        Of the display that it stands for [Hz].

    >>> clock = RefreshClock(50.0)
    >>> clock.advance(), clock.advance(), clock.now()
    (0.02, 0.04, 0.04)
    """

    def __init__(self, refresh_rate: float) -> None:
        self._refresh_rate = refresh_rate
        self._refreshes = 0  # counted, for a sum of durations would drift

    def now(self) -> float:
        """Return the time [s]."""
        return self._refreshes / self._refresh_rate

    def advance(self, refreshes: int = 1) -> float:
        """Let some refreshes pass, and return the time then [s]."""
        self._refreshes += refreshes
        return self.now()
