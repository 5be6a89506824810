"""Slope at the visibility threshold over luminance (Figure 3), published thresholds beside ours."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.findings import Findings
from evenlight.analysis.published import published, published_values
from evenlight.analysis.report import Section, Table
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.statistic import Origin, Statistic
from evenlight.method.rate_limit import rate_limit_at

AUTHORS = "authors_thresholds"


def slope_findings(calibration: Findings, limit: RateLimit) -> Findings:
    """Return the rate limit at the luminances that the paper's calibration has thresholds for.

    Parameters
    ----------
    calibration : Findings
        Of the calibration: its figure of the rate limit is shown.
    limit : RateLimit
        What was fitted to it.
    """
    rows: list[Statistic] = []
    lines = []
    for luminance, rate, place in _thresholds():
        group, ours = f"{luminance:g} cd/m^2", float(rate_limit_at(limit, luminance))
        origin = Origin.SIMULATED if limit.simulated else Origin.RECORDED
        low, high = _band(limit, luminance)
        rows += [
            Statistic(
                "slopes", group, "slope at threshold", rate, "cd/m^2/s", Origin.PUBLISHED, method=place
            ),
            Statistic(
                "slopes", group, "rate limit", ours, "cd/m^2/s", origin, low, high,
                None if low is None else limit.band_level, method=limit.source,
            ),
        ]  # fmt: skip
        band = None if low is None or high is None else f"{low:.3g} to {high:.3g}"
        lines.append((luminance, rate, 100 * rate / luminance, ours, band, 100 * ours / luminance))
    drawing = next(d for d in calibration.drawings if d.name == "rate_limit")
    kind = "simulated" if limit.simulated else "recorded"
    table = Table(
        "Fastest change of luminance that is noticed in 75 % of the trials.",
        ("luminance [cd/m²]", "published [cd/m²/s]", "[%/s]", f"{kind} [cd/m²/s]", "95 % band", "[%/s]"),
        tuple(lines),
    )
    worst = max(abs(np.log(line[3] / line[1])) for line in lines)
    lead = (
        f"Thresholds of the {kind} calibration agree with the published ones within a factor of "
        f"{np.exp(worst):.2f}."
    )
    if limit.simulated:
        lead += " They should: the simulated participants were drawn around the published curve."
    note = (
        "The paper shows these thresholds in a figure only; their numbers come from the program that its "
        "authors published."
    )
    caption = drawing.picture
    section = Section(
        "Slope over luminance (Figure 3)", (lead, note), (table,), (caption,), simulated=limit.simulated
    )
    statistics = (*rows, *(row for row in calibration.statistics if row.table == "rate_limit"))
    return Findings("slope_over_luminance", lead, statistics, (drawing,), (section,), calibration.warnings)


def _thresholds() -> list[tuple[float, float, str]]:
    """Return luminance, slope (the drop over the ramp's time) and place of the published thresholds."""
    seconds = published("ramp.duration").number
    values = published_values(AUTHORS)
    pairs = zip(values[::2], values[1::2], strict=True)  # luminance, drop, luminance, drop, ...
    return [(luminance.number, drop.number / seconds, drop.place) for luminance, drop in pairs]


def _band(limit: RateLimit, luminance: float) -> tuple[float | None, float | None]:
    """Return the band of a limit; None without one, and beyond the measured luminances."""
    low, high = limit.luminance_range
    if not limit.band_luminance or not low * (1 - 1e-9) <= luminance <= high * (1 + 1e-9):
        return None, None
    at, lower, upper = limit.band_luminance, limit.band_lower, limit.band_upper
    return float(np.interp(luminance, at, lower)), float(np.interp(luminance, at, upper))
