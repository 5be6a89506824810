"""Sweeps lose no reading, whatever happens to instruments, person or program."""

import dataclasses
import itertools
import json
import os
import signal
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from rehearsed_sweeps import DISPLAY, LUMINANCE, N_LUMINANCE, N_POWER, RIG, Faulty, lines, request

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import EVENTS, READINGS
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.experiments.sessions.staging import Staging
from evenlight.experiments.stage import PausePressed
from evenlight.experiments.sweeps import sweep_devices
from evenlight.experiments.sweeps.run_sweep import run_sweep
from evenlight.experiments.sweeps.sweep_readings import SweepStore
from evenlight.hardware.protocols import Fault, InstrumentError


@pytest.fixture
def failing(monkeypatch):
    """Let the luminance meter fail at some calls, counted from 1."""
    opened = sweep_devices.open_luminance_meter

    def make(faults):
        monkeypatch.setattr(sweep_devices, "open_luminance_meter", lambda *a: Faulty(opened(*a), faults))

    return make


@pytest.mark.parametrize(("task", "n"), [("luminance-sweep", N_LUMINANCE), ("power-sweep", N_POWER)])
def test_a_sweep_makes_every_reading(tmp_path, task, n):
    outcome = run_sweep(request(tmp_path, task))
    assert (outcome.status, outcome.done, outcome.planned) == (SessionStatus.COMPLETE, n, n)
    rows = lines(tmp_path, task=task)
    assert [row["index"] for row in rows] == list(range(n))
    assert all(a["ended_s"] <= b["begun_s"] for a, b in itertools.pairwise(rows))


def test_what_is_read_is_what_the_panel_shows(tmp_path):
    run_sweep(request(tmp_path))
    white = [r["luminance_cd_m2"] for r in lines(tmp_path) if r["phase"] == "drift"]
    half = [r["luminance_cd_m2"] for r in lines(tmp_path) if r["factor"] == 0.5]
    # The panel is within a hundredth of warm after two minutes more of sweep; the meter's noise is smaller.
    assert all(abs(value / (120.0 + 0.05) - 1) < 0.06 for value in white)
    assert all(abs(value / (60.0 + 0.05) - 1) < 0.06 for value in half)


def test_the_warm_up_lasts_as_long_as_the_design_says(tmp_path):
    run_sweep(request(tmp_path))
    warm = [row["ended_s"] for row in lines(tmp_path) if row["phase"] == "warm_up"]
    assert [round(time - warm[0]) for time in warm] == [0, 60, 120]


@pytest.mark.parametrize("fault", [Fault.NO_REPLY, Fault.GARBLED])
def test_what_fails_on_its_way_is_tried_again_and_noted(tmp_path, failing, fault):
    failing({5: InstrumentError("meter: silent", fault), 6: InstrumentError("meter: silent", fault)})
    outcome = run_sweep(request(tmp_path))
    assert outcome.status is SessionStatus.COMPLETE
    assert [row["attempts"] for row in lines(tmp_path)].count(3) == 1
    failed = [event for event in lines(tmp_path, EVENTS) if event["kind"] == "reading_failed"]
    assert [event["attempt"] for event in failed] == [1, 2]
    assert all(fault.value in event["detail"] and "tried again" in event["detail"] for event in failed)


@pytest.mark.slow
@pytest.mark.parametrize(
    "faults",
    [
        {5: Fault.DISCONNECTED},
        {5: Fault.LOW_BATTERY},
        {5: Fault.OVER_RANGE},
        {5: Fault.NO_REPLY, 6: Fault.NO_REPLY, 7: Fault.GARBLED},  # more often than the design allows
    ],
)
def test_what_fails_for_good_stops_the_sweep_which_goes_on_where_it_was(tmp_path, failing, faults):
    failing({call: InstrumentError("meter: its own words", fault) for call, fault in faults.items()})
    with pytest.raises(InstrumentError, match=r"its own words.*4 of 18 readings are safe.*--resume") as error:
        run_sweep(request(tmp_path))
    assert error.value.fault is list(faults.values())[-1]
    before = (tmp_path / "lab/sweeps/luminance-sweep_01" / READINGS).read_text()
    failing({})
    outcome = run_sweep(request(tmp_path, resume=True))
    assert (outcome.status, outcome.done) == (SessionStatus.COMPLETE, N_LUMINANCE)
    assert (tmp_path / "lab/sweeps/luminance-sweep_01" / READINGS).read_text().startswith(before)
    assert [row["index"] for row in lines(tmp_path)] == list(range(N_LUMINANCE))


@pytest.mark.slow
@pytest.mark.parametrize("stop", [KeyboardInterrupt(), PausePressed()])
@pytest.mark.parametrize("call", [1, 2, 9, N_LUMINANCE])
def test_a_sweep_interrupted_anywhere_resumes(tmp_path, failing, stop, call):
    failing({call: stop})
    if isinstance(stop, KeyboardInterrupt):
        with pytest.raises(KeyboardInterrupt):
            run_sweep(request(tmp_path))
    else:
        assert run_sweep(request(tmp_path)).status is SessionStatus.ABORTED
    assert len(lines(tmp_path)) == call - 1
    failing({})
    run_sweep(request(tmp_path, resume=True))
    uninterrupted = tmp_path / "again"
    run_sweep(request(uninterrupted))
    shown = [(row["pixel_value"], row["factor"], row["repeat"]) for row in lines(tmp_path)]
    assert shown == [(row["pixel_value"], row["factor"], row["repeat"]) for row in lines(uninterrupted)]


@pytest.mark.slow
def test_a_program_that_is_killed_in_the_midst_of_a_reading_loses_none(tmp_path):
    script = f"""
import dataclasses, os, signal, sys
from pathlib import Path
sys.path += [{str(Path(__file__).parent)!r}, {str(Path(__file__).parents[1] / "companions")!r}]
import test_run_sweep as t
opened = t.sweep_devices.open_luminance_meter
class Killed(t.Faulty):
    def read_luminance(self):
        self._calls += 1
        if self._calls == 8:
            os.kill(os.getpid(), signal.SIGKILL)
        return self._inner.read_luminance()
t.sweep_devices.open_luminance_meter = lambda *a: Killed(opened(*a), {{}})
t.run_sweep(t.request(Path({str(tmp_path)!r})))
"""
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(evenlight.__file__).parents[1], env=os.environ, timeout=100
    )
    assert ended.returncode == -signal.SIGKILL
    assert len(lines(tmp_path)) == 7
    with (tmp_path / "lab/sweeps/luminance-sweep_01" / READINGS).open("a") as log:
        log.write('{"index": 7, "phase": "swe')  # as a crash of the system may leave it
    run_sweep(request(tmp_path, resume=True))
    assert [row["index"] for row in lines(tmp_path)] == list(range(N_LUMINANCE))
    assert any(event["kind"] == "line_torn" for event in lines(tmp_path, EVENTS))


def test_a_screen_too_dark_for_the_meter_is_a_reading_without_a_value(tmp_path, failing):
    failing({4: InstrumentError("meter: too dark", Fault.UNDER_RANGE, "OK13")})
    run_sweep(request(tmp_path))
    row = lines(tmp_path)[3]
    assert (row["luminance_cd_m2"], row["status"], row["meter_status"]) == (None, "under_range", "OK13")
    assert len(lines(tmp_path)) == N_LUMINANCE


def test_a_sweep_that_was_away_warms_the_display_up_again(tmp_path, failing):
    failing({5: PausePressed()})
    run_sweep(request(tmp_path))
    failing({})
    run_sweep(request(tmp_path, resume=True))
    again = [event for event in lines(tmp_path, EVENTS) if event["kind"] == "continued"]
    assert len(again) == 1
    assert "120 s of white" in again[0]["detail"]
    times = [row["begun_s"] for row in lines(tmp_path)]
    assert times == sorted(times)
    assert times[4] - times[3] > 120


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 5}, "--seed"),
        ({"design": dataclasses.replace(LUMINANCE, repeats=4)}, "--design"),
        ({"rig": dataclasses.replace(RIG, bits=10)}, "--rig"),
    ],
)
def test_what_is_not_as_it_was_is_refused(tmp_path, failing, change, words):
    failing({5: PausePressed()})
    run_sweep(request(tmp_path))
    with pytest.raises(InputError, match=words):
        run_sweep(request(tmp_path, resume=True, **change))


def test_nothing_is_overwritten(tmp_path):
    run_sweep(request(tmp_path))
    with pytest.raises(InputError, match="never overwritten"):
        run_sweep(request(tmp_path))


def test_a_complete_sweep_that_is_resumed_has_only_its_results_made(tmp_path):
    run_sweep(request(tmp_path))
    before = (tmp_path / "lab/sweeps/luminance-sweep_01" / READINGS).read_text()
    outcome = run_sweep(request(tmp_path, resume=True))
    assert (outcome.status, outcome.done) == (SessionStatus.COMPLETE, N_LUMINANCE)
    assert (tmp_path / "lab/sweeps/luminance-sweep_01" / READINGS).read_text() == before


def test_without_backlight_and_display_file_factors_are_left_out_and_the_log_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_devices, "_backlight", lambda *where, **how: None)
    rig = dataclasses.replace(RIG, pixels_per_degree=40.0)
    outcome = run_sweep(request(tmp_path, rig=rig, display=None))
    assert outcome.done == N_LUMINANCE - 3  # the readings of the one factor
    assert {row["factor"] for row in lines(tmp_path)} == {None}
    said = [event["detail"] for event in lines(tmp_path, EVENTS) if event["kind"] == "changed"]
    assert any("factors left out" in detail for detail in said)


def test_without_a_backlight_the_pixels_of_a_known_display_make_factors(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_devices, "_backlight", lambda *where, **how: None)
    assert run_sweep(request(tmp_path)).done == N_LUMINANCE
    half = [row for row in lines(tmp_path) if row["factor"] == 0.5]
    # By hand: black + (peak - black) L'^2.2 = peak / 2, so L' = ((60 - 0.3) / (120 - 0.3))^(1 / 2.2).
    code = round(255 * (59.7 / 119.7) ** (1 / 2.2))
    assert {row["pixel_value"] for row in half} == {code / 255}
    assert all(abs(row["achieved_factor"] - 0.5) < 0.005 for row in half)


@pytest.mark.parametrize(
    ("task", "rig", "display", "words"),
    [
        ("luminance-sweep", {"luminance_meter": "none"}, DISPLAY, "no luminance meter"),
        ("power-sweep", {"power_meter": "none"}, DISPLAY, "no power meter"),
        ("luminance-sweep", {}, None, "pixels_per_degree"),
        ("power-sweep", {"luminance_meter": "none"}, None, "run luminance-sweep first"),
    ],
)
def test_a_rig_that_lacks_what_a_sweep_needs_is_refused_before_a_file_is_written(
    tmp_path, task, rig, display, words
):
    with pytest.raises(InputError, match=words):
        run_sweep(request(tmp_path, task, rig=dataclasses.replace(RIG, **rig), display=display))
    assert not (tmp_path / "lab").exists()


@pytest.fixture
def table(tmp_path):
    """A rig whose luminance meter is a table, with three readings of each of five levels."""
    path = tmp_path / "readings.csv"
    rows = [f"{value},{0.2 + 100 * value**2.2:.4f}" for value in (0, 0.25, 0.5, 0.75, 1)]
    path.write_text("\n".join(["pixel_value,luminance_cd_m2", *rows * 3]) + "\n")
    return {"rig": dataclasses.replace(RIG, luminance_meter=f"csv:{path}"), "design": None}


def test_an_import_that_was_interrupted_is_finished(tmp_path, table, monkeypatch):
    wanted = request(tmp_path, staging=Staging(), **table)
    write = SweepStore.write

    def interrupted(store, reading):
        if reading.index == 7:
            raise KeyboardInterrupt
        write(store, reading)

    monkeypatch.setattr(SweepStore, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_sweep(wanted)
    monkeypatch.undo()
    assert len(lines(tmp_path)) == 7
    outcome = run_sweep(dataclasses.replace(wanted, resume=True))
    assert (outcome.status, outcome.done) == (SessionStatus.COMPLETE, 15)
    assert [row["index"] for row in lines(tmp_path)] == list(range(15))


def test_a_table_has_its_own_levels_and_the_reflected_light_of_the_design(tmp_path, table):
    design = dataclasses.replace(LUMINANCE, reflected_luminance=0.15)
    outcome = run_sweep(request(tmp_path, staging=Staging(), rig=table["rig"], design=design))
    manifest = json.loads((outcome.folder / "sweep.json").read_text())["design"]
    assert manifest["pixel_values"] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert manifest["reflected_luminance_cd_m2"] == 0.15


class Moments:
    """A time of day that goes on by itself, and by what is added while nobody is there."""

    def __init__(self):
        self.now = datetime(2026, 11, 21, 9, tzinfo=UTC)

    def __call__(self):
        self.now += timedelta(seconds=1)
        return self.now.isoformat()


@pytest.fixture
def days(monkeypatch):
    """Let a rehearsal have a time of day."""
    moments = Moments()
    monkeypatch.setattr(Staging, "utc", lambda staging: moments())
    return moments


def test_the_time_away_counts(tmp_path, failing, days):
    failing({9: PausePressed()})  # after the warm-up
    run_sweep(request(tmp_path))
    days.now += timedelta(seconds=600)
    failing({})
    run_sweep(request(tmp_path, resume=True))
    times = [row["begun_s"] for row in lines(tmp_path)]
    # 600 s away, then 120 s of white, which is the design's warm-up, and the reading itself.
    assert 720 < times[8] - times[7] < 740
    again = [event for event in lines(tmp_path, EVENTS) if event["kind"] == "continued"]
    assert "120 s of white" in again[0]["detail"]


def test_a_short_time_away_is_warmed_up_for_as_long(tmp_path, failing, days):
    failing({9: PausePressed()})
    run_sweep(request(tmp_path))
    days.now += timedelta(seconds=30)
    failing({})
    run_sweep(request(tmp_path, resume=True))
    again = [event["detail"] for event in lines(tmp_path, EVENTS) if event["kind"] == "continued"]
    assert 30 <= float(again[0].split()[1]) < 35


def test_a_warm_up_that_was_interrupted_goes_on_at_its_intervals(tmp_path, failing, days):
    failing({2: PausePressed()})  # after the first of its readings, which are 60 s apart
    run_sweep(request(tmp_path))
    days.now += timedelta(seconds=3600)
    failing({})
    run_sweep(request(tmp_path, resume=True))
    warm = [row["begun_s"] for row in lines(tmp_path) if row["phase"] == "warm_up"]
    # 61 s until it was interrupted, an hour away, and the interval to the second reading once more.
    assert 3718 < warm[1] - warm[0] < 3726
    assert 58 < warm[2] - warm[1] < 62


def test_a_display_file_that_appears_in_the_midst_does_not_change_the_plan(tmp_path, failing, monkeypatch):
    # Without a backlight, factors are made by the pixels of a known display only.
    monkeypatch.setattr(sweep_devices, "_backlight", lambda *where, **how: None)
    rig = dataclasses.replace(RIG, pixels_per_degree=40.0)
    failing({5: PausePressed()})
    began = run_sweep(request(tmp_path, display=None, rig=rig))
    failing({})
    outcome = run_sweep(request(tmp_path, display=DISPLAY, rig=rig, resume=True))
    assert outcome.planned == outcome.done == began.planned


def test_a_simulated_backlight_makes_a_simulated_sweep(tmp_path, table):
    rig = dataclasses.replace(table["rig"], backlight="simulated")
    outcome = run_sweep(request(tmp_path, staging=Staging(), rig=rig, design=None))
    assert json.loads((outcome.folder / "sweep.json").read_text())["simulated"]


def test_a_late_reading_that_is_too_dark_counts_its_tries(tmp_path, failing):
    failing({4: InstrumentError("", Fault.NO_REPLY), 5: InstrumentError("", Fault.UNDER_RANGE, "OK13")})
    run_sweep(request(tmp_path))
    assert (lines(tmp_path)[3]["status"], lines(tmp_path)[3]["attempts"]) == ("under_range", 2)
