"""The report of a calibration: one page that an experimenter can judge it by."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
from evenlight.analysis.calibration.rate_limit.conditions import condition_of
from evenlight.analysis.figure_style import short, write_png
from evenlight.analysis.report import Report, Section, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.data_schema.provenance import Provenance
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
    calibration : Calibration
        What was fitted.
    choices : LimitChoices
        The curves that could serve.
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
    figure = limit_choices_figure(results.choices, _own_thresholds(results.calibration), results.comparison)
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
    return Report(
        "Calibration of the rate limit",
        _lead(results),
        (
            calibration_section(calibration, pictures["psychometric.png"]),
            population_section(calibration.levels, simulated),
            rate_limit_section(calibration, pictures["rate_limit.png"], published=False),
            choices_section(results.choices, results.comparison, pictures[FIGURE]),
            *_warnings(calibration),
            thresholds_section(calibration),
            provenance_section(_origins(results)),
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
    return words[0].replace(" %", "\u00a0%")


def _own_thresholds(calibration: Calibration) -> list[Threshold]:
    """Return the thresholds that the curve runs through: of the ramps that the limit is for."""
    fit = calibration.rate_limit
    return [t for t in fit.used if fit.reference in (None, condition_of(t))]


def _warnings(calibration: Calibration) -> tuple[Section, ...]:
    """Return a section of what to be warned of that no other section says; none if there is nothing."""
    said = {*calibration.data.warnings, *calibration.rate_limit.notes}
    others = tuple(warning for warning in calibration.warnings if warning not in said)
    if not others:
        return ()
    text = ("Not every level or participant is as the models have it.",)
    notes = tuple(f"{words[0].upper()}{words[1:]}." for words in others)
    return (Section("To be looked at", text, (), (), notes, calibration.data.simulated),)


def _origins(results: FitResults) -> dict[str, Provenance]:
    """Return where data set and fit come from."""
    made = results.calibration.data.sessions[0].manifest.provenance
    return {"first session": made, "fit": results.origin}
