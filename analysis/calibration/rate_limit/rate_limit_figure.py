"""The figure of the rate limit ΔL(L): thresholds, the curve through them, and its band (Section 3.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import special

from evenlight.analysis.calibration.psychometric.ramp_counts import joined_luminances
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.figure_style import (
    FAINT,
    INK,
    LIMIT,
    MUTED,
    PAGE,
    PARTICIPANT,
    FigureFormat,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at

BESIDE = ((0, (1.2, 1.4)), (0, (5, 1.4, 1.2, 1.4)))  # dotted, dash-dotted
NONE: Mapping[str, RateLimit] = MappingProxyType({})
FEWEST_FOR_INTERVALS = 4  # people: Student's t of two or three makes a mean's interval say nothing
SHARES = (1.0, 2.0, 3.0, 5.0, 10.0)  # [%/s] relative rates with a guide line


def rate_limit_figure(
    limit: RateLimit,
    thresholds: Sequence[Threshold] = (),
    compared: RateLimit | None = None,
    medium: FigureFormat = PAGE,
    beside: Mapping[str, RateLimit] = NONE,
) -> Figure:
    """Draw a rate limit with its band, the thresholds that it was fitted to, and what it is outside of them.

    Rays from the origin are constant relative rates, so that the figure reads in %/s too.

    Parameters
    ----------
    limit, compared : RateLimit, and optional another
        The curve, and another one, drawn beside it.
    thresholds : sequence of Threshold
        Of all participants, those left out for their flag included; without any, the limit's own points.
    medium : FigureFormat
        Where it is shown.
    beside : mapping of str to RateLimit
        Curves of other models by their names, drawn thinly.
    """
    with look(medium):
        em = medium.em
        left = 4.6 * em
        width = medium.width - left - 4.2 * em
        lines, above = heading_lines(*_heading(limit, thresholds), width, em)
        columns = 3 if width > 50 * em else 2
        key = 1.7 * em * (-(-(_key_count(limit, thresholds, compared) + len(beside)) // columns))
        height = min(0.56 * width, medium.height - above - key - 5.6 * em)
        figure = new_figure(medium, above + 1.2 * em + height + key + 4.4 * em)
        lines_at(figure, left, lines)
        axes = axes_at(figure, left, above + 1.2 * em, width, height)
        _draw_curve(axes, limit)
        for (name, other), dashes in zip(beside.items(), BESIDE, strict=False):
            inside = np.linspace(*other.luminance_range, 401)
            axes.plot(
                inside, rate_limit_at(other, inside), color=INK, linestyle=dashes, linewidth=0.9, label=name
            )
        if compared is not None:
            _draw_compared(axes, compared)
        _draw_points(axes, limit, thresholds)
        right = 1.15 * max(limit.luminance_range[1], compared.luminance_range[1] if compared else 0.0)
        axes.set(xlim=(0, right), xlabel="luminance L [cd/m²]", ylabel="rate of luminance change [cd/m²/s]")
        axes.set_ylim(0, 1.04 * axes.get_ylim()[1])
        _draw_rays(axes)
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -3.9 * em / height), ncols=columns)
    return figure


def _key_count(limit: RateLimit, thresholds: Sequence[Threshold], compared: RateLimit | None) -> int:
    """Return how many entries the key has."""
    used = [t for t in thresholds if t.flag not in UNUSABLE]
    several = len({t.participant_id for t in used}) > 1
    left_out = len(thresholds) > len(used) > 0
    return 3 + bool(limit.band_luminance) + several + left_out + (compared is not None)


def _heading(limit: RateLimit, thresholds: Sequence[Threshold]) -> tuple[str, str]:
    """Return title and subtitle."""
    title = f"Luminance change {limit.at_limit_in_words} on {limit.display_name}"
    degree = len(limit.coefficients) - 1
    forms = {
        RateLimitForm.LN_RATE: f"ln(rate): polynomial of degree {degree} in luminance",
        RateLimitForm.RATE: f"rate: polynomial of degree {degree} in luminance",
        RateLimitForm.LOG_LOG: f"ln(rate): polynomial of degree {degree} in ln(luminance)",
    }
    people = len({t.participant_id for t in thresholds})
    if people:
        who = "simulated participant" if limit.simulated else "participant"
        origin = f"{people} {who}{'s' if people > 1 else ''}"
    else:
        origin = "simulated participants" if limit.simulated else f"rate limit {limit.name}"
    return title, f"{origin} · {forms[limit.form]}"


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


def _draw_points(axes: Axes, limit: RateLimit, thresholds: Sequence[Threshold]) -> None:
    """Draw the participants' thresholds lightly, and the mean of each level with its interval."""
    used = [t for t in thresholds if t.flag not in UNUSABLE]
    left_out = [t for t in thresholds if t.flag in UNUSABLE]
    if not used:
        axes.plot(limit.point_luminance, limit.point_rate, "o", color=INK, label="thresholds", zorder=4)
        return
    size = text_size()
    people = len({t.participant_id for t in used})
    several = people > 1
    if several:
        opacity = float(np.clip(8 / np.sqrt(len(used)), 0.2, 0.6))
        place, rate = _coordinates(used)
        axes.plot(place, rate, "o", color=PARTICIPANT, alpha=opacity, ms=0.32 * size, mew=0, zorder=2,
                  label="one participant")  # fmt: skip
    if left_out:
        axes.plot(
            *_coordinates(left_out), "x", color=MUTED, ms=0.45 * size, label=_without_value(limit), zorder=2
        )
    means = np.array(level_means(used)).T
    label = "level mean, 95 % CI" if several else "threshold, 95 % CrI"
    spread: Array | None = np.abs(means[2:] - means[1])
    # Curve, band and thresholds set the axis; an interval that leaves it ends in an arrow.
    top = max(axes.get_ylim()[1], 1.05 * means[1].max())
    cut = means[3] > top
    if several and people < FEWEST_FOR_INTERVALS:
        label, spread, cut = "level mean", None, cut & False
    axes.errorbar(means[0], means[1], yerr=spread, fmt="o", color=INK, ms=0.55 * size, capsize=0.25 * size,
                  elinewidth=size / 9, capthick=size / 9, label=label, zorder=4)  # fmt: skip
    axes.plot(means[0][cut], np.full(cut.sum(), top), "^", color=INK, ms=0.6 * size, clip_on=False, zorder=4)
    axes.set_ylim(0, top)


def _without_value(limit: RateLimit) -> str:
    """Return what a threshold is that no answer ties down."""
    return "all answers alike, or left out" if limit.model is RateLimitModel.JOINT else "left out"


def _coordinates(thresholds: Sequence[Threshold]) -> tuple[list[float], list[float]]:
    """Return luminances and rates."""
    return [t.luminance for t in thresholds], [t.threshold for t in thresholds]


def _draw_curve(axes: Axes, limit: RateLimit) -> None:
    """Draw the curve and its band within the measured range, and dashed what holds outside of it."""
    low, high = limit.luminance_range
    inside = np.linspace(low, high, 401)
    axes.plot(inside, rate_limit_at(limit, inside), color=LIMIT, label="rate limit ΔL(L)", zorder=3)
    if limit.band_luminance:
        axes.fill_between(limit.band_luminance, limit.band_lower, limit.band_upper, color=LIMIT, alpha=0.16,
                          linewidth=0, label=limit.band_words, zorder=1)  # fmt: skip
    below, beyond = np.array([0.0, low]), np.array([high, 1.15 * high])
    label = "held outside the measured range"
    for part, name in ((below, label), (beyond, None)):
        axes.plot(
            part, rate_limit_at(limit, part), color=LIMIT, linestyle=(0, (3, 1.6)), label=name, zorder=3
        )


def _draw_compared(axes: Axes, other: RateLimit) -> None:
    """Draw another rate limit within the range that it was measured in."""
    inside = np.linspace(*other.luminance_range, 401)
    label = drawable(f"{other.name} ({other.display_name})")
    axes.plot(
        inside, rate_limit_at(other, inside), color=INK, linestyle="-.", linewidth=1.2, label=label, zorder=3
    )


def _draw_rays(axes: Axes) -> None:
    """Draw lines of constant relative rate, named where they leave the frame."""
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    size = text_size()
    for share in SHARES:
        end = min(right, 100 * top / share)
        axes.plot([0, end], [0, share * end / 100], color=FAINT, linewidth=size / 14, zorder=0.5)
        at_right = end == right
        axes.annotate(
            f"{share:g} %/s", (end, share * end / 100),
            xytext=(0.3 * size, 0) if at_right else (0, 0.2 * size), textcoords="offset points",
            ha="left" if at_right else "center", va="center" if at_right else "bottom", color=MUTED,
            fontsize=0.85 * size, annotation_clip=False,
        )  # fmt: skip
