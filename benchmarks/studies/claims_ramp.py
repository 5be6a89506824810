"""Recovery: simulated answers with a known truth, through the fits, back to the truth."""

import numpy as np
import pytest
from scipy import stats

from evenlight.analysis.calibration.psychometric.psychometric_fit import PsychometricFit, fit_psychometric
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, basis_for
from evenlight.analysis.inference.mixed_model import GroupedEstimates, fit_mixed_model
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.experiments.ramp.ramp_observer import draw_observer
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import PsychometricFunction, yes_probability

DESIGN = RampDesign()
LUMINANCE = 100.0  # of the one level [cd/m²]
RATES = LUMINANCE * np.array(DESIGN.relative_rates)
N_CATCH = 120  # of a participant: 20 % of 600 trials
FITS = 400
Recovered = list[tuple[PsychometricFunction, PsychometricFit]]


@pytest.fixture(scope="module")
def recovered() -> Recovered:
    """The population of `evenlight simulate`, one level each."""
    rng = np.random.default_rng(20_250)
    limit = load_rate_limit("surace2025")
    pairs = []
    for _ in range(FITS):
        truth = draw_observer(limit, (LUMINANCE,), rng).function_at(LUMINANCE)
        n = np.full(RATES.size, DESIGN.repetitions)
        yes = rng.binomial(n, yes_probability(RATES, truth))
        catch = int(rng.binomial(N_CATCH, truth.guess_rate))
        pairs.append((truth, fit_psychometric(RampCounts(RATES, yes, n, catch, N_CATCH))))
    return pairs


def coverage_band(level: float, n: int) -> tuple[float, float]:
    """Shares of n intervals in which a true coverage of `level` lies in 999 of 1000 studies."""
    low, high = stats.binom.interval(0.999, n, level)
    return float(low) / n, float(high) / n


def test_the_95_percent_interval_of_the_threshold_covers_the_truth_in_95_percent(
    recovered: Recovered,
) -> None:
    covered = np.mean(
        [
            fit.ln_threshold.ci_low <= np.log(truth.threshold) <= fit.ln_threshold.ci_high
            for truth, fit in recovered
        ]
    )
    low, high = coverage_band(0.95, FITS)  # 0.913 to 0.983
    assert low <= covered <= high


def test_the_threshold_is_off_by_less_than_three_percent_on_average(recovered: Recovered) -> None:
    errors = np.array([fit.ln_threshold.mean - np.log(truth.threshold) for truth, fit in recovered])
    assert abs(errors.mean()) < 0.03
    assert (
        errors.std() < 0.21
    )  # what 48 ramps with constant rates allow: one threshold is known to about 19 %


def test_the_stated_standard_error_is_the_error_that_is_made(recovered: Recovered) -> None:
    errors = np.array([fit.ln_threshold.mean - np.log(truth.threshold) for truth, fit in recovered])
    stated = np.sqrt(np.mean([fit.ln_threshold.sd**2 for _, fit in recovered]))
    assert stated == pytest.approx(errors.std(), rel=0.2)


def test_guess_rates_are_recovered_from_the_participants_catch_trials(recovered: Recovered) -> None:
    errors = np.array([fit.guess_rate.mean - truth.guess_rate for truth, fit in recovered])
    assert abs(errors.mean()) < 0.01
    covered = np.mean(
        [fit.guess_rate.ci_low <= truth.guess_rate <= fit.guess_rate.ci_high for truth, fit in recovered]
    )
    low, high = coverage_band(0.95, FITS)
    assert low <= covered <= high


def test_the_populations_curve_lies_in_its_band_in_95_percent() -> None:
    # 10 participants, 10 levels, quartic truth; the curve is asked at the middle and at both ends.
    rng = np.random.default_rng(7)
    luminance = np.array([4.6, 9.2, 13.9, 18.5, 23.1, 20.9, 41.8, 62.6, 83.5, 104.4])
    design = basis_for(luminance, RateLimitOptions()).design(luminance)
    truth = np.array([0.46, 0.93, -0.53, 0.25, -0.09])  # about the published curve
    asked = design[[0, 6, 9]]
    groups = np.repeat(np.arange(10), 10)
    quantile = stats.t.ppf(0.975, 9)
    inside = []
    for _ in range(120):
        errors = rng.uniform(0.15, 0.3, 100)
        values = np.tile(design @ truth, 10) + 0.25 * rng.standard_normal(10)[groups]
        values += np.hypot(errors, 0.1) * rng.standard_normal(100)
        fit = fit_mixed_model(GroupedEstimates(values, errors, np.tile(design, (10, 1)), groups))
        half = quantile * np.sqrt(np.einsum("ij,jk,ik->i", asked, fit.covariance, asked))
        inside.append(np.abs(asked @ (fit.coefficients - truth)) <= half)
    low, high = coverage_band(0.95, 120)  # 0.875 to 1
    for share in np.mean(inside, axis=0):
        assert low <= share <= high
