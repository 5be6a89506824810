"""The summary of a calibration for programs, `fit_summary.json`: what the rate limit rests on."""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import Any

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.joint.joint_fit import JointFit
from evenlight.analysis.calibration.level_estimates import difference_in_words, level_mapping, mean_ratios
from evenlight.analysis.calibration.rate_limit.conditions import Condition, ConditionEffect
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.method.rate_limit import rate_limit_at

COMPARED_AT = 201  # luminances at which two curves are compared


def summary_of(calibration: Calibration, provenance: Provenance) -> dict[str, Any]:
    """Return the content of `fit_summary.json`."""
    curve, roll = calibration.rate_limit, calibration.data.roll
    return {
        "simulated": calibration.data.simulated,
        "n_participants": len(calibration.data.participant_ids),
        "n_trials": len(calibration.data.trials),
        "n_thresholds": len(calibration.thresholds),
        "n_thresholds_used": len(curve.used),
        "excluded_participants": calibration.excluded_participants,
        "flags": Counter(flag for fit in calibration.thresholds if (flag := fit.threshold.flag.value)),
        "participant_sd_ln": curve.participant_sd,
        "residual_sd_ln": curve.residual_sd,
        "model": calibration.models.chosen.value,
        "form": curve.limit.form.value,
        "degree": len(curve.limit.coefficients) - 1,
        "residual_df": curve.residual_df,
        "condition_number": curve.limit.condition_number,
        "monotone": curve.monotone,
        "falling_cd_m2": [list(stretch) for stretch in curve.falling],
        "models": _models(calibration),
        "joint": None if calibration.models.joint is None else _joint(calibration.models.joint),
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
        "warnings": [*calibration.warnings, *(roll.warnings if roll else ())],
        "roll": mapping_from_record(roll) if roll else None,
        "provenance": mapping_from_record(provenance),
    }


def _ratio(limit: RateLimit, chosen: RateLimit) -> Array | None:
    """Return a limit as a multiple of the chosen one over the luminances of both; None where one is 0."""
    low = max(limit.luminance_range[0], chosen.luminance_range[0])
    high = min(limit.luminance_range[1], chosen.luminance_range[1])
    luminance = np.linspace(low, high, COMPARED_AT)
    rates, own = rate_limit_at(limit, luminance), rate_limit_at(chosen, luminance)
    if min(rates.min(), own.min()) <= 0:  # a polynomial of the rate can fall so far: no ratio
        return None
    return rates / own


def _models(calibration: Calibration) -> dict[str, Any]:
    """Return the curve of each model as an entry, and why some are missing."""
    models = calibration.models
    entries: dict[str, Any] = {}
    for model, fit in models.fits.items():
        limit, ratio = fit.limit, _ratio(fit.limit, models.fit.limit)
        entries[model.value] = {
            "form": limit.form.value,
            "degree": len(limit.coefficients) - 1,
            "coefficients": list(limit.coefficients),
            "luminance_range_cd_m2": list(limit.luminance_range),
            "falling_cd_m2": [list(stretch) for stretch in fit.falling],
            "band_kind": limit.band_kind.value if limit.band_luminance else None,
            "widest_band_cd_m2_s": list(limit.widest_band[1:]) if limit.widest_band else None,
            "ratio_to_chosen_mean": None if ratio is None else float(np.exp(np.mean(np.log(ratio)))),
            "ratio_to_chosen_min": None if ratio is None else float(ratio.min()),
            "ratio_to_chosen_max": None if ratio is None else float(ratio.max()),
        }
    return {**entries, "missing": {model.value: why for model, why in models.missing.items()}}


def _joint(joint: JointFit) -> dict[str, Any]:
    """Return what the joint model tells beyond its curve."""
    return {
        "n_trials": joint.n_trials,
        "participant_sd_ln": dataclasses.asdict(joint.participant_sd),
        "level_sd_ln": dataclasses.asdict(joint.level_sd),
        "width": joint.width,
        "lapse_rate": joint.lapse_rate,
        "participants": [dataclasses.asdict(person) for person in joint.participants],
        "shapes": [{**dataclasses.asdict(shape), "form": shape.form.value} for shape in joint.shapes],
        "left_out": list(joint.left_out),
        "band_luminance_cd_m2": joint.band_luminance.tolist(),
        "pointwise_lower_cd_m2_s": joint.pointwise_lower.tolist(),
        "pointwise_upper_cd_m2_s": joint.pointwise_upper.tolist(),
    }


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
