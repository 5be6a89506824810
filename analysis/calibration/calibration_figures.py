"""The figures of a calibration: psychometric functions, and the rate limit that their thresholds make."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from matplotlib.figure import Figure

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.conditions import condition_of
from evenlight.analysis.calibration.psychometric_figure import psychometric_figure
from evenlight.analysis.calibration.rate_limit_figure import rate_limit_figure
from evenlight.analysis.figure_style import PAGE, Medium, write_png
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.threshold import Threshold


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
