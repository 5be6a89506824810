"""The power that a meter or battery measures while the desktop is dimmed."""

from __future__ import annotations

import time

from evenlight.hardware.protocols import InstrumentError, PowerMeter
from evenlight.hardware.rig import open_power_meter

RATE = 1.0  # [Hz]: no battery's gauge is quicker
AGAIN = (
    60.0  # [s] after which a meter that has failed is tried again: a battery that is charged tells nothing
)


class PowerGauge:
    """The mean of what a meter of some name measures; of none, without a name."""

    def __init__(self, name: str) -> None:
        self._name, self._open_at, self._powers = name, -AGAIN, [0.0, 0.0]
        self._meter: PowerMeter | None = None

    def mean(self) -> float | None:
        """Return the mean so far [W]; None before the first sample."""
        try:
            if self._name and self._meter is None and time.monotonic() >= self._open_at:
                self._open_at = time.monotonic() + AGAIN
                self._meter = open_power_meter(self._name, time.monotonic)
                self._meter.start(RATE)
            for sample in self._meter.samples() if self._meter else ():
                self._powers = [self._powers[0] + sample.power, self._powers[1] + 1]
        except InstrumentError:
            if self._meter:
                self._meter.close()
            self._meter = None
        return self._powers[0] / self._powers[1] if self._powers[1] else None
