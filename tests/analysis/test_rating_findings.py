"""The analysis of detail ratings: what it says of made-up ratings, and of hard ones."""

import functools
from pathlib import Path

import numpy as np
import pytest
from made_ratings import Raters, drawn_ratings, rating_data, rating_trial
from scipy import stats

from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.fixed_effects import FitFlag
from evenlight.analysis.rating.rating_findings import rating_findings
from evenlight.analysis.rating.rating_model import (
    few_sample_p,
    likelihood_ratio,
    permuted_interaction,
    rating_fits,
)
from evenlight.analysis.rating.rating_order import NO_PAIR
from evenlight.analysis.rating.rating_pairs import over_sequences, paired_ratings, person_means
from evenlight.analysis.rating.rating_power import smallest_difference
from evenlight.analysis.results import Analysis
from evenlight.analysis.session_loading import task_data_of
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES, RatingTrial, Version

OURS, BASELINE = Version.OURS, Version.BASELINE


def rated(ours: dict[str, list[int]], baseline: dict[str, list[int]]) -> list[RatingTrial]:
    """One rating per participant of each version, by sequence; orders alternate."""
    trials = []
    for number, sequence in enumerate(ours):
        for person, ratings in enumerate(zip(ours[sequence], baseline[sequence], strict=True)):
            for version, rating in zip((OURS, BASELINE), ratings, strict=True):
                place = 1 if (version is OURS) == ((person + number) % 2 == 0) else 2
                trials.append(rating_trial(f"{person:02}", sequence, version, rating, place))
    return trials


def statistics(findings: Analysis, group: str, beginning: str) -> list[Statistic]:
    return [s for s in findings.rows if s.group == group and s.what.startswith(beginning)]


def statistic(findings: Analysis, group: str, beginning: str) -> Statistic:
    return statistics(findings, group, beginning)[0]


@functools.cache
def seventeen() -> Analysis:
    """17 people who rate ours a point higher in gym where the scale allows it, and not in library."""
    library = [3, 4, 2, 5, 3, 3, 4, 4, 2, 3, 5, 4, 3, 3, 4, 2, 3]
    other = [4, 3, 2, 5, 3, 4, 3, 4, 2, 3, 5, 4, 3, 4, 3, 2, 3]
    baseline = library[5:] + library[:5]  # of other people, so that nobody has one level throughout
    ours = [min(rating + 1, 5) for rating in baseline]
    trials = rated({"library": library, "gym": ours}, {"library": other, "gym": baseline})
    return rating_findings(rating_data(trials, ("gym", "library")), 1)


def test_the_means_have_both_standard_errors_by_hand() -> None:
    ratings = np.array([3, 4, 2, 5, 3, 3, 4, 4, 2, 3, 5, 4, 3, 3, 4, 2, 3])
    mean = statistic(seventeen(), "library", "mean rating, ours")
    assert mean.value == pytest.approx(57 / 17)
    assert mean.ci_low is not None
    assert mean.ci_low < 57 / 17
    spread = float(np.sum((ratings - 57 / 17) ** 2))
    assert statistic(seventeen(), "library", "standard error, ours").value == pytest.approx(
        (spread / 16 / 17) ** 0.5
    )
    population = statistic(seventeen(), "library", "standard error, population SD, ours")
    assert population.value == pytest.approx((spread / 17 / 17) ** 0.5)
    counts = [statistic(seventeen(), "library", f"ratings of {k}, ours").value for k in range(1, 6)]
    assert counts == [0, 3, 7, 5, 2]


def test_a_difference_that_is_there_is_found_and_one_that_is_not_is_not() -> None:
    gym, library = (statistic(seventeen(), name, "mean difference, ours") for name in ("gym", "library"))
    # 15 of 17 differ, all by one point upwards: p = 2 / 2^15.
    assert gym.value == pytest.approx(15 / 17)
    assert gym.p_value == pytest.approx(2.0**-14)
    assert gym.p_adjusted == pytest.approx(2.0**-13)
    assert (library.value, library.p_value) == (0.0, 1.0)
    both = (15 / 17 + 0) / 2  # the mean of each participant's two differences
    assert seventeen().lead.startswith(
        f"The track was rated {both:.2f} points higher than constant dimming over 2"
    )
    assert "1 of 2 sequences differs beyond chance" in seventeen().lead
    assert [own.value for own in seventeen().key_figures[:3]] == [f"+{both:.2f} points", "1 of 2", "17"]
    assert len(seventeen().lead.split()) <= 60


def test_results_stand_in_the_order_of_the_design_and_say_where_they_come_from() -> None:
    groups = dict.fromkeys(s.group for s in seventeen().rows)
    assert list(groups) == ["gym", "library", "all"]
    assert {s.origin for s in seventeen().rows} == {Origin.SIMULATED}
    assert all(section.simulated for section in seventeen().sections)
    assert "17 simulated participants" in seventeen().drawings[0].caption


def test_every_number_of_the_figure_has_its_point() -> None:
    points = seventeen().drawings[0].points
    bars = [p.x for p in points if (p.panel, p.series) == ("gym", "ours, ratings")]
    assert bars == [0, 0, 3, 7, 7]
    differences = {p.x: p.y for p in points if p.series == "gym, bins of 1"}
    assert differences == {0.0: 2.0, 1.0: 15.0}
    mean = next(p for p in points if p.series == "mean and 95 % confidence interval" and p.label == "gym")
    drawn = statistic(seventeen(), "gym", "mean difference, ours")
    assert (mean.y, mean.low, mean.high) == (drawn.value, drawn.ci_low, drawn.ci_high)


def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    data = rating_data(drawn_ratings(Raters(), 4, np.random.default_rng(2)))
    for name in ("one", "other"):
        rating_findings(data, 7).write(tmp_path / name)
    names = sorted(p.name for p in (tmp_path / "one").iterdir())
    assert names == ["rating.png", "rating_points.csv", "rating_statistics.csv"]
    assert all((tmp_path / "one" / n).read_bytes() == (tmp_path / "other" / n).read_bytes() for n in names)


def test_everybody_giving_the_same_rating_gives_flags_and_no_odds_ratio() -> None:
    same = {"gym": [3] * 17, "library": [3] * 17}
    findings = rating_findings(rating_data(rated(same, same)), 1)
    assert repr(findings).startswith("<Analysis of rating: ")
    assert "The track and constant dimming were rated alike" in repr(findings)
    odds = statistic(findings, "all", "odds ratio of a higher rating, ours")
    assert (odds.value, odds.p_value) == (None, None)
    assert odds.flag == FitFlag.NO_VARIATION.value
    for name in ("gym", "library", "all"):
        difference = statistic(findings, name, "mean difference, ours")
        assert (difference.value, difference.p_value) == (0.0, 1.0)
        assert "cannot speak for either side" in difference.flag
        assert statistic(findings, name, "Cohen's d_z").value is None
    assert not any("always" in words for words in findings.warnings)


def test_complete_separation_has_one_sided_odds_and_says_so() -> None:
    findings = rating_findings(rating_data(rated({"gym": [5] * 6}, {"gym": [1] * 6}), ("gym",)), 1)
    odds = statistic(findings, "all", "odds ratio of a higher rating, ours")
    assert odds.value is None
    assert odds.flag
    cells = findings.sections[2].tables[0].rows[0]
    assert cells[2].endswith(", no upper bound")  # all fives against all ones: no odds are too high
    difference = statistic(findings, "gym", "mean difference, ours")
    assert (difference.p_value, difference.ci_high) == (2 * 0.5**6, 4.0)  # no further than ratings can differ
    assert statistic(findings, "gym", "probability of superiority").value == 1.0


def test_one_participant_shows_nothing_of_other_people() -> None:
    one = {"gym": [4], "library": [3]}
    findings = rating_findings(rating_data(rated(one, {"gym": [2], "library": [3]})), 1)
    difference = statistic(findings, "all", "mean difference, ours")
    assert (difference.value, difference.ci_low, difference.p_value) == (1.0, None, 1.0)
    assert "one pair" in difference.flag
    assert any("one participant" in words for words in findings.warnings)
    assert statistic(findings, "gym", "standard error, ours").flag == "one participant: no spread"


def test_a_participant_with_one_trial_leaves_the_pairs_and_is_named() -> None:
    trials = rated(
        {"gym": [4, 5, 3, 4], "library": [3, 4, 4, 5]}, {"gym": [3, 3, 3, 4], "library": [2, 4, 3, 4]}
    )
    kept = [t for t in trials if t.participant_id != "01" or (t.sequence == "gym" and t.version is OURS)]
    findings = rating_findings(rating_data(kept), 1)
    assert statistic(findings, "gym", "mean difference, ours").n == 3
    assert statistic(findings, "gym", "mean rating, ours").n == 4
    assert "participants without both versions of every sequence: 01" in findings.warnings


def test_a_version_that_nobody_rated_leaves_rows_with_a_flag() -> None:
    trials = [t for t in rated({"gym": [4, 5], "house": [3, 4]}, {"gym": [3, 3], "house": [1, 1]})
              if t.sequence == "gym" or t.version is OURS]  # fmt: skip
    findings = rating_findings(rating_data(trials, ("gym", "house")), 1)
    row = statistic(findings, "house", "mean difference, ours")
    assert (row.value, row.p_value, row.flag) == (None, None, "nobody has rated both versions")
    # Holm counts the one test that there is.
    gym = statistic(findings, "gym", "mean difference, ours")
    assert gym.p_adjusted == gym.p_value


def test_a_designed_sequence_that_nobody_rated_keeps_its_rows_and_is_named() -> None:
    both = {"gym": [4, 5, 3, 4], "house": [3, 4, 4, 5]}
    trials = rated(both, {"gym": [3, 3, 3, 4], "house": [2, 4, 3, 4]})
    findings = rating_findings(rating_data(trials, ("library", "gym", "house")), 1)
    row = statistic(findings, "library", "mean difference, ours")
    assert (row.value, row.n, row.flag) == (None, 0, "nobody has rated both versions")
    assert any("nobody rated library" in words for words in findings.warnings)
    assert statistic(findings, "all", "odds ratio of a higher rating, house to").what.endswith("to gym")


def test_answers_that_separate_are_a_warning_and_no_end_of_an_interval_is_beyond_belief() -> None:
    rng = np.random.default_rng(4)
    high, low = (
        {name: rng.integers(*span, 12).tolist() for name in ("gym", "house")} for span in ((4, 6), (1, 4))
    )
    findings = rating_findings(rating_data(rated(high, low), ("gym", "house")), 1)
    (warning,) = findings.warnings
    assert warning.startswith("odds ratio of a higher rating, the track to baseline: runs to plus infinity")
    ends = [end for row in statistics(findings, "all", "odds ratio") for end in (row.ci_low, row.ci_high)]
    assert all(end is None or 1e-6 <= end <= 1e6 for end in ends)


def everybody_their_own() -> Analysis:
    """Twelve people, each of whom always gives one rating: the participants' SD has no bound."""
    own = [1 + person % 5 for person in range(12)]
    return rating_findings(rating_data(rated({"gym": own, "house": own}, {"gym": own, "house": own})), 1)


def test_people_who_always_give_their_own_rating_have_no_odds_ratio_but_the_reason() -> None:
    findings = everybody_their_own()
    odds = statistics(findings, "all", "odds ratio")
    assert len(odds) == 4
    spreads = statistics(findings, "all", "standard deviation of the participants'")
    for row in (*odds, *spreads, statistic(findings, "all", "version x sequence, likelihood ratio")):
        assert (row.value, row.ci_low, row.ci_high, row.p_value) == (None, None, None, None)
        assert FitFlag.NOT_CONVERGED.value in row.flag
    (section,) = (s for s in findings.sections if s.title == "All ratings in one model")
    assert all(cells[1:4] == (None, None, None) for cells in section.tables[0].rows)
    assert "cannot tell (" in section.paragraphs[0]


def test_alike_differences_leave_no_smallest_difference_and_one_sequence_no_row_of_all() -> None:
    findings = rating_findings(rating_data(rated({"gym": [4] * 8}, {"gym": [3] * 8}), ("gym",)), 1)
    row = statistic(findings, "gym", "smallest mean difference")
    assert (row.value, row.flag) == (None, "all 8 differences are alike: no spread to compute with")
    assert {s.group for s in findings.rows if s.table == "differences"} == {"gym"}


def test_sequences_rated_alike_can_show_the_same() -> None:
    same = [5, 3, 4, 4, 2, 5, 3, 4]
    less = [4, 3, 3, 4, 2, 3, 3, 4]
    data = rating_data(rated({"gym": same, "house": same}, {"gym": less, "house": less}), ("gym", "house"))
    gym, house = (statistic(rating_findings(data, 1), name, "smallest mean") for name in ("gym", "house"))
    assert gym.value == house.value is not None


def test_the_primary_test_is_named() -> None:
    primary = [s for s in seventeen().rows if s.method.startswith("primary")]
    assert {s.what for s in primary} == {"mean difference, ours less baseline"}


def test_repetitions_are_averaged_before_they_are_compared() -> None:
    trials = [
        rating_trial(who, "gym", version, rating, repetition=number)
        for who, ours, baseline in (("1", (4, 5), (3, 3)), ("2", (2, 3), (3, 4)))
        for version, ratings in ((OURS, ours), (BASELINE, baseline))
        for number, rating in enumerate(ratings, start=1)
    ]
    pairs = paired_ratings(trials, "gym")
    assert pairs.values.tolist() == [1.5, -1.0]
    assert (pairs.scores.tolist(), pairs.step) == ([3, -2], 0.5)
    assert person_means(t for t in trials if t.version is OURS).values.tolist() == [4.5, 2.5]


def test_the_mean_over_sequences_is_each_participants_own() -> None:
    trials = rated({"gym": [4, 5], "library": [3, 1]}, {"gym": [3, 3], "library": [3, 2]})
    without = [t for t in trials if (t.participant_id, t.sequence) != ("01", "library")]
    both = [paired_ratings(without, name) for name in ("gym", "library")]
    assert over_sequences(both).values.tolist() == [0.5, 2.0]


def test_200_participants_are_no_trouble() -> None:
    trials = drawn_ratings(Raters(effect=0.6), 200, np.random.default_rng(5))
    pairs = paired_ratings(trials, "gym")
    assert sign_flip_test(pairs.scores).n == 200
    smallest = smallest_difference(200, pairs.values.std(ddof=1), np.random.default_rng(1))
    assert smallest is not None
    assert smallest < 0.3


def test_the_model_finds_the_effect_that_was_put_in() -> None:
    # 40 people, 8 ratings each: the log-odds have a standard error of about 0.3.
    raters = Raters(effect=1.5, effect_sd=0.5, place=-0.6)
    fit, _ = rating_fits(drawn_ratings(raters, 40, np.random.default_rng(8)), PAPER_SEQUENCES)
    for effect, true in zip(fit.effects[:2], (1.5, -0.6), strict=True):  # of the version, and of the place
        assert effect.estimate is not None
        assert effect.standard_error is not None
        assert abs(effect.estimate - true) < 2.6 * effect.standard_error
        assert effect.ci_low is not None
        assert effect.ci_high is not None
        assert effect.ci_low < true < effect.ci_high


def test_an_effect_in_one_sequence_only_is_an_interaction() -> None:
    raters = Raters(by_sequence=(4.0, 0.0, 0.0, -4.0))
    trials = drawn_ratings(raters, 17, np.random.default_rng(3))
    interaction, df = likelihood_ratio(trials, PAPER_SEQUENCES, rating_fits(trials, PAPER_SEQUENCES)[0])
    assert df == 3
    assert interaction.p_value is not None
    assert interaction.p_value < 0.001
    pairs = [paired_ratings(trials, name) for name in PAPER_SEQUENCES]
    permuted, _ = permuted_interaction(pairs, np.random.default_rng(1))
    assert permuted.p_value is not None
    assert permuted.p_value < 0.001


def test_in_a_normal_model_the_likelihood_ratio_gives_the_p_of_its_f_test() -> None:
    # Three columns of noise beside an intercept, by least squares: RSS with and without them.
    rng = np.random.default_rng(6)
    y, x = rng.normal(size=20), rng.normal(size=(20, 3))
    full = np.column_stack([np.ones(20), x])
    rss_full = float(np.sum((y - full @ np.linalg.lstsq(full, y, rcond=None)[0]) ** 2))
    rss = float(np.sum((y - y.mean()) ** 2))
    expected = stats.f.sf((rss - rss_full) / 3 / (rss_full / 16), 3, 16)
    assert few_sample_p(20 * np.log(rss / rss_full), 3, 20, 16) == pytest.approx(expected)


def test_one_sequence_has_no_interaction() -> None:
    trials = rated({"gym": [4, 5, 3]}, {"gym": [3, 3, 4]})
    permuted, _ = permuted_interaction([paired_ratings(trials, "gym")], np.random.default_rng(1))
    assert (permuted.p_value, permuted.flag) == (None, "one sequence: nothing that could differ")
    assert likelihood_ratio(trials, ("gym",), rating_fits(trials, ("gym",))[0])[0].p_value is None


def test_trials_in_memory_give_the_same_numbers_as_sessions() -> None:
    trials = drawn_ratings(Raters(), 6, np.random.default_rng(3))
    in_sessions = rating_findings(rating_data(trials, tuple(sorted(PAPER_SEQUENCES))), 1)
    in_memory = rating_findings(task_data_of("rating", trials, simulated=True), 1)
    assert in_memory.rows == in_sessions.rows


def test_without_an_order_a_sentence_takes_the_place_of_its_table() -> None:
    trials = rated({"gym": [3, 4, 5, 2, 4, 3]}, {"gym": [2, 4, 3, 2, 5, 1]})
    for trial in trials:
        object.__setattr__(trial, "place_in_pair", None)  # as of an imported table without the column
    findings = rating_findings(rating_data(trials, ("gym",)), 1)
    about = next(own for own in findings.sections if own.title == "The order of the versions")
    assert about.tables == ()
    assert about.paragraphs == (f"What the order does cannot be told: {NO_PAIR}.",)
