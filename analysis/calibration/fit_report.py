"""The results of a calibration: thresholds, rate limit, summary, figures, and a report to judge them by."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration, NoRateLimitError, ThresholdFits
from evenlight.analysis.calibration.calibration_sections import lapses_before, shared_luminances
from evenlight.analysis.calibration.inference_data import inference_data
from evenlight.analysis.calibration.joint.joint_fit import JointFit
from evenlight.analysis.calibration.level_estimates import difference_in_words, level_mapping, mean_ratios
from evenlight.analysis.calibration.model_checks import checks_section
from evenlight.analysis.calibration.ramp_findings import findings_without_limit, ramp_findings
from evenlight.analysis.calibration.rate_limit.conditions import Condition, ConditionEffect
from evenlight.analysis.figure_style import write_figure
from evenlight.analysis.report import Report, Section, write_report
from evenlight.analysis.report_sections import files_section, plan_section, provenance_section, roll_section
from evenlight.analysis.results import Analysis
from evenlight.analysis.wording import sentence
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json, write_json_record
from evenlight.data_schema.threshold import Threshold

DRAWS = "joint_draws.nc"
FILES = {
    "thresholds.csv": "thresholds of each participant and level, with credible intervals",
    "rate_limit.json": "the fitted rate limit, for `evenlight optimize --rate-limit`",
    "fit_summary.json": "what the fit rests on, for programs",
    "psychometric.png, rate_limit.png": "the figures of this page",
    DRAWS: "draws from the joint model's posterior, of curve and people, for ArviZ",
}
WITHOUT_LIMIT = {"thresholds.csv": FILES["thresholds.csv"]}
COMPARED_AT = 201  # luminances at which two curves are compared
SCORED = ("form", "degree", "score", "standard_error", "chosen")


def write_fit(calibration: Calibration, folder: Path, origin: Provenance, checks: bool = False) -> Analysis:
    """Write thresholds, rate limit, summary, figures and `report.html`; return what was found.

    `checks`: whether to check the joint model, and write draws from its posterior.
    """
    write_calibration(calibration, folder, origin)
    found = ramp_findings(calibration)
    if checks:
        data = inference_data(calibration)
        data.to_netcdf(str(folder / DRAWS))
        found = dataclasses.replace(found, sections=(*found.sections, checks_section(calibration, data)))
    write_pictures(found, folder)
    files = {name: words for name, words in FILES.items() if checks or name != DRAWS}
    write_report(folder / "report.html", _report(calibration, found, origin, files))
    return found


def write_calibration(calibration: Calibration, folder: Path, provenance: Provenance) -> None:
    """Write `thresholds.csv`, `rate_limit.json` and `fit_summary.json`."""
    write_thresholds(calibration, folder)
    participants = len(calibration.data.participant_ids)
    kind = "simulated participants" if calibration.data.simulated else "participants"
    fitted = calibration.rate_limit.limit
    limit = dataclasses.replace(
        fitted,
        simulated=calibration.data.simulated,
        source=f"ramp calibration with {participants} {kind}: {fitted.task_in_words}",
        provenance=provenance,
        display_fingerprints=calibration.data.display_fingerprints,
    )
    write_json_record(folder / "rate_limit.json", limit)
    write_json(folder / "fit_summary.json", summary_of(calibration, provenance))


def write_without_limit(refused: NoRateLimitError, folder: Path, origin: Provenance) -> None:
    """Write what is left where no rate limit can be had: thresholds, figure of the answers, `report.html`."""
    found = findings_without_limit(refused)
    write_thresholds(refused.fits, folder)
    write_pictures(found, folder)
    write_report(folder / "report.html", _report(refused.fits, found, origin, WITHOUT_LIMIT))


def write_thresholds(fits: ThresholdFits, folder: Path) -> None:
    """Write `thresholds.csv`."""
    write_rows(folder / "thresholds.csv", Threshold, [fit.threshold for fit in fits.thresholds])


def write_pictures(found: Analysis, folder: Path) -> None:
    """Write `psychometric.png`, and `rate_limit.png` if there is one."""
    for drawing in found.drawings:
        write_figure(folder / f"{drawing.name}.png", drawing.figure)


def _report(fits: ThresholdFits, found: Analysis, origin: Provenance, files: dict[str, str]) -> Report:
    data = fits.data
    return Report(
        "Calibration of the rate limit",
        found.lead,
        (
            *plan_section(data.departures),
            *_to_be_looked_at(fits),
            *found.sections,
            *((roll_section(data.roll),) if data.roll else ()),
            provenance_section({"first session": data.sessions[0].manifest.provenance, "fit": origin}),
            files_section(files),
        ),
        key_figures=found.key_figures,
    )


def _to_be_looked_at(fits: ThresholdFits) -> tuple[Section, ...]:
    """Return a section of what to be warned of that no other section says; none if there is nothing."""
    said = set(fits.data.warnings)
    if isinstance(fits, Calibration):
        said |= {*fits.rate_limit.notes, *fits.models.first_notes}
    notes = tuple(f"{sentence(words)}." for words in fits.warnings if words not in said)
    simulated = fits.data.simulated
    return (Section("To be looked at", notes=notes, simulated=simulated),) if notes else ()


def summary_of(calibration: Calibration, provenance: Provenance) -> dict[str, Any]:
    """Return the content of `fit_summary.json`."""
    curve, roll = calibration.rate_limit, calibration.data.roll
    return {
        "departures": list(calibration.data.departures),
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
        "serial_dependence": mapping_from_record(calibration.serial) if calibration.serial else None,
        "lapse_prior": list(lapses_before(calibration)),
        "session_drift": mapping_from_record(calibration.drift) if calibration.drift else None,
        "criteria": {who: mapping_from_record(c) for who, c in calibration.criteria.items()},
        "interval_biases": {who: mapping_from_record(b) for who, b in calibration.interval_biases.items()},
        "warnings": [*calibration.warnings, *(roll.warnings if roll else ())],
        "roll": mapping_from_record(roll) if roll else None,
        "provenance": mapping_from_record(provenance),
    }


def _models(calibration: Calibration) -> dict[str, Any]:
    models = calibration.models
    entries: dict[str, Any] = {}
    for model, fit in models.fits.items():
        limit, luminance = fit.limit, shared_luminances(fit.limit, models.fit.limit, COMPARED_AT)
        rates, own = limit(luminance), models.fit.limit(luminance)
        # A polynomial of the rate can fall to 0: no ratio.
        ratio = rates / own if min(rates.min(), own.min()) > 0 else None
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
    shapes = [{**dataclasses.asdict(shape), "form": shape.form.value} for shape in joint.shapes]
    return {
        "n_trials": joint.n_trials,
        "participant_sd_ln": dataclasses.asdict(joint.participant_sd),
        "level_sd_ln": dataclasses.asdict(joint.level_sd),
        "width": joint.width,
        "lapse_rate": joint.lapse_rate,
        "sigmoid": joint.options.sigmoid.value,
        "participants": [dataclasses.asdict(person) for person in joint.participants],
        "shapes": [{key: shape[key] for key in SCORED} for shape in shapes],
        "left_out": list(joint.left_out),
        "band_luminance_cd_m2": joint.band_luminance.tolist(),
        "pointwise_lower_cd_m2_s": joint.pointwise_lower.tolist(),
        "pointwise_upper_cd_m2_s": joint.pointwise_upper.tolist(),
    }


def _condition(condition: Condition) -> dict[str, Any]:
    return {"direction": condition.direction.value, "ramp_duration_s": condition.ramp_duration}


def _effect(effect: ConditionEffect) -> dict[str, Any]:
    own = ("ratio", "ci_low", "ci_high", "ratio_of_equal_amounts", "in_words")
    return {**_condition(effect.condition), **{name: getattr(effect, name) for name in own}}
