"""The random threshold: it is recovered, pooling moves it, and the quadrature is fine enough."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate, special, stats

from evenlight.analysis.calibration.level_estimates import (
    RandomThresholdFit,
    RandomThresholdModel,
    even_rule,
    fit_random_threshold,
    logistic_threshold,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts, pooled_counts
from evenlight.method.psychometric import PsychometricFunction, yes_probability

RATES = np.array([0.8, 1.3, 2.0, 2.8, 4.0, 5.5, 8.0, 12.0])
MEDIAN, SD, PEOPLE = 3.1, 0.3, 12
EXPERIMENTS = 60


def hermite_rule(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the Gauss-Hermite rule of n nodes for a standard normal z, weights as logarithms."""
    nodes, weights = special.roots_hermitenorm(n)
    with np.errstate(divide="ignore"):  # the outermost weights of a large rule are below any float
        ln_weights = np.log(weights)
    return np.asarray(nodes), np.asarray(ln_weights - special.logsumexp(ln_weights))


def experiment(rng: np.random.Generator, n: int = 8, two: bool = False, sd: float = SD) -> list[RampCounts]:
    """The answers of a dozen participants whose ln(threshold) scatters about ln 3.1."""
    people = []
    for _ in range(PEOPLE):
        guess = 0.5 if two else 0.06
        own = PsychometricFunction(MEDIAN * math.exp(sd * rng.standard_normal()), 1.6, guess, 0.02)
        yes = rng.binomial(n, yes_probability(RATES, own))
        catch = (0, 0) if two else (int(rng.binomial(120, guess)), 120)
        people.append(RampCounts(RATES, yes, np.full(8, n), *catch, guess_rate=0.5 if two else None))
    return people


@pytest.mark.parametrize("two", [False, True])
def test_the_populations_threshold_is_recovered_with_its_interval_and_pooling_moves_it_up(two: bool) -> None:
    # 60 experiments: a coverage of 95 % shows as 86 to 100 % in 999 of 1000 studies.
    rng = np.random.default_rng(3)
    errors, covered, pooled = [], [], []
    for _ in range(EXPERIMENTS):
        people = experiment(rng, two=two)
        fit = fit_random_threshold(people)
        assert fit is not None
        errors.append(math.log(fit.threshold / MEDIAN))
        covered.append(fit.ci_low <= MEDIAN <= fit.ci_high)
        pooled.append(math.log((logistic_threshold(pooled_counts(people)) or math.nan) / MEDIAN))
    low, _ = stats.binom.interval(0.999, EXPERIMENTS, 0.95)
    assert np.mean(covered) >= low / EXPERIMENTS
    spread = np.std(errors) / EXPERIMENTS**0.5
    assert abs(np.mean(errors)) < 0.02 + 2.6 * spread
    if not two:  # guesses and lapses, which the pooled function has not, and people: all upwards
        assert np.mean(pooled) > 0.05


def test_differences_between_people_alone_move_the_pooled_point_up_by_what_theory_says() -> None:
    # Nobody guesses or lapses. A logistic function of scale s has the variance π²s²/3; blurred by a normal of
    # SD σ it is about one of scale s sqrt(1 + 3σ²/(π²s²)). Its middle stays, and its 75 % point, ln 3 scales
    # above, moves with the scale; s = 1.6 / (2 ln 19).
    s, sd = 1.6 / (2 * math.log(19)), 0.5
    shift = math.log(3) * s * (math.sqrt(1 + 3 * sd**2 / (math.pi * s) ** 2) - 1)
    z = stats.norm.ppf((np.arange(200) + 0.5) / 200)
    functions = [PsychometricFunction(MEDIAN * math.exp(sd * v), 1.6) for v in z]
    mean = np.mean([yes_probability(RATES, f) for f in functions], axis=0)
    counts = RampCounts(RATES, np.round(1e5 * mean).astype(np.int64), np.full(8, 100_000))
    found = logistic_threshold(counts)
    assert found is not None
    assert math.log(found / MEDIAN) == pytest.approx(shift, rel=0.15)


def test_the_scatter_between_participants_is_recovered() -> None:
    rng = np.random.default_rng(4)
    fits = [fit_random_threshold(experiment(rng, n=20)) for _ in range(30)]
    assert np.mean([fit.participant_sd for fit in fits if fit]) == pytest.approx(SD, abs=0.04)


def test_participants_who_are_alike_still_have_an_interval() -> None:
    fit = fit_random_threshold(experiment(np.random.default_rng(5), sd=0.0))
    assert fit is not None
    assert 0 < fit.participant_sd < 0.25
    assert fit.ci_low < fit.threshold < fit.ci_high


def test_the_likelihood_is_that_of_adaptive_integration() -> None:
    # Each participant's z integrated by scipy's adaptive quadrature, over the function as it is defined.
    people = experiment(np.random.default_rng(6), n=30)[:3]
    model = RandomThresholdModel(people, even_rule())
    mu, sd, width, lapse = math.log(3.0), 0.3, 1.4, 0.03
    expected = 0.0
    for counts in people:
        guess = (1 + counts.catch_yes) / (11 + counts.catch_trials)

        def ln_density(z: float, counts: RampCounts = counts, guess: float = guess) -> float:
            f = PsychometricFunction(math.exp(mu + sd * z), width, guess, lapse)
            psi = yes_probability(counts.rates, f)
            answers = counts.n_yes * np.log(psi) + (counts.n_trials - counts.n_yes) * np.log1p(-psi)
            return float(answers.sum() - z * z / 2 - math.log(2 * math.pi) / 2)

        top = max(ln_density(z) for z in np.linspace(-4, 4, 81))

        def density(z: float, of: Callable[[float], float] = ln_density, top: float = top) -> float:
            return math.exp(of(z) - top)

        area, _ = integrate.quad(density, -8, 8, epsabs=0, epsrel=1e-10, limit=400)
        expected += top + math.log(area)
    assert model.ln_likelihood(mu, sd, width, lapse) == pytest.approx(expected, abs=1e-7)


def test_with_the_answers_of_a_session_any_fine_rule_agrees() -> None:
    rng = np.random.default_rng(7)
    for _ in range(3):
        people = experiment(rng, n=8)
        usual = fit_random_threshold(people)
        assert usual is not None
        for rule in (even_rule(481), hermite_rule(101), hermite_rule(401)):
            assert_same(usual, fit_random_threshold(people, rule=rule))


def test_with_many_answers_the_even_nodes_still_agree_with_finer_ones() -> None:
    rng = np.random.default_rng(7)
    for _ in range(3):
        people = experiment(rng, n=40)
        usual = fit_random_threshold(people)
        assert usual is not None
        for rule in (even_rule(481), hermite_rule(401)):
            assert_same(usual, fit_random_threshold(people, rule=rule))


def assert_same(one: RandomThresholdFit, other: RandomThresholdFit | None) -> None:
    assert other is not None
    assert math.log(one.threshold / other.threshold) == pytest.approx(0.0, abs=1e-4)
    assert one.standard_error_ln == pytest.approx(other.standard_error_ln, rel=2e-3)


def test_twenty_one_gauss_hermite_nodes_state_too_small_a_standard_error() -> None:
    """A participant's likelihood is narrow beside the population, and 21 nodes step over it."""
    rng = np.random.default_rng(8)
    ratios = []
    for _ in range(8):
        people = experiment(rng, n=60)
        usual, coarse = fit_random_threshold(people), fit_random_threshold(people, rule=hermite_rule(21))
        assert usual is not None
        if coarse is not None:
            ratios.append(coarse.standard_error_ln / usual.standard_error_ln)
    assert np.median(ratios) < 0.8


def test_a_participant_who_saw_everything_counts_as_far_as_the_answers_go() -> None:
    people = experiment(np.random.default_rng(9))
    keen = RampCounts(RATES, np.full(8, 8), np.full(8, 8), 3, 120)
    without, with_keen = fit_random_threshold(people), fit_random_threshold([*people, keen])
    assert without is not None
    assert with_keen is not None
    assert with_keen.threshold < without.threshold
    assert with_keen.n_participants == len(people) + 1


def test_one_participant_or_answers_all_alike_give_no_population() -> None:
    people = experiment(np.random.default_rng(10))
    assert fit_random_threshold(people[:1]) is None
    alike = [RampCounts(RATES, np.full(8, 8), np.full(8, 8))] * 3
    assert fit_random_threshold(alike) is None
