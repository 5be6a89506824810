"""Statistics of plain tables: the same as those of sessions, and errors that name the row."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import evenlight

# tests/pipeline and tests/analysis draw the same pictures.
pytestmark = pytest.mark.usefixtures("blank_pictures")

LEVELS = (8.0, 20.0, 40.0, 60.0, 80.0, 100.0)  # [cd/m^2]
RELATIVE = 0.03  # the rate noticed in 75 % of the trials, as a share of the luminance per second


def ramps(seed: int = 1, people: int = 3) -> pd.DataFrame:
    """Answers drawn from a logistic function of ln(rate) that is 0.75 at 3 % of the luminance per second."""
    rng = np.random.default_rng(seed)
    rows = []
    for who in range(1, people + 1):
        for level in LEVELS:
            for share in (0.0, 0.01, 0.02, 0.03, 0.045, 0.07):
                for _ in range(10):
                    says_yes = 0.02 if share == 0 else 1 / (1 + np.exp(-4 * np.log(share / RELATIVE)) / 3)
                    rows.append((who, level, share * level, bool(rng.random() < says_yes)))
    return pd.DataFrame(rows, columns=["participant_id", "luminance_cd_m2", "rate_cd_m2_s", "response"])


@pytest.fixture(scope="module")
def fit() -> evenlight.RampFit:
    return evenlight.fit_ramps(ramps(), simulated=True)


def test_thresholds_recover_what_the_answers_were_drawn_from(fit: evenlight.RampFit) -> None:
    table = fit.thresholds
    relative = table["threshold_cd_m2_s"] / table["luminance_cd_m2"]
    assert len(table) == 18
    assert np.exp(np.log(relative).mean()) == pytest.approx(RELATIVE, rel=0.15)
    held = (table["ci_low"] <= RELATIVE * table["luminance_cd_m2"]) & (
        RELATIVE * table["luminance_cd_m2"] <= table["ci_high"]
    )
    assert held.mean() > 0.75  # 95 % intervals; 5 or more of 18 miss with a probability of 0.1 %


def test_the_rate_limit_is_for_the_display_and_says_that_it_is_simulated(fit: evenlight.RampFit) -> None:
    assert fit.rate_limit.display_name == "varjo-xr3"
    assert fit.rate_limit.display == evenlight.load_display("varjo-xr3")
    assert fit.rate_limit.simulated
    track = evenlight.optimize([np.full((16, 16, 3), 90, np.uint8)] * 4, 0.6, rate_limit=fit.rate_limit)
    assert track.outcome.simulated


def test_the_rate_at_half_of_the_rise_is_that_of_the_function_drawn_from(fit: evenlight.RampFit) -> None:
    """1 / (1 + e^(-4 ln r) / 3) is 1/2 at ln r = -ln(3) / 4: 0.76 times the rate at 3/4."""
    table, half = fit.threshold(), RELATIVE * 3**-0.25
    relative = table["rate_cd_m2_s"] / table["luminance_cd_m2"]
    assert len(table) == 18
    assert np.exp(np.log(relative).mean()) == pytest.approx(half, rel=0.15)
    held = (table["ci_low"] <= half * table["luminance_cd_m2"]) & (
        half * table["luminance_cd_m2"] <= table["ci_high"]
    )
    assert held.mean() > 0.75
    assert (table["rate_cd_m2_s"].between(table["ci_low"], table["ci_high"])).all()


def test_a_psychometric_function_gives_probabilities_and_what_it_is_made_of(fit: evenlight.RampFit) -> None:
    function = fit.psychometric(2, 40.0)
    table = fit.thresholds.set_index(["participant_id", "luminance_cd_m2"]).loc[("2", 40.0)]
    assert function.threshold == pytest.approx(table["threshold_cd_m2_s"], rel=1e-12)
    attentive = dataclasses.replace(function, lapse_rate=0.0)
    assert float(attentive(function.threshold)) == pytest.approx(0.75, rel=1e-12)
    assert float(function(0.0)) == pytest.approx(function.guess_rate, abs=1e-12)
    step = 1e-5  # the slope is the derivative by ln(rate)
    ends = function(function.threshold * np.exp([-step, step]))
    assert function.slope == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6)
    at = fit.threshold(0.9).set_index(["participant_id", "luminance_cd_m2"]).loc[("2", 40.0), "rate_cd_m2_s"]
    share = (float(function(at)) - function.guess_rate) / (1 - function.guess_rate - function.lapse_rate)
    assert share == pytest.approx(0.9, rel=1e-9)


def test_a_rate_limit_can_be_called(fit: evenlight.RampFit) -> None:
    low, high = fit.rate_limit.luminance_range
    inside, below, beyond = fit.rate_limit(low), fit.rate_limit([low / 2, 0.0]), fit.rate_limit(2 * high)
    assert below.tolist() == pytest.approx([float(inside) / 2, 0.0])
    assert float(beyond) == pytest.approx(float(fit.rate_limit(high)), rel=1e-12)


def test_a_fit_says_what_came_out_and_draws_it(fit: evenlight.RampFit) -> None:
    heading, lead, *figures = repr(fit).splitlines()
    assert heading == "<RampFit of 3 simulated participants: 18 thresholds>"
    assert "\n".join([lead, *figures]) == fit.summary()
    assert lead.startswith("On varjo-xr3, luminance changes of ")
    assert len(lead.split()) <= 60
    assert 3 <= len(figures) <= 4
    assert set(fit.plot()) == {"psychometric", "rate_limit"}
    assert fit.to_frame().equals(fit.thresholds)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda fit: fit.threshold(1.5), "between 0 and 1, got 1.5"),
        (lambda fit: fit.psychometric("9", 40.0), "no participant 9; there are 1, 2, 3"),
        (lambda fit: fit.psychometric("1", 50.0), "no level of 50 cd/m.2; there are 100 .*8 cd/m.2, falling"),
        (lambda fit: fit.plot("answers"), "one of psychometric, rate_limit"),
    ],
)
def test_what_a_fit_does_not_have_is_refused_with_what_it_has(
    fit: evenlight.RampFit, asked: Callable[[evenlight.RampFit], Any], words: str
) -> None:
    with pytest.raises(evenlight.InputError, match=words):
        asked(fit)


def test_a_table_gives_the_thresholds_that_its_data_set_gives(
    command: Callable[..., Any], short_ramps: Path, tmp_path: Path
) -> None:
    """The trials of simulated sessions, once as sessions and once as the table they are exported to."""
    dataset = tmp_path / "dataset"
    people = ("--participants", 2, "--seed", 5, "--design", short_ramps)
    assert command("simulate", "ramp", *people, "--out", dataset, "--quiet").code == 0
    assert command("fit", dataset, "--out", tmp_path / "fit", "--quiet").code == 0
    rows = [pd.read_json(file, lines=True, dtype={"participant_id": str, "session_id": str})
            for file in sorted(dataset.glob("sub-*/ses-*/trials.jsonl"))]  # fmt: skip
    table = pd.concat(rows).rename(columns={"initial_luminance_cd_m2": "luminance_cd_m2"})
    table = table[table["practice"] == 0] if "practice" in table else table
    by_table = evenlight.fit_ramps(table, simulated=True).thresholds
    by_dataset = pd.read_csv(tmp_path / "fit" / "thresholds.csv", dtype={"participant_id": str})
    for column in ("threshold_cd_m2_s", "ci_low", "ci_high", "false_alarm_rate", "d_prime"):
        np.testing.assert_allclose(by_table[column].astype(float), by_dataset[column], rtol=1e-9)


def test_what_is_saved_is_what_optimize_takes(fit: evenlight.RampFit, tmp_path: Path) -> None:
    fit.save(tmp_path)
    assert (tmp_path / "SHA256SUMS").read_text().startswith("# evenlight fit: ")
    again = evenlight.load_rate_limit(tmp_path / "rate_limit.json")
    assert again.coefficients == fit.rate_limit.coefficients
    assert evenlight.load_rate_limit(tmp_path) == again
    assert again.simulated
    assert (tmp_path / "thresholds.csv").read_text().count("\n") == 19
    for name in fit.figures:
        assert (tmp_path / f"{name}.png").exists()
        assert (tmp_path / f"{name}_points.csv").exists()


def ratings(people: int = 8) -> pd.DataFrame:
    """Each prefers ours by one point in one sequence, and by none in the other."""
    return pd.DataFrame(
        [
            {"participant_id": who, "sequence": sequence, "version": version, "rating": rating}
            for who in range(1, people + 1)
            for sequence, ours in (("gym", 4), ("library", 3))
            for version, rating in (("ours", ours), ("baseline", 3))
        ]
    )


def test_ratings_have_the_means_and_the_exact_test_that_follow_by_hand() -> None:
    found = evenlight.analyze(ratings())
    table = found.statistics
    gym = table[(table["group"] == "gym") & table["p_value"].notna()]
    # All eight differences are +1: of the 2^8 sign flips two are as extreme, p = 2/256.
    assert np.isclose(gym["p_value"], 2 / 256).any()
    assert "rating" in repr(found)


@pytest.mark.parametrize(("first", "known"), [("baseline", True), ("ours", True), ("ours", False)])
def test_the_order_of_versions_is_that_of_trial_index_and_not_of_the_rows(first: str, known: bool) -> None:
    shown = [
        (who, name, version, 2 * place + (version != first))
        for version in ("ours", "baseline")
        for who in range(6)
        for place, name in enumerate(("gym", "hall"))
    ]
    table = pd.DataFrame(shown, columns=["participant_id", "sequence", "version", "trial_index"])
    table["rating"] = 3 + (table["version"] == "ours")
    found = evenlight.analyze(table if known else table.drop(columns="trial_index"))
    where = "second" if first == "baseline" else "first"
    assert (f"the track was shown {where} in all 12 pairs" in found.lead) is known


def test_comparisons_have_the_share_and_the_binomial_test_that_follow_by_hand() -> None:
    rows = [
        {
            "participant_id": who,
            "sequence": "gym",
            "ours_interval": 1,
            "response": "first" if who < 8 else "second",
        }
        for who in range(8)
    ]
    table = evenlight.analyze(rows[:8]).statistics
    assert np.isclose(table["p_value"].dropna(), 2 / 256).any()  # 8 of 8 under a chance of one half


def test_search_times_need_no_column_that_statistics_do_not_read() -> None:
    rng = np.random.default_rng(2)
    rows = [
        {"participant_id": who, "sequence": "gym", "keypoint": f"k{point}", "version": version,
         "factor": 0.6 if version == "ours" else 0.4, "found": True,
         "search_time_s": float(rng.lognormal(1.0 + 0.4 * (version == "baseline"), 0.3))}
        for who in range(1, 7) for point in range(4) for version in ("ours", "baseline")
        if (who + point) % 2 == (version == "ours")
    ]  # fmt: skip
    found = evenlight.analyze(rows)
    assert found.name == "search"
    assert len(found.statistics) > 10
    numbers = pd.DataFrame(rows).assign(found=1.0)  # as pandas reads a column with gaps
    assert evenlight.analyze(numbers).statistics.equals(found.statistics)


def test_results_are_saved_as_the_command_saves_them(tmp_path: Path) -> None:
    evenlight.analyze(ratings()).save(tmp_path)
    assert (tmp_path / "rating_statistics.csv").exists()
    assert list(tmp_path.glob("*.png"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.drop(columns="rate_cd_m2_s"), "no column rate_cd_m2_s; its columns are participant_id"),
        (lambda t: t.assign(response="perhaps"), "row 0 of the table: .*response"),
        (lambda t: t.assign(participant_id="a b"), "row 0 of the table: .*participant_id"),
        (lambda t: t.assign(luminance_cd_m2=-1.0), "row 0 of the table: "),
        (lambda t: t[:0], "no row"),
        (lambda t: t.assign(rate_cd_m2_s=[float("nan"), *t["rate_cd_m2_s"][1:]]), "row 0 .*no rate_cd_m2_s"),
        (
            lambda t: t.assign(luminance_cd_m2=500.0),
            r"row 0 .*500, above the 104\.4 of the display",
        ),
        (lambda t: t.assign(response="first"), "no ramp_interval"),
        (lambda t: "trials.csv", r"read it with pandas\.read_csv"),
    ],
)
def test_ramps_that_cannot_be_used_are_named(
    change: Callable[[pd.DataFrame], pd.DataFrame], says: str
) -> None:
    with pytest.raises(evenlight.InputError, match=says):
        evenlight.fit_ramps(change(ramps(people=1)))


def test_ramps_at_one_luminance_make_a_constant_limit_which_is_said_first() -> None:
    table = ramps(people=3)
    fit = evenlight.fit_ramps(table[table["luminance_cd_m2"] == 40.0])
    assert fit.rate_limit.luminance_range == (40.0, 40.0)
    assert len(fit.rate_limit.coefficients) == 1
    assert any("the limit is a constant" in warning for warning in fit.warnings[:2])


@pytest.mark.parametrize(
    ("table", "task", "says"),
    [
        (ratings().drop(columns="version"), None, "row 0 of the table: no version"),
        (
            ratings().assign(rating=-9),
            None,
            "ratings from -9 to -9 are on no usual scale; say theirs with scale",
        ),
        (ratings().drop(columns="rating"), None, "the columns do not tell the task"),
        (ratings(), "ranking", "task must be one of rating, comparison, search"),
    ],
)
def test_answers_that_cannot_be_used_are_named(table: pd.DataFrame, task: str | None, says: str) -> None:
    with pytest.raises(evenlight.InputError, match=says):
        evenlight.analyze(table, task)
