"""The psychometric fit against psignifit 4.3 (Schütt et al. 2016), with data and priors alike.

Both integrate the same posterior on a grid, so that means and quantiles may differ by no more than half a
step of the coarser one, psignifit's; it is read off its result. Alike is made what differs by default: no
overdispersion (eta), a guess rate that is fixed, our priors. psignifit's threshold is that of the function
between its asymptotes, and its intervals lie half a step low (they add up whole masses); therefore its
posterior is taken, not its estimates, moved to the point where 75 % of the answers are right or "yes" but for
lapses.
"""

import numpy as np
import psignifit
import pytest
from scipy import stats

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    WIDTH_PRIOR,
    ParameterEstimate,
    fit_psychometric,
    lapse_prior,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.data_schema.arrays import Array
from evenlight.method.psychometric import WIDTH_LOGITS

RATES = np.array([0.8, 1.3, 2.0, 2.8, 4.0, 5.5, 8.0, 12.0])
SUCCESSES = {0.05: [1, 2, 6, 10, 16, 18, 20, 20], 0.5: [11, 9, 12, 15, 18, 20, 19, 20]}  # of 20 each
EXPERIMENT = {0.05: "yes/no", 0.5: "2AFC"}


def psignifit_posterior(counts: RampCounts) -> tuple[dict[str, Array], Array]:
    """Return psignifit's nodes, and its masses (lapse, threshold, width)."""
    a, b = lapse_prior(counts.guess_rate)
    x = np.log(counts.rates)
    result = psignifit.psignifit(
        np.column_stack([x, counts.n_yes, counts.n_trials]).astype(float),
        sigmoid="logistic",
        experiment_type=EXPERIMENT[counts.guess_rate],
        fixed_parameters={"eta": 1e-8, **({"gamma": 0.05} if counts.guess_rate == 0.05 else {})},
        priors={
            "lambda": lambda lapse: stats.beta.pdf(lapse, a, b),
            "width": lambda width: stats.lognorm.pdf(width, WIDTH_PRIOR[1], scale=WIDTH_PRIOR[0]),
            "threshold": np.ones_like,  # flat where the data are, as ours
        },
        bounds={"width": (0.1, 12.0), "lambda": (0.0, 0.2), "threshold": (x[0] - 1, x[-1] + 1)},
        debug=True,
    )
    assert list(result.parameter_values) == ["eta", "gamma", "lambda", "threshold", "width"]
    return result.parameter_values, result.debug["posteriors"][0, 0]


def assert_within_half_a_step(
    ours: ParameterEstimate, values: Array, masses: Array, half_step: float
) -> None:
    mean = float(np.sum(masses * values))
    assert ours.mean == pytest.approx(mean, abs=half_step)
    assert ours.sd == pytest.approx(np.sqrt(np.sum(masses * (values - mean) ** 2)), abs=half_step)
    order = np.argsort(values, axis=None)
    cumulative = np.cumsum(masses.ravel()[order]) - masses.ravel()[order] / 2
    low, high = np.interp([0.025, 0.975], cumulative, values.ravel()[order])
    assert ours.ci_low == pytest.approx(low, abs=half_step)
    assert ours.ci_high == pytest.approx(high, abs=half_step)


@pytest.mark.parametrize("guess_rate", SUCCESSES)
def test_threshold_width_and_lapse_rate_agree_with_psignifit_to_half_a_step_of_its_grid(
    guess_rate: float,
) -> None:
    n = np.full(RATES.size, 20)
    counts = RampCounts(RATES, np.array(SUCCESSES[guess_rate]), n, guess_rate=guess_rate)
    nodes, masses = psignifit_posterior(counts)
    masses = masses / masses.sum()
    lapse, threshold, width = np.meshgrid(nodes["lambda"], nodes["threshold"], nodes["width"], indexing="ij")
    to_75_percent = np.log((0.75 - guess_rate) / 0.25) / WIDTH_LOGITS
    fit = fit_psychometric(counts)
    half = {name: float(np.diff(nodes[name]).max()) / 2 for name in ("lambda", "threshold", "width")}
    assert half["threshold"] < fit.ln_threshold.sd / 4  # the tolerance is narrow beside what is compared
    assert_within_half_a_step(fit.ln_threshold, threshold + width * to_75_percent, masses, half["threshold"])
    assert_within_half_a_step(fit.ln_width, np.log(width), masses, half["width"] / width.min())
    assert_within_half_a_step(fit.lapse_rate, lapse, masses, half["lambda"])
