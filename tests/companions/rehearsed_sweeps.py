"""Sweeps of a simulated panel with meters that fail at some calls, as several test files need them."""

import dataclasses
import json

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.dataset_layout import READINGS
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.sweep import LuminanceSweepDesign, PowerSweepDesign
from evenlight.experiments.sessions.staging import Staging
from evenlight.experiments.sweeps.run_sweep import SweepRequest

DISPLAY = Display("bench", 120.0, 0.3, 2.2, pixels_per_degree=40.0, reflected_luminance=0.05)
RIG = Rig("bench", "bench.display.toml", 0.6, 60.0, luminance_meter="simulated", power_meter="simulated")
LUMINANCE = LuminanceSweepDesign(
    pixel_values=(0.0, 0.5, 1.0), factors=(0.5,), warm_up=120.0, drift_pixel_values=(1.0,)
)
POWER = PowerSweepDesign(factors=(0.2, 0.6, 1.0), warm_up=60.0, average=0.5)
N_LUMINANCE = 3 + 3 * 4 + 3  # of warm-up, of levels, at the end
N_POWER = 2 + 3 * 3 + 3


def request(folder, task="luminance-sweep", **changes):
    design = LUMINANCE if task == "luminance-sweep" else POWER
    made = SweepRequest(task, folder / "lab", "01", RIG, DISPLAY, design, Staging("data"))
    return dataclasses.replace(made, **changes)


def lines(folder, name=READINGS, task="luminance-sweep"):
    text = (folder / "lab" / "sweeps" / f"{task}_01" / name).read_text()
    return [json.loads(line) for line in text.splitlines()]


class Faulty:
    """A meter that fails at some calls."""

    def __init__(self, inner, faults):
        self._inner, self._faults, self._calls = inner, faults, 0

    def __enter__(self):
        self._inner.__enter__()
        return self

    def __exit__(self, *error):
        self._inner.__exit__(*error)

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def read_luminance(self):
        self._calls += 1
        if failure := self._faults.get(self._calls):
            raise failure
        return self._inner.read_luminance()
