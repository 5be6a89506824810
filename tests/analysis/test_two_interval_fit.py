"""Fits of the choice between two intervals: the guess rate is known, the threshold is 75 % right."""

import itertools
import math

import numpy as np
import pytest
from example_ramps import CHOICE, answer_of, ramp_of
from scipy import special

from evenlight.analysis.calibration.level_estimates import logistic_threshold
from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    LAPSE_PRIOR,
    THRESHOLD_FALLOFF,
    WIDTH_PRIOR,
    fit_psychometric,
    posterior_grid,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts, catch_counts, ramp_counts
from evenlight.analysis.calibration.psychometric.signal_detection import TWO_INTERVAL_D_PRIME
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of, flag_of
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampTrial
from evenlight.data_schema.threshold import ThresholdFlag
from evenlight.method.psychometric import PsychometricFunction, yes_probability

RATES = np.array([0.8, 1.3, 2.0, 2.8, 4.0, 5.5, 8.0, 12.0])


def counts(right: list[int], n: int) -> RampCounts:
    return RampCounts(RATES, np.array(right), np.full(len(right), n), guess_rate=0.5)


TYPICAL = counts([5, 4, 7, 7, 9, 10, 9, 10], 10)


def test_the_means_are_those_of_a_brute_force_grid_over_three_parameters() -> None:
    # The posterior as written: trapezoid rule on one even grid over the whole prior, guess rate 0.5.
    x = np.log(RATES)
    t = np.linspace(x[0] - 2.5, x[-1] + 2.5, 160)[:, None, None]
    w = np.linspace(math.log(1.6) - 2.7, math.log(1.6) + 2.7, 80)[None, :, None]
    m = np.linspace(1e-9, 0.2, 40)[None, None, :]
    flank = np.maximum(0, np.maximum(x[0] - t, t - x[-1])) / THRESHOLD_FALLOFF
    ln = -(flank**2) / 2 - ((w - math.log(WIDTH_PRIOR[0])) / WIDTH_PRIOR[1]) ** 2 / 2
    ln = ln + (2 * LAPSE_PRIOR[1] - 1) * np.log1p(-m)  # Beta(1, 60): lapses show half as often
    for xi, k, n in zip(x, TYPICAL.n_yes, TYPICAL.n_trials, strict=True):
        psi = 0.5 + (0.5 - m) * special.expit(2 * math.log(19) * (xi - t) / np.exp(w))
        ln = ln + k * np.log(psi) + (n - k) * np.log1p(-psi)
    mass = np.exp(ln - ln.max())
    for axis in range(3):
        index: list[slice | int] = [slice(None)] * 3
        for index[axis] in (0, -1):
            mass[tuple(index)] /= 2
    mass /= mass.sum()
    grid = posterior_grid(TYPICAL)
    assert grid.mean_and_sd(0)[0] == pytest.approx(float((t * mass).sum()), abs=0.001)
    assert grid.mean_and_sd(1)[0] == pytest.approx(float((w * mass).sum()), abs=0.009)
    assert grid.mean_and_sd(3)[0] == pytest.approx(float((m * mass).sum()), abs=0.001)


def test_a_known_guess_rate_is_its_own_estimate() -> None:
    fit = fit_psychometric(TYPICAL)
    assert (fit.guess_rate.mean, fit.guess_rate.sd, fit.guess_rate.ci_low) == (0.5, 0.0, 0.5)
    half_way = 0.75 - fit.lapse_rate.mean / 2
    assert float(yes_probability(fit.function.threshold, fit.function)) == pytest.approx(half_way)


@pytest.mark.parametrize("right", [[10] * 8, [5] * 8, [0] * 8, [10, 9, 8, 7, 6, 5, 4, 3]])
def test_hard_answers_give_an_ordered_finite_interval(right: list[int]) -> None:
    fit = fit_psychometric(counts(right, 10))
    for estimate in (fit.ln_threshold, fit.ln_width, fit.lapse_rate):
        assert -math.inf < estimate.ci_low < estimate.median < estimate.ci_high < math.inf


def test_thresholds_are_recovered_from_a_hundred_choices() -> None:
    # 150 people with 96 choices each: the scatter of their thresholds is about 0.21, of their mean 0.017.
    rng = np.random.default_rng(21)
    errors, covered = [], []
    for _ in range(150):
        truth = PsychometricFunction(
            3.1 * np.exp(0.27 * rng.standard_normal()), 1.6 * np.exp(0.3 * rng.standard_normal()), 0.5, 0.012
        )
        right = rng.binomial(12, yes_probability(RATES, truth))
        fit = fit_psychometric(RampCounts(RATES, right, np.full(8, 12), guess_rate=0.5))
        errors.append(fit.ln_threshold.mean - math.log(truth.threshold))
        covered.append(fit.ln_threshold.ci_low <= math.log(truth.threshold) <= fit.ln_threshold.ci_high)
    assert abs(np.mean(errors)) < 0.02 + 2.6 * 0.017
    assert 0.89 <= np.mean(covered) <= 0.995


@pytest.mark.parametrize(
    ("right", "threshold", "flag"),
    [
        ([5, 6, 8, 10], 4.0, ThresholdFlag.NONE),
        ([10, 10, 10, 10], 0.5, ThresholdFlag.ALL_YES),
        ([5, 4, 6, 5], 12.0, ThresholdFlag.ALL_NO),  # 20 of 40: guesses
        ([3, 4, 4, 5], 12.0, ThresholdFlag.ALL_NO),  # fewer than guesses
        ([9, 10, 9, 10], 0.9, ThresholdFlag.BELOW_RANGE),
        ([5, 5, 5, 6], 9.0, ThresholdFlag.ABOVE_RANGE),
    ],
)
def test_flags_know_that_half_is_right_by_chance(
    right: list[int], threshold: float, flag: ThresholdFlag
) -> None:
    data = RampCounts(2.0 ** np.arange(4), np.array(right), np.full(4, 10), guess_rate=0.5)
    assert flag_of(data, threshold) is flag


def test_the_pooled_logistic_rises_from_one_half() -> None:
    function = PsychometricFunction(3.0, 1.6, guess_rate=0.5)
    right = np.round(10_000 * yes_probability(RATES, function)).astype(np.int64)
    data = RampCounts(RATES, right, np.full(8, 10_000), guess_rate=0.5)
    assert logistic_threshold(data) == pytest.approx(3.0, rel=2e-3)


def choices(
    table: dict[float, tuple[int, int]], duration: float = 5.0, direction: Direction = Direction.DOWN
) -> list[RampTrial]:
    """Choices with, for each rate, so many right of so many; the ramp in either interval in turn."""
    return [
        ramp_of(50.0, rate, CHOICE, duration=duration, direction=direction, ramp_interval=1 + i % 2,
                response=answer_of(Procedure.TWO_INTERVAL, i < right, 1 + i % 2))
        for rate, (right, n) in table.items()
        for i in range(n)
    ]  # fmt: skip


RISING = {0.25: (5, 10), 0.5: (7, 10), 1.0: (9, 10), 2.0: (10, 10)}


def test_right_answers_are_counted_whichever_interval_held_the_ramp() -> None:
    data = ramp_counts(choices(RISING))
    assert data.n_yes.tolist() == [5, 7, 9, 10]
    assert data.guess_rate == 0.5
    assert catch_counts(choices(RISING)) == {}


def test_a_threshold_of_two_intervals_says_so_and_has_the_d_prime_of_its_definition() -> None:
    record = fit_thresholds_of(choices(RISING))[0].threshold
    assert record.procedure is Procedure.TWO_INTERVAL
    assert record.d_prime == TWO_INTERVAL_D_PRIME
    assert record.false_alarm_rate is None
    assert record.criterion is not None
    assert record.guess_rate == 0.5
    # d' = 1 is Φ(1/√2) = 76 % right, a little above the threshold.
    assert record.threshold_d_prime_1 is not None
    assert 1.0 < record.threshold_d_prime_1 / record.threshold < 1.05


def test_directions_and_durations_are_levels_of_their_own() -> None:
    trials = [
        trial
        for duration, direction in itertools.product((5.0, 10.0), Direction)
        for trial in choices(RISING, duration, direction)
    ]
    found = [(f.threshold.direction, f.threshold.ramp_duration) for f in fit_thresholds_of(trials)]
    assert set(found) == set(itertools.product(Direction, (5.0, 10.0)))
    assert len(found) == 4
