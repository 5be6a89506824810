"""The power that a meter or battery measures while the desktop is dimmed."""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Iterator

from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.rig import open_power_meter

RATE = 1.0  # [Hz]: no battery's gauge is quicker
AGAIN = 60.0  # [s] after which one that has failed is tried again: a battery that is charged tells nothing


def mean_power(name: str) -> Iterator[float | None]:
    """Yield the mean since it began of what a meter measures [W]; None before its first sample."""
    powers, again = list[float](), -AGAIN
    while True:
        with contextlib.suppress(InstrumentError), open_power_meter(name, time.monotonic) as meter:
            meter.start(RATE)
            while True:
                powers += [sample.power for sample in meter.samples()]
                yield statistics.fmean(powers) if powers else None
        again = time.monotonic() + AGAIN
        while time.monotonic() < again:
            yield statistics.fmean(powers) if powers else None
