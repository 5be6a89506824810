"""The results of a calibration: thresholds, rate limit, summary, figures, and a report to judge them by."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.calibration_sections import (
    calibration_section,
    population_section,
    thresholds_section,
)
from evenlight.analysis.calibration.choices.choice_on_clip import ClipComparison
from evenlight.analysis.calibration.choices.limit_choices import SAFE, LimitChoices
from evenlight.analysis.calibration.choices.limit_choices_figure import limit_choices_figure
from evenlight.analysis.calibration.choices.limit_choices_report import (
    FIGURE,
    LOG_LOG_LIMIT,
    SAFE_LIMIT,
    SUMMARY,
    TABLE,
    choices_section,
)
from evenlight.analysis.calibration.fit_summary import summary_of
from evenlight.analysis.calibration.limit_models import FEW_LEVELS
from evenlight.analysis.calibration.psychometric.psychometric_figure import psychometric_figure
from evenlight.analysis.calibration.rate_limit.conditions import condition_of
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import rate_limit_figure
from evenlight.analysis.calibration.rate_limit_section import rate_limit_section
from evenlight.analysis.figure_style import PAGE, FigureFormat, short, write_png
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.report import Report, Section, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section, roll_section
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import BandKind, RateLimit, RateLimitModel
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
    figure = limit_choices_figure(results.choices, fit.own, results.comparison)
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
            files_section({name: what for name, what in FILES.items() if name not in _unwritten(results)}),
        ),
    )


def _unwritten(results: FitResults) -> tuple[str, ...]:
    """Return the files that this calibration does not have."""
    if results.choices.fitted.limit.wide_band:
        return SAFE_LIMIT, LOG_LOG_LIMIT
    return () if results.choices.named(SAFE) else (SAFE_LIMIT,)


def _lead(results: FitResults) -> str:
    """Return what came out, for whom and how sure, in a few sentences."""
    calibration, models = results.calibration, results.calibration.models
    limit, width = calibration.rate_limit.limit, 0.0
    if limit.band_luminance and not limit.wide_band:
        width = 100 * float(np.expm1(np.median(np.log(np.divide(limit.band_upper, limit.band_lower))) / 2))
    words = prose(
        "fit_lead",
        limit=limit,
        ends=[(short(float(rate_limit_at(limit, L))), short(L)) for L in sorted({*limit.luminance_range})],
        known="known as a whole" if limit.band_kind is BandKind.SIMULTANEOUS else "known",
        width=width,
        simulated=calibration.data.simulated,
        source=_source(calibration),
        few=FEW_LEVELS.get(models.levels, ""),
        falls=calibration.rate_limit.falling,
        comparison=results.comparison,
        gains=[100 * outcome.gain for outcome in results.comparison.outcomes] if results.comparison else (),
    )
    return cautious(results.calibration.concerns, words[0].replace(" %", "\u00a0%"))


def _source(calibration: Calibration) -> str:
    """Return whose answers the limit rests on, and by which model."""
    people, joint = len(calibration.data.participant_ids), calibration.models.joint
    if calibration.models.chosen is RateLimitModel.JOINT and joint is not None:
        n = len(joint.participants)
        return f"all {joint.n_trials} answers of {n} participant{'s' * (n > 1)} at once (joint model)"
    if calibration.models.chosen is RateLimitModel.POOLED:
        return f"the answers of {people} participants pooled, as if of one person (pooled model)"
    return f"{len(calibration.rate_limit.used)} thresholds of {people} participants (individual model)"


def _warnings(calibration: Calibration) -> tuple[Section, ...]:
    """Return a section of what to be warned of that no other section says; none if there is nothing."""
    said = {*calibration.data.warnings, *calibration.rate_limit.notes, *calibration.models.first_notes}
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
        display_fingerprints=calibration.data.display_fingerprints,
    )
    write_json_record(folder / "rate_limit.json", limit)
    write_json(folder / "fit_summary.json", summary_of(calibration, provenance))


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
        "rate_limit.png": rate_limit_figure(
            limit, drawn_thresholds(calibration), compared, medium, _beside(calibration)
        ),
    }


def _beside(calibration: Calibration) -> dict[str, RateLimit]:
    """Return the other models' curves by what they are called."""
    return {f"{model.value} model": fit.limit for model, fit in calibration.models.others.items()}


def drawn_thresholds(calibration: Calibration) -> list[Threshold]:
    """Return the thresholds of the condition that the limit is for; others lie off it by their effect."""
    reference = calibration.rate_limit.reference
    thresholds = (fit.threshold for fit in calibration.thresholds)
    return [t for t in thresholds if reference in (None, condition_of(t))]
