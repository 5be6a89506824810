"""`evenlight fit`: from simulated sessions to the files of the contract."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from evenlight.analysis.fit_commands import fit
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import BandKind, RateLimitForm, RateLimitModel
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.threshold import Threshold
from evenlight.experiments.viewing.simulate_viewing import ViewingSimulation, simulate_viewing
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import rate_limit_at

pytestmark = pytest.mark.usefixtures("blank_pictures")

CONTRACT = (
    "participant_id,factor,luminance_cd_m2,threshold_cd_m2_s,ci_low,ci_high,false_alarm_rate,n_trials,flag"
)


def simulate(folder: Path, participants: int, design: RampDesign, seed: int = 3) -> Path:
    display = load_display("varjo-xr3")
    simulate_viewing(ViewingSimulation(participants, seed, "ramp", display, design), folder)
    return folder


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fit") / "dataset"
    return simulate(folder, 6, RampDesign(screens=("white",), repetitions=3))


@pytest.fixture(scope="module")
def results(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    fit(dataset, out=folder, quiet=True)
    return folder


def test_thresholds_have_the_columns_of_the_contract_and_a_row_per_participant_and_level(
    results: Path,
) -> None:
    rows = read_rows(Threshold, results / "thresholds.csv")
    header = (results / "thresholds.csv").read_text().splitlines()[0].split(",")
    assert set(CONTRACT.split(",")) <= set(header)
    assert len({(r.participant_id, r.screen, r.factor) for r in rows}) == 30  # 6 people, 5 levels


def test_thresholds_lie_near_the_truth_that_was_written_beside_the_data(dataset: Path, results: Path) -> None:
    # 24 ramps per level: about a quarter of the threshold each; the mean over 30 is known to 5 %.
    truth = {
        (p["participant_id"], level["screen"], level["factor"]): level["threshold_cd_m2_s"]
        for p in json.loads((dataset / "simulated_truth.json").read_text())["participants"]
        for level in p["levels"]
    }
    rows = read_rows(Threshold, results / "thresholds.csv")
    errors = np.log([r.threshold / truth[r.participant_id, r.screen, r.factor] for r in rows])
    assert abs(errors.mean()) < 0.15
    assert errors.std() < 0.45


def test_the_rate_limit_serves_the_optimizer_and_says_that_it_is_simulated(results: Path) -> None:
    limit = load_rate_limit(str(results / "rate_limit.json"))
    assert limit.simulated
    assert limit.display_fingerprint == load_display("varjo-xr3").fingerprint
    assert limit.model is RateLimitModel.JOINT
    assert limit.band_kind is BandKind.SIMULTANEOUS
    # Six participants whose thresholds have a standard deviation of 25 %: within 3 · 0.25/sqrt(6).
    ratio = rate_limit_at(limit, [20.0, 60.0]) / rate_limit_at(load_rate_limit("surace2025"), [20.0, 60.0])
    assert (np.abs(np.log(ratio)) < 0.31).all()


def test_the_summary_states_what_the_curve_rests_on(results: Path) -> None:
    summary = json.loads((results / "fit_summary.json").read_text())
    assert summary["simulated"] is True
    assert summary["n_participants"] == 6
    assert summary["n_thresholds"] == 30
    assert summary["condition_number"] < 5
    assert summary["residual_df"] == 5 - 1 - summary["degree"]  # five luminances
    assert isinstance(summary["monotone"], bool)
    assert summary["models"]["pooled"]["ratio_to_chosen_mean"] > 0
    assert set(summary["criteria"]) == {"01", "02", "03", "04", "05", "06"}
    assert set(summary["provenance"]["inputs"]) == {"dataset"}


def test_the_same_data_give_the_same_files(dataset: Path, results: Path, tmp_path: Path) -> None:
    fit(dataset, out=tmp_path, quiet=True)
    for name in ("thresholds.csv", "rate_limit.json", "fit_summary.json"):
        assert (tmp_path / name).read_bytes() == (results / name).read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in results.iterdir()}


def test_a_power_law_can_be_asked_for(dataset: Path, tmp_path: Path) -> None:
    fit(dataset, out=tmp_path, form=RateLimitForm.LOG_LOG, degree=1, quiet=True)
    limit = load_rate_limit(str(tmp_path / "rate_limit.json"))
    assert limit.form is RateLimitForm.LOG_LOG
    # Near Weber's law: ΔL ∝ L^a with a about 1 (published points: 0.97 by least squares in log-log).
    low, high = limit.luminance_range
    exponent = limit.coefficients[1] / (np.log(high / low) / 2)
    assert 0.7 < exponent < 1.2


def test_a_degree_that_two_luminances_do_not_have_is_refused_and_leaves_nothing_half_written(
    tmp_path: Path,
) -> None:
    design = RampDesign(factors=(1.0,), repetitions=1)
    data = simulate(tmp_path / "data", 1, design)
    out = tmp_path / "out"
    with pytest.raises(InputError, match="degree 4 needs thresholds at 5 or more luminances, got 2"):
        fit(data, out=out, degree=4, quiet=True)
    assert not out.exists()


def test_a_participant_who_sees_everything_counts_and_is_named(
    dataset: Path, results: Path, tmp_path: Path, command
) -> None:
    """Their thresholds lie below the slowest rate: the joint limit sinks; the individual one lacks them."""
    changed = tmp_path / "changed"
    shutil.copytree(dataset, changed)
    trials = changed / "sub-02" / "ses-01" / "trials.jsonl"
    lines = [json.loads(line) for line in trials.read_text().splitlines()]
    ramps = [line | ({} if line["is_catch"] else {"response": "yes"}) for line in lines]
    trials.write_text("".join(json.dumps(line) + "\n" for line in ramps))
    result = command("fit", changed, "--out", tmp_path / "out", "--quiet")
    assert result.code == 0
    (told,) = [line for line in result.err.splitlines() if "are all alike" in line]
    assert "02" in told
    summary = json.loads((tmp_path / "out" / "fit_summary.json").read_text())
    assert summary["excluded_participants"] == {}
    assert [p["participant_id"] for p in summary["joint"]["participants"] if p["all_alike"]] == ["02"]
    own, before = (load_rate_limit(str(path / "rate_limit.json")) for path in (tmp_path / "out", results))
    assert rate_limit_at(own, 50.0) < rate_limit_at(before, 50.0)
    individual = command("fit", changed, "--out", tmp_path / "individual", "--quiet", "--model", "individual")
    assert "5 of 30 thresholds are left out" in individual.err
    assert "too high, on the unsafe side" in individual.err
    summary = json.loads((tmp_path / "individual" / "fit_summary.json").read_text())
    assert summary["excluded_participants"] == {"02": "all_yes"}


def test_the_error_stream_of_a_pipe_holds_words_alone(tmp_path: Path, short_ramps: Path, command) -> None:
    """A progress bar leaves an empty line where there is no terminal to draw it on."""
    made = command(
        "simulate", "ramp", "--participants", 1, "--design", short_ramps, "--out", tmp_path / "data"
    )
    fitted = command("fit", tmp_path / "data", "--out", tmp_path / "out")
    assert made.code == fitted.code == 0
    assert made.err == ""
    assert all(line.startswith("evenlight: ") for line in fitted.err.splitlines())


def test_a_data_set_without_catch_trials_is_fitted_with_a_warning(
    dataset: Path, results: Path, tmp_path: Path
) -> None:
    changed = tmp_path / "changed"
    shutil.copytree(dataset / "sub-01", changed / "sub-01")
    for trials in changed.glob("sub-*/ses-*/trials.jsonl"):
        lines = [line for line in trials.read_text().splitlines() if not json.loads(line)["is_catch"]]
        trials.write_text("".join(line + "\n" for line in lines))
    fit(changed, out=tmp_path / "out", quiet=True)
    told = [
        any("no catch trials" in warning for warning in json.loads(path.read_text())["warnings"])
        for path in (results / "fit_summary.json", tmp_path / "out" / "fit_summary.json")
    ]
    assert told == [False, True]


@pytest.mark.parametrize("name", ["simulate", "fit"])
def test_quiet_is_a_flag_without_an_opposite(name: str, command) -> None:
    assert command(name, "--no-quiet").code == 2
    assert "--no-quiet" not in command(name, "--help").out


def test_a_degree_out_of_bounds_is_refused_before_any_work(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="got 12"):
        fit(dataset, out=tmp_path / "out", degree=12, quiet=True)


def test_the_results_of_a_fit_pass_the_validation(results: Path, command) -> None:
    result = command("validate", results)
    assert result.code == 0, result.err + result.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--procedure", "two_interval"), "holds no trials of two_interval"),
        (("--direction", "up"), "no usable threshold of rising ramps"),
        (("--ramp-duration", "10"), "no usable threshold of ramps of 10 s"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line_and_leaves_nothing(
    dataset: Path, tmp_path: Path, command, arguments: tuple[str, ...], words: str
) -> None:
    result = command("fit", dataset, "--out", tmp_path / "out", *arguments)
    assert result.code == 2
    assert words in result.err
    assert result.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
