"""What dimming that moves gains over constant dimming, told while it runs: to warn where it gains nothing."""

from __future__ import annotations

import math

from evenlight.method.online.governor import NO_ROOM, MeanSoFar

NO_GAIN = 0.97  # SD of the loss over that of constant dimming, from which on nothing is gained to speak of
# The loss of constant dimming is not measured. It is taken to grow as (1 - b)^1.5 from what is: on 9 videos
# with either controller the ratio then is that of the curves to 0.02, and up to 0.06 above it in dark walks.
LOSS_EXPONENT = 1.5


class GainMonitor:
    """Estimates the SD of the loss over time, over that of constant dimming by the mean factor.

    Parameters
    ----------
    horizon : float
        Over which both are taken; of older frames ever less is remembered [s].
    """

    def __init__(self, horizon: float) -> None:
        self._horizon, self._passed = horizon, 0.0
        self._factor = MeanSoFar()
        self._ours, self._full = (MeanSoFar(), MeanSoFar()), (MeanSoFar(), MeanSoFar())

    def take(self, factor: float, loss: float, duration: float) -> None:
        """Take note of a frame: its factor, its loss at that factor, and how long it is shown [s]."""
        self._passed += duration
        self._factor.with_next(factor, duration, self._horizon)
        full = loss / max(1 - factor, NO_ROOM) ** LOSS_EXPONENT
        for value, (mean, square) in ((loss, self._ours), (full, self._full)):
            mean.with_next(value, duration, self._horizon)
            square.with_next(value**2, duration, self._horizon)

    @property
    def ratio(self) -> float | None:
        """The ratio; None before a horizon has passed, or where constant dimming's loss does not change."""
        dimming = math.pow(1 - self._factor.mean, LOSS_EXPONENT)
        constant = _sd(*self._full) * dimming
        if self._passed < self._horizon * (1 - 1e-9) or constant <= 1e-9:
            return None
        return _sd(*self._ours) / constant


def gain_warning(ratio: float | None) -> str | None:
    """Return what is to be said of a ratio of SDs; None where something is gained, or none is known.

    >>> gain_warning(0.99)
    'nothing is gained: the loss varies 0.99 times as much as with constant dimming by the mean factor'
    """
    if ratio is None or ratio < NO_GAIN:
        return None
    words = "times as much as with constant dimming by the mean factor"
    return f"nothing is gained: the loss varies {ratio:.2f} {words}"


def _sd(mean: MeanSoFar, square: MeanSoFar) -> float:
    return math.sqrt(max(square.mean - mean.mean**2, 0.0))
