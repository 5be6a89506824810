"""Draws from the joint model's posterior, of curve and people together, as ArviZ's InferenceData.

A node of spreads is drawn by its weight, a curve from the node's normal posterior, and then, exactly as on
the grid, each participant's deviation, width, guess and lapse rate at that curve. The draws are independent.
The log-likelihood of a participant's answers at a level has the level's own scatter summed over; in predicted
answers of the same people to the same ramps it is drawn anew.
"""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import numpy as np
from scipy import special

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.calibration_sections import group_of
from evenlight.analysis.calibration.joint.joint_fit import drawn_curves
from evenlight.analysis.calibration.joint.marginal_likelihood import (
    FINER,
    GUESS_NODES,
    LAPSE_NODES,
    WIDTHS,
    ln_odds,
    smoothed,
    within_beta_nodes,
)
from evenlight.analysis.calibration.joint.population_curve import (
    DEVIATIONS,
    LEVEL_SDS,
    SPREAD_RATIO,
    PopulationCurve,
)
from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    MAX_GUESS,
    MAX_LAPSE,
    guess_prior,
    lapse_prior,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now

DRAWS = 1000  # the Monte Carlo error of a mean is 3 % of the posterior's standard deviation
APPROXIMATE = (
    "The curve is normal at each node of the spreads; ln_density_ratio is ln of the exact over that density. "
    "Mean and spread of ln(width) over people are held at their mode. Within a step of its grid a value is "
    "drawn evenly, a guess or lapse rate as its prior."
)
OF_DRAWS = "coefficients", "f", "cells", "ln_ratio"
SPREADS = "participant_sd", "level_sd", "deviation_sd"
RATE = "cd/m^2/s"
# Of the posterior: dimensions beside the draws, unit, meaning
VARIABLES = {
    "rate_limit": (["luminance"], RATE, "threshold of the median participant, for the limit's ramps"),
    "threshold": (["level"], RATE, "threshold of the median participant at a level"),
    "participant_factor": (["participant"], "1", "a participant's thresholds as a multiple of the curve"),
    "width": (["participant"], "1", "ln(rate) between 5 % and 95 % of the psychometric function's rise"),
    "guess_rate": (["participant"], "1", "psychometric function without a ramp"),
    "lapse_rate": (["participant"], "1", "1 minus the psychometric function of the fastest ramps"),
    "participant_sd": ([], "1", "standard deviation of ln(threshold) between participants"),
    "level_sd": ([], "1", "standard deviation of a participant's levels about their own curve"),
    "deviation_sd": ([], "1", "size of the curve's deviation from a power law, in ln(threshold)"),
}


def arviz() -> Any:
    """Return ArviZ, or refuse where it is not installed."""
    if importlib.util.find_spec("arviz") is None:
        raise InputError("checks of the joint model need an extra: pip install 'evenlight[bayes]'")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # what its version 1 will be
        import arviz as found
    return found


def inference_data(calibration: Calibration, size: int = DRAWS, seed: int = 1) -> Any:
    """Return so many independent draws from the posterior of the joint model, as ArviZ's InferenceData.

    Raises
    ------
    InputError
        If ArviZ is not installed, or there is no joint model.
    """
    az, joint, rng = arviz(), calibration.models.joint, np.random.default_rng(seed)
    if joint is None:
        raise InputError(
            f"there is no joint model to check: {', '.join(calibration.models.missing.values())}"
        )
    population, tables = joint.population, joint.population.tables
    drawn = _drawn(population, size, rng)
    found = drawn | {
        "rate_limit": np.exp(drawn_curves(population, drawn["coefficients"], joint.band_luminance)),
        "threshold": np.exp(drawn["f"]) * tables.luminance,
        "participant_factor": np.exp(drawn["u"]),
    }
    counts = np.zeros((2, len(tables.participants), len(tables.levels)), dtype=np.int64)
    for (c, p), answers in tables.cells.items():
        counts[:, p, c] = np.sum([(own.n_yes.sum(), own.n_trials.sum()) for own, _ in answers], axis=0)
    of_cell = ["participant", "level"]
    data = az.from_dict(
        posterior={name: found[name][None] for name in VARIABLES},
        posterior_predictive={"n_success": _answers(population, drawn, rng)[None]},
        log_likelihood={"n_success": drawn["cells"].transpose(0, 2, 1)[None]},
        sample_stats={"ln_density_ratio": drawn["ln_ratio"][None]},
        observed_data={"n_success": counts[0]},
        constant_data={"n_trials": counts[1], "level_luminance": tables.luminance},
        coords={
            "luminance": joint.band_luminance,
            "participant": list(tables.participants),
            "level": [group_of(level) for level in tables.levels],
        },
        dims={name: dims for name, (dims, *_) in VARIABLES.items()}
        | {"n_success": of_cell, "n_trials": of_cell, "level_luminance": ["level"]},
    )
    made_by = provenance_now()
    versions = {"evenlight": made_by.software_version, **made_by.versions, "arviz": az.__version__}
    attrs = {"simulated": str(calibration.data.simulated).lower(), "approximate": APPROXIMATE, "seed": seed}
    for group in data.groups():
        data[group].attrs = attrs | {f"{name}_version": own for name, own in versions.items()}
    for name, (_, unit, meaning) in VARIABLES.items():
        data.posterior[name].attrs = {"units": unit, "long_name": meaning}
    data.posterior.luminance.attrs["units"] = data.constant_data.level_luminance.attrs["units"] = "cd/m^2"
    return data


def _drawn(population: PopulationCurve, size: int, rng: np.random.Generator) -> dict[str, Array]:
    """Return draws in an order by chance, each of shape (N, ...), by name."""
    tables, design = population.tables, population.prior.design
    of_nodes = rng.multinomial(size, population.weights).tolist()
    smooth = {sd: smoothed(tables, sd) for sd in {node.spread.level_sd for node in population.nodes}}
    drawn = []
    for node, n in zip(population.nodes, of_nodes, strict=True):
        own, seen = node.precision - np.diag(population.prior.precision(node.deviation)), node.evaluation
        spreads = node.spread.participant_sd, node.spread.level_sd, node.deviation
        for coefficients in node.draws(n, rng):
            f, move = design @ coefficients - np.log(tables.luminance), coefficients - node.at
            u, places, cells, value = smooth[node.spread.level_sd].drawn(f, node.spread, rng)
            approximate = seen.value + design.T @ seen.gradient @ move - 0.5 * move @ own @ move
            at = np.arange(u.size), places
            people = u, tables.ln_width[at], tables.guess_rate[at], tables.lapse_rate[at]
            drawn.append((coefficients, f, cells, value - approximate, *spreads, *people))
    order = rng.permutation(size)
    columns = (np.array(column)[order] for column in zip(*drawn, strict=True))
    arrays = dict(zip((*OF_DRAWS, *SPREADS, "u", "width", "guess_rate", "lapse_rate"), columns, strict=True))
    within = rng.uniform(-0.5, 0.5, (2, *arrays["u"].shape))
    arrays["u"] += tables.step / FINER * within[0]
    arrays["width"] = np.exp(arrays["width"] + np.log(WIDTHS[1] / WIDTHS[0]) * within[1])
    for p, counts in {p: own[0][0] for (_, p), own in tables.cells.items()}.items():
        lapse, prior = arrays["lapse_rate"][:, p], lapse_prior(counts.guess_rate)
        lapse[:] = within_beta_nodes(lapse, prior, MAX_LAPSE, LAPSE_NODES, rng)
        if counts.guess_rate is None:
            guess, prior = arrays["guess_rate"][:, p], guess_prior(counts.catch_yes, counts.catch_trials)
            guess[:] = within_beta_nodes(guess, prior, MAX_GUESS, GUESS_NODES, rng)
    ratios = SPREAD_RATIO, LEVEL_SDS[1] / LEVEL_SDS[0], DEVIATIONS[1] / DEVIATIONS[0]
    for name, ratio in zip(SPREADS, ratios, strict=True):
        arrays[name] *= ratio ** rng.triangular(-1, 0, 1, size)  # as their intervals interpolate
    return arrays


def _answers(population: PopulationCurve, drawn: dict[str, Array], rng: np.random.Generator) -> Array:
    """Return the successes of the same people in another run, (N, participants, levels)."""
    scatter = drawn["level_sd"][:, None, None] * rng.standard_normal(drawn["cells"].shape)
    made = np.zeros(scatter.transpose(0, 2, 1).shape)
    for (c, p), answers in population.tables.cells.items():
        threshold = (drawn["f"][:, c] + drawn["u"][:, p] + scatter[:, c, p])[:, None]
        width, guess, lapse = (drawn[name][:, p, None] for name in ("width", "guess_rate", "lapse_rate"))
        for counts, x in answers:
            share = special.expit(ln_odds(x - threshold, np.log(width), guess, population.tables.sigmoid))
            for _, n, low, missed in counts.parts(guess, lapse):
                made[:, p, c] += rng.binomial(n, low + (1 - low - missed) * share).sum(axis=1)
    return made
