"""Whether the joint model fits, and how much its priors matter: predicted answers, other priors, tilts.

Tilts: a participant's ln(threshold) may rise by more or less with ln L than the curve. The score of a tilt
over its information, the participant's factor taken out, is its estimate to first order; that all are alike
is tested by F: their weighted squares over those of the levels. The model takes tilts for scatter of levels.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from evenlight.analysis import figure_style as style
from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.calibration_sections import group_of, level_words
from evenlight.analysis.calibration.inference_data import arviz, inference_data
from evenlight.analysis.calibration.joint.joint_fit import (
    CURVES_DRAWN,
    LEAST_INFORMATION,
    SEED,
    JointFit,
    drawn_curves,
    simultaneous_band,
)
from evenlight.analysis.calibration.joint.population_curve import PopulationCurve, PriorScales
from evenlight.analysis.report import Picture, Section, Table, probability
from evenlight.analysis.report_prose import prose, section
from evenlight.data_schema.arrays import Array, Mask
from evenlight.data_schema.rate_limit import Sigmoid
from evenlight.data_schema.recordings.ramp import Procedure

DRAWS_COMPARED = 500  # of each other sigmoid
UNRELIABLE_K = 0.7  # Vehtari et al. (2024), J. Mach. Learn. Res. 25(72)
LEAST_SCATTER = 0.1  # of levels, over what the model expects
POOR_FIT = 0.05  # over the number of people and levels that are judged
COLUMNS, PANEL = 5, 9.0  # of the figure; height of a panel [em]
OF_SPREADS = {  # whose scales are in ln units
    "participant_sd": "σ_u, between participants",
    "level_sd": "τ, of levels",
    "deviation": "deviation from a power law",
}
PRIORS = OF_SPREADS | {"width": "ln(width): mean and spread", "lapse": "mean lapse rate"}


class Predicted(NamedTuple):
    """Shares of successes beside those predicted, (participants, levels); nan where nothing was shown."""

    share: Array
    low: Array  # ends of the 95 % predictive interval
    high: Array
    outside: Mask  # of the interval
    p_values: dict[str, float]  # of participants, then of levels


def predicted_shares(data: Any) -> Predicted:
    """Return how the answers compare with those predicted, from an InferenceData.

    The p-value of a participant or level is the share of predictions whose squared deviations from the mean
    prediction, each over its variance, add up to at least those of the answers.
    """
    n = np.where(data.constant_data.n_trials > 0, data.constant_data.n_trials, np.nan)
    made, share = data.posterior_predictive.n_success.values[0] / n, data.observed_data.n_success.values / n
    variance = np.maximum(made.var(axis=0), n**-3)
    own, simulated = ((values - made.mean(axis=0)) ** 2 / variance for values in (share, made))
    p_values: dict[str, float] = {}
    for axis, of in ((1, "participant"), (0, "level")):
        as_far = np.nansum(simulated, axis=axis + 1) >= np.nansum(own, axis=axis)
        p_values |= dict(zip(data.posterior[of].values.tolist(), as_far.mean(axis=0).tolist(), strict=True))
    low, high = np.quantile(made, [0.025, 0.975], axis=0)
    return Predicted(share, low, high, (share < low) | (share > high), p_values)


def tilts(population: PopulationCurve) -> tuple[dict[str, tuple[float, float]], float]:
    """Return each participant's tilt with its standard error, and the p-value of no differences between them.

    A tilt of 0.1 is thresholds that rise as L^0.1 beside the curve. Who saw one luminance has none.
    Errors and test rest on the scatter of levels about the tilted curves: in τ that of the tilts is, too.
    """
    seen, x = population.central.evaluation, np.log(population.tables.luminance)[:, None]
    weight = np.maximum(seen.cell_information, 1e-9)
    off = x - np.average(np.broadcast_to(x, weight.shape), axis=0, weights=weight)
    information = (weight * off**2).sum(axis=0)
    known = information > 1.0  # a standard error below 1
    if known.sum() < 2:
        return {}, 1.0
    weight, off, residual = weight[:, known], off[:, known], (seen.slope / weight)[:, known]
    residual = residual - np.average(residual, axis=0, weights=weight)
    tilt, information = (weight * off * residual).sum(axis=0) / information[known], information[known]
    free = int((weight > LEAST_INFORMATION).sum()) - 2 * tilt.size
    left = (weight * (residual - tilt * off) ** 2).sum() / free if free > 0 else 1.0
    scale = max(float(left), LEAST_SCATTER)
    f = information @ (tilt - np.average(tilt, weights=information)) ** 2 / (tilt.size - 1) / scale
    names = np.array(population.tables.participants)[known].tolist()
    errors = np.sqrt(scale / information).tolist()
    found = dict(zip(names, zip(tilt.tolist(), errors, strict=True), strict=True))
    return found, float(stats.f.sf(f, tilt.size - 1, max(free, 1)))


def other_priors(joint: JointFit) -> Iterator[tuple[str, float, float, float]]:
    """Yield each prior's name, the factor of its scale, and the share by which curve and band's width change.

    The curve's change is that where it is largest; of the width of the simultaneous band in ln(rate) the mean
    counts. Priors of spreads weigh the nodes; the others are fitted anew.
    """
    first, width = _curve_and_width(joint.population, joint)
    for own in fields(PriorScales):
        for factor in (0.5, 2.0):
            scales = PriorScales(**{own.name: factor * getattr(PriorScales(), own.name)})
            if own.name in OF_SPREADS:
                other = joint.population.reweighed(scales)
            else:
                other = joint.refit(joint.options, scales)
            curve, own_width = _curve_and_width(other, joint)
            most = max(curve - first, key=abs)
            yield own.name, factor, float(np.expm1(most)), own_width / width - 1


def _curve_and_width(population: PopulationCurve, joint: JointFit) -> tuple[Array, float]:
    """Return ln(rate) of the mean curve, and the simultaneous band's mean width."""
    mean = population.weights @ np.array([node.mean for node in population.nodes])
    coefficients = population.draws(CURVES_DRAWN, np.random.default_rng(SEED))
    curves = drawn_curves(population, np.vstack([mean, coefficients]), joint.band_luminance)
    lower, upper = simultaneous_band(curves[1:], joint.options.band_level)
    return curves[0], float(np.mean(upper - lower))


def sigmoid_scores(calibration: Calibration, data: Any) -> list[tuple[str, float, float, int, float]]:
    """Return how well each sigmoid predicts a participant's answers at a level from all others, best first.

    By Pareto-smoothed importance sampling of draws (PSIS-LOO, Vehtari et al. 2017, Stat. Comput. 27, 1413):
    the score less the best one's, the standard error of that, cells with a Pareto k above 0.7, and the share
    by which the curve changes where it does most, 0 for the sigmoid that was fitted.
    """
    joint, loos, moved = calibration.models.joint, {}, {}
    assert joint is not None  # there are draws from it
    first, shown = _curve_and_width(joint.population, joint)[0], data.constant_data.n_trials.values > 0
    for sigmoid in Sigmoid:
        other, own = joint.population, data
        if sigmoid is not joint.options.sigmoid:
            other = joint.refit(replace(joint.options, sigmoid=sigmoid))
            models = replace(calibration.models, joint=replace(joint, population=other))
            own = inference_data(replace(calibration, models=models), DRAWS_COMPARED)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of high Pareto k, which are counted
            cells = arviz().from_dict(
                log_likelihood={"cells": own.log_likelihood.n_success.values[..., shown]}
            )
            loos[sigmoid.value] = arviz().loo(cells, pointwise=True, reff=1.0)
        moved[sigmoid.value] = float(np.expm1(max(_curve_and_width(other, joint)[0] - first, key=abs)))
    rows, best = [], max(loos.values(), key=lambda loo: loo.elpd_loo)
    for name, loo in sorted(loos.items(), key=lambda item: -item[1].elpd_loo):
        worse = (loo.loo_i - best.loo_i).values
        bad = int((loo.pareto_k > UNRELIABLE_K).sum())
        rows.append((name, float(worse.sum()), float(worse.std() * worse.size**0.5), bad, moved[name]))
    return rows


def checks_section(calibration: Calibration, data: Any) -> Section:
    """Return the section of the report that says how the model fits; `data` as of `inference_data`."""
    joint = calibration.models.joint
    assert joint is not None  # there are draws from it
    found, (tilted, tilt_p) = predicted_shares(data), tilts(joint.population)
    outside, there, levels = found.outside, np.isfinite(found.share), joint.population.tables.levels
    several = len({(level.direction, level.ramp_duration) for level in levels}) > 1
    named = {group_of(k): f"{level_words(k, several)} ({k.luminance:.4g} cd/m²)" for k in levels}
    p_values = {named.get(name, name): p for name, p in found.p_values.items()}
    counts = [[*of.sum(axis=1), *of.sum(axis=0)] for of in (outside, there)]
    rows = []
    for (name, p), out, cells in zip(p_values.items(), *counts, strict=True):
        tilt, error = tilted.get(name, (np.nan, np.nan))
        words = " to ".join(_signed(tilt + z * error, 2) for z in (-1.96, 1.96))
        own = f"{_signed(tilt, 2)} ({words})" if name in tilted else None
        rows.append((name, f"{out} of {cells}", probability(p), own))
    priors, sigmoids = list(other_priors(joint)), sigmoid_scores(calibration, data)
    by_prior, by_sigmoid = [], []
    for name, factor, limit, band in priors:
        sd = f"{factor * getattr(PriorScales(), name):g}, " if name in OF_SPREADS else ""
        changes = f"{_signed(100 * limit, 1)} %", f"{_signed(100 * band, 0)} %"
        by_prior.append((PRIORS[name], f"{sd}× {factor:g}", *changes))
    for name, score, error, bad, limit in sigmoids:
        change = f"{_signed(100 * limit, 1)} %" if limit else "as fitted"
        by_sigmoid.append((name, f"{score:z.1f}".replace("-", "−"), f"{error:.1f}", bad, change))
    columns = "prior", "scale", "change of limit", "of band's width"
    tables = (
        Table(prose("fit_checks_cells")[0], ("who or where", "outside", "p", "tilt (95 % CI)"), tuple(rows)),
        Table(prose("fit_checks_priors")[0], columns, tuple(by_prior)),
        Table(
            prose("fit_checks_sigmoids")[0],
            ("sigmoid", "predictive score", "standard error", "unreliable", "change of limit"),
            tuple(by_sigmoid),
        ),
    )
    ratio, curves = data.sample_stats.ln_density_ratio.values[0], data.posterior.rate_limit.values[0]
    two = calibration.procedure is Procedure.TWO_INTERVAL
    values = {
        "outside": int(outside.sum()),
        "cells": int(there.sum()),
        "poor": {name: p for name, p in p_values.items() if p < POOR_FIT / len(rows)},
        "p_values": p_values,
        "tilted": bool(tilted),
        "tilt_p": tilt_p,
        "of_priors": [max(abs(limit) for *_, limit, _ in priors), max(abs(band) for *_, band in priors)],
        "sigmoids": sigmoids,
        "k": float(arviz().psislw(ratio)[1]),
        "draws": len(ratio),
        "error": float(np.max(np.log(curves).std(axis=0)) / len(ratio) ** 0.5),
    }
    picture = Picture(_figure(found, data), prose("fit_checks_caption", two=two)[0])
    return section("fit_checks", tables, (picture,), simulated=calibration.data.simulated, **values)


def _signed(value: float, digits: int) -> str:
    return f"{value:+z.{digits}f}".replace("-", "−")


def _figure(found: Predicted, data: Any) -> bytes:
    """Return a panel of each participant: levels from dark to bright, shares and predictive intervals."""
    luminance = data.constant_data.level_luminance.values
    names, order = data.posterior.participant.values.tolist(), np.argsort(luminance)
    at = np.arange(luminance.size)
    columns = min(COLUMNS, len(names))
    grid = [names[k : k + columns] for k in range(0, len(names), columns)]
    grid[-1] += ["."] * (columns - len(grid[-1]))
    about = "bars: 95 % predictive intervals; dots: shares of the answers, red where outside"
    of_axes = {"empty_sentinel": ".", "sharey": True}
    with style.look():
        heights = [PANEL] * len(grid)
        figure, axes = style.panels("Answers and predicted answers", about, grid, heights, 4.2, **of_axes)
        for k, own in enumerate(axes[name] for name in names):
            share, low, high, outside = (of[k, order] for of in found[:4])
            own.vlines(at, low, high, color=style.FAINT, linewidth=4)
            for where, colour in ((~outside, style.OURS), (outside, style.LOST)):
                own.plot(at[where], share[where], "o", color=colour, markersize=3)
            p = probability(found.p_values[names[k]])
            own.set_title(style.drawable(f"{names[k]} (p {p})"), loc="left")
            own.set_xlim(-0.6, at[-1] + 0.6)
            own.yaxis.set_major_formatter(style.PERCENT)
            ticks = sorted({0, at[-1] // 2, at[-1]})
            own.set_xticks(ticks, [style.short(luminance[order[tick]]) for tick in ticks])
        figure.supxlabel("levels, by luminance [cd/m²]", y=0.01, fontsize=style.text_size())
        return style.png_bytes(figure)
