"""Hard cases of fits: empty and saturated cells, one trial or a trillion, powers of L, extrapolation."""

import math

import numpy as np
import pytest

from evenlight.analysis.calibration.psychometric.psychometric_fit import PsychometricFit, fit_psychometric
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, basis_for
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_points
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import (
    PsychometricFunction,
    log_likelihood,
    rate_at,
    yes_probability,
)
from evenlight.method.rate_limit import rate_limit_at, scalar_rate_limit

RATES = np.array([0.1, 0.3, 1.0, 3.0, 10.0])
# The authors' coefficients of ln(rate) over L, highest power first (their published program).
QUARTIC = [-7.32344335e-08, 2.23659401e-05, -2.59136234e-03, 1.42944472e-01, -2.40443357]
DISPLAY = Display("d", 1e4, 0.0, 2.2, 30.0)


def fitted(n_yes, n_trials, rates=RATES, **others) -> PsychometricFit:
    """A fit, once all that it says is a number and its intervals hold their medians."""
    fit = fit_psychometric(RampCounts(np.asarray(rates), np.array(n_yes), np.array(n_trials), **others))
    for found in (fit.ln_threshold, fit.ln_width, fit.guess_rate, fit.lapse_rate):
        assert np.isfinite([found.mean, found.sd, found.ci_low, found.ci_high]).all()
        assert found.ci_low <= found.median <= found.ci_high
    return fit


def test_cells_without_trials_and_saturated_cells() -> None:
    steep = PsychometricFunction(1.0, 0.05)  # at 0.1 and 10 it is 0 and 1 to all digits
    counts = ([0, 0, 3, 5, 5], [5, 0, 4, 5, 5])
    assert log_likelihood(steep, RATES, *counts) == pytest.approx(3 * math.log(0.75) + math.log(0.25))
    fitted(*counts)


@pytest.mark.slow
@pytest.mark.parametrize(
    "n_yes",
    [[20] * 5, [0] * 5, [0, 0, 0, 20, 20], [20, 20, 10, 0, 0]],
    ids=["all yes", "all no", "separated", "upside down"],
)
@pytest.mark.parametrize("guess_rate", [None, 0.5])
def test_answers_without_a_maximum_of_the_likelihood(n_yes, guess_rate) -> None:
    n_trials = [20] * 5
    threshold = fitted(n_yes, n_trials, guess_rate=guess_rate).ln_threshold
    assert np.log(0.1) - 3 < threshold.ci_low < threshold.ci_high < np.log(10.0) + 3


@pytest.mark.parametrize(("n_yes", "n_trials"), [([1], [1]), ([0], [1]), ([0], [0])])
def test_one_trial_or_none_says_next_to_nothing(n_yes, n_trials) -> None:
    fit = fitted(n_yes, n_trials, rates=[1.0])
    assert fit.ln_threshold.ci_high - fit.ln_threshold.ci_low > 1


def test_rates_over_twelve_decades() -> None:
    rates = np.geomspace(1e-6, 1e6, 5)
    assert yes_probability(1e6, PsychometricFunction(1e-6, 0.2)) == 1.0
    observer = PsychometricFunction(1.0, 1.5, 0.1, 0.02)
    fit = fitted([2, 2, 15, 20, 20], [20] * 5, rates=rates)
    assert rates[1] < math.exp(fit.ln_threshold.mean) < rates[3]
    probability = yes_probability(rates, observer)
    assert ((probability >= 0.1) & (probability <= 0.98)).all()
    np.testing.assert_allclose(rate_at(probability[2], observer), 1.0, rtol=1e-12)


@pytest.mark.parametrize("trials", [10**4, 10**6, 10**9, 10**12])
def test_answers_by_the_million_are_found_between_the_nodes(trials) -> None:
    truth = PsychometricFunction(0.8, 1.2, 0.05, 0.02)
    n_yes = np.round(trials * yes_probability(RATES, truth)).astype(np.int64)
    fit = fitted(n_yes, [trials] * 5)
    for found, true in (
        (fit.ln_threshold, math.log(0.8)),
        (fit.ln_width, math.log(1.2)),
        (fit.guess_rate, 0.05),
        (fit.lapse_rate, 0.02),
    ):
        assert abs(found.mean - true) < 2 * found.sd
    # The information of N trials grows with N: the spread is about that of 10^4 trials by the root of it.
    assert 0.005 < fit.ln_threshold.sd * math.sqrt(trials / 10**4) < 0.02


def test_the_published_quartic_far_outside_its_data() -> None:
    def naive(luminance: float) -> float:
        with np.errstate(under="ignore"):
            return float(np.exp(np.polyval(QUARTIC, luminance)))

    darkest, brightest = 8.8, 104.4  # cd/m^2, of what was measured
    relative = naive(darkest) / darkest
    ours = load_rate_limit("surace2025")
    luminance = np.array([1e-6, 1.0, darkest, brightest, 120.0, 150.0, 1e4])
    rate = rate_limit_at(ours, luminance)
    np.testing.assert_allclose(rate[:3] / luminance[:3], relative, rtol=1e-5)
    np.testing.assert_allclose(rate[3:], naive(brightest), rtol=1e-5)
    assert rate_limit_at(ours, [0.0, np.inf, 1e308]).tolist() == [0.0, rate[3], rate[3]]
    inside = np.linspace(darkest, brightest, 9)
    np.testing.assert_allclose(rate_limit_at(ours, inside), [naive(L) for L in inside], rtol=1e-5)


@pytest.mark.parametrize(
    "luminance",
    [(8.8, 14.1, 18.3, 23.4, 43.5, 63.6, 83.9, 104.4), (9000.0, 9250.0, 9500.0, 9750.0, 10000.0)],
)
def test_coefficients_survive_six_digits(luminance) -> None:
    L = np.array(luminance)
    rate = 0.03 * L
    fit = fit_points(L, rate, DISPLAY).limit
    assert fit.condition_number is not None
    assert fit.condition_number < 5
    printed_limit = RateLimit(
        "r", "d", "", fit.form, tuple(float(f"{c:.6g}") for c in fit.coefficients), fit.luminance_range
    )
    ours = np.abs(rate_limit_at(printed_limit, L) / rate_limit_at(fit, L) - 1).max()
    assert ours < 1e-5
    np.testing.assert_allclose(scalar_rate_limit(fit)(float(L[2])), rate_limit_at(fit, L[2]), rtol=1e-12)


@pytest.mark.parametrize("form", [RateLimitForm.LN_RATE, RateLimitForm.RATE])
def test_luminances_that_do_not_tell_a_quartic_are_refused(form) -> None:
    crowded = [1e-6, 1e-3, 1.0, 1e2, 1e3, 1e6]
    with pytest.raises(InputError, match=r"condition number .*; choose the form log_log, a lower degree"):
        basis_for(crowded, RateLimitOptions(form))
    rates, over_logs = 0.03 * np.array(crowded), RateLimitOptions(RateLimitForm.LOG_LOG)
    limit = fit_points(crowded, rates, DISPLAY, over_logs).limit
    np.testing.assert_allclose(rate_limit_at(limit, crowded), rates, rtol=1e-10)


def test_a_quartic_over_ten_decades_of_luminance() -> None:
    luminance = np.geomspace(1e-4, 1e4, 9)
    fit = fit_points(luminance, 0.03 * luminance, DISPLAY, RateLimitOptions(RateLimitForm.LOG_LOG))
    assert fit.limit.condition_number is not None
    assert fit.limit.condition_number < 5
    np.testing.assert_allclose(rate_limit_at(fit.limit, luminance), 0.03 * luminance, rtol=1e-10)
