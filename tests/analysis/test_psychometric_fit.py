"""Psychometric fits: what a fit states, how long it takes, and answers that fit nothing."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from evenlight.analysis.calibration.psychometric.psychometric_fit import fit_psychometric
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.method.psychometric import yes_probability

RATES = np.array([0.8, 1.3, 2.0, 2.8, 4.0, 5.5, 8.0, 12.0])


def counts(yes: list[int], n: int = 6, catch: tuple[int, int] = (6, 120)) -> RampCounts:
    return RampCounts(RATES, np.array(yes), np.full(8, n), *catch)


TYPICAL = counts([0, 1, 1, 3, 4, 5, 6, 6])
HARD = {
    "perfect separation": counts([0, 0, 0, 0, 6, 6, 6, 6]),
    "all yes": counts([6] * 8),
    "all no": counts([0] * 8, catch=(0, 120)),
    "one trial per rate": counts([0, 0, 0, 1, 0, 1, 1, 1], n=1, catch=(0, 0)),
    "one trial": RampCounts(np.array([2.0]), np.array([1]), np.array([1])),
    "backwards": counts([6, 6, 5, 4, 2, 1, 0, 0]),
    "very many trials": counts([50, 80, 200, 400, 700, 850, 930, 960], n=1000, catch=(50, 1000)),
}


def test_but_for_lapses_the_fitted_function_runs_through_75_percent_at_the_threshold() -> None:
    fit = fit_psychometric(TYPICAL)
    threshold = math.exp(fit.ln_threshold.mean)
    assert float(yes_probability(threshold, replace(fit.function, lapse_rate=0.0))) == pytest.approx(0.75)


@pytest.mark.parametrize("name", HARD)
def test_hard_answers_give_an_ordered_finite_interval_and_no_warning(name: str) -> None:
    fit = fit_psychometric(HARD[name])
    for estimate in (fit.ln_threshold, fit.ln_width, fit.guess_rate, fit.lapse_rate):
        assert -math.inf < estimate.ci_low < estimate.median < estimate.ci_high < math.inf
        assert estimate.ci_low < estimate.mean < estimate.ci_high
        assert estimate.sd > 0


def test_all_yes_and_all_no_say_only_on_which_side_of_the_tested_rates_the_threshold_lies() -> None:
    below, above = fit_psychometric(HARD["all yes"]), fit_psychometric(HARD["all no"])
    assert below.ln_threshold.mean < math.log(RATES[0])
    assert above.ln_threshold.mean > math.log(RATES[-1])
    # The prior's flank has a standard deviation of 0.5: nothing narrower can be known of either.
    for fit in (below, above):
        assert fit.ln_threshold.ci_high - fit.ln_threshold.ci_low > 1.0


def test_a_separated_threshold_lies_in_the_gap() -> None:
    fit = fit_psychometric(HARD["perfect separation"])
    assert math.log(2.8) < fit.ln_threshold.mean < math.log(4.0) + 0.1
    assert fit.ln_threshold.ci_low < math.log(2.8) + 0.2


def test_more_trials_narrow_the_interval_by_the_square_root_of_their_number() -> None:
    # 16 times the answers: a quarter of the standard error, up to what the priors add to the smaller sample.
    few = fit_psychometric(counts([0, 1, 1, 3, 4, 5, 6, 6], catch=(6, 120)))
    many = fit_psychometric(counts([0, 16, 16, 48, 64, 80, 96, 96], n=96, catch=(96, 1920)))
    assert many.ln_threshold.sd == pytest.approx(few.ln_threshold.sd / 4, rel=0.2)


def test_false_alarms_are_held_against_the_answers_to_ramps() -> None:
    # Who says "yes" to 30 % of the catch trials has said some of the "yes" to slow ramps without seeing them.
    honest = fit_psychometric(counts([2, 2, 2, 3, 4, 5, 6, 6], catch=(0, 120)))
    eager = fit_psychometric(counts([2, 2, 2, 3, 4, 5, 6, 6], catch=(36, 120)))
    assert eager.guess_rate.mean == pytest.approx(0.3, abs=0.05)
    assert honest.guess_rate.mean < 0.1
    assert eager.ln_width.mean < honest.ln_width.mean


def test_the_same_answers_give_the_same_fit() -> None:
    first, second = fit_psychometric(TYPICAL), fit_psychometric(TYPICAL)
    assert first.ln_threshold == second.ln_threshold
    assert first.function == second.function


@pytest.mark.real_time
def test_a_fit_with_intervals_takes_at_most_50_ms_of_one_core() -> None:
    durations = []
    for _ in range(10):
        start = time.process_time()
        fit_psychometric(TYPICAL)
        durations.append(time.process_time() - start)
    assert min(durations) < 0.050
