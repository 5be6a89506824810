"""Drift: found where it is, estimated, and not seen where there is none."""

import numpy as np
import pytest
from scipy import stats

from evenlight.analysis.calibration.psychometric.psychometric_fit import fit_psychometric
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.analysis.calibration.psychometric.thresholds import TimedAnswers, drift_of
from evenlight.method.psychometric import PsychometricFunction, yes_probability

RATES = np.array([0.8, 1.3, 2.0, 2.8, 4.0, 5.5, 8.0, 12.0])
N_LEVELS = 6
COARSER = (20, 12, 8, 6)  # nodes: a function to 0.3 % of its threshold, in half the time


def session(
    rng: np.random.Generator, ln_change: float, two: bool = False, n_levels: int = N_LEVELS
) -> list[TimedAnswers]:
    """A session of levels in a random order; ln(threshold) moves by `ln_change` from its begin to its end."""
    guess = 0.5 if two else 0.05
    levels = []
    order = rng.permutation(n_levels * 48) / (n_levels * 48)
    for k in range(n_levels):
        times, rates = order[48 * k : 48 * (k + 1)], np.tile(RATES, 6)
        own = [
            PsychometricFunction(3.1 * np.exp(ln_change * (time - 0.5)), 1.6, guess, 0.02) for time in times
        ]
        seen = rng.random(48) < [float(yes_probability(rate, f)) for rate, f in zip(rates, own, strict=True)]
        counts = RampCounts(
            RATES,
            np.array([int(seen[rates == rate].sum()) for rate in RATES]),
            np.full(8, 6),
            *((0, 0) if two else (6, 120)),
            guess_rate=0.5 if two else None,
        )
        levels.append((fit_psychometric(counts, fine=COARSER).function, rates, seen.astype(float), times))
    return levels


@pytest.mark.parametrize("two", [False, True])
def test_a_participant_whose_threshold_triples_is_found(two: bool) -> None:
    # 288 ramps know ln(ratio) to about 0.23, 480 choices between two intervals to about 0.33: ln 3 is 4.8 and
    # 3.3 of these, and a test at 5 % finds it in 99 and 91 of 100.
    rng = np.random.default_rng(1)
    drifts = [drift_of(session(rng, np.log(3.0), two, 10 if two else 6)) for _ in range(20)]
    assert np.mean([drift is not None and drift[1] < 0.05 for drift in drifts]) >= 0.75


def test_a_doubling_is_estimated_as_one() -> None:
    # 20 sessions know the mean ln(ratio) to 0.05; the estimate is of first order.
    rng = np.random.default_rng(4)
    drifts = [drift_of(session(rng, np.log(2.0))) for _ in range(20)]
    ratios = [drift[0] for drift in drifts if drift is not None]
    assert np.exp(np.mean(np.log(ratios))) == pytest.approx(2.0, rel=0.2)


def test_without_a_drift_the_p_value_is_even() -> None:
    rng = np.random.default_rng(2)
    drifts = [drift_of(session(rng, 0.0, two=True)) for _ in range(100)]
    p = np.array([drift[1] for drift in drifts if drift is not None])
    low, high = stats.binom.interval(0.999, 100, 0.05)
    assert low / 100 <= np.mean(p < 0.05) <= high / 100
    assert stats.kstest(p, "uniform").pvalue > 0.001


def test_a_deviance_over_rates_would_not_see_it() -> None:
    """With the order at random a drift only flattens the function: the answers at each rate stay binomial.

    Their mean over the drift lies within 1.2 % of a wider logistic function of the same kind.
    """
    changes = np.linspace(-0.35, 0.35, 101)
    mixed = np.mean(
        [yes_probability(RATES, PsychometricFunction(3.1 * np.exp(d), 1.6)) for d in changes], axis=0
    )
    slope = np.polyfit(np.log(RATES), np.log(mixed / (1 - mixed)), 1)
    again = 1 / (1 + np.exp(-np.polyval(slope, np.log(RATES))))
    assert np.abs(mixed - again).max() < 0.012


def test_trials_that_all_have_the_same_time_tell_nothing() -> None:
    levels = session(np.random.default_rng(3), 0.0)
    still = [(*level[:3], np.full(48, 0.3)) for level in levels]
    assert drift_of(still) is None
    assert drift_of([]) is None
