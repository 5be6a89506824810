"""Sweeps as a meter would read them off a simulated panel, without the hours that a real one takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_layout import READINGS, SWEEP_MANIFEST
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.sweep import (
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    PowerSweepDesign,
    ReadingStatus,
    SweepManifest,
    SweepPhase,
)
from evenlight.data_schema.storage.append_log import record_line
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel

STARTED = "2026-03-02T09:00:00Z"
WARM = PanelPhysics(warm_up_share=0.0)


@dataclass(frozen=True, slots=True)
class Meter:
    """How a simulated luminance meter reads.

    Attributes
    ----------
    share, floor : float
        Standard deviation of a reading: of the value, and in the dark [1, cd/m^2].
    digits : int
        Significant digits that it shows; 0 for all.
    finest : float
        Its last digit at the finest [cd/m^2].
    lowest : float
        Below which it has no value [cd/m^2].
    """

    share: float = 0.002
    floor: float = 0.002
    digits: int = 4
    finest: float = 0.001
    lowest: float = 0.0

    def read(self, luminance: float, rng: np.random.Generator) -> float | None:
        """Return what it shows of a luminance [cd/m^2]; None where that is too dark."""
        seen = luminance + float(np.hypot(self.floor, self.share * luminance)) * rng.standard_normal()
        if seen < self.lowest:
            return None
        if not self.digits:
            return seen
        exponent = int(np.floor(np.log10(max(abs(seen), 1e-9)))) + 1
        step = max(self.finest, 10.0 ** (exponent - self.digits))
        return round(round(seen / step) * step, 9)


@dataclass(frozen=True, slots=True)
class Step:
    """One thing that is shown and read."""

    phase: SweepPhase
    repeat: int
    pixel_value: float
    factor: float | None


def luminance_steps(design: LuminanceSweepDesign, rng: np.random.Generator) -> list[Step]:
    """Return what a luminance sweep shows, each repeat in another random order."""
    warm = int(design.warm_up / design.warm_up_interval)
    steps = [Step(SweepPhase.WARM_UP, k + 1, 1.0, None) for k in range(warm)]
    levels: list[tuple[float, float | None]] = [(v, None) for v in design.pixel_values]
    levels += [(1.0, b) for b in design.factors]
    for repeat in range(1, design.repeats + 1):
        order = rng.permutation(len(levels))
        steps += [Step(SweepPhase.SWEEP, repeat, *levels[k]) for k in order]
    for repeat in range(1, design.repeats + 1):
        steps += [Step(SweepPhase.DRIFT, repeat, v, None) for v in design.drift_pixel_values]
    return steps


def luminance_readings(
    physics: PanelPhysics,
    rng: np.random.Generator,
    design: LuminanceSweepDesign | None = None,
    meter: Meter | None = None,
    transfer: Callable[[float], float] | None = None,
    seconds: float = 3.0,
) -> tuple[LuminanceReading, ...]:
    """Return the readings of a luminance sweep, each of which takes so many seconds with its settling."""
    design, meter = design or LuminanceSweepDesign(), meter or Meter()
    now = [0.0]
    panel = SimulatedPanel(physics, lambda: now[0], transfer)
    readings = []
    for index, step in enumerate(luminance_steps(design, rng)):
        panel.show(step.pixel_value)
        panel.set_backlight(step.factor or 1.0)
        now[0] += design.warm_up_interval if step.phase is SweepPhase.WARM_UP else seconds
        luminance = meter.read(panel.luminance(), rng)
        there = luminance is not None
        readings.append(
            LuminanceReading(
                index, step.phase, step.repeat, step.pixel_value, step.factor, step.factor or 1.0, luminance,
                ReadingStatus.OK if there else ReadingStatus.UNDER_RANGE, "OK00" if there else "OK13",
                begun=now[0] - 1.0, ended=now[0],
            )
        )  # fmt: skip
    return tuple(readings)


@dataclass(frozen=True, slots=True)
class PowerNoise:
    """Standard deviation of one power reading: of the value, and at zero [1, W]."""

    share: float = 0.001
    floor: float = 0.0005


def power_readings(
    physics: PanelPhysics,
    rng: np.random.Generator,
    design: PowerSweepDesign | None = None,
    meter: Meter | None = None,
    noise: PowerNoise | None = None,
) -> tuple[PowerReading, ...]:
    """Return the readings of a power sweep; without a luminance where the meter is None."""
    design, noise = design or PowerSweepDesign(), noise or PowerNoise()
    now = [0.0]
    panel = SimulatedPanel(physics, lambda: now[0])
    panel.show(1.0)
    readings = []
    for index, (phase, repeat, factor) in enumerate(_power_steps(design, rng)):
        panel.set_backlight(factor)
        now[0] += design.warm_up_interval if phase is SweepPhase.WARM_UP else 4.0
        luminance = None if meter is None else meter.read(panel.luminance(), rng)
        status = ReadingStatus.OK if luminance is not None else ReadingStatus.UNDER_RANGE
        power = (
            panel.power() + float(np.hypot(noise.floor, noise.share * panel.power())) * rng.standard_normal()
        )
        readings.append(
            PowerReading(
                index, phase, repeat, factor, factor, luminance, None if meter is None else status, power,
                power_sd=0.003, duration=1.99, n_samples=200, n_lost=0, n_duplicated=0, meter_status="OK",
                begun=now[0] - 3.0, ended=now[0],
            )
        )  # fmt: skip
    return tuple(readings)


def _power_steps(design: PowerSweepDesign, rng: np.random.Generator) -> list[tuple[SweepPhase, int, float]]:
    """Return phase, repeat and factor of each reading."""
    warm = int(design.warm_up / design.warm_up_interval)
    steps = [(SweepPhase.WARM_UP, k + 1, 1.0) for k in range(warm)]
    for repeat in range(1, design.repeats + 1):
        order = rng.permutation(len(design.factors))
        steps += [(SweepPhase.SWEEP, repeat, design.factors[k]) for k in order]
    for repeat in range(1, design.repeats + 1):
        steps += [(SweepPhase.DRIFT, repeat, factor) for factor in design.drift_factors]
    return steps


def manifest_of(
    design: LuminanceSweepDesign | PowerSweepDesign, n_readings: int, **changes: Any
) -> SweepManifest:
    """Return the manifest of a complete simulated sweep, with what a test wants to be otherwise."""
    kind = "luminance" if isinstance(design, LuminanceSweepDesign) else "power"
    rig = Rig("made", "bench", 0.6, 60.0, luminance_meter="simulated", power_meter="simulated")
    made = SweepManifest(
        session_id="01", task=f"{kind}-sweep", simulated=True, status=SessionStatus.COMPLETE,
        n_readings=n_readings, design=design, rig=rig, display_name="bench", pixels_per_degree=60.0,
        peak_luminance=None, provenance=Provenance(seed=1), started=STARTED,
    )  # fmt: skip
    return replace(made, **changes)


def write_sweep(
    folder: Path,
    design: LuminanceSweepDesign | PowerSweepDesign,
    readings: Sequence[LuminanceReading | PowerReading],
    **changes: Any,
) -> Path:
    """Write a sweep as a folder of files, and return the folder."""
    folder.mkdir(parents=True)
    n_readings = changes.pop("n_readings", len(readings))
    write_json_record(folder / SWEEP_MANIFEST, manifest_of(design, n_readings, **changes))
    (folder / READINGS).write_text("".join(map(record_line, readings)))
    return folder
