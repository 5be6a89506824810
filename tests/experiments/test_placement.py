"""Adaptive placement: where the next ramp is looked for, and what is learnt from an answer."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from scipy import special

from evenlight.analysis.calibration.psychometric import psychometric_fit as fit
from evenlight.data_schema.recordings.ramp import Placement
from evenlight.experiments.ramp.adaptive_placement import (
    CANDIDATES,
    FALLOFF,
    GUESS_PRIOR,
    JITTER_STEPS,
    LAPSE_PRIOR,
    LAPSE_RATES,
    WIDTH_MEDIAN,
    WIDTH_SPREAD,
    WIDTHS,
    AdaptivePlacement,
    PlacementGrid,
    expected_entropy,
    placement_grid,
)
from evenlight.method.psychometric import PsychometricFunction, yes_probability

YES_NO, TWO = placement_grid(15.0, two_interval=False), placement_grid(20.0, two_interval=True)
MIDDLE = 0.5  # of the jitter


def test_the_grid_is_the_psychometric_function_at_its_nodes() -> None:
    rng = np.random.default_rng(1)
    for grid in (YES_NO, TWO):
        for _ in range(50):
            c, t, w, g, m = (int(rng.integers(n)) for n in grid.success.shape)
            function = PsychometricFunction(
                np.exp(grid.thresholds[t]), WIDTHS[w], grid.guess_rates[g], LAPSE_RATES[m]
            )
            expected = yes_probability(np.exp(c * grid.step), function)
            assert grid.success[c, t, w, g, m] == pytest.approx(float(expected), abs=1e-12)


def test_the_candidates_reach_from_the_lowest_to_the_highest_rate() -> None:
    assert YES_NO.step * (CANDIDATES - 1) == pytest.approx(np.log(15.0))


def test_an_answer_changes_belief_by_bayes_rule() -> None:
    adaptive = AdaptivePlacement(Placement.TARGETED, YES_NO)
    adaptive.take("level", 10, success=True)
    adaptive.take("level", 4, success=False)
    adaptive.take_catch(yes=True)
    expected = YES_NO.prior * YES_NO.success[10] * (1 - YES_NO.success[4]) * YES_NO.guess_rates[:, None]
    np.testing.assert_allclose(adaptive.posterior("level"), expected / expected.sum(), atol=1e-15)


def entropy_as_printed(posterior: np.ndarray, grid: PlacementGrid) -> list[float]:
    """Prins (2013), step by step: posterior after each answer, summed over nuisances, its entropy."""
    values = []
    for success in grid.success:
        value = 0.0
        for chance in (success, 1 - success):
            total = float((posterior * chance).sum())
            marginal = (posterior * chance / total).sum(axis=(1, 2, 3))
            value += total * float(special.entr(marginal).sum())
        values.append(value)
    return values


def test_the_expected_entropy_is_that_of_the_marginal_posterior() -> None:
    adaptive = AdaptivePlacement(Placement.PSI_MARGINAL, YES_NO)
    for candidate, success in ((13, True), (7, False), (9, True)):
        adaptive.take("level", candidate, success)
    posterior = adaptive.posterior("level")
    np.testing.assert_allclose(
        expected_entropy(posterior, YES_NO), entropy_as_printed(posterior, YES_NO), atol=1e-12
    )
    chosen = adaptive.candidate("level", MIDDLE)
    assert chosen == int(np.argmin(entropy_as_printed(posterior, YES_NO)))


def test_no_answer_is_expected_to_make_the_threshold_less_certain() -> None:
    now = float(special.entr(YES_NO.prior.sum(axis=(1, 2, 3))).sum())
    assert (expected_entropy(YES_NO.prior, YES_NO) < now).all()


def places(
    placement: Placement, grid: PlacementGrid, threshold: int, trials: int = 60, seed: int = 2
) -> list[int]:
    """Candidates shown to an observer whose 75 % point is a candidate."""
    rng = np.random.default_rng(seed)
    guess = float(grid.guess_rates[min(3, grid.guess_rates.size - 1)])
    truth = PsychometricFunction(np.exp(threshold * grid.step), 1.6, guess, 0.02)
    adaptive = AdaptivePlacement(placement, grid)
    shown = []
    for _ in range(trials):
        shown.append(adaptive.candidate("level", rng.random()))
        adaptive.take(
            "level", shown[-1], rng.random() < yes_probability(np.exp(shown[-1] * grid.step), truth)
        )
        if grid is YES_NO:
            adaptive.take_catch(rng.random() < guess)
    return shown


@pytest.mark.parametrize("grid", [YES_NO, TWO], ids=["yes/no", "two intervals"])
@pytest.mark.parametrize("threshold", [7, 13, 19])
def test_targeted_placement_settles_around_the_75_percent_point(grid: PlacementGrid, threshold: int) -> None:
    # After 30 trials a threshold is known to about 0.16 (yes/no) or 0.28 (two intervals) in ln(rate), and a
    # step is 0.10 to 0.12: the mean of 20 sessions is within a step.
    settled = [
        np.mean(places(Placement.TARGETED, grid, threshold, seed=seed)[30:]) - threshold for seed in range(20)
    ]
    assert abs(np.mean(settled)) < 1.0


def test_the_jitter_is_even_and_stays_within_its_steps() -> None:
    adaptive = AdaptivePlacement(Placement.TARGETED, YES_NO)
    middle = adaptive.candidate("level", MIDDLE)
    shown = [
        adaptive.candidate("level", jitter) - middle for jitter in np.linspace(0, 1, 200, endpoint=False)
    ]
    assert (min(shown), max(shown)) == (-JITTER_STEPS, JITTER_STEPS)
    assert abs(np.mean(shown)) < 0.1


@pytest.mark.parametrize("placement", [Placement.TARGETED, Placement.PSI_MARGINAL])
@pytest.mark.parametrize("success", [True, False])
def test_who_sees_everything_or_nothing_is_followed_to_the_end_of_the_range_and_not_beyond(
    placement: Placement, success: bool
) -> None:
    adaptive = AdaptivePlacement(placement, YES_NO)
    shown = []
    for _ in range(40):
        shown.append(adaptive.candidate("level", MIDDLE))
        adaptive.take("level", shown[-1], success)
    assert shown[-1] == (0 if success else CANDIDATES - 1)
    assert all(0 <= candidate < CANDIDATES for candidate in shown)


def test_levels_have_thresholds_of_their_own_but_share_the_guess_rate() -> None:
    adaptive = AdaptivePlacement(Placement.TARGETED, YES_NO)
    before = adaptive.posterior("other")
    adaptive.take("level", 10, success=False)
    np.testing.assert_array_equal(adaptive.posterior("other"), before)
    adaptive.take_catch(yes=True)
    # "Yes" to nothing: "yes" is now less of a sign that something was seen, at every level.
    guess = adaptive.posterior("other").sum(axis=(0, 1, 3)) @ YES_NO.guess_rates
    assert guess > before.sum(axis=(0, 1, 3)) @ YES_NO.guess_rates


def best_of(repeats: int, action: Callable[[], object]) -> float:
    durations = []
    for _ in range(repeats):
        start = time.process_time()
        action()
        durations.append(time.process_time() - start)
    return min(durations)


def test_the_choice_of_the_next_ramp_takes_well_under_five_milliseconds() -> None:
    adaptive = AdaptivePlacement(Placement.PSI_MARGINAL, YES_NO)
    adaptive.take("level", 10, success=True)
    assert best_of(5, lambda: adaptive.candidate("level", MIDDLE)) < 0.005


def test_the_prior_is_that_of_the_fit() -> None:
    assert (fit.WIDTH_PRIOR, fit.THRESHOLD_FALLOFF) == ((WIDTH_MEDIAN, WIDTH_SPREAD), FALLOFF)
    assert (fit.GUESS_PRIOR, fit.LAPSE_PRIOR) == (GUESS_PRIOR, LAPSE_PRIOR)
