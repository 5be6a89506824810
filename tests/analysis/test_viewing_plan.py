"""Claims about planning viewing experiments: a plan's power is that of the analysis, on what is assumed."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy import special, stats

from evenlight.analysis.comparison.comparison_shares import Choices, estimate_share
from evenlight.analysis.inference.binomial_tests import difference_power
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.plans.plan import Plan, people_in_words
from evenlight.analysis.plans.questions import (
    PUBLISHED_DIFFERENCE,
    PUBLISHED_SPREAD,
    ComparisonTruth,
    RatingTruth,
    SearchTruth,
)
from evenlight.analysis.plans.viewing_plan import (
    _comparison_p_values,
    _search_p_values,
    clustered_equivalence,
    drawn_differences,
    drawn_searches,
    needed_by_line,
    person_in_the_middle,
    plan_viewing,
    version_effect,
)
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.search.search_models import slowing
from evenlight.data_schema.analysis_results import ViewingPlanRow
from evenlight.data_schema.storage.tables import read_rows

RATING = RatingTruth(0.5, 0.8, 0.25, 4)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_viewing(RATING, (8, 17, 40), runs=1000)


def lines_of(plan: Plan) -> dict[str, list[ViewingPlanRow]]:
    """The rows of each test."""
    return {row.test: [own for own in plan.rows if own.test == row.test] for row in plan.rows}


def row_of(plan: Plan, test: str, participants: int) -> ViewingPlanRow:
    return next(row for row in plan.rows if row.test.startswith(test) and row.participants == participants)


def test_one_answer_of_each_is_planned_without_simulation() -> None:
    plan = plan_viewing(ComparisonTruth(0.75, sequences=1), (17, 30))
    row = row_of(plan, "difference, one sequence", 17)
    chances = stats.binom.pmf(np.arange(18), 17, 0.75)
    found = [stats.binomtest(k, 17).pvalue <= 0.05 for k in range(18)]
    assert row.power == pytest.approx(chances[found].sum())
    assert (row.power_low, row.power_high, row.runs) == (row.power, row.power, 0)
    assert row.type_i_error == pytest.approx(2 * 3214 / 2**17)


def test_several_answers_of_one_person_are_simulated_and_tested_by_person() -> None:
    """A person who is always of one mind says as much in four answers as in one."""
    one_mind = ComparisonTruth(0.75, spread=5.0, repetitions=4, sequences=1)
    rng = np.random.default_rng(1)
    p_values = _comparison_p_values(one_mind, 0.75, (1500, 17), rng)["one"]
    one = plan_viewing(ComparisonTruth(0.75, sequences=1), (17,))
    single = row_of(one, "difference", 17)
    several = float(np.mean(p_values <= 0.05))
    # Standard error of 1500 experiments: 1.3 %. A mean of four answers is a little better than one, but far
    # from four independent ones.
    independent = float(difference_power(4 * 17, 0.75))
    assert single.power - 3 * 0.013 < several < (single.power + independent) / 2


def test_many_experiments_are_tested_as_one_is() -> None:
    rng = np.random.default_rng(3)
    chosen = rng.binomial(4, rng.beta(3, 2, (40, 9)))
    people = tuple("abcdefghi")
    found = [estimate_share(Choices(people, row, np.full(9, 4)), 0.2) for row in chosen]
    theirs = [1.0 if one.equivalence.p_value is None else one.equivalence.p_value for one in found]
    assert clustered_equivalence(chosen / 4, 4, 0.2) == pytest.approx(theirs, abs=1e-12)
    assert clustered_equivalence(np.full((1, 9), 0.5), 4, 0.2).tolist() == [1.0]


@pytest.mark.parametrize("share", [0.5, 0.65, 0.9])
@pytest.mark.parametrize("spread", [0.0, 0.5, 2.0])
def test_people_who_differ_have_the_mean_share_that_was_asked_for(share: float, spread: float) -> None:
    middle = person_in_the_middle(share, spread)
    z = (np.arange(200_000) + 0.5) / 200_000  # quantiles of the normal distribution
    assert special.expit(middle + spread * special.ndtri(z)).mean() == pytest.approx(share, abs=2e-5)


def test_the_drawn_ratings_have_the_mean_and_the_spread_that_were_asked_for() -> None:
    rng = np.random.default_rng(6)
    truth = RatingTruth(0.5, 0.9, 0.5, 2)
    drawn = drawn_differences(truth, 0.5, (400, 100), rng)
    # 80 000 differences in pairs that go together: the mean is known to 0.9 · sqrt(1.5 / 80000) = 0.004.
    assert drawn.mean() == pytest.approx(0.5, abs=0.016)
    assert drawn.std() == pytest.approx(0.9, abs=0.012)
    between = np.corrcoef(drawn[..., 0].ravel(), drawn[..., 1].ravel())[0, 1]
    assert 0.4 < between < 0.52  # rounding takes a little of the 0.5
    assert set(np.unique(drawn)) <= set(range(-4, 5))


def test_the_published_table_says_how_large_and_how_scattered_differences_are() -> None:
    # Table 1: 0.17, 0.48, 0.36, 0.82; standard errors of 17 people, whose ratings correlate by 1/2.
    means, errors = (
        np.array([[published(f"detail_quality.{name}.{who}_{kind}").number for who in ("ours", "baseline")]
                  for name in SEQUENCES])
        for kind in ("mean", "sem")
    )  # fmt: skip
    assert np.mean(means[:, 0] - means[:, 1]) == pytest.approx(PUBLISHED_DIFFERENCE)
    assert math.sqrt(17 * np.mean(errors**2)) == pytest.approx(PUBLISHED_SPREAD, abs=1e-4)
    assert RatingTruth().difference == PUBLISHED_DIFFERENCE


def test_power_rises_with_participants_and_with_the_sequences_that_are_averaged(plan: Plan) -> None:
    for rows in lines_of(plan).values():
        power = [row.power for row in rows]
        assert power == sorted(power)
    for n in (8, 17, 40):
        one, mean = (row_of(plan, f"difference, {what}", n).power for what in ("one", "mean"))
        assert mean > one


def test_the_power_of_ratings_is_about_that_of_a_t_test(plan: Plan) -> None:
    """With 40 people the sign-flip test is as good as Student's t, as Fisher found; normal power."""
    row = row_of(plan, "difference, one sequence", 40)
    expected = special.ndtr(0.5 / 0.8 * math.sqrt(40) - stats.t.ppf(0.975, 39))
    # Standard error of 1000 experiments at 97 %: 0.6 %; whole ratings cost up to 2 %.
    assert expected - 0.04 < row.power <= expected + 0.02


def test_no_test_finds_more_often_than_it_may_what_is_not_there(plan: Plan) -> None:
    for row in plan.rows:
        # Three standard errors of 1000 experiments.
        assert row.type_i_error < row.level + 3 * math.sqrt(row.level * (1 - row.level) / 1000)
        assert row.type_i_error_low <= row.type_i_error <= row.type_i_error_high


def test_the_line_finds_the_number_that_a_known_power_needs() -> None:
    """Φ(0.4 √N - 1.96) = 0.8 at N = (2.802 / 0.4)² = 49.05, hence 50; the interval holds it as 95 % do."""
    numbers, rng = [20, 35, 50, 80], np.random.default_rng(8)
    truth = special.ndtr(0.4 * np.sqrt(numbers) - 1.959964)
    held = 0
    for _ in range(60):
        found = needed_by_line(numbers, (rng.binomial(500, truth) / 500).tolist(), 500, 0.8)
        needed, low, high = found
        held += low <= 50 <= high
        # A power of 0.8 in 500 runs has a standard error of 0.018; it rises by 0.4 / (2 · 7) · φ(0.84), which
        # is 0.008, per participant: 2.2 of them, and three times that.
        assert needed == pytest.approx(50, abs=7)
    assert held >= 52  # 60 intervals at 95 %: fewer than 52 with a chance of 1 %


def test_power_that_does_not_rise_needs_no_number() -> None:
    assert needed_by_line([10, 20], [0.0, 0.0], 100, 0.8)[0] is None
    assert needed_by_line([10, 20], [1.0, 1.0], 100, 0.8)[0] == 10
    assert needed_by_line([10], [0.9], 100, 0.8)[2] == 10
    assert needed_by_line([10, 40, 80], [0.05, 0.06, 0.05], 200, 0.8)[0] is None


def test_a_line_far_from_the_wanted_power_gives_no_number() -> None:
    assert needed_by_line([4, 5], [0.0, 0.001], 1000, 0.8) == (None, None, None)
    assert needed_by_line([20, 30], [0.98, 0.995], 1000, 0.8)[0] == 20
    assert needed_by_line([10, 20], [0.3, 0.55], 1000, 0.8)[0] is not None


def test_participants_with_whom_nothing_can_be_found_are_no_point_of_the_line() -> None:
    few = plan_viewing(RATING, (3, 4, 5), runs=50)
    assert {row.participants_needed for row in few.rows} == {None}
    assert few.answer[0].startswith("difference, one sequence: participants beyond what was tried for 80 %")
    with_few, without = (plan_viewing(RATING, numbers, runs=200) for numbers in ((2, 20, 40), (20, 40)))
    assert with_few.rows[0].participants_needed == without.rows[0].participants_needed is not None


def test_the_numbers_needed_are_told_with_their_interval(plan: Plan) -> None:
    for (test, rows), sentence in zip(lines_of(plan).items(), plan.answer, strict=True):
        assert sentence.startswith(f"{test}: {people_in_words(rows[0])} participants for 80 % power")
    exact = plan_viewing(ComparisonTruth(sequences=1), (17,))
    assert "97 participants" in exact.answer[0]
    far = plan_viewing(ComparisonTruth(0.51, sequences=1), (17,))
    assert "above 1000 participants" in far.answer[0]


def test_the_same_seed_gives_the_same_plan_whatever_else_is_tried() -> None:
    two = plan_viewing(RATING, (8, 17), runs=50)
    one = plan_viewing(RATING, (17,), runs=50)
    assert [row.power for row in one.rows] == [row.power for row in two.rows if row.participants == 17]


class TestSearch:
    def test_the_effect_that_was_put_in_is_found(self) -> None:
        truth = SearchTruth(ratio=0.7, undetected=0.3, spread=0.1, locations=5)
        found = version_effect(truth, 0.7, 40, np.random.default_rng(2))
        assert found.standard_error is not None
        assert found.estimate == pytest.approx(math.log(0.7), abs=3 * found.standard_error)
        assert found.standard_error < 0.1  # sqrt((0.1² + 2 · 0.6² / 5 · 1.5) / 40) = 0.075

    def test_so_many_of_the_baselines_searches_end_at_the_limit(self) -> None:
        truth = SearchTruth(undetected=0.3, locations=100, spread=0.0)
        found = drawn_searches(truth, 1.0, 300, np.random.default_rng(4))[0] < 0
        # People and places go together: 300 and 100 of them; SD of ln t of 0.4 between places, 0.76 in all.
        assert 1 - found.mean() == pytest.approx(0.3, abs=0.06)

    def test_a_slowing_is_excluded_by_a_one_sided_test(self) -> None:
        found = FixedEffect("ours", 0.05, 0.08, None, None, None, df=16)
        theirs = stats.t.cdf((0.05 - math.log(1.25)) / 0.08, 16)
        assert slowing(found, math.log(1.25))[0] == pytest.approx(theirs)
        assert slowing(FixedEffect("ours", None, None, None, None, None), 0.2) == (None, None)

    def test_all_undetected_finds_nothing_and_does_not_fail(self) -> None:
        p_values = _search_p_values(
            SearchTruth(undetected=0.9, locations=1), 0.9, (3, 2), np.random.default_rng(1)
        )
        assert p_values
        for name, values in p_values.items():
            assert len(values) == 3, name
            assert all(0 <= p <= 1 for p in values), name


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("rating", "--precision", "0.1"),
            "--precision goes with ramp, not with rating, which has --difference",
        ),
        (("ramp", "--power", "0.8"), "--power goes with rating and comparison and search, not with ramp"),
        (("search", "--share", "0.6"), "--share goes with comparison, not with search"),
        (("rating", "--margin", "0.2"), "--margin goes with comparison and search, not with rating"),
        (("comparison", "--margin", "0.6"), "comparison: margin must be at most 0.499, got 0.6"),
        (("comparison", "--share", "0.5"), "comparison: share must not be 0.5"),
        (("comparison", "--repetitions", "0"), "repetitions must be at least 1, got 0"),
        (("comparison", "--spread", "-1"), "spread must be at least 0, got -1"),
        (("rating", "--difference", "5"), "difference must be at most 3.99 rating points, got 5"),
        (("rating", "--spread", "0.2"), "whole ones with a mean of 0.4575 have a spread between"),
        (("rating", "--agreement", "1"), "agreement must be at most 0.99, got 1"),
        (("rating", "--sequences", "0"), "sequences must be at least 1, got 0"),
        (("search", "--ratio", "1"), "ratio must be at most 0.999, got 1"),
        (("search", "--margin", "0.5"), "margin must be at least 1.001, got 0.5"),
        (("search", "--undetected", "1"), "undetected must be at most 0.9, got 1"),
        (("search", "--locations", "0"), "locations must be at least 1, got 0"),
        (("rating", "--power", "1"), "power must be at most 0.999, got 1"),
        (("rating", "--participants", "1,5"), "--participants takes numbers from 2 to 1000, got 1,5"),
        (("rating", "--seed", "-1"), "seed must be 0 or more, got -1"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_one_line(command, tmp_path: Path, options, words: str) -> None:
    result = command("plan", *options, "--out", tmp_path / "out")
    assert result.code == 2
    assert result.err.count("\n") == 1
    assert words in result.err
    assert not (tmp_path / "out").exists()


def test_the_command_writes_rows_words_and_a_figure(command, tmp_path: Path) -> None:
    result = command("plan", "comparison", "--participants", "17,40", "--quick", "--out", tmp_path)
    assert result.code == 0, result.err
    assert result.err == ""
    assert "all with simulated participants" in result.out
    rows = read_rows(ViewingPlanRow, tmp_path / "plan.csv")
    assert {row.participants for row in rows} == {17, 40}
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["simulated"] is True
    assert content["truth"]["margin"] == 0.15
    assert content["rows"][0]["power"] == rows[0].power
    assert (tmp_path / "plan.png").read_bytes()[:4] == b"\x89PNG"
    assert command("validate", tmp_path).code == 0


def test_a_plan_without_a_finding_is_written_too(tmp_path: Path) -> None:
    plan = plan_viewing(ComparisonTruth(0.51, sequences=1, power=0.99), (2,))
    plan.save(tmp_path)
    rows = read_rows(ViewingPlanRow, tmp_path / "plan.csv")
    assert rows[0].participants_needed is None
    assert repr(plan).startswith(
        "<Artifact comparison: how many participants>\ndifference, one sequence: above"
    )


def test_the_figure_draws_power_and_error_of_every_row(plan: Plan) -> None:
    for axes, values in zip(
        plan.plot("plan").axes[1:],  # the key of the lines is the first
        ([r.power for r in plan.rows], [r.type_i_error for r in plan.rows]),
        strict=True,
    ):
        drawn = {round(float(y), 6) for line in axes.lines for y in np.atleast_1d(line.get_ydata())}
        assert {round(100 * value, 6) for value in values} <= drawn
