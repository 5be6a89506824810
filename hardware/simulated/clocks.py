"""Clocks of rehearsals: they go with the frames drawn, or with the waiting asked for, not with the sun."""

from __future__ import annotations

import math


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


def refresh_after(last: float | None, now: float, period: float) -> float:
    """Return when the next refresh of a screen is due, a whole number of periods after the last flip [s].

    Before the first flip it is one period from now.

    >>> refresh_after(10.0, 10.01, 0.02), refresh_after(10.0, 10.05, 0.02), refresh_after(None, 3.0, 0.02)
    (10.02, 10.06, 3.02)
    """
    if last is None:
        return now + period
    return last + (math.floor((now - last) / period) + 1) * period


class WaitingClock:
    """A clock that goes only while the program waits: half an hour of warm-up takes no time.

    >>> clock = WaitingClock()
    >>> clock.wait(1800.0)
    >>> clock.now()
    1800.0
    """

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        """Return the time [s]."""
        return self._now

    def wait(self, seconds: float) -> None:
        """Let some time pass [s]."""
        if seconds < 0:
            raise ValueError(f"cannot wait for {seconds:g} s")
        self._now += seconds
