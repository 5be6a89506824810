"""The figures of a calibration: psychometric functions, and the rate limit that their thresholds make."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from analysis.calibration import Calibration
from analysis.conditions import condition_of
from analysis.figure_style import PAGE, Medium, write_png
from analysis.psychometric_figure import psychometric_figure
from analysis.rate_limit_figure import rate_limit_figure
from data_schema.rate_limit import RateLimit


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
    simulated = calibration.data.simulated
    limit = dataclasses.replace(calibration.rate_limit.limit, simulated=simulated)
    reference = calibration.rate_limit.reference
    thresholds = [
        fit.threshold
        for fit in calibration.thresholds
        if reference in (None, condition_of(fit.threshold))  # others lie off the curve by their effect
    ]
    figures = {
        "psychometric.png": psychometric_figure(calibration.thresholds, simulated, medium),
        "rate_limit.png": rate_limit_figure(limit, thresholds, compared, medium),
    }
    for name, figure in figures.items():
        write_png(folder / name, figure)
    return tuple(figures)
