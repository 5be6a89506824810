"""Goodness of fit: p-values that mean what they say, and misfits that are found."""

import numpy as np
import pytest
from numbers_of_sets import counts_at, few_and_many
from numpy.typing import NDArray
from scipy import optimize, stats

from evenlight.analysis.calibration.psychometric.goodness_of_fit import (
    GoodnessOfFit,
    answered,
    bin_starts,
    goodness_of_fit,
    joint_p_value,
    most_probable,
)
from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    LAPSE_PRIOR,
    MAX_LAPSE,
    THRESHOLD_FALLOFF,
    WIDTH_PRIOR,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.method.psychometric import PsychometricFunction, log_likelihood, yes_probability

RATES = np.array([0.8, 1.3, 2.0, 2.8, 4.0, 5.5, 8.0, 12.0])


def drawn(
    probability: NDArray[np.float64], n: int, rng: np.random.Generator, two: bool = False
) -> RampCounts:
    """Answers at eight rates; in yes/no with 120 catch trials of a guess rate of 5 %."""
    yes = rng.binomial(n, probability)
    catch = (0, 0) if two else (int(rng.binomial(120, 0.05)), 120)
    return RampCounts(RATES, yes, np.full(8, n), *catch, guess_rate=0.5 if two else None)


def person(rng: np.random.Generator, two: bool) -> PsychometricFunction:
    return PsychometricFunction(
        3.1 * np.exp(0.25 * rng.standard_normal()),
        1.6 * np.exp(0.3 * rng.standard_normal()),
        0.5 if two else 0.05,
        0.02,
    )


@pytest.mark.slow
@pytest.mark.parametrize("two", [False, True])
@pytest.mark.parametrize("sets", few_and_many(60, 300))
def test_under_the_true_model_one_fit_in_twenty_is_called_poor_at_5_percent(sets: int, two: bool) -> None:
    rng = np.random.default_rng(11)
    p = [fit_p(drawn(yes_probability(RATES, person(rng, two)), 6, rng, two)) for _ in range(sets)]
    for level in (0.05, 0.5):
        low, high = counts_at(level, sets)
        assert low <= np.mean(np.array(p) <= level) <= high


def fit_p(counts: RampCounts) -> float:
    found = goodness_of_fit(counts, replicates=99)
    assert found is not None
    return found.p_value


@pytest.mark.slow
@pytest.mark.parametrize("sets", few_and_many(50, 200))
def test_adaptively_placed_answers_are_judged_over_bins_and_not_called_poor_too_often(sets: int) -> None:
    # A staircase, 3 steps up and 1 down, with jitter: rates and answers depend on each other.
    rng = np.random.default_rng(12)
    p = [fit_p(by_staircase(person(rng, two=False), 60, rng)) for _ in range(sets)]
    low, high = counts_at(0.05, sets)
    assert low <= np.mean(np.array(p) <= 0.05) <= high


def by_staircase(function: PsychometricFunction, n: int, rng: np.random.Generator) -> RampCounts:
    grid, place = np.geomspace(0.8, 12, 31), 24
    yes, trials = np.zeros(31, dtype=np.int64), np.zeros(31, dtype=np.int64)
    for _ in range(n):
        shown = int(np.clip(place + rng.integers(-2, 3), 0, 30))
        seen = rng.random() < float(yes_probability(grid[shown], function))
        yes[shown] += seen
        trials[shown] += 1
        place = int(np.clip(place + (-1 if seen else 3), 0, 30))
    asked = trials > 0
    return RampCounts(grid[asked], yes[asked], trials[asked], int(rng.binomial(120, 0.05)), 120)


MISFITS = {
    # A participant who missed every second ramp of the fastest rates: looked away, or pressed the wrong key.
    "falls again": np.array([0.05, 0.1, 0.3, 0.7, 0.95, 0.95, 0.5, 0.4]),
    # Two populations of trials: half of them seen at once, half only when very fast.
    "plateau": np.array([0.05, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.98]),
}


@pytest.mark.parametrize("name", MISFITS)
def test_a_function_that_is_not_logistic_is_found_in_nine_of_ten(name: str) -> None:
    rng = np.random.default_rng(13)
    p = [fit_p(drawn(MISFITS[name], 20, rng)) for _ in range(30)]
    assert np.mean(np.array(p) <= 0.05) > 0.9


def test_misfits_that_no_level_shows_by_itself_add_up_over_a_participants_levels() -> None:
    # Shares that zigzag by 22 % about a logistic function: ten levels of 48 ramps together show it.
    rng = np.random.default_rng(14)
    bent = yes_probability(RATES, PsychometricFunction(3.1, 1.6, 0.05, 0.02))
    bumpy = np.clip(bent + 0.22 * np.array([1, -1, 1, -1, 1, -1, 1, -1]), 0.03, 0.97)
    levels = [goodness_of_fit(drawn(bumpy, 6, rng)) for _ in range(10)]
    fits = [fit for fit in levels if fit is not None]
    joint = joint_p_value(fits)
    assert joint is not None
    assert joint < 0.01
    assert joint <= min(np.median([fit.p_value for fit in fits]), 0.5)
    honest = [goodness_of_fit(drawn(bent, 6, rng)) for _ in range(10)]
    steady = joint_p_value([fit for fit in honest if fit is not None])
    assert steady is not None
    assert steady > 0.01


def test_the_same_answers_have_the_same_p_value() -> None:
    counts = RampCounts(RATES, np.array([0, 1, 1, 3, 4, 5, 6, 6]), np.full(8, 6), 6, 120)
    assert fit_p(counts) == fit_p(counts)


def test_answers_as_the_function_expects_them_have_the_smallest_deviance() -> None:
    # 1000 ψ(rate) "yes" of 1000 (rounded): each bin adds about (0.5/sd)² at most, 0.3²/(1000 · 0.05) < 0.01.
    expected = np.round(1000 * yes_probability(RATES, PsychometricFunction(3.1, 1.6, 0.05, 0.02)))
    found = goodness_of_fit(RampCounts(RATES, expected.astype(np.int64), np.full(8, 1000), 500, 10_000))
    assert found is not None
    assert found.deviance < 0.5
    assert found.p_value > 0.9


def test_the_deviance_is_that_of_the_textbook() -> None:
    # 2 (ln L of the shares themselves - ln L of the function), at the most probable function.
    counts = RampCounts(RATES, np.array([1, 1, 2, 4, 5, 8, 9, 9]), np.full(8, 10), 6, 120)
    t, w, g, m = fitted(counts)
    function = PsychometricFunction(float(np.exp(t)), float(np.exp(w)), float(g), float(m))
    shares = counts.n_yes / counts.n_trials
    saturated = float(np.sum(counts.n_yes * np.log(shares) + (10 - counts.n_yes) * np.log(1 - shares)))
    expected = 2 * (saturated - log_likelihood(function, counts.rates, counts.n_yes, counts.n_trials))
    found = goodness_of_fit(counts)
    assert found is not None
    assert found.deviance == pytest.approx(expected, rel=1e-6)


def fitted(counts: RampCounts) -> NDArray[np.float64]:
    return np.asarray(most_probable(answered(counts))[0])


@pytest.mark.parametrize(
    "yes", [[0, 1, 1, 3, 4, 5, 6, 6], [0, 0, 0, 0, 6, 6, 6, 6], [2, 1, 3, 2, 4, 3, 4, 5]]
)
def test_the_most_probable_function_is_that_of_a_general_optimizer(yes: list[int]) -> None:
    # The posterior as written, in the same variables (whose measure moves its maximum), by Nelder and Mead.
    counts = RampCounts(RATES, np.array(yes), np.full(8, 6), 6, 120)

    def cost(u: NDArray[np.float64]) -> float:
        g, m = 0.7 / (1 + np.exp(-u[2])), MAX_LAPSE / (1 + np.exp(-u[3]))
        function = PsychometricFunction(float(np.exp(u[0])), float(np.exp(u[1])), float(g), float(m))
        x = np.log(RATES)
        flank = max(x[0] - u[0], u[0] - x[-1], 0.0) / THRESHOLD_FALLOFF
        ln_prior = -(flank**2) / 2 - ((u[1] - np.log(WIDTH_PRIOR[0])) / WIDTH_PRIOR[1]) ** 2 / 2
        ln_prior += stats.beta.logpdf(g, 1 + 6, 10 + 114) + np.log(g * (1 - g / 0.7))
        ln_prior += stats.beta.logpdf(m, *LAPSE_PRIOR) + np.log(m * (1 - m / MAX_LAPSE))
        return -(log_likelihood(function, RATES, counts.n_yes, counts.n_trials) + float(ln_prior))

    start = np.array([1.0, 0.4, -2.5, -1.5])
    best = optimize.minimize(
        cost, start, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-10, "maxiter": 4000}
    )
    found = fitted(counts)
    assert found[0] == pytest.approx(best.x[0], abs=2e-3)
    assert found[1] == pytest.approx(best.x[1], abs=5e-3)


def test_too_few_trials_have_no_p_value() -> None:
    assert goodness_of_fit(RampCounts(RATES, np.zeros(8, dtype=np.int64), np.ones(8, dtype=np.int64))) is None
    assert joint_p_value([]) is None


def test_every_bin_holds_five_trials_and_every_rate_is_in_one() -> None:
    rng = np.random.default_rng(15)
    for _ in range(50):
        n = rng.integers(1, 8, rng.integers(2, 40))
        sums = np.add.reduceat(n, bin_starts(n))
        assert sums.sum() == n.sum()
        assert (sums >= 5).all() or sums.size == 1


def test_answers_all_alike_are_judged_without_a_warning() -> None:
    for yes in (0, 6):
        found = goodness_of_fit(RampCounts(RATES, np.full(8, yes), np.full(8, 6), 3, 120))
        assert isinstance(found, GoodnessOfFit)
        assert 0 < found.p_value <= 1
