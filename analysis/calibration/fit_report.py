"""The results of a calibration: thresholds, rate limit, summary, figures, and a report to judge them by."""

from __future__ import annotations

import dataclasses
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.calibration_sections import (
    calibration_section,
    population_section,
    rate_limit_section,
    thresholds_section,
)
from evenlight.analysis.calibration.choices.choice_on_clip import ClipComparison
from evenlight.analysis.calibration.choices.limit_choices import LimitChoices
from evenlight.analysis.calibration.choices.limit_choices_figure import limit_choices_figure
from evenlight.analysis.calibration.choices.limit_choices_report import (
    FIGURE,
    LOG_LOG_LIMIT,
    SAFE_LIMIT,
    SUMMARY,
    TABLE,
    choices_section,
)
from evenlight.analysis.calibration.level_estimates import difference_in_words, level_mapping, mean_ratios
from evenlight.analysis.calibration.psychometric.psychometric_figure import psychometric_figure
from evenlight.analysis.calibration.rate_limit.conditions import Condition, ConditionEffect, condition_of
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import rate_limit_figure
from evenlight.analysis.figure_style import PAGE, FigureFormat, short, write_png
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.report import Report, Section, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section, roll_section
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json, write_json_record
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at

REPORT = "report.html"
FILES = {
    "thresholds.csv": "thresholds of each participant and level, with credible intervals",
    "rate_limit.json": "the fitted rate limit, for `evenlight optimize --rate-limit`",
    SAFE_LIMIT: "the lower edge of its band, for the same use",
    LOG_LOG_LIMIT: "the better of line and quadratic in log-log, for the same use",
    "fit_summary.json": "what the fit rests on, for programs",
    f"{TABLE}, {SUMMARY}": "the curves that could be chosen, compared",
    f"psychometric.png, rate_limit.png, {FIGURE}": "the figures of this page",
}
COMPARED_AT = 201  # luminances at which two curves are compared


@dataclass(frozen=True, slots=True)
class FitResults:
    """What the report is about.

    Attributes
    ----------
    calibration, choices : Calibration, LimitChoices
        What was fitted, and the curves that could serve.
    comparison : ClipComparison or None
        What they do to a clip, if one was looked at.
    origin : Provenance
        Software and inputs.
    """

    calibration: Calibration
    choices: LimitChoices
    comparison: ClipComparison | None
    origin: Provenance


def write_fit_report(folder: Path, results: FitResults) -> None:
    """Write `report.html` and `limit_choices.png` beside the figures of the calibration."""
    fit = results.calibration.rate_limit
    own = [t for t in fit.used if fit.reference in (None, condition_of(t))]  # those the curve runs through
    figure = limit_choices_figure(results.choices, own, results.comparison)
    write_png(folder / FIGURE, figure)
    pictures = {name: (folder / name).read_bytes() for name in ("psychometric.png", "rate_limit.png", FIGURE)}
    write_report(folder / REPORT, fit_report(results, pictures))


def fit_report(results: FitResults, pictures: dict[str, bytes]) -> Report:
    """Return the report of a calibration.

    Parameters
    ----------
    results : FitResults
        What it is about.
    pictures : dict of str to bytes
        Its figures by the names of their files.
    """
    calibration, simulated = results.calibration, results.calibration.data.simulated
    roll = calibration.data.roll
    return Report(
        "Calibration of the rate limit",
        _lead(results),
        (
            *((roll_section(roll),) if roll else ()),
            calibration_section(calibration, pictures["psychometric.png"]),
            population_section(calibration.levels, simulated),
            rate_limit_section(calibration, pictures["rate_limit.png"], published=False),
            choices_section(results.choices, results.comparison, pictures[FIGURE]),
            *_warnings(calibration),
            thresholds_section(calibration),
            provenance_section(
                {
                    "first session": calibration.data.sessions[0].manifest.provenance,
                    "fit": results.origin,
                }
            ),
            files_section(FILES),
        ),
    )


def _lead(results: FitResults) -> str:
    """Return what came out, in two sentences."""
    limit = results.calibration.rate_limit.limit
    width = None
    if limit.band_luminance:
        widths = np.log(np.array(limit.band_upper) / np.maximum(limit.band_lower, 1e-300)) / 2
        width = 100 * float(np.expm1(np.median(widths)))
    words = prose(
        "fit_lead",
        limit=limit,
        ends=[(short(float(rate_limit_at(limit, L))), short(L)) for L in limit.luminance_range],
        width=width,
        falls=results.choices.fitted.falling,
        comparison=results.comparison,
        gains=[100 * outcome.gain for outcome in results.comparison.outcomes] if results.comparison else (),
    )
    return cautious(results.calibration.concerns, words[0].replace(" %", "\u00a0%"))


def _warnings(calibration: Calibration) -> tuple[Section, ...]:
    """Return a section of what to be warned of that no other section says; none if there is nothing."""
    said = {*calibration.data.warnings, *calibration.rate_limit.notes}
    others = tuple(warning for warning in calibration.warnings if warning not in said)
    if not others:
        return ()
    text = ("Not every level or participant is as the models have it.",)
    notes = tuple(f"{words[0].upper()}{words[1:]}." for words in others)
    return (Section("To be looked at", text, (), (), notes, calibration.data.simulated),)


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
        "warnings": [*calibration.warnings, *(roll.warnings if roll else ())],
        "roll": mapping_from_record(roll) if roll else None,
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
    calibration: Calibration, folder: Path, compared: RateLimit | None = None, medium: FigureFormat = PAGE
) -> tuple[str, ...]:
    """Write `psychometric.png` and `rate_limit.png`, and return their names.

    Parameters
    ----------
    calibration, folder : Calibration, Path
        What was fitted, and where to.
    compared, medium : RateLimit, optional, and FigureFormat
        Another rate limit, drawn beside it; and where they are shown.
    """
    figures = calibration_figures(calibration, compared, medium)
    for name, figure in figures.items():
        write_png(folder / name, figure)
    return tuple(figures)


def calibration_figures(
    calibration: Calibration, compared: RateLimit | None = None, medium: FigureFormat = PAGE
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
