"""The figure of psychometric functions: how often ramps are seen, for each level and participant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from evenlight.analysis.calibration.psychometric.goodness_of_fit import LEAST_IN_BIN, bin_starts
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampLevelKey,
    joined_levels,
    level_of_threshold,
    level_order,
)
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE, ThresholdFit
from evenlight.analysis.figure_style import (
    FAINT,
    INK,
    LIMIT,
    MUTED,
    PAGE,
    PARTICIPANT,
    FigureFormat,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    short,
    text_at,
    text_size,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.data_schema.threshold import Threshold
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, yes_probability

MOST_COLUMNS = 5  # panels side by side at most
LEAST_WIDTH = 9.0  # of a panel [em]
TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50)  # [%/s]
BETWEEN_ROWS = 6.8  # numbers of the axis, and the next row's titles [em]
LEAST_IN_DOT = 12  # trials of neighbouring rates that are drawn as one dot


def psychometric_figure(
    fits: Sequence[ThresholdFit], simulated: bool = False, medium: FigureFormat = PAGE
) -> Figure:
    """Draw the psychometric functions of all participants, a panel for each screen and factor.

    Rates are relative to the panel's initial luminance, so that all panels share one axis. Below each panel
    are the participants' thresholds with their credible intervals, lowest first.

    Parameters
    ----------
    fits, simulated : sequence of ThresholdFit, bool
        One per participant and level, and whether participants were simulated; the figure says so.
    medium : FigureFormat
        Where it is shown.
    """
    levels = by_level(fits)
    with look(medium):
        em = medium.em
        width = medium.width - 5.4 * em
        rows = panel_rows(list(levels), int(np.clip(width / (LEAST_WIDTH * em), 1, MOST_COLUMNS)))
        lines, above = heading_lines(*heading_of(fits, simulated), width, em)
        scale = scale_of(fits)
        entries = 5 if scale.zero else 4
        key_columns = entries if width > 56 * em else 2
        top = above + (1.6 * -(-entries // key_columns) + 4.6) * em
        strip = float(np.clip(0.45 * max(len(group) for group in levels.values()), 1.5, 9.0)) * em
        panel = (medium.height - top) / len(rows) - strip - BETWEEN_ROWS * em
        panel = float(np.clip(panel, 7 * em, 10 * em))
        grid = _PanelGrid(em, 4.2 * em, top, width / max(map(len, rows)), panel, strip)
        figure = new_figure(medium, grid.top + len(rows) * grid.row_height - 1.8 * em)
        lines_at(figure, grid.left, lines)
        _draw_key(figure, grid, above, key_columns, scale)
        for row, keys in enumerate(rows):
            for column, key in enumerate(keys):
                _draw_level(figure, grid, (row, column), levels[key], scale)
        _name_axes(figure, grid, len(rows), medium, scale)
    return figure


def _draw_level(
    figure: Figure, grid: _PanelGrid, place: tuple[int, int], fits: list[ThresholdFit], scale: _PanelScale
) -> None:
    """Draw one level: functions, answers and false alarms above, thresholds below."""
    em, (row, column) = grid.em, place
    left, wide = grid.left + column * grid.cell_width, grid.cell_width - 1.0 * em
    top = grid.top + row * grid.row_height
    panel = axes_at(figure, left, top, wide, grid.panel_height)
    strip = axes_at(figure, left, top + grid.panel_height + 0.3 * em, wide, grid.strip_height)
    _draw_functions(panel, fits, scale)
    _draw_answers(panel, fits, scale)
    _draw_thresholds(strip, fits)
    mean = _mean_threshold(fits)
    t, (level,) = fits[0].threshold, by_level(fits)
    names = [
        (f"{t.screen}, b = {t.factor:g}", INK),
        (f"{short(level.luminance)} cd/m²{_way(t) if scale.several else ''}", INK),
    ]
    if mean is not None:
        names.append((f"{short(mean)} cd/m²/s", LIMIT))
        for axes in (panel, strip):
            axes.axvline(100 * mean / level.luminance, color=LIMIT, linewidth=0.08 * 72 * em, zorder=1)
    for line, (words, colour) in enumerate(names):
        text_at(
            figure, left, top + (1.25 * (line - len(names)) - 0.6) * em, words, color=colour,
            fontsize=0.92 * 72 * em,
        )  # fmt: skip
    for axes in (panel, strip):
        _set_rate_axis(axes, scale)
    panel.tick_params(labelbottom=False, labelleft=column == 0)
    strip.tick_params(left=False, labelleft=False)
    strip.spines["left"].set_visible(False)


def _way(threshold: Threshold) -> str:
    """Return direction and duration of the ramps, for a panel's title."""
    arrow = "↓" if threshold.direction is Direction.DOWN else "↑"
    return f", {arrow} {threshold.ramp_duration:g} s"


def _draw_functions(axes: Axes, fits: list[ThresholdFit], scale: _PanelScale) -> None:
    """Draw each participant's function thinly, and their mean."""
    relative = np.geomspace(scale.low / 1.2, scale.high * 1.2, 121)
    curves = [yes_probability(relative * fit.threshold.luminance / 100, fit.fit.function) for fit in fits]
    opacity = float(np.clip(4 / len(fits), 0.15, 0.8))
    size = text_size()
    for curve in curves:
        axes.plot(relative, curve, color=PARTICIPANT, alpha=opacity, linewidth=size / 11, zorder=2)
    if len(curves) > 1:
        axes.plot(relative, np.mean(curves, axis=0), color=LIMIT, zorder=3)
    axes.axhline(THRESHOLD_PROBABILITY, color=MUTED, linewidth=size / 16, linestyle=(0, (4, 3)), zorder=1)
    margin = 0.04 * (1 - scale.lowest_share)
    ticks = [tick for tick in (0, 0.25, 0.5, 0.75, 1) if tick >= scale.lowest_share]
    axes.set(ylim=(scale.lowest_share - margin, 1 + margin), yticks=ticks)
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f}")


def _draw_answers(axes: Axes, fits: list[ThresholdFit], scale: _PanelScale) -> None:
    """Draw the shares of successes over the rates, and at no change the false alarms."""
    size = text_size()
    rates, yes, trials = drawn_answers(fits)
    area = (0.75 * size) ** 2 * trials / trials.max()
    axes.scatter(
        rates, yes / trials, s=area, facecolor=INK, edgecolor="white", linewidth=size / 22, clip_on=False,
        zorder=4,
    )  # fmt: skip
    alarms = [f.threshold.false_alarm_rate for f in fits if f.threshold.false_alarm_rate is not None]
    if alarms:
        zero = np.full(len(alarms), scale.zero_at)
        axes.scatter(zero, alarms, s=(0.4 * size) ** 2, color=PARTICIPANT, alpha=0.5, linewidth=0, zorder=3)
        caught = sum(f.fit.counts.catch_yes for f in fits) / sum(f.fit.counts.catch_trials for f in fits)
        axes.scatter(zero[:1], [caught], marker="D", s=(0.6 * size) ** 2, color=INK, linewidth=0, zorder=4)


def _mean_threshold(fits: list[ThresholdFit]) -> float | None:
    """Return the geometric mean of the thresholds that can be used [cd/m^2/s]; None without any."""
    usable = [f.threshold.threshold for f in fits if f.threshold.flag not in UNUSABLE]
    return float(np.exp(np.mean(np.log(usable)))) if usable else None


def _draw_thresholds(axes: Axes, fits: list[ThresholdFit]) -> None:
    """Draw the thresholds with their intervals, one below the other; hollow ones cannot be used."""
    size = text_size()
    dot = float(np.clip(4.5 / len(fits), 0.13, 0.32)) * size
    for place, fit in enumerate(fits):
        t = fit.threshold
        usable = t.flag not in UNUSABLE
        relative = 100 * np.array([t.ci_low, t.threshold, t.ci_high]) / t.luminance
        style: dict[str, Any] = {"color": PARTICIPANT, "linewidth": max(dot / 5, 0.4)}
        axes.plot(relative[[0, 2]], [place, place], linestyle="-" if usable else ":", **style)
        face = INK if usable else "white"
        axes.plot(relative[1], place, "o", ms=dot, mfc=face, mec=INK, mew=dot / 8)
    axes.set(ylim=(len(fits) - 0.3, -0.7))


def _set_rate_axis(axes: Axes, scale: _PanelScale) -> None:
    """Give some axes the common logarithmic axis of relative rates, with "no change" at its left end."""
    axes.set_xscale("log")
    axes.set_xlim(scale.left, scale.high * 1.25)
    ticks = [tick for tick in TICKS if scale.low * 0.9 <= tick <= scale.high * 1.1]
    at, names = list(ticks), [f"{tick:g}" for tick in ticks]
    if scale.zero:
        at, names = [scale.zero_at, *at], ["0", *names]
        axes.axvline(scale.low / 1.4, color=FAINT, linewidth=text_size() / 16, zorder=0)
    axes.set_xticks(at, names)
    axes.set_xticks([], minor=True)


def _draw_key(figure: Figure, grid: _PanelGrid, top: float, columns: int, scale: _PanelScale) -> None:
    """Write what is what, above the panels."""
    size = 72 * grid.em
    line: dict[str, Any] = {"color": PARTICIPANT, "linewidth": size / 11}
    dots: dict[str, Any] = {"linestyle": "none", "color": INK}
    success = "correct answers" if scale.two else "“yes”"
    handles = [
        Line2D([], [], label="a participant", **line),
        Line2D([], [], color=LIMIT, label="mean, threshold"),
        Line2D(
            [], [], marker="o", label=f"share of {success}, area: trials", markersize=0.6 * size,
            **dots,
        ),
        Line2D(
            [], [], marker="o", markersize=0.4 * size, mfc=INK, mec=INK, label="threshold, 95 % credible",
            **line,
        ),
    ]  # fmt: skip
    if scale.zero:
        alarms = Line2D([], [], marker="D", label="false alarms", markersize=0.5 * size, **dots)
        handles.insert(3, alarms)
    full_width, full_height = figure.get_size_inches()
    anchor = (grid.left / full_width, 1 - (top + 0.3 * grid.em) / full_height)
    figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=anchor, ncols=columns, fontsize=0.9 * size
    )


def _name_axes(figure: Figure, grid: _PanelGrid, rows: int, medium: FigureFormat, scale: _PanelScale) -> None:
    """Write what the axes measure."""
    height = float(figure.get_size_inches()[1])
    words = "rate of change, per initial luminance [%/s]"
    words += ";  0: catch trials" if scale.zero else ""
    text_at(figure, grid.left, height - 1.0 * grid.em, words, va="bottom")
    for row in range(rows):
        middle = grid.top + row * grid.row_height + grid.panel_height / 2
        text_at(
            figure, 0.6 * grid.em, middle, "correct [%]" if scale.two else "“yes” [%]", rotation=90,
            va="center",
        )  # fmt: skip


def by_level(fits: Sequence[ThresholdFit]) -> dict[RampLevelKey, list[ThresholdFit]]:
    """Return the fits of each level, lowest threshold first."""
    joined = joined_levels(level_of_threshold(fit.threshold) for fit in fits)
    levels: dict[RampLevelKey, list[ThresholdFit]] = {}
    for fit in sorted(fits, key=lambda fit: fit.threshold.threshold):
        levels.setdefault(joined[level_of_threshold(fit.threshold)], []).append(fit)
    return levels


@dataclass(frozen=True, slots=True)
class _PanelGrid:
    """Where the panels are [inch]."""

    em: float
    left: float
    top: float
    cell_width: float
    panel_height: float
    strip_height: float

    @property
    def row_height(self) -> float:
        """Height of a row: panel, strip, title and numbers of the axis."""
        return self.panel_height + self.strip_height + BETWEEN_ROWS * self.em


@dataclass(frozen=True, slots=True)
class _PanelScale:
    """What all panels share.

    Attributes
    ----------
    low, high, lowest_share : float
        Slowest and fastest relative rate tested [%/s]; where the axis of answers begins.
    two, zero, several : bool
        Whether of two intervals the right one was to be found; whether there are catch trials, drawn at the
        left end of the axis; whether there are several directions or durations.
    """

    low: float
    high: float
    lowest_share: float
    two: bool
    zero: bool
    several: bool

    @property
    def zero_at(self) -> float:
        """Where on the logarithmic axis "no change" is put [%/s]."""
        return self.low / 2

    @property
    def left(self) -> float:
        """Left end of the axis [%/s]."""
        return self.zero_at / 1.25 if self.zero else self.low / 1.4


def scale_of(fits: Sequence[ThresholdFit]) -> _PanelScale:
    """Return what all panels share."""
    rates = [100 * fit.fit.counts.rates / fit.threshold.luminance for fit in fits]
    two = fits[0].threshold.procedure is Procedure.TWO_INTERVAL
    levels = by_level(fits)
    shares = [drawn_answers(group) for group in levels.values()]
    lowest = min(float((yes / trials).min()) for _, yes, trials in shares)
    return _PanelScale(
        low=float(min(r.min() for r in rates)),
        high=float(max(r.max() for r in rates)),
        lowest_share=min(0.5, lowest) if two else 0.0,
        two=two,
        zero=any(fit.fit.counts.catch_trials for fit in fits),
        several=len({(level.direction, level.ramp_duration) for level in levels}) > 1,
    )


def panel_rows(levels: list[RampLevelKey], columns: int) -> list[list[RampLevelKey]]:
    """Return the levels in rows: a new row for each screen and condition, brighter levels to the right."""
    blocks: dict[tuple[object, ...], list[RampLevelKey]] = {}
    for level in sorted(levels, key=level_order):  # white, then gray
        blocks.setdefault((level.screen, level.direction, level.ramp_duration), []).append(level)
    rows: list[list[RampLevelKey]] = []
    for block in blocks.values():
        own = sorted(block, key=lambda level: level.luminance)
        rows += [own[k : k + columns] for k in range(0, len(own), columns)]
    return rows


def heading_of(fits: Sequence[ThresholdFit], simulated: bool) -> tuple[str, str]:
    """Return title and subtitle."""
    people = len({fit.threshold.participant_id for fit in fits})
    trials = sum(fit.threshold.n_trials for fit in fits)
    catches = sum({fit.threshold.participant_id: fit.threshold.n_catch for fit in fits}.values())
    who = ("simulated " if simulated else "") + ("participant" if people == 1 else "participants")
    two = fits[0].threshold.procedure is Procedure.TWO_INTERVAL
    ramps = f"{trials} ramps" if two else f"{trials} ramps and {catches} catch trials"
    several = len({(fit.threshold.direction, fit.threshold.ramp_duration) for fit in fits}) > 1
    arrows = ", direction and duration" if several else ""
    verb = "found" if two else "seen"
    return (
        "How often the interval with a change of luminance is found"
        if two
        else "How often a change of luminance is seen",
        f"{people} {who}, {ramps}. Above each panel: screen and brightness factor, initial "
        f"luminance{arrows}, and the rate {verb} in {100 * THRESHOLD_PROBABILITY:.0f} % of the "
        "trials (geometric mean of participants).",
    )


def pooled_answers(fits: Sequence[ThresholdFit]) -> tuple[Array, Array, Array]:
    """Return relative rates [%/s], successes and trials, summed over the participants of a level."""
    rates = np.concatenate([100 * fit.fit.counts.rates / fit.threshold.luminance for fit in fits])
    distinct, index = np.unique(np.round(rates, 9), return_inverse=True)
    yes = np.concatenate([fit.fit.counts.n_yes for fit in fits]).astype(np.float64)
    trials = np.concatenate([fit.fit.counts.n_trials for fit in fits]).astype(np.float64)
    return distinct, _summed(index, yes), _summed(index, trials)


def drawn_answers(fits: Sequence[ThresholdFit]) -> tuple[Array, Array, Array]:
    """Return the pooled answers as they are drawn: where single rates have few trials, put together.

    Adaptive placement asks many rates a few times; shares of two or three answers would be dots at 0, 50 and
    100 %. A group lies at the mean ln(rate) of its trials.
    """
    rates, yes, trials = pooled_answers(fits)
    if trials.min() >= LEAST_IN_BIN:
        return rates, yes, trials
    starts = bin_starts(trials.astype(np.int64), LEAST_IN_DOT)
    total = np.add.reduceat(trials, starts)
    middle = np.exp(np.add.reduceat(trials * np.log(rates), starts) / total)
    return middle, np.add.reduceat(yes, starts), total


def _summed(index: NDArray[np.intp], values: Array) -> Array:
    """Return the sum of the values of each index."""
    return np.asarray(np.bincount(index, values), dtype=np.float64)
