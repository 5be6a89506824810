"""A reading that contradicts those before it, told at once, while its level is still shown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.data_schema.recordings.sweep import LuminanceReading, PowerReading, SweepPhase
from evenlight.method.suspect_readings import TOLERANCES, suspect_readings


def doubt_of_last(readings: Sequence[LuminanceReading | PowerReading]) -> str:
    """Return in words what the last reading contradicts; nothing if it fits those before it.

    The rule is that of the fit (`method.suspect_readings`), over what has been read. A reading of the warm-up
    has nothing to be compared with, but the next one, a little later.
    """
    last = readings[-1]
    if last.phase is SweepPhase.WARM_UP:
        return ""
    own = [r for r in readings if r.phase is not SweepPhase.WARM_UP and r.level[0] == last.level[0]]
    levels = np.array([r.level[1] for r in own])
    for unit, value in last.measured.items():
        values = np.array([r.measured.get(unit) for r in own], dtype=np.float64)
        if suspect_readings(values, levels, TOLERANCES[unit]).left_out[-1]:
            before = values[:-1][levels[:-1] == levels[-1]]
            others = ", ".join("too dark" if np.isnan(v) else f"{v:.5g}" for v in before[-5:])
            read = "too dark" if value is None else f"{value:.5g} {unit}"
            against = f"its level had {others}" if others else "neighbouring levels leave no room for it"
            return f"{read} at the {last.level[0]} {last.level[1]:.4g}, and {against}"
    return ""
