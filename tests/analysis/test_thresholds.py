"""Thresholds: counting answers, flags, catch trials and the criterion."""

import itertools

import numpy as np
import pytest
from example_ramps import ramp_of
from scipy import special

from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts, catch_counts, ramp_counts
from evenlight.analysis.calibration.psychometric.signal_detection import criterion_of, false_alarm_warnings
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of, flag_of
from evenlight.data_schema.recordings.ramp import RampTrial, Response
from evenlight.data_schema.threshold import ThresholdFlag


def answers(
    participant: str, table: dict[float, tuple[int, int]], luminance: float = 100.0
) -> list[RampTrial]:
    """Trials with, for each rate, so many "yes" of so many."""
    return [
        ramp_of(
            luminance, rate, participant_id=participant, response=Response.YES if i < yes else Response.NO
        )
        for rate, (yes, n) in table.items()
        for i in range(n)
    ]


RISING = {1.0: (0, 4), 2.0: (1, 4), 4.0: (3, 4), 8.0: (4, 4)}


def test_answers_are_counted_by_rate_in_any_order() -> None:
    trials = answers("01", RISING)
    counts = ramp_counts([trials[i] for i in np.random.default_rng(1).permutation(16)])
    assert counts.rates.tolist() == [1.0, 2.0, 4.0, 8.0]
    assert counts.n_yes.tolist() == [0, 1, 3, 4]
    assert counts.n_trials.tolist() == [4, 4, 4, 4]


def test_there_is_one_threshold_per_participant_and_level_in_order() -> None:
    trials = answers("02", RISING) + answers("01", RISING, 50.0) + answers("01", RISING)
    found = [(f.threshold.participant_id, f.threshold.factor) for f in fit_thresholds_of(trials)]
    assert found == [("01", 1.0), ("01", 0.5), ("02", 1.0)]


def test_a_participants_catch_trials_count_at_all_of_their_levels_and_at_nobody_elses() -> None:
    trials = answers("01", {0.0: (1, 4), **RISING}) + answers("01", {0.0: (2, 4), **RISING}, 50.0)
    trials += answers("02", {0.0: (0, 2), **RISING})
    assert catch_counts(trials) == {"01": (3, 8), "02": (0, 2)}
    records = [fit.threshold for fit in fit_thresholds_of(trials)]
    assert [(r.n_catch, r.false_alarm_rate) for r in records] == [(8, 3 / 8), (8, 3 / 8), (2, 0.0)]
    assert [r.n_trials for r in records] == [16, 16, 16]


def test_a_level_of_catch_trials_alone_has_no_threshold() -> None:
    trials = answers("01", {0.0: (1, 4)}, 50.0) + answers("01", RISING)
    assert [fit.threshold.luminance for fit in fit_thresholds_of(trials)] == [100.0]


def test_without_catch_trials_there_is_no_false_alarm_rate() -> None:
    record = fit_thresholds_of(answers("01", RISING))[0].threshold
    assert record.false_alarm_rate is None
    assert record.n_catch == 0


def counts(yes: list[int], n: int = 4, catch: tuple[int, int] = (0, 8)) -> RampCounts:
    return RampCounts(2.0 ** np.arange(len(yes)), np.array(yes), np.full(len(yes), n), *catch)


@pytest.mark.parametrize(
    ("data", "threshold", "flag"),
    [
        (counts([0, 1, 3, 4]), 4.0, ThresholdFlag.NONE),
        (counts([4, 4, 4, 4]), 0.5, ThresholdFlag.ALL_YES),
        (counts([0, 0, 0, 0]), 12.0, ThresholdFlag.ALL_NO),
        (counts([0, 0, 4, 4]), 3.0, ThresholdFlag.SEPARATED),
        (counts([0, 2, 4, 4]), 3.0, ThresholdFlag.NONE),  # one rate has both answers: the slope is known
        (counts([3, 4, 3, 4]), 0.9, ThresholdFlag.BELOW_RANGE),
        (counts([0, 0, 1, 1]), 9.0, ThresholdFlag.ABOVE_RANGE),
        (counts([1, 2, 3, 4], catch=(5, 8)), 4.0, ThresholdFlag.FALSE_ALARMS),
        (counts([1, 2, 3, 4], catch=(4, 8)), 4.0, ThresholdFlag.NONE),  # half is not more than half
        (counts([4, 4, 4, 4], catch=(8, 8)), 0.5, ThresholdFlag.ALL_YES),  # the graver reason first
    ],
)
def test_flags(data: RampCounts, threshold: float, flag: ThresholdFlag) -> None:
    assert flag_of(data, threshold) is flag


def test_flagged_answers_still_give_a_valid_record() -> None:
    for first, last in itertools.product([(0, 4), (4, 4)], repeat=2):
        table = {1.0: first, 2.0: first, 4.0: last, 8.0: last}
        record = fit_thresholds_of(answers("01", table))[0].threshold
        assert record.ci_low <= record.threshold <= record.ci_high


def test_the_log_linear_correction_keeps_the_criterion_finite() -> None:
    assert criterion_of(0, 9).criterion == pytest.approx(-special.ndtri(0.05))  # 0.5 / 10
    assert criterion_of(9, 9).criterion == pytest.approx(-special.ndtri(0.95))


def caught(participant: str, bright: tuple[int, int], dark: tuple[int, int]) -> list[RampTrial]:
    """Ramps at two luminances, and answers "yes" to so many of so many catch trials at each."""
    return answers(participant, RISING | {0.0: bright}) + answers(participant, RISING | {0.0: dark}, 50.0)


def warned(trials: list[RampTrial]) -> str:
    fits = [fit.threshold for fit in fit_thresholds_of(trials, judge=False)]
    criteria = {who: criterion_of(*counts) for who, counts in catch_counts(trials).items()}
    return " ".join(false_alarm_warnings(criteria, fits))


def test_catch_trials_are_stated_for_the_participant_and_for_the_level() -> None:
    bright, dark = (fit.threshold for fit in fit_thresholds_of(caught("01", (1, 10), (4, 10)), judge=False))
    assert (bright.false_alarm_rate, bright.n_catch) == (0.25, 20)
    assert (bright.level_false_alarm_rate, bright.level_n_catch) == (0.1, 10)
    assert (dark.level_false_alarm_rate, dark.level_n_catch) == (0.4, 10)


def test_false_alarms_that_depend_on_the_luminance_are_reported() -> None:
    """2 of 40 against 20 of 40: by chance once in 100 000 times. 5 against 6 are no difference."""
    assert "false alarms differ between the luminances" in warned(caught("01", (2, 40), (20, 40)))
    assert "differ" not in warned(caught("01", (5, 40), (6, 40)))


def test_false_alarms_are_compared_with_the_correct_rejections() -> None:
    """5 of 50 against 18 of 50, as a table of "yes" and "no": [[5, 45], [18, 32]].

    χ² with Yates' correction is N (|ad - bc| - N/2)² / (product of row and column sums), which is
    100 (|160 - 810| - 50)² / (50 · 50 · 23 · 77) = 8.131 with one degree of freedom: z = 2.8515, p = 0.00435.
    A table of "yes" and other counts has another p: [[5, 55], [18, 68]] would have 0.07, and no warning.
    """
    assert "differ between the luminances (p = 0.0044)" in warned(caught("01", (5, 50), (18, 50)))


def test_who_says_yes_to_a_third_of_the_catch_trials_is_named() -> None:
    assert "participants 07 (35 %) say yes to many catch trials" in warned(caught("07", (7, 20), (7, 20)))
    assert warned(caught("07", (2, 20), (2, 20))) == ""
