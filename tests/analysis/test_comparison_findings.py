"""Claims about the artifact comparison: what answers show is said, and what they do not is flagged."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from comparison_answers import NAMES, answers_of, data_of, row, rows_of
from comparison_levels import SEED, model_rates, pooled_rates, trials_of
from scipy import stats
from statsmodels.stats.contingency_tables import cochrans_q
from statsmodels.stats.multitest import multipletests

from evenlight.analysis.comparison.comparison_figure import power_figure, shares_figure
from evenlight.analysis.comparison.comparison_findings import (
    comparison_findings,
    lead_of,
    pooled_section,
    shares_section,
)
from evenlight.analysis.comparison.comparison_results import (
    AGREEMENT,
    DIFFERENCE,
    Comparison,
    add_limits,
    choice_model,
    compare,
)
from evenlight.analysis.comparison.comparison_shares import (
    Choices,
    consistency_of,
    count_choices,
    estimate_share,
    sequence_differences,
    standard_error,
)
from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.inference.binomial_tests import difference_power, smallest_margin_ever
from evenlight.analysis.plans.questions import ComparisonTruth
from evenlight.analysis.report import Picture
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import Rows
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.errors import InputError


def limits_of(n: int, margin: float) -> dict[str, float | None]:
    return add_limits(Rows(Origin.COMPUTED), n, margin)


@pytest.fixture(scope="module")
def found() -> Comparison:
    return compare(data_of(answers_of(lambda who, s: (who + s) % 3 == 0)), 1, 0.15)


@pytest.fixture(scope="module")
def published_like() -> Analysis:
    """9, 8, 8 and 9 of 17, as the percentages of the paper's table say."""
    wanted = (9, 8, 8, 9)
    return comparison_findings(data_of(answers_of(lambda who, s: (who + 4 * s) % 17 < wanted[s])))


@pytest.mark.slow
def test_nine_of_seventeen_is_neither_told_from_a_coin_nor_shown_to_be_one(published_like: Analysis) -> None:
    share = row(published_like.rows, "shares", "library", "ours chosen")
    assert (share.value, share.p_value, share.p_adjusted, share.n) == (9 / 17, 1.0, 1.0, 17)
    equal = row(published_like.rows, "equivalence", "library", "share within")
    # P(X >= 9 | 0.35) and P(X <= 9 | 0.65) of 17: the larger.
    p_value = max(stats.binom.sf(8, 17, 0.35), stats.binom.cdf(9, 17, 0.65))
    assert equal.p_value == pytest.approx(p_value)
    assert p_value > 0.05
    assert "17 answers cannot show a share within 0.5 ± 0.15" in published_like.lead
    assert [own.value for own in published_like.key_figures[:3]] == ["50.0 %", "0 of 4", "17"]


def test_each_sequence_stands_in_the_order_of_the_design(published_like: Analysis) -> None:
    shares = [s.group for s in published_like.rows if s.what == "ours chosen"]
    assert shares == [*NAMES, "all"]


def test_holm_adjusts_for_the_number_of_sequences() -> None:
    counts = (16, 14, 9, 8)
    found = compare(data_of(answers_of(lambda who, s: (who + 5 * s) % 17 < counts[s])), 1, 0.15)
    raw = [stats.binomtest(k, 17).pvalue for k in counts]
    rows = [row(found.rows, "shares", name, "ours chosen") for name in NAMES]
    assert [own.p_value for own in rows] == pytest.approx(raw)
    adjusted = multipletests(raw, method="holm")[1].tolist()
    assert [own.p_adjusted for own in rows] == pytest.approx(adjusted)
    # 0.0003 and 0.0127: 14 of 17 by itself, times three.
    assert "differ from a coin's in library and gym" in lead_of(found, limits_of(17, 0.15))


def test_sequences_are_written_with_spaces() -> None:
    found = compare(data_of(answers_of(lambda who, s: s == 2)), 1, 0.15)
    words = [
        lead_of(found, limits_of(17, 0.15)),
        *(str(r[0]) for r in shares_section(found, Picture(b"", "")).tables[0].rows),
    ]
    words += [label.get_text() for label in shares_figure(found).figure.axes[0].get_yticklabels()]
    assert not any("living_room" in text for text in words)
    assert sum("iving room" in text for text in words) == 3


def test_the_margin_is_the_readers_and_said_with_every_result(published_like: Analysis) -> None:
    found = compare(data_of(answers_of(lambda who, s: (who + s + who // 4) % 2 == 0)), 1, 0.3)
    equal = row(found.rows, "equivalence", "gym", "share within 0.5 ± 0.3")
    assert equal.value is not None
    k = round(17 * equal.value)
    assert equal.p_value == pytest.approx(max(stats.binom.sf(k - 1, 17, 0.2), stats.binom.cdf(k, 17, 0.8)))
    assert "0.5 ± 0.3" in lead_of(found, limits_of(17, 0.3))
    assert "0.5 ± 0.15" in published_like.drawings[0].caption


@pytest.mark.parametrize("margin", [0.0, 0.5, -0.1])
def test_a_margin_that_is_none_is_refused(margin: float) -> None:
    with pytest.raises(InputError, match=r"must lie between 0 and 0\.5, got"):
        compare(data_of(answers_of(lambda who, s: True)), 1, margin)


def test_one_answer_of_each_gives_the_binomial_test_by_signs_as_well() -> None:
    """All choices of signs of ±1 are the outcomes of a coin."""
    for k in range(18):
        one = estimate_share(Choices(tuple("abcdefghijklmnopq"), np.arange(17) < k, np.ones(17, int)), 0.15)
        assert one.difference.p_value == pytest.approx(stats.binomtest(k, 17).pvalue)


def test_the_scatter_of_participants_with_equal_answers_is_that_of_their_mean_share() -> None:
    chosen = np.array([0, 1, 2, 2, 3, 4])
    choices = Choices(tuple("abcdef"), chosen, np.full(6, 4))
    assert standard_error(choices) == pytest.approx(stats.sem(chosen / 4))
    found = estimate_share(choices, 0.2)
    theirs = stats.ttest_1samp(chosen / 4, 0.5).confidence_interval(0.9)
    narrow = found.equivalence
    assert (narrow.ci_low, narrow.ci_high) == pytest.approx((theirs.low, theirs.high))
    # Of six people the sign flip rejects only what all of them lie beyond: below 0 of 4, or above 4 of 4.
    assert (found.difference.ci_low, found.difference.ci_high) == (0.0, 1.0)
    above = stats.ttest_1samp(chosen / 4, 0.3, alternative="greater").pvalue
    below = stats.ttest_1samp(chosen / 4, 0.7, alternative="less").pvalue
    assert narrow.p_value == pytest.approx(max(above, below))


def test_several_answers_of_one_person_are_no_sample_of_people() -> None:
    """Four answers of each, all alike: as good as one. 12 of 17 is p = 0.14, 48 of 68 would be p = 0.001."""
    people = tuple("abcdefghijklmnopq")
    alike = estimate_share(Choices(people, 4 * (np.arange(17) < 12), np.full(17, 4)), 0.15)
    assert alike.difference.p_value == pytest.approx(stats.binomtest(12, 17).pvalue)
    assert not alike.choices.one_each


def test_dependent_answers_have_no_bayes_factor() -> None:
    rows = rows_of(answers_of(lambda who, s: (who + s) % 3 < 2, repetitions=2))
    bayes = [s for s in rows if s.table == "bayes"]
    assert [s.value for s in bayes] == [None] * 15
    assert {s.flag for s in bayes} == {"answers of one person are not independent"}


def test_people_who_take_the_same_difference_either_way_are_found_though_the_share_is_one_half() -> None:
    choices = Choices(tuple("abcdefghijklmnop"), 4 * (np.arange(16) < 8), np.full(16, 4))
    assert estimate_share(choices, 0.15).difference.p_value == 1.0
    ratio, p_value = consistency_of(choices)
    assert ratio == 4.0  # 16 people with (±4)² by 64 answers
    assert p_value == pytest.approx((2 / 16) ** 16, rel=1e-9)


def test_consistency_is_the_chance_over_all_outcomes() -> None:
    answers = np.array([1, 2, 4])
    choices = Choices(("a", "b", "c"), np.array([1, 0, 3]), answers)
    reached = total = 0
    for outcome in itertools.product((0, 1), repeat=7):
        parts = np.split(np.array(outcome), [1, 3])
        total += 1
        reached += sum((2 * p.sum() - p.size) ** 2 for p in parts) >= 1 + 4 + 4
    assert consistency_of(choices) == pytest.approx((9 / 7, reached / total))


def test_sequences_are_identifiable_as_by_cochrans_q() -> None:
    rng = np.random.default_rng(5)
    table = rng.random((17, 4)) < np.array([0.3, 0.5, 0.6, 0.7])
    trials = data_of(answers_of(lambda who, s: bool(table[who, s]))).trials
    spread, p_value = sequence_differences(trials, NAMES, np.random.default_rng(1))
    assert spread == pytest.approx(np.ptp(table.mean(axis=0)))
    # Q is a constant times the statistic; its chi-squared p is that of many people, hence the tolerance.
    assert p_value == pytest.approx(cochrans_q(table).pvalue, abs=0.03)


def test_a_sequence_compared_more_often_than_others_is_no_difference() -> None:
    """Answers 0, 0 to the library and 1 to the gym: of three places for the one, this alone lies as far out.

    Expected are 2/3 and 1/3: squares add up to 8/9 here, and to 2/9 for the other two places.
    """
    one = [("01", "library", False, 1), ("01", "library", False, 2), ("01", "gym", True, 1)]
    spread, p_value = sequence_differences(data_of(one).trials, ("library", "gym"), np.random.default_rng(1))
    assert spread == 1.0
    assert p_value == pytest.approx(1 / 3, abs=0.015)  # 9999 permutations: three times 0.005


def test_nobody_who_compared_two_sequences_leaves_nothing_to_compare() -> None:
    one_each = [(f"{k:02d}", NAMES[k % 4], k % 3 == 0, 1 + k % 2) for k in range(12)]
    found = compare(data_of(one_each), 1, 0.15)
    assert found.guessing(DIFFERENCE) is None
    assert found.guessing(AGREEMENT) is None


def test_the_same_seed_gives_the_same_numbers() -> None:
    trials = data_of(answers_of(lambda who, s: (who * who + 3 * s + who * s) % 5 < 2)).trials
    one, two, other = (sequence_differences(trials, NAMES, np.random.default_rng(k)) for k in (3, 3, 4))
    assert one == two != other


@pytest.mark.slow
def test_what_seventeen_people_are_told_of_all_answers_errs_no_more_often_than_it_may() -> None:
    # 1000 experiments: 5 % and 95 % have a standard error of 0.7 %; 92 and 98 % of 0.9 and 0.4 %. Three each.
    truth = ComparisonTruth(0.9, 0.15, 0.5)
    half, edge = (pooled_rates(truth, share, 1000, SEED) for share in (0.5, 0.65))
    assert half.difference < 0.05 + 0.021
    assert edge.equivalence < 0.05 + 0.021
    for rates in (half, edge):
        assert 0.92 - 0.026 < rates.coverage < 0.98 + 0.013


def test_the_mixed_model_finds_the_preference_that_was_put_in() -> None:
    # Each of 200 people chooses ours with 3 in 4; nobody differs. Standard error of the log-odds of 800
    # answers: 1 / sqrt(800 · 3/16), and three of them.
    chosen = np.random.default_rng(2).binomial(4, 0.75, 200)
    effect = choice_model(tuple(trials_of(chosen, 4))).intercept
    assert effect is not None
    assert effect.estimate == pytest.approx(np.log(3), abs=3 / np.sqrt(800 * 3 / 16))


@pytest.mark.slow
def test_the_mixed_model_is_seldom_fooled_by_guessing() -> None:
    # 20 fits: five or more errors at 5 % have a chance of 0.3 %.
    different, held = model_rates(ComparisonTruth(0.9, 0.15, 0.5), 0.5, 20, SEED)
    assert different < 5 / 20
    assert held > 15 / 20


def test_the_figure_draws_every_share_and_its_interval(found: Comparison) -> None:
    figure = shares_figure(found).figure
    drawn = {round(float(x), 9) for line in figure.axes[0].lines for x in np.atleast_1d(line.get_xdata())}
    for own in found.listed.values():
        assert own is not None
        share = own.difference
        assert {round(end or 0.0, 9) for end in (share.value, share.ci_low, share.ci_high)} <= drawn
    assert png_bytes(figure)[:4] == b"\x89PNG"


def test_the_figure_of_power_draws_the_experiments_own_number_of_answers() -> None:
    power, margins = power_figure(17, 0.15).figure.axes
    own = power.lines[0].get_ydata()
    assert own[50] == pytest.approx(100 * float(difference_power(17, 0.75)))
    assert margins.lines[2].get_ydata()[0] == pytest.approx(100 * smallest_margin_ever(17))


def test_every_number_of_the_figures_is_in_their_tables(published_like: Analysis) -> None:
    shares, power = published_like.drawings
    assert [p.label for p in shares.points] == [*NAMES, "all answers"]
    assert {p.series for p in power.points} == {
        "n = 17", "n = 50", "n = 100", "n = 200", "at best", "80 % power"
    }  # fmt: skip
    assert all(p.n for p in (*shares.points, *power.points))


def test_recorded_answers_are_not_called_simulated() -> None:
    found = compare(data_of(answers_of(lambda who, s: (who + s) % 3 == 0), simulated=False), 1, 0.15)
    assert {s.origin.value for s in found.rows} == {"recorded"}
    assert "simulated" not in lead_of(found, limits_of(17, 0.15))
    assert not pooled_section(found).simulated
    assert not shares_section(found, Picture(b"", "")).simulated


def test_counts_are_of_people_and_their_answers() -> None:
    choices = count_choices(data_of(answers_of(lambda who, s: s == 0, people=2, repetitions=3)).trials)
    assert (choices.participants, choices.chosen.tolist(), choices.answers.tolist()) == (
        ("00", "01"), [3, 3], [12, 12]
    )  # fmt: skip
