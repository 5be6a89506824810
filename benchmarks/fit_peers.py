"""Other ways to fit a psychometric function: maximum likelihood, logistic regression, psignifit."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy import optimize, special, stats

from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    MAX_GUESS,
    MAX_LAPSE,
    WIDTH_PRIOR,
    lapse_prior,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.data_schema.arrays import Array
from evenlight.method.psychometric import (
    THRESHOLD_PROBABILITY,
    WIDTH_LOGITS,
    PsychometricFunction,
    log_likelihood,
    threshold_logit,
)

WIDEST = 12.0  # of ln(rate), for psignifit's grid


def most_likely_ln_threshold(counts: RampCounts) -> float:
    """Return ln(threshold) of greatest likelihood, four parameters within bounds (SciPy's L-BFGS-B)."""
    x = np.log(counts.rates)

    def cost(p: Array) -> float:
        function = PsychometricFunction(math.exp(p[0]), math.exp(p[1]), p[2], p[3])
        catch = stats.binom.logpmf(counts.catch_yes, counts.catch_trials, p[2])
        return -log_likelihood(function, counts.rates, counts.n_yes, counts.n_trials) - float(catch)

    bounds = [(x[0] - 2, x[-1] + 2), (math.log(0.1), math.log(WIDEST)), (1e-6, MAX_GUESS), (1e-6, MAX_LAPSE)]
    start = np.array([float(x.mean()), math.log(1.6), 0.05, 0.02])
    return float(optimize.minimize(cost, start, method="L-BFGS-B", bounds=bounds).x[0])


def regression_ln_threshold(counts: RampCounts) -> float:
    """Return ln(rate) at 75 % by logistic regression of two parameters, as in the paper (statsmodels)."""
    import statsmodels.api as sm

    answers = np.column_stack([counts.n_yes, counts.n_trials - counts.n_yes])
    design = sm.add_constant(np.log(counts.rates))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of separated answers; the point is what it gives
        constant, slope = sm.GLM(answers, design, family=sm.families.Binomial()).fit().params
    return float((special.logit(THRESHOLD_PROBABILITY) - constant) / slope)


def psignifit_ln_threshold(counts: RampCounts) -> float:
    """Return the posterior mean of ln(threshold) by psignifit, made to use our priors and our 75 %.

    Only for a guess rate that the task fixes. See tests/analysis/test_psignifit_agrees.py for what is alike.

    Raises
    ------
    ImportError
        Where psignifit is not installed.
    """
    import psignifit

    guess = counts.guess_rate or 0.0
    a, b = lapse_prior(guess)
    x = np.log(counts.rates)
    options: dict[str, Any] = {
        "sigmoid": "logistic",
        "experiment_type": "2AFC",
        "fixed_parameters": {"eta": 1e-8},
        "priors": {
            "lambda": lambda lapse: stats.beta.pdf(lapse, a, b),
            "width": lambda width: stats.lognorm.pdf(width, WIDTH_PRIOR[1], scale=WIDTH_PRIOR[0]),
            "threshold": np.ones_like,
        },
        "bounds": {"width": (0.1, WIDEST), "lambda": (0.0, MAX_LAPSE), "threshold": (x[0] - 1, x[-1] + 1)},
    }
    data = np.column_stack([x, counts.n_yes, counts.n_trials]).astype(float)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of small data sets
        result = psignifit.psignifit(data, debug=True, **options)
    nodes, masses = result.parameter_values, result.debug["posteriors"][0, 0]
    _, threshold, width = np.meshgrid(nodes["lambda"], nodes["threshold"], nodes["width"], indexing="ij")
    at_75_percent = threshold + width * threshold_logit(guess) / WIDTH_LOGITS
    return float(np.sum(masses * at_75_percent) / masses.sum())
