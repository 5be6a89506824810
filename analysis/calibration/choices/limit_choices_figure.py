"""The figure of the choices for the rate limit: where the curves part, and what that does to a clip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.calibration.choices.choice_on_clip import ClipComparison
from evenlight.analysis.calibration.choices.limit_choices import (
    FITTED,
    INDIVIDUAL,
    JOINT,
    LOG_LOG_QUADRATIC,
    POOLED,
    POWER_LAW,
    SAFE,
    LimitChoices,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import level_means
from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    PARTICIPANT,
    FigureFormat,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at

DASHED, DOTTED, DASH_DOT = (0, (4, 1.6)), (0, (1.2, 1.4)), (0, (5, 1.4, 1.2, 1.4))
LINES: dict[str, tuple[str, Any]] = {
    FITTED: (LIMIT, "-"),
    SAFE: (LIMIT, DASHED),
    POWER_LAW: (OURS, "-"),
    LOG_LOG_QUADRATIC: (OURS, DASHED),
    "rate_4": (BASELINE, "-"),
    "ln_rate_4": (PARTICIPANT, DASH_DOT),
    JOINT: (PARTICIPANT, "-"),
    INDIVIDUAL: (PARTICIPANT, DASHED),
    POOLED: (INK, DOTTED),
}
LOWEST, HIGHEST = 0.4, 2.5  # ratios shown at most: beyond, a curve has lost its thresholds


def limit_choices_figure(
    choices: LimitChoices,
    thresholds: Sequence[Threshold],
    comparison: ClipComparison | None = None,
    medium: FigureFormat = PAGE,
) -> Figure:
    """Draw each choice as a multiple of the fitted curve, and what the optimizer makes of a clip within it.

    Parameters
    ----------
    choices, thresholds : LimitChoices, sequence of Threshold
        The curves, and the thresholds that the fitted one was fitted to.
    comparison : ClipComparison, optional
        What they do to a clip; without it the upper part is drawn alone.
    medium : FigureFormat
        Where it is shown.
    """
    with look(medium):
        em = medium.em
        left = 4.6 * em
        width = medium.width - left - 1.5 * em
        lines, above = heading_lines(*_heading(choices, comparison), width, em)
        rows = len(choices.choices)
        columns = 2 if width > 40 * em else 1
        key = 1.7 * em * (-(-(rows + 2) // columns))
        parts = (2.6, 1.9) if comparison else (1.0,)
        gains = (1.9 * rows + 5.2) * em if comparison else 0.0
        between = 4.6 * em
        room = medium.height - above - 1.2 * em - key - gains - between * len(parts)
        heights = [max(part / sum(parts) * room, 7 * em) for part in parts]
        if not comparison:
            heights = [min(heights[0], 0.5 * width)]
        figure = new_figure(
            medium, above + 1.2 * em + sum(heights) + between * len(parts) + key + gains + 0.4 * em
        )
        lines_at(figure, left, lines)
        top = above + 1.2 * em
        ratios = axes_at(figure, left, top, width, heights[0])
        _draw_ratios(ratios, choices, thresholds)
        ratios.legend(loc="upper left", bbox_to_anchor=(0.0, -4.0 * em / heights[0]), ncols=columns)
        top += heights[0] + between + 0.6 * em + key
        if comparison:
            _draw_tracks(axes_at(figure, left, top, width, heights[1]), comparison)
            top += heights[1] + between
            wide = 16 * em if columns == 2 else 0.0
            gain = axes_at(figure, left + wide, top, width - wide, 1.9 * rows * em)
            _draw_gains(gain, choices, comparison, named=columns == 2)
    return figure


def _heading(choices: LimitChoices, comparison: ClipComparison | None) -> tuple[str, str]:
    """Return title and subtitle."""
    simulated = "Simulated participants. " if choices.fitted.limit.simulated else ""
    title = "What hangs on the curve that is drawn through the thresholds"
    subtitle = f"{simulated}Above: each curve as a multiple of the fitted one. "
    if comparison:
        subtitle += (
            f"Middle: the brightness that the optimizer gives {comparison.video} within each limit, mean "
            f"factor {comparison.budget:g}. Below: its gain, by how much less contrast loss differs between "
            "two frames than under constant dimming."
        )
    return title, subtitle


def _draw_ratios(axes: Axes, choices: LimitChoices, thresholds: Sequence[Threshold]) -> None:
    """Draw the curves, the fitted one's band and the means of the levels, as multiples of the fitted one."""
    fitted = choices.fitted.limit
    if fitted.band_luminance:
        middle = _positive(fitted, np.array(fitted.band_luminance))
        lower, upper = (np.array(edge) / middle for edge in (fitted.band_lower, fitted.band_upper))
        label = f"{fitted.band_words} of the fitted curve"
        axes.fill_between(
            fitted.band_luminance, lower, upper, color=LIMIT, alpha=0.14, linewidth=0, label=label, zorder=1
        )
    for choice in choices.choices:
        low, high = choice.limit.luminance_range
        luminance = np.linspace(
            max(low, fitted.luminance_range[0]), min(high, fitted.luminance_range[1]), 401
        )
        ratio = rate_limit_at(choice.limit, luminance) / _positive(fitted, luminance)
        colour, dashes = LINES[choice.name]
        axes.plot(luminance, ratio, color=colour, linestyle=dashes, label=choice.words, zorder=3)
    means = np.array(level_means(thresholds)).T
    if means.size:
        size = text_size()
        means[1:] /= _positive(fitted, means[0])
        axes.errorbar(means[0], means[1], yerr=np.abs(means[2:] - means[1]), fmt="o", color=INK,
                      ms=0.45 * size, capsize=0.2 * size, elinewidth=size / 11, alpha=0.75,
                      label="thresholds: mean of a level, 95 %", zorder=4)  # fmt: skip
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, LOWEST), min(high, HIGHEST))
    ticks = [t for t in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.4, 1.7, 2, 2.5) if _within(axes, t)]
    axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
    axes.set_yticks([], minor=True)
    axes.set(xlim=(0, None), xlabel="luminance L [cd/m²]", ylabel="rate / fitted rate")


def _positive(limit: RateLimit, luminance: Array) -> Array:
    """Return a limit's rate [cd/m^2/s]; NaN, which is not drawn, where it is 0."""
    rate = rate_limit_at(limit, luminance)
    return np.where(rate > 0, rate, np.nan)


def _within(axes: Axes, value: float) -> bool:
    """Return whether a value lies within the vertical axis."""
    low, high = axes.get_ylim()
    return bool(low <= value <= high)


def _draw_tracks(axes: Axes, comparison: ClipComparison) -> None:
    """Draw the tracks over time, the fitted limit's on top."""
    for outcome in reversed(comparison.outcomes):
        colour, dashes = LINES[outcome.choice]
        axes.plot(
            comparison.times, outcome.factors, color=colour, linestyle=dashes, linewidth=text_size() / 7
        )
    axes.axhline(comparison.budget, color=FAINT, zorder=0)
    axes.set(
        xlim=(float(comparison.times[0]), float(comparison.times[-1])),
        xlabel="time [s]",
        ylabel="brightness factor b",
    )


def _draw_gains(axes: Axes, choices: LimitChoices, comparison: ClipComparison, named: bool) -> None:
    """Draw the gain of each choice as a bar, with its value."""
    size = text_size()
    for place, (choice, outcome) in enumerate(zip(choices.choices, comparison.outcomes, strict=True)):
        colour, _ = LINES[choice.name]
        gain = 100 * outcome.gain
        axes.barh(place, gain, height=0.5, color=colour, alpha=0.35 if choice.name == SAFE else 0.85)
        words = f"{gain:.1f} %"
        if named and outcome.share_of_fitted > 1.005:
            words += f"   up to {outcome.share_of_fitted:.2f} × the fitted limit"
        axes.annotate(words, (gain, place), xytext=(0.4 * size, 0), textcoords="offset points", va="center",
                      color=MUTED, fontsize=0.92 * size)  # fmt: skip
    axes.set(ylim=(len(choices.choices) - 0.4, -0.6))
    names = [choice.words for choice in choices.choices] if named else ["" for _ in choices.choices]
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(left=False)
    axes.set_xlim(0, 1.75 * max(5.0, *(100 * outcome.gain for outcome in comparison.outcomes)))
    axes.set_xlabel("gain over constant dimming [%]")
