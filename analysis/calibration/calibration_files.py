"""The files of a calibration: thresholds, rate limit, `fit_summary.json` and the two figures."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.level_estimates import difference_in_words, level_mapping, mean_ratios
from evenlight.analysis.calibration.psychometric.psychometric_figure import psychometric_figure
from evenlight.analysis.calibration.psychometric.thresholds import ThresholdFit
from evenlight.analysis.calibration.rate_limit.conditions import Condition, ConditionEffect, condition_of
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import rate_limit_figure
from evenlight.analysis.figure_style import PAGE, Medium, write_png
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json, write_json_record
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at

COMPARED_AT = 201  # luminances at which two curves are compared


def write_calibration(calibration: Calibration, folder: Path, provenance: Provenance) -> None:
    """Write `thresholds.csv`, `rate_limit.json` and `fit_summary.json`."""
    write_rows(folder / "thresholds.csv", Threshold, [fit.threshold for fit in calibration.thresholds])
    participants = len(calibration.data.participant_ids)
    kind = "simulated participants" if calibration.data.simulated else "participants"
    fitted = calibration.rate_limit.limit
    limit = dataclasses.replace(
        fitted,
        simulated=calibration.data.simulated,
        source=f"ramp calibration with {participants} {kind}: {fitted.task_in_words}",
        provenance=provenance,
    )
    write_json_record(folder / "rate_limit.json", limit)
    write_json(folder / "fit_summary.json", summary_of(calibration, provenance))


def summary_of(calibration: Calibration, provenance: Provenance) -> dict[str, Any]:
    """Return the content of `fit_summary.json`."""
    curve = calibration.rate_limit
    return {
        "simulated": calibration.data.simulated,
        "n_participants": len(calibration.data.participant_ids),
        "n_trials": len(calibration.data.trials),
        "n_thresholds": len(calibration.thresholds),
        "n_thresholds_used": len(curve.used),
        "excluded_participants": calibration.excluded_participants,
        "flags": _flag_counts(calibration.thresholds),
        "participant_sd_ln": curve.participant_sd,
        "residual_sd_ln": curve.residual_sd,
        "form": curve.limit.form.value,
        "degree": len(curve.limit.coefficients) - 1,
        "residual_df": curve.residual_df,
        "condition_number": curve.limit.condition_number,
        "monotone": curve.monotone,
        "falling_cd_m2": [list(stretch) for stretch in curve.falling],
        "pooled": pooled_comparison(calibration),
        "levels": [level_mapping(level) for level in calibration.levels],
        "levels_in_words": difference_in_words(calibration.levels),
        "pooled_ratio_mean": mean_ratios(calibration.levels)[0],
        "mean_of_fits_ratio_mean": mean_ratios(calibration.levels)[1],
        "reference": None if curve.reference is None else _condition(curve.reference),
        "condition_effects": [_effect(effect) for effect in curve.effects],
        "procedure": calibration.procedure.value,
        "participants": {who: mapping_from_record(p) for who, p in calibration.participants.items()},
        "criteria": {who: mapping_from_record(c) for who, c in calibration.criteria.items()},
        "interval_biases": {who: mapping_from_record(b) for who, b in calibration.interval_biases.items()},
        "warnings": list(calibration.warnings),
        "provenance": mapping_from_record(provenance),
    }


def pooled_comparison(calibration: Calibration) -> dict[str, Any] | None:
    """Return how far the pooled curve lies from the population's, as ratios; None if one is missing or 0."""
    pooled = calibration.pooled
    if pooled is None:
        return None
    ours, theirs = calibration.rate_limit.limit, pooled.curve.limit
    low = max(ours.luminance_range[0], theirs.luminance_range[0])
    high = min(ours.luminance_range[1], theirs.luminance_range[1])
    luminance = np.linspace(low, high, COMPARED_AT)
    pooled_rate, own_rate = rate_limit_at(theirs, luminance), rate_limit_at(ours, luminance)
    if min(pooled_rate.min(), own_rate.min()) <= 0:  # a polynomial of the rate can fall so far: no ratio
        return None
    ratio = pooled_rate / own_rate
    mean = float(np.exp(np.mean(np.log(ratio))))
    return {
        "luminance_cd_m2": pooled.luminance.tolist(),
        "threshold_cd_m2_s": pooled.threshold.tolist(),
        "coefficients": list(theirs.coefficients),
        "monotone": pooled.curve.monotone,
        "levels_left_out": pooled.left_out,
        "ratio_to_population_mean": mean,
        "ratio_to_population_min": float(ratio.min()),
        "ratio_to_population_max": float(ratio.max()),
        "in_words": f"the pooled curve lies {abs(mean - 1):.1%} {'above' if mean > 1 else 'below'} the "
        "population's on average, in which each participant has a threshold of their own",
    }


def _flag_counts(thresholds: tuple[ThresholdFit, ...]) -> dict[str, int]:
    """Return how many thresholds carry each flag."""
    counts: dict[str, int] = {}
    for fit in thresholds:
        if fit.threshold.flag.value:
            counts[fit.threshold.flag.value] = counts.get(fit.threshold.flag.value, 0) + 1
    return counts


def _condition(condition: Condition) -> dict[str, Any]:
    """Return a condition as an entry."""
    return {"direction": condition.direction.value, "ramp_duration_s": condition.ramp_duration}


def _effect(effect: ConditionEffect) -> dict[str, Any]:
    """Return the effect of a condition as an entry."""
    return {
        **_condition(effect.condition),
        "ratio": effect.ratio,
        "ci_low": effect.ci_low,
        "ci_high": effect.ci_high,
        "ratio_of_equal_amounts": effect.ratio_of_equal_amounts,
        "in_words": effect.in_words,
    }


def write_figures(
    calibration: Calibration, folder: Path, compared: RateLimit | None = None, medium: Medium = PAGE
) -> tuple[str, ...]:
    """Write `psychometric.png` and `rate_limit.png`, and return their names.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    folder : Path
        Where to.
    compared : RateLimit, optional
        Another rate limit, drawn beside it.
    medium : Medium
        Where they are shown.
    """
    figures = calibration_figures(calibration, compared, medium)
    for name, figure in figures.items():
        write_png(folder / name, figure)
    return tuple(figures)


def calibration_figures(
    calibration: Calibration, compared: RateLimit | None = None, medium: Medium = PAGE
) -> dict[str, Figure]:
    """Return the two figures by the names of their files."""
    simulated = calibration.data.simulated
    limit = dataclasses.replace(calibration.rate_limit.limit, simulated=simulated)
    return {
        "psychometric.png": psychometric_figure(calibration.thresholds, simulated, medium),
        "rate_limit.png": rate_limit_figure(limit, drawn_thresholds(calibration), compared, medium),
    }


def drawn_thresholds(calibration: Calibration) -> list[Threshold]:
    """Return the thresholds of the condition that the limit is for; others lie off it by their effect."""
    reference = calibration.rate_limit.reference
    thresholds = (fit.threshold for fit in calibration.thresholds)
    return [t for t in thresholds if reference in (None, condition_of(t))]
