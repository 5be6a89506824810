"""Sweeps from the command line: from a display nobody knows to the files that `optimize` takes."""

import dataclasses
import json
import os

import pytest
from emulators.ours import attach
from warm_evenlight import Run

from evenlight.analysis.sweeps.sweep_report import fit_sweep
from evenlight.data_schema.display import Display
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.recordings.dataset_layout import READINGS
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, PowerFit
from evenlight.data_schema.storage.text_files import read_json_record, read_toml_record
from evenlight.experiments.sessions.staging import Staging
from evenlight.experiments.sweeps import sweep_devices
from evenlight.experiments.sweeps.run_sweep import SweepRequest, run_sweep
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel
from evenlight.method.preset_files import load_display

NEW_RIG = """
name = "new"
display = "new.display.toml"
viewing_distance_m = 0.6
refresh_rate_hz = 60.0
pixels_per_degree = 42.0
luminance_meter = "{meter}"
power_meter = "simulated"
"""


@pytest.fixture
def lab(tmp_path, command):
    """Run a sweep of a rig, rehearsed without a window."""

    def run(*words, rig="simulated", out="lab"):
        return command("run", *words, "--rig", rig, "--simulate", "data", "--out", tmp_path / out)

    return run


@pytest.fixture
def new_rig(tmp_path):
    """Write a rig whose display has no file yet."""

    def write(meter="simulated"):
        path = tmp_path / "new.rig.toml"
        path.write_text(NEW_RIG.format(meter=meter))
        return path

    return write


def test_a_luminance_sweep_ends_in_a_display_that_is_the_panels(lab, tmp_path):
    done = lab("luminance-sweep", "--session", "01")
    assert (done.code, done.err) == (0, "")
    assert "SIMULATED" in done.out
    folder = tmp_path / "lab/sweeps/luminance-sweep_01"
    readings = len((folder / READINGS).read_text().splitlines())
    assert f"complete: {readings} of {readings} readings in {folder}\n" in done.out
    display, truth = read_toml_record(Display, folder / "display.toml"), load_display("varjo-xr3")
    assert abs(display.gamma - truth.gamma) < 0.01
    assert abs(display.peak_luminance / truth.peak_luminance - 1) < 0.005
    assert abs(display.black_level - truth.black_level) < 0.02
    assert display.pixels_per_degree == truth.pixels_per_degree
    assert "SIMULATED" in display.name
    assert read_json_record(DisplayFit, folder / "display_fit.json")


def test_a_power_sweep_ends_in_a_power_model_that_is_the_panels(lab, tmp_path):
    done = lab("power-sweep", "--session", "01")
    assert (done.code, done.err) == (0, "")
    folder, truth = tmp_path / "lab/sweeps/power-sweep_01", PanelPhysics()
    model = read_toml_record(PowerModel, folder / "power.toml")
    assert abs(model.base_power / truth.base_power - 1) < 0.01
    assert abs(model.power_per_luminance / truth.power_per_luminance - 1) < 0.01
    fit = read_json_record(PowerFit, folder / "power_fit.json")
    assert fit.simulated


def test_optimize_takes_what_the_sweeps_of_a_new_display_made(
    lab, new_rig, tmp_path, command, make_video, monkeypatch
):
    attach(monkeypatch)
    rig = new_rig("simulated:ls100")
    for task in ("luminance-sweep", "power-sweep"):
        done = lab(task, "--session", "01", "--design", "quick", rig=rig)
        assert done.code == 0, done.err
    sweeps, track = tmp_path / "lab/sweeps", tmp_path / "track"
    make_video(tmp_path / "made.mkv", [0.3 + 0.05 * frame for frame in range(12)], (64, 48), 25.0)
    done = command(
        *(
            "optimize",
            "--no-player",
            tmp_path / "made.mkv",
            "--budget",
            "0.5",
            "--out",
            track,
            "--other-display-ok",
        ),
        *("--display", sweeps / "luminance-sweep_01/display.toml"),
        *("--power-model", sweeps / "power-sweep_01/power.toml"),
    )
    assert done.code == 0, done.err
    summary = json.loads((track / "summary.json").read_text())
    assert summary["full_power_w"] > summary["mean_power_w"] > 0


def test_the_data_set_of_sweeps_is_valid_and_fit_makes_the_results_anew(lab, tmp_path, command):
    lab("luminance-sweep", "--session", "01", "--design", "quick")
    lab("power-sweep", "--session", "01", "--design", "quick", "--participant", "m1")
    done = command("validate", tmp_path / "lab")
    assert done.code == 0, done.out + done.err
    done = command("fit", tmp_path / "lab", "--out", tmp_path / "fitted")
    assert done.code == 0, done.err
    made = (tmp_path / "lab/sweeps/luminance-sweep_01/display.toml").read_text()
    assert (tmp_path / "fitted/luminance-sweep/display.toml").read_text() == made
    assert json.loads((tmp_path / "lab/sweeps/power-sweep_01/sweep.json").read_text())["measured_by"] == "m1"


def test_a_changed_reading_is_found(lab, tmp_path, command):
    lab("luminance-sweep", "--session", "01", "--design", "quick")
    path = tmp_path / "lab/sweeps/luminance-sweep_01/readings.jsonl"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:-2], lines[-1], lines[-1]]) + "\n")
    done = command("validate", tmp_path / "lab")
    assert done.code == 1
    assert "is there already" in done.out + done.err
    assert "expected" in done.out + done.err


def test_readings_made_elsewhere_are_imported(tmp_path, new_rig, command):
    # Beside the rig, which names it relative to itself.
    rows = [f"{value},{0.2 + 100 * value**2.2:.4f}" for value in (0, 0.25, 0.5, 0.75, 1)]
    table = tmp_path / "readings.csv"
    table.write_text("\n".join(["pixel_value,luminance_cd_m2", *rows * 3]) + "\n")
    words = ("run", "luminance-sweep", "--session", "01", "--rig", new_rig("csv:readings.csv"))
    done = command(*words, "--out", tmp_path / "lab")
    assert done.code == 0, done.err
    display = read_toml_record(Display, tmp_path / "lab/sweeps/luminance-sweep_01/display.toml")
    assert abs(display.gamma - 2.2) < 0.01
    assert "SIMULATED" not in display.name
    table.write_text("\n".join(["pixel_value,luminance_cd_m2", *rows]) + "\n")
    done = command(*words, "--out", tmp_path / "other")
    assert done.code == 2
    assert "at least 3 of each level" in done.err


def test_power_without_a_luminance_meter_goes_by_the_curve_of_the_backlight(tmp_path, monkeypatch):
    # A backlight whose luminance goes with the square of its factor, and power with luminance.
    truth = PanelPhysics(peak_luminance=104.4, backlight_exponent=2.0, warm_up_share=0.0)
    monkeypatch.setattr(sweep_devices, "_panel", lambda display, now: SimulatedPanel(truth, now))
    rig = Rig("square", "varjo-xr3", 0.6, 60.0, backlight="simulated", luminance_meter="simulated",
              power_meter="simulated")  # fmt: skip
    display = load_display("varjo-xr3")
    asked = SweepRequest("luminance-sweep", tmp_path / "lab", "01", rig, display, None, Staging("data"))
    folder = run_sweep(asked).folder
    fit_sweep(folder, folder)
    curve = str(folder / "brightness.csv")
    without = dataclasses.replace(rig, luminance_meter="none", backlight_curve=curve)
    folder = run_sweep(dataclasses.replace(asked, task="power-sweep", rig=without)).folder
    fit_sweep(folder, folder)
    fit = read_json_record(PowerFit, folder / "power_fit.json")
    low, high = fit.base_power_interval
    assert low - 0.001 <= truth.base_power <= high + 0.001
    assert abs(fit.power_per_luminance / truth.power_per_luminance - 1) < 0.01
    assert fit.is_linear


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["luminance-sweep", "--session", "01", "--stimuli", "here"],
            "--stimuli is for sessions with people",
        ),
        (["luminance-sweep", "--session", "01", "--design", "qick"], "did you mean 'quick'"),
        (["luminance-sweep", "--session", "01", "--participant", "Anna"], "a digit among them"),
        (["ramp", "--session", "01"], "--participant is missing"),
        (["power-sweep", "--session", "01", "--resume"], "there is no sweep to resume"),
    ],
)
def test_bad_input_ends_with_one_line(lab, tmp_path, words, said):
    done = lab(*words)
    assert done.code == 2
    assert said in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not (tmp_path / "lab").exists()


def test_a_display_measured_too_long_ago_is_refused_before_a_window_opens(tmp_path, command):
    old = 'name = "old"\npeak_luminance_cd_m2 = 100.0\nblack_level_cd_m2 = 0.1\ngamma = 2.2\n'
    (tmp_path / "old.display.toml").write_text(f'{old}pixels_per_degree = 40.0\nmeasured = "2020-01-01"\n')
    rig = tmp_path / "old.rig.toml"
    rig.write_text(
        'name = "old"\ndisplay = "old.display.toml"\nviewing_distance_m = 0.6\nrefresh_rate_hz = 60.0\n'
        "calibration_age_limit_days = 30.0\n"
    )
    words = ("run", "ramp", "--participant", "01", "--session", "01", "--rig", rig, "--design", "quick")
    done = command(*words, "--out", tmp_path / "lab")
    assert done.code == 2
    assert "2020-01-01" in done.err
    assert "--old-calibration-ok" in done.err
    assert not (tmp_path / "lab").exists()
    done = command(*words, "--simulate", "data", "--out", tmp_path / "lab")
    assert done.code == 0, done.err
    with rig.open("a") as file:
        file.write('power_meter = "board:/dev/none"\n')
    done = command("run", "power-sweep", "--session", "01", "--rig", rig, "--out", tmp_path / "lab2")
    assert (done.code, "2020-01-01" in done.err) == (2, True)


def test_a_sweep_on_a_window_draws_the_codes_that_it_says(tmp_path, small_rig, virtual_screen):
    words = ["run", "luminance-sweep", "--session", "01", "--rig", str(small_rig), "--design", "quick"]
    words += ["--simulate", "visual", "--out", str(tmp_path / "lab")]
    done = Run(words, os.environ | {"DISPLAY": virtual_screen(24)})
    _, err = done.communicate(timeout=200)
    # The screen reads each code back after drawing it, and refuses another.
    assert done.returncode == 0, err
    manifest = json.loads((tmp_path / "lab/sweeps/luminance-sweep_01/sweep.json").read_text())
    assert manifest["simulated"]
    assert manifest["apparatus"]["bits"] == "8"
