"""The figure of the rate limit ΔL(L): thresholds, the curve through them, and its band (Section 3.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import special

from evenlight.analysis import figure_style as style
from evenlight.analysis.calibration.psychometric.ramp_counts import joined_luminances
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import shape_name
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.rows import Plot
from evenlight.data_schema.analysis_results import Origin, PlottedPoint
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.rate_limit import RateLimit, RateLimitModel
from evenlight.data_schema.threshold import Threshold

BESIDE = ((0, (1.2, 1.4)), (0, (5, 1.4, 1.2, 1.4)))  # dotted, dash-dotted
NONE: Mapping[str, RateLimit] = MappingProxyType({})
FEWEST_FOR_INTERVALS = 4  # people: Student's t of two or three makes a mean's interval say nothing
SHARES = (1.0, 2.0, 3.0, 5.0, 10.0)  # [%/s] relative rates with a guide line
CURVE_POINTS = 61  # drawn as a smooth line
UNITS = ("luminance", "cd/m^2", "rate", "cd/m^2/s")


def rate_limit_figure(
    limit: RateLimit,
    thresholds: Sequence[Threshold] = (),
    compared: RateLimit | None = None,
    beside: Mapping[str, RateLimit] = NONE,
) -> tuple[Figure, tuple[PlottedPoint, ...]]:
    """Draw a rate limit with its band, the thresholds that it was fitted to, and what it is outside of them.

    Rays from the origin are constant relative rates, so that the figure reads in %/s too.

    Parameters
    ----------
    limit, compared : RateLimit, and optional another
        The curve, and another one, drawn beside it.
    thresholds : sequence of Threshold
        Of all participants, those left out for their flag included; without any, the limit's own points.
    beside : mapping of str to RateLimit
        Curves of other models by their names, drawn thinly.
    """
    with style.look():
        em = PAGE.em
        left = 4.6 * em
        width = PAGE.width - left - 4.2 * em
        lines, above = style.heading_lines(*_heading(limit, thresholds), width, em)
        key = 1.7 * em * (-(-(_key_count(limit, thresholds, compared) + len(beside)) // 3))
        height = min(0.56 * width, PAGE.height - above - key - 5.6 * em)
        figure = style.new_figure(above + 1.2 * em + height + key + 4.4 * em)
        style.lines_at(figure, left, lines)
        axes = style.axes_at(figure, left, above + 1.2 * em, width, height)
        origin = Origin.SIMULATED if limit.simulated else Origin.RECORDED
        curve = Plot(axes, "rate limit", origin, UNITS)
        _draw_limit(curve, limit)
        for (name, other), dashes in zip(beside.items(), BESIDE, strict=False):
            inside = np.linspace(*other.luminance_range, 401)
            axes.plot(inside, other(inside), color=style.INK, linestyle=dashes, linewidth=0.9, label=name)
        if compared is not None:
            _draw_compared(curve, compared)
        points = Plot(axes, "rate limit", origin, UNITS)
        _draw_thresholds(points, limit, thresholds)
        right = 1.15 * max(limit.luminance_range[1], compared.luminance_range[1] if compared else 0.0)
        axes.set(xlim=(0, right), xlabel="luminance L [cd/m²]", ylabel="rate of luminance change [cd/m²/s]")
        axes.set_ylim(0, 1.04 * axes.get_ylim()[1])
        _draw_rays(axes)
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -3.9 * em / height), ncols=3)
    return figure, (*points.points, *curve.points)


def _key_count(limit: RateLimit, thresholds: Sequence[Threshold], compared: RateLimit | None) -> int:
    used = [t for t in thresholds if t.flag not in UNUSABLE]
    several = len({t.participant_id for t in used}) > 1
    left_out = len(thresholds) > len(used) > 0
    return 3 + bool(limit.band_luminance) + several + left_out + (compared is not None)


def _heading(limit: RateLimit, thresholds: Sequence[Threshold]) -> tuple[str, str]:
    title = f"Luminance change {limit.at_limit_in_words} on {limit.display_name}"
    shape = shape_name(limit.form, len(limit.coefficients) - 1)
    people = len({t.participant_id for t in thresholds})
    if people:
        who = "simulated participant" if limit.simulated else "participant"
        return title, f"{people} {who}{'s' if people > 1 else ''} · {shape}"
    return title, f"{'simulated participants' if limit.simulated else f'rate limit {limit.name}'} · {shape}"


def level_means(thresholds: Sequence[Threshold]) -> list[tuple[float, float, float, float]]:
    """Return luminance, geometric mean and 95 % confidence interval of the thresholds at each level.

    The interval is that of the mean over participants (Student's t on the logarithms); at a level of one
    participant it is the threshold's own credible interval.
    """
    means = []
    places = joined_luminances(thresholds)
    for luminance in sorted(set(places)):
        own = [t for t, place in zip(thresholds, places, strict=True) if place == luminance]
        logs = np.log([t.threshold for t in own])
        if len(own) == 1:
            means.append((luminance, own[0].threshold, own[0].ci_low, own[0].ci_high))
            continue
        middle = float(logs.mean())
        half = float(special.stdtrit(len(own) - 1, 0.975) * logs.std(ddof=1) / np.sqrt(len(own)))
        low, mean, high = np.exp([middle - half, middle, middle + half]).tolist()
        means.append((luminance, mean, low, high))
    return means


def band_at(limit: RateLimit, luminance: float) -> tuple[float | None, float | None]:
    """Return the edges of a limit's band at a luminance [cd/m^2/s]; None without a band."""
    if not limit.band_luminance:
        return None, None
    at = limit.band_luminance
    return float(np.interp(luminance, at, limit.band_lower)), float(
        np.interp(luminance, at, limit.band_upper)
    )


def _draw_thresholds(plot: Plot, limit: RateLimit, thresholds: Sequence[Threshold]) -> None:
    """Draw the participants' thresholds lightly, and the mean of each level with its interval."""
    axes, size = plot.axes, style.text_size()
    for t in thresholds:
        series = "left out" if t.flag in UNUSABLE else f"participant {t.participant_id}"
        plot.note(series, t.luminance, t.threshold)
    used = [t for t in thresholds if t.flag not in UNUSABLE]
    left_out = [(t.luminance, t.threshold) for t in thresholds if t.flag in UNUSABLE]
    if not used:
        axes.plot(limit.point_luminance, limit.point_rate, "o", color=style.INK, label="thresholds", zorder=4)
        return
    people = len({t.participant_id for t in used})
    if people > 1:
        look_of_one: dict[str, Any] = {
            "alpha": float(np.clip(8 / np.sqrt(len(used)), 0.2, 0.6)),
            "label": "one participant",
        }
        places, rates = [t.luminance for t in used], [t.threshold for t in used]
        axes.plot(places, rates, "o", color=style.PARTICIPANT, ms=0.32 * size, mew=0, zorder=2, **look_of_one)
    _draw_means(plot, used, people)
    if left_out:
        alike = "all answers alike, or left out"  # which the joint model does not leave out
        look: dict[str, Any] = {"color": style.MUTED, "ms": 0.45 * size, "zorder": 2, "clip_on": False}
        at, rates = np.array(left_out).T
        top = axes.get_ylim()[1]
        beyond = rates > top  # a value that is the prior's: the axis is not stretched for it
        axes.plot(at[beyond], np.full(beyond.sum(), top), "^", **look)
        label = alike if limit.model is RateLimitModel.JOINT else "left out"
        axes.plot(at[~beyond], rates[~beyond], "x", label=label, **look)


def _draw_means(plot: Plot, used: Sequence[Threshold], people: int) -> None:
    axes, size = plot.axes, style.text_size()
    means, places = level_means(used), joined_luminances(used)
    for luminance, mean, low, high in means:
        plot.note("level mean", luminance, mean, n=places.count(luminance), ends=(low, high))
    at, middle, lower, upper = np.array(means).T
    label = "level mean, 95 % CI" if people > 1 else "threshold, 95 % CrI"
    spread: Array | None = np.abs(np.array([lower, upper]) - middle)
    # Curve, band and thresholds set the axis; an interval that leaves it ends in an arrow.
    top = max(axes.get_ylim()[1], 1.05 * middle.max())
    cut = upper > top
    if 1 < people < FEWEST_FOR_INTERVALS:
        label, spread, cut = "level mean", None, cut & False
    bars: dict[str, Any] = {"capsize": 0.25 * size, "elinewidth": size / 9, "capthick": size / 9}
    axes.errorbar(
        at, middle, yerr=spread, fmt="o", color=style.INK, ms=0.55 * size, label=label, zorder=4, **bars
    )
    axes.plot(at[cut], np.full(cut.sum(), top), "^", color=style.INK, ms=0.6 * size, clip_on=False, zorder=4)
    axes.set_ylim(0, top)


def _draw_limit(plot: Plot, limit: RateLimit) -> None:
    """Draw the curve and its band within the measured range, and dashed what holds outside of it."""
    axes, (low, high) = plot.axes, limit.luminance_range
    axes.plot(*_noted(plot, limit, "rate limit"), color=style.LIMIT, label="rate limit ΔL(L)", zorder=3)
    if limit.band_luminance:
        edges = (limit.band_luminance, limit.band_lower, limit.band_upper)
        axes.fill_between(
            *edges, color=style.LIMIT, alpha=0.16, linewidth=0, label=limit.band_words, zorder=1
        )
    for part, label in (([0.0, low], "held outside the measured range"), ([high, 1.15 * high], None)):
        axes.plot(part, limit(part), color=style.LIMIT, linestyle=(0, (3, 1.6)), label=label, zorder=3)


def _draw_compared(plot: Plot, other: RateLimit) -> None:
    for at, rate in zip(other.point_luminance, other.point_rate, strict=True):
        plot.note(f"{other.name}, thresholds", at, rate, origin=Origin.PUBLISHED)
    label = style.drawable(f"{other.name} ({other.display_name})")
    curve = _noted(plot, other, other.name, Origin.PUBLISHED)
    plot.axes.plot(*curve, color=style.INK, linestyle="-.", linewidth=1.2, label=label, zorder=3)


def _noted(plot: Plot, limit: RateLimit, series: str, origin: Origin | None = None) -> tuple[Array, Array]:
    luminance = np.linspace(*limit.luminance_range, CURVE_POINTS)
    rates = limit(luminance)
    for at, rate in zip(luminance.tolist(), rates.tolist(), strict=True):
        plot.note(series, at, rate, ends=band_at(limit, at), origin=origin)
    return luminance, rates


def _draw_rays(axes: Axes) -> None:
    """Draw lines of constant relative rate, named where they leave the frame."""
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    size = style.text_size()
    for share in SHARES:
        end = min(right, 100 * top / share)
        axes.plot([0, end], [0, share * end / 100], color=style.FAINT, linewidth=size / 14, zorder=0.5)
        look_of_name: dict[str, Any] = {"xytext": (0, 0.2 * size), "ha": "center", "va": "bottom"}
        if end == right:
            look_of_name = {"xytext": (0.3 * size, 0), "ha": "left", "va": "center"}
        axes.annotate(
            f"{share:g} %/s",
            (end, share * end / 100),
            textcoords="offset points",
            color=style.MUTED,
            fontsize=0.85 * size,
            annotation_clip=False,
            **look_of_name,
        )
