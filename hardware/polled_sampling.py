"""When an instrument that is asked for each value is asked again, and what its samples are."""

from __future__ import annotations

from evenlight.data_schema.power_log import PowerSample

ROUNDING = 1e-6  # of a period, in a clock that adds up
BACKWARDS = -0.05  # [W] further below zero than any zero error of a meter for panels


class PolledSampling:
    """The times and the count of an instrument's samples that the computer asks for one by one.

    A value that is asked for late makes the distance to the one before longer; none is made up, and none is
    lost: the count is of values that were read.
    """

    def __init__(self) -> None:
        self._period, self._due, self._count = 0.0, 0.0, 0
        self.is_running = False

    def begin(self, rate: float, now: float) -> None:
        """Begin to ask at a rate [Hz], the first time now [s]."""
        self._period, self._due, self._count = 1 / rate, now, 0
        self.is_running = True

    def end(self) -> None:
        """Ask no more."""
        self.is_running = False

    def is_due(self, now: float) -> bool:
        """Return whether the next value is to be asked for, and count on from there if it is."""
        if now < self._due - ROUNDING * self._period:
            return False
        self._due += self._period
        if self._due <= now:  # what was missed is not made up for in a rush
            self._due = now + self._period
        return True

    def sample(self, power: float, sent: float, received: float) -> PowerSample:
        """Return the sample of a value that was asked for and came at two times of the computer [s].

        The instrument measured somewhere between the two; their middle stands for it.
        """
        self._count += 1
        return PowerSample(self._count - 1, (sent + received) / 2, received, power)
