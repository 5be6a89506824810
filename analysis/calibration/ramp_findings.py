"""What a calibration found, as rows and figures: the population's thresholds, and the rate limit ΔL(L)."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.calibration_sections import (
    calibration_section,
    population_section,
    thresholds_section,
)
from evenlight.analysis.calibration.fit_report import calibration_figures, drawn_thresholds
from evenlight.analysis.calibration.level_estimates import LevelEstimates
from evenlight.analysis.calibration.psychometric.ramp_counts import joined_luminances
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import level_means
from evenlight.analysis.calibration.rate_limit_section import rate_limit_section
from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.method.rate_limit import rate_limit_at

UNIT = "cd/m^2/s"
INTERVAL = 0.95
CURVE_POINTS = 61  # drawn as a smooth line
WAYS = {
    "random": "of the median participant: all participants' answers, a random threshold for each participant",
    "pooled": "75 % point of all participants' answers pooled, as if of one person (a reading of the paper)",
    "mean": "geometric mean of the participants' own usable thresholds",
}


def ramp_findings(calibration: Calibration, compared: RateLimit | None = None) -> Findings:
    """Return what a calibration found.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    compared : RateLimit, optional
        Another rate limit, drawn beside it.
    """
    simulated = calibration.data.simulated
    origin = Origin.SIMULATED if simulated else Origin.RECORDED
    psychometric, limit = (png_bytes(f) for f in calibration_figures(calibration, compared).values())
    drawings = (
        Drawing(
            "psychometric", psychometric, "Answers and fitted psychometric functions.",
            _answer_points(calibration, origin),
        ),
        Drawing(
            "rate_limit", limit, "The rate limit with its band, and the thresholds behind it.",
            (*_limit_points(calibration, origin), *(_compared_points(compared) if compared else ())),
        ),
    )  # fmt: skip
    return Findings(
        name="ramp",
        lead=_lead(calibration),
        statistics=(
            *(row for level in calibration.levels for row in _threshold_rows(level, origin)),
            *_limit_rows(calibration, origin),
        ),
        drawings=drawings,
        sections=(
            calibration_section(calibration, psychometric),
            population_section(calibration.levels, simulated),
            rate_limit_section(calibration, limit, published=compared is not None),
            thresholds_section(calibration),
        ),
        warnings=calibration.warnings,
        concerns=calibration.concerns,
    )


def _lead(calibration: Calibration) -> str:
    """Return what came out, in a sentence."""
    limit = calibration.rate_limit.limit
    low, high = limit.luminance_range
    slowest, fastest = rate_limit_at(limit, [low, high])
    who = "simulated participants" if calibration.data.simulated else "participants"
    return (
        f"Of {len(calibration.data.participant_ids)} {who}, the median one's ramp at threshold rises from "
        f"{slowest:.2g} cd/m²/s at {low:.3g} cd/m² to {fastest:.2g} cd/m²/s at {high:.3g} cd/m²."
    )


def _threshold_rows(level: LevelEstimates, origin: Origin) -> tuple[Statistic, ...]:
    """Return the estimates of the population's threshold at a level."""
    key, random = level.level, level.random
    condition = f"{key.direction.value}, {key.ramp_duration:g} s"
    group = f"{key.screen}, factor {key.factor:g}, {key.luminance:.4g} cd/m^2, {condition}"
    best = Statistic(
        "thresholds", group, "threshold of the population", random.threshold if random else None, UNIT,
        origin,
        ci_low=random.ci_low if random else None, ci_high=random.ci_high if random else None,
        interval=INTERVAL if random else None, n=random.n_participants if random else level.n_participants,
        method=WAYS["random"], flag="" if random else level.in_words,
    )  # fmt: skip
    others = (
        ("threshold, answers pooled", level.pooled, WAYS["pooled"], "all answers are alike"),
        ("threshold, mean of fits", level.mean_of_fits, WAYS["mean"], "no usable threshold"),
    )
    return best, *(
        Statistic(
            "thresholds", group, what, value, UNIT, origin, n=level.n_participants, method=how,
            flag="" if value is not None else why,
        )
        for what, value, how, why in others
    )  # fmt: skip


def _limit_rows(calibration: Calibration, origin: Origin) -> tuple[Statistic, ...]:
    """Return the rate limit at the luminances that were measured, with its band."""
    limit = calibration.rate_limit.limit
    luminances = sorted({t.luminance for t in drawn_thresholds(calibration)})
    n = len({fit.threshold.participant_id for fit in calibration.thresholds})
    how = (
        f"degree {len(limit.coefficients) - 1}, {limit.form.value}; {limit.band_words}; {limit.task_in_words}"
    )
    rows = []
    for luminance in luminances:
        low, high = _band(limit, luminance)
        rows.append(
            Statistic(
                "rate_limit", f"{luminance:.4g} cd/m^2", "rate limit", float(rate_limit_at(limit, luminance)),
                UNIT, origin, ci_low=low, ci_high=high, interval=None if low is None else limit.band_level,
                n=n, method=how,
            )
        )  # fmt: skip
    return tuple(rows)


def _band(limit: RateLimit, luminance: float) -> tuple[float | None, float | None]:
    """Return the band of a limit at a luminance; None without one."""
    if not limit.band_luminance:
        return None, None
    edges = (
        float(np.interp(luminance, limit.band_luminance, edge))
        for edge in (limit.band_lower, limit.band_upper)
    )
    return next(edges), next(edges)


def _point(series: str, x: float, y: float, origin: Origin) -> PlottedPoint:
    """Return a point of the figure of the rate limit."""
    return PlottedPoint("rate limit", series, "", x, y, "luminance", "cd/m^2", "rate", UNIT, origin)


def _limit_points(calibration: Calibration, origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return what the figure of the rate limit draws: thresholds, level means, curve and band."""
    thresholds = drawn_thresholds(calibration)
    own = [
        _point("left out" if t.flag in UNUSABLE else f"participant {t.participant_id}", t.luminance,
               t.threshold, origin)
        for t in thresholds
    ]  # fmt: skip
    used = [t for t in thresholds if t.flag not in UNUSABLE]
    places = joined_luminances(used)
    means = [
        PlottedPoint(
            "rate limit", "level mean", "", x, y, "luminance", "cd/m^2", "rate", UNIT, origin, low, high,
            places.count(x),
        )
        for x, y, low, high in level_means(used)
    ]  # fmt: skip
    return (*own, *means, *_curve_points(calibration.rate_limit.limit, "rate limit", origin))


def _curve_points(limit: RateLimit, series: str, origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return a rate limit as a line, with its band."""
    places = np.linspace(*limit.luminance_range, CURVE_POINTS).tolist()
    return tuple(
        PlottedPoint(
            "rate limit", series, "", x, float(rate_limit_at(limit, x)), "luminance", "cd/m^2", "rate", UNIT,
            origin, *_band(limit, x),
        )
        for x in places
    )  # fmt: skip


def _compared_points(compared: RateLimit) -> tuple[PlottedPoint, ...]:
    """Return the other rate limit's points and line."""
    points = zip(compared.point_luminance, compared.point_rate, strict=True)
    thresholds = (_point(f"{compared.name}, thresholds", x, y, Origin.PUBLISHED) for x, y in points)
    return (*thresholds, *_curve_points(compared, compared.name, Origin.PUBLISHED))


def _answer_points(calibration: Calibration, origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return the share of successes at each rate, by level and participant."""
    points = []
    for fit in calibration.thresholds:
        t, counts = fit.threshold, fit.fit.counts
        panel = f"{t.screen}, factor {t.factor:g}, {t.direction.value}, {t.ramp_duration:g} s"
        for rate, hits, shown in zip(
            counts.rates.tolist(), counts.n_yes.tolist(), counts.n_trials.tolist(), strict=True
        ):
            points.append(
                PlottedPoint(
                    panel, f"participant {t.participant_id}", "", rate, hits / shown, "rate", UNIT,
                    "share detected", "1", origin, n=shown,
                )
            )  # fmt: skip
    return tuple(points)
