"""Claims about the files that follow from a sweep, and about `evenlight fit` on data sets with sweeps."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_sweeps import STARTED, WARM, Meter, luminance_readings, power_readings, write_sweep
from matplotlib.figure import Figure

from evenlight.analysis.fit_commands import fit
from evenlight.analysis.sweeps.sweep_report import analyse_sweep, fit_sweep
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.sweep import (
    LuminanceSweepDesign,
    PowerReading,
    PowerSweepDesign,
    SweepPhase,
)
from evenlight.data_schema.recordings.sweep_fit import (
    DisplayFit,
    PowerFit,
    SweepFlag,
)
from evenlight.data_schema.storage.result_folders import SUMS
from evenlight.data_schema.storage.text_files import read_json_record, read_toml_record
from evenlight.experiments.viewing.simulate_viewing import ViewingSimulation, simulate_viewing
from evenlight.hardware.simulated.panel import PanelPhysics
from evenlight.method.preset_files import load_display

pytestmark = pytest.mark.usefixtures("blank_pictures")

DRAWN = Figure.savefig
LUMINANCE = LuminanceSweepDesign(factors=(0.25, 0.5, 1.0))
POWER = PowerSweepDesign()
METER = Meter()
DIM = PanelPhysics(peak_luminance=300.0, black_level=0.3, gamma=2.4)


def luminance_folder(
    path: Path, physics: PanelPhysics = DIM, meter: Meter | None = None, **changes: object
) -> Path:
    readings = luminance_readings(physics, np.random.default_rng(11), LUMINANCE, meter)
    return write_sweep(path, LUMINANCE, readings, **changes)


def readings_of_power(physics: PanelPhysics = WARM, meter: Meter | None = METER) -> tuple[PowerReading, ...]:
    return power_readings(physics, np.random.default_rng(12), POWER, meter)


def fit_and_draw(folder: Path) -> None:
    """Fit a sweep with its pictures, which are blank in the other tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", DRAWN)
        fit_sweep(folder, folder)


@pytest.fixture(scope="module")
def luminance(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a luminance sweep, in the sweep's own folder."""
    folder = luminance_folder(tmp_path_factory.mktemp("luminance") / "sweep")
    fit_and_draw(folder)
    return folder


@pytest.fixture(scope="module")
def power(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a power sweep, in the sweep's own folder."""
    folder = write_sweep(tmp_path_factory.mktemp("power") / "sweep", POWER, readings_of_power())
    fit_and_draw(folder)
    return folder


def test_the_display_serves_the_optimizer_and_says_that_it_is_simulated(luminance: Path) -> None:
    display = load_display(str(luminance / "display.toml"))
    assert display.peak_luminance == pytest.approx(300.0, rel=0.005)
    assert display.gamma == pytest.approx(2.4, abs=0.01)
    assert display.black_level == pytest.approx(0.3, abs=0.02)
    assert display.pixels_per_degree == 60.0
    assert "SIMULATED" in display.name
    assert display.source.startswith("SIMULATED")
    assert display.measured == ""
    assert display.provenance is not None
    assert display.provenance.inputs["readings.jsonl"] == sha256_of_file(luminance / "readings.jsonl")


def test_a_measured_display_has_its_date_and_no_such_word(tmp_path: Path) -> None:
    folder = luminance_folder(tmp_path / "sweep", simulated=False)
    fit_sweep(folder, tmp_path / "out")
    text = (tmp_path / "out" / "display.toml").read_text()
    assert read_toml_record(Display, tmp_path / "out" / "display.toml").measured == STARTED
    assert "SIMULATED" not in text
    assert "imulated:" not in (tmp_path / "out" / "report.html").read_text()


def test_the_levels_are_the_readings_averaged(luminance: Path) -> None:
    rows = read_json_record(DisplayFit, luminance / "display_fit.json").levels
    lines = [json.loads(line) for line in (luminance / "readings.jsonl").read_text().splitlines()]
    own = [r["luminance_cd_m2"] for r in lines if r["pixel_value"] == 0.5 and r["phase"] == "sweep"]
    row = next(row for row in rows if row.pixel_value == 0.5)
    assert len(rows) == 17
    assert row.luminance == pytest.approx(np.mean(own))
    assert row.luminance_sd == pytest.approx(np.std(own, ddof=1))
    assert row.n_readings == 3


def test_the_brightness_table_has_what_a_backlight_is_linearized_by(luminance: Path) -> None:
    with (luminance / "brightness.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["factor"]) for row in rows] == [0.25, 0.5, 1.0]
    assert [float(row["achieved_factor"]) for row in rows] == pytest.approx([0.25, 0.5, 1.0])
    assert [float(row["luminance_cd_m2"]) for row in rows] == pytest.approx([75.0, 150.0, 300.0], rel=0.01)


def test_a_backlight_that_is_not_linear_in_light_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = luminance_folder(tmp_path / "sweep", replace(DIM, backlight_exponent=1.5))
    fit_sweep(folder, folder)
    found = read_json_record(DisplayFit, folder / "display_fit.json")
    assert SweepFlag.BRIGHTNESS_NOT_LINEAR in found.flags
    # 0.25^1.5 / 0.25 - 1 = -0.5
    assert found.brightness_deviation == pytest.approx(-0.5, abs=0.005)
    assert found.brightness_deviation_factor == 0.25
    assert "not in proportion to the brightness factor: -50" in capsys.readouterr().err


def test_a_good_sweep_has_no_flag_and_prints_no_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = luminance_folder(tmp_path / "sweep")
    lines = fit_sweep(folder, folder)
    assert read_json_record(DisplayFit, folder / "display_fit.json").flags == ()
    assert capsys.readouterr().err == ""
    assert any("gamma curve describes the display" in line for line in lines)


def test_readings_that_leave_the_curve_open_are_no_verdict_for_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A meter of 20 % at five levels: gamma is known to some 0.2, and no curve can be ruled out."""
    few = replace(LUMINANCE, pixel_values=(0.0, 0.25, 0.5, 0.75, 1.0))
    readings = luminance_readings(DIM, np.random.default_rng(1), few, Meter(share=0.2, floor=0.01))
    folder = write_sweep(tmp_path / "sweep", few, readings)
    lines = fit_sweep(folder, folder)
    found = read_json_record(DisplayFit, folder / "display_fit.json")
    low, high = found.gamma_interval
    assert (high - low) / 2 * np.log(2) > 0.05
    assert SweepFlag.VAGUE in found.flags
    assert not any("gamma curve describes the display" in line for line in lines)
    assert f"is open: the readings allow gamma {low:.4g} to {high:.4g}" in capsys.readouterr().err


@pytest.mark.parametrize("every", [2, 3, 7])
def test_a_meter_that_gives_old_values_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], every: int
) -> None:
    fresh = luminance_readings(DIM, np.random.default_rng(11), LUMINANCE)
    readings = list(fresh)
    for k in range(every, len(readings), every):
        readings[k] = replace(readings[k], luminance=readings[k - 1].luminance)
    folder = write_sweep(tmp_path / "sweep", LUMINANCE, tuple(readings))
    fit_sweep(folder, folder)
    found = read_json_record(DisplayFit, folder / "display_fit.json")
    assert SweepFlag.STALE_READINGS in found.flags
    # Of one kind of level, neither dark (ten times 0.02 cd/m^2) nor the brightest (2 % and 0.02 below).
    bright = 0.98 * max(reading.luminance or 0.0 for reading in readings) - 0.02
    told = [
        k
        for k in range(every, len(readings), every)
        if readings[k].level[0] == readings[k - 1].level[0]
        and readings[k].level != readings[k - 1].level
        and 0.2 < (readings[k].luminance or 0.0) < bright
    ]
    assert found.n_stale == len(told) > 1
    assert "repeat the one before to the last digit" in capsys.readouterr().err


def test_old_values_are_named_where_each_pass_has_the_same_order(tmp_path: Path) -> None:
    """18 levels, of which every third repeats the one before in each pass: no reading of its own is left."""
    design = replace(
        LUMINANCE, pixel_values=tuple(k / 17 for k in range(18)), drift_pixel_values=(1.0,), factors=()
    )
    fresh = luminance_readings(DIM, np.random.default_rng(11), design)
    begin = sum(reading.phase is SweepPhase.WARM_UP for reading in fresh)
    swept = sorted(fresh[begin : begin + 54], key=lambda r: (r.repeat, r.pixel_value))
    readings = [*fresh[:begin], *swept, *fresh[begin + 54 :]]
    for k in range(begin + 2, begin + 54, 3):
        readings[k] = replace(readings[k], luminance=readings[k - 1].luminance)
    ordered = tuple(
        replace(reading, index=k, begun=3.0 * k, ended=3.0 * k + 1) for k, reading in enumerate(readings)
    )
    folder = write_sweep(tmp_path / "sweep", design, ordered)
    fit_sweep(folder, folder)
    assert SweepFlag.STALE_READINGS in read_json_record(DisplayFit, folder / "display_fit.json").flags


def test_a_display_that_gets_no_brighter_has_no_old_values(tmp_path: Path) -> None:
    """White from L' = 0.75 on, read by a meter without noise: levels read alike, and the meter is right."""
    readings = luminance_readings(
        DIM, np.random.default_rng(11), LUMINANCE, Meter(share=0.0, floor=0.0), lambda v: min(v, 0.75)
    )
    folder = write_sweep(tmp_path / "sweep", LUMINANCE, readings)
    fit_sweep(folder, folder)
    assert read_json_record(DisplayFit, folder / "display_fit.json").n_stale == 0


def test_what_went_wrong_in_a_sweep_is_flagged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Begun cold with a minute of warm-up, a display that ages 60 % an hour, a meter that reads from 0.4 on.
    design = replace(LUMINANCE, warm_up=120.0, warm_up_interval=10.0)
    physics = replace(DIM, warm_up_share=-0.3, drift_per_hour=0.6)
    readings = luminance_readings(physics, np.random.default_rng(1), design, Meter(lowest=0.4))
    folder = write_sweep(tmp_path / "sweep", design, readings)
    fit_sweep(folder, folder)
    flags = read_json_record(DisplayFit, folder / "display_fit.json").flags
    assert {
        SweepFlag.DRIFTED,
        SweepFlag.UNSTEADY,
        SweepFlag.BLACK_UNDER_RANGE,
        SweepFlag.REPEATS_APART,
    } <= set(flags)
    printed = capsys.readouterr().err
    assert printed.count("evenlight: warning: ") == len(flags)
    assert "only known to lie below" in printed


def test_reports_hold_their_figure_and_say_simulated(luminance: Path, power: Path) -> None:
    for folder, figure in ((luminance, "luminance.png"), (power, "power.png")):
        page = (folder / "report.html").read_text()
        assert (folder / figure).stat().st_size > 20_000
        assert "data:image/png;base64," in page
        assert "Simulated: the readings come from a simulated display" in page
        assert "http" not in page


def test_from_python_a_sweep_answers_as_every_analysis(power: Path, tmp_path: Path) -> None:
    result = analyse_sweep(power)
    table = result.to_frame()
    levels = read_json_record(PowerFit, power / "power_fit.json").levels
    assert table["power_w"].tolist() == [level.power for level in levels]
    assert isinstance(result.plot("power"), Figure)
    assert repr(result).startswith("<Power of bench (SIMULATED)>\nPower is linear in luminance: ")
    assert len(result.first_lines[0].split()) <= 60
    result.save(tmp_path / "again")
    assert (tmp_path / "again/power.toml").read_text() == (power / "power.toml").read_text()


def test_the_power_model_serves_the_optimizer_and_holds_the_truth(power: Path) -> None:
    model = read_toml_record(PowerModel, power / "power.toml")
    found = read_json_record(PowerFit, power / "power_fit.json")
    low, high = found.base_power_interval
    assert low < WARM.base_power < high
    low, high = found.power_per_luminance_interval
    assert low < WARM.power_per_luminance < high
    assert model.peak_luminance == pytest.approx(200.0, rel=0.005)
    assert "SIMULATED" in model.name
    assert found.flags == ()
    assert len(found.levels) == 10


def test_without_a_luminance_meter_the_factor_tells_the_luminance_and_the_files_say_so(
    tmp_path: Path,
) -> None:
    folder = write_sweep(tmp_path / "sweep", POWER, readings_of_power(meter=None), peak_luminance=200.0)
    fit_sweep(folder, folder)
    model = read_toml_record(PowerModel, folder / "power.toml")
    assert "luminance as factor times 200 cd/m^2" in model.source
    assert "Nothing read the luminance" in (folder / "report.html").read_text()
    assert model.power_per_luminance == pytest.approx(WARM.power_per_luminance, rel=0.01)


def test_neither_meter_nor_peak_is_refused(tmp_path: Path) -> None:
    folder = write_sweep(tmp_path / "sweep", POWER, readings_of_power(meter=None))
    with pytest.raises(
        InputError, match="measure with a luminance meter, or give the rig a measured display"
    ):
        fit_sweep(folder, folder)
    assert not (folder / "power.toml").exists()


def test_reflected_light_is_taken_off_the_luminance_of_a_power_sweep(tmp_path: Path) -> None:
    design = replace(POWER, reflected_luminance=5.0)
    readings = readings_of_power(replace(WARM, reflected_luminance=5.0))
    folder = write_sweep(tmp_path / "sweep", design, readings)
    fit_sweep(folder, folder)
    found = read_json_record(PowerFit, folder / "power_fit.json")
    assert found.base_power == pytest.approx(WARM.base_power, abs=0.002)
    assert found.peak_luminance == pytest.approx(200.0, rel=0.005)


def test_droop_is_flagged_with_its_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readings = readings_of_power(replace(WARM, droop=0.2, peak_luminance=500.0))
    folder = write_sweep(tmp_path / "sweep", POWER, readings)
    fit_sweep(folder, folder)
    found = read_json_record(PowerFit, folder / "power_fit.json")
    assert SweepFlag.NOT_LINEAR in found.flags
    assert "LED droop" in capsys.readouterr().err
    assert found.bend == pytest.approx(-0.2 * 0.9**2 / 4 / 0.918, abs=0.005)


def test_without_a_luminance_meter_a_bend_is_not_blamed_on_the_leds_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # A backlight whose light goes with the square of its factor, on a panel that is linear in light.
    readings = readings_of_power(replace(WARM, backlight_exponent=2.0), meter=None)
    folder = write_sweep(tmp_path / "sweep", POWER, readings, peak_luminance=200.0)
    fit_sweep(folder, folder)
    assert SweepFlag.NOT_LINEAR in read_json_record(PowerFit, folder / "power_fit.json").flags
    told = capsys.readouterr().err
    assert "power, or the backlight's light, is not linear in the factor" in told
    assert "droop" not in told


def test_a_base_power_that_may_as_well_be_zero_is_zero_and_flagged(tmp_path: Path) -> None:
    for seed in range(20):
        readings = power_readings(replace(WARM, base_power=0.0), np.random.default_rng(seed), POWER, Meter())
        folder = write_sweep(tmp_path / f"sweep{seed}", POWER, readings)
        fit_sweep(folder, folder)
        found = read_json_record(PowerFit, folder / "power_fit.json")
        if SweepFlag.BASE_POWER_ZERO in found.flags:
            break
    assert found.base_power == 0.0
    assert found.power_per_luminance == pytest.approx(WARM.power_per_luminance, rel=0.003)
    assert read_toml_record(PowerModel, folder / "power.toml").base_power == 0.0


def test_a_base_power_clearly_below_zero_is_refused(tmp_path: Path) -> None:
    readings = readings_of_power(replace(WARM, base_power=-0.05))
    with pytest.raises(InputError, match="no panel gives power"):
        fit_sweep(write_sweep(tmp_path / "sweep", POWER, readings), tmp_path / "out")


def test_fit_takes_a_data_set_that_holds_sweeps_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset, out = tmp_path / "dataset", tmp_path / "out"
    luminance_folder(dataset / "sweeps" / "luminance-sweep_01", session_id="01")
    luminance_folder(
        dataset / "sweeps" / "luminance-sweep_02", session_id="02", started="2026-03-05T09:00:00Z"
    )
    write_sweep(dataset / "sweeps" / "power-sweep_01", POWER, readings_of_power())
    fit(dataset, out=out)
    page = (out / "power-sweep" / "report.html").read_text()
    assert page.count("P of the line [W]") == 1
    assert sorted(path.name for path in out.iterdir()) == [SUMS, "luminance-sweep", "power-sweep"]
    found = read_json_record(DisplayFit, out / "luminance-sweep" / "display_fit.json")
    assert found.session_id == "02"
    printed = capsys.readouterr().out
    assert "luminance-sweep: luminance-sweep_02; not fitted: luminance-sweep_01" in printed


def test_ramps_and_sweeps_are_fitted_together_and_a_bad_sweep_spoils_no_ramp(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset, out = tmp_path / "dataset", tmp_path / "out"
    display = load_display("varjo-xr3")
    simulate_viewing(ViewingSimulation(2, 3, "ramp", display, RampDesign(repetitions=2)), dataset)
    luminance_folder(dataset / "sweeps" / "luminance-sweep_01")
    few = readings_of_power()[:5]
    write_sweep(dataset / "sweeps" / "power-sweep_01", POWER, few, status=SessionStatus.ABORTED)
    fit(dataset, out=out, quiet=True)
    assert (out / "rate_limit.json").exists()
    assert (out / "luminance-sweep" / "display.toml").exists()
    assert not (out / "power-sweep").exists()
    assert "power-sweep was not fitted" in capsys.readouterr().err


def test_a_data_set_whose_sweeps_are_all_unusable_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    few = readings_of_power()[:5]
    write_sweep(tmp_path / "dataset" / "sweeps" / "power-sweep_01", POWER, few, status=SessionStatus.ABORTED)
    with pytest.raises(InputError, match="has no reading of the factors"):
        fit(tmp_path / "dataset", out=tmp_path / "out", quiet=True)
    assert not (tmp_path / "out").exists()
