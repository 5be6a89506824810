"""Claims about reading sweeps: what is refused, what is said, which one is fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_sweeps import WARM, luminance_readings, power_readings, write_sweep

from evenlight.analysis.sweeps.sweep_loading import load_sweep, newest_sweeps
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import READINGS
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.sweep import (
    LuminanceReading,
    LuminanceSweepDesign,
    PowerSweepDesign,
    SweepPhase,
)

DESIGN = LuminanceSweepDesign(
    pixel_values=(0.0, 0.25, 0.5, 0.75, 1.0), factors=(0.5, 1.0), warm_up=60.0, warm_up_interval=20.0
)


def readings_of(design: LuminanceSweepDesign = DESIGN) -> tuple[LuminanceReading, ...]:
    return luminance_readings(WARM, np.random.default_rng(1), design)


def test_a_complete_sweep_is_read_without_a_word(tmp_path: Path) -> None:
    readings = readings_of()
    sweep = load_sweep(write_sweep(tmp_path / "sweep", DESIGN, readings))
    assert sweep.readings == readings
    assert sweep.complete
    assert not sweep.warnings
    assert set(sweep.inputs) == {"sweep.json", "readings.jsonl"}


def test_pixel_values_count_as_asked_for_within_half_a_code(tmp_path: Path) -> None:
    # 0.25 · 255 = 63.75: the display shows code 64, and the reading says so.
    shown = [replace(r, pixel_value=round(r.pixel_value * 255) / 255) for r in readings_of()]
    assert load_sweep(write_sweep(tmp_path / "sweep", DESIGN, shown)).complete


def test_a_sweep_that_lacks_levels_is_refused_with_their_names(tmp_path: Path) -> None:
    some = [r for r in readings_of() if r.factor is not None or r.pixel_value not in (0.25, 0.75)]
    folder = write_sweep(tmp_path / "sweep", DESIGN, some, status=SessionStatus.ABORTED)
    with pytest.raises(
        InputError, match=r"no reading of the pixel values 0\.25, 0\.75 \(2 of 5 levels\).*--resume"
    ):
        load_sweep(folder)


def test_an_incomplete_sweep_with_every_level_is_used_and_said_so(tmp_path: Path) -> None:
    some = [r for r in readings_of() if r.repeat < 3]
    folder = write_sweep(tmp_path / "sweep", DESIGN, some, n_readings=30, status=SessionStatus.ABORTED)
    sweep = load_sweep(folder)
    assert not sweep.complete
    assert "aborted with" in sweep.warnings[0]


def test_a_display_without_brightness_factors_is_no_incomplete_sweep(tmp_path: Path) -> None:
    some = [r for r in readings_of() if r.factor is None]
    sweep = load_sweep(write_sweep(tmp_path / "sweep", DESIGN, some))
    assert sweep.complete
    assert "no brightness factors were measured" in sweep.warnings[0]


def test_a_power_sweep_without_a_factor_is_refused(tmp_path: Path) -> None:
    design = PowerSweepDesign(factors=(0.2, 0.6, 1.0), warm_up=0.0)
    some = [r for r in power_readings(WARM, np.random.default_rng(1), design) if r.factor != 0.6]
    with pytest.raises(InputError, match=r"no reading of the factors 0\.6"):
        load_sweep(write_sweep(tmp_path / "sweep", design, some))


def test_a_torn_last_line_is_left_out_and_said_so(tmp_path: Path) -> None:
    folder = write_sweep(tmp_path / "sweep", DESIGN, readings_of())
    path = folder / READINGS
    path.write_text(path.read_text()[:-40])
    sweep = load_sweep(folder)
    assert len(sweep.readings) == len(readings_of()) - 1
    assert any("torn" in warning for warning in sweep.warnings)


def test_a_line_that_is_no_reading_is_named(tmp_path: Path) -> None:
    folder = write_sweep(tmp_path / "sweep", DESIGN, readings_of())
    path = folder / READINGS
    path.write_text(path.read_text().replace('"phase": "sweep"', '"phase": "swep"', 1))
    first = next(r.index for r in readings_of() if r.phase is SweepPhase.SWEEP)
    with pytest.raises(InputError, match=rf"line {first + 1}: phase: expected one of"):
        load_sweep(folder)


def test_a_reading_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    readings = readings_of()
    folder = write_sweep(tmp_path / "sweep", DESIGN, (*readings, readings[3]))
    with pytest.raises(InputError, match="reading 3 is there twice"):
        load_sweep(folder)


def test_the_newest_complete_sweep_of_each_task_is_chosen(tmp_path: Path) -> None:
    sweeps = {
        "01": ("2026-03-01T09:00:00Z", SessionStatus.COMPLETE),
        "02": ("2026-03-03T09:00:00Z", SessionStatus.COMPLETE),
        "03": ("2026-03-02T09:00:00Z", SessionStatus.COMPLETE),
        "04": ("2026-03-04T09:00:00Z", SessionStatus.ABORTED),
    }
    for session, (started, status) in sweeps.items():
        folder = tmp_path / "sweeps" / f"luminance-sweep_{session}"
        write_sweep(folder, DESIGN, readings_of(), session_id=session, started=started, status=status)
    ((chosen, others),) = newest_sweeps(tmp_path).items()
    assert chosen.name == "luminance-sweep_02"
    assert others == ("luminance-sweep_01", "luminance-sweep_03", "luminance-sweep_04")
