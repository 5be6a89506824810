"""The figure of psychometric functions: how often ramps are seen, for each level and participant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis import figure_style as style
from evenlight.analysis.calibration.psychometric.goodness_of_fit import LEAST_IN_BIN, bin_starts
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampLevelKey,
    by_joined_level,
    level_order,
    pooled_counts,
)
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE, ThresholdFit, level_of_fit
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import bounds
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import FEWEST_FOR_INTERVALS, level_means
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.rows import Plot
from evenlight.data_schema.analysis_results import Origin, PlottedPoint
from evenlight.data_schema.arrays import Array, Integers
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, yes_probability

MOST_COLUMNS = 5  # panels side by side at most
LEAST_WIDTH = 9.0  # of a panel [em]
TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50)  # [%/s]
TITLES = 5.0  # the lines above a panel [em]
BELOW = 3.0  # the numbers of the axis, and the gap to the next row [em]
LEAST_IN_DOT = 12  # trials of neighbouring rates that are drawn as one dot
LONGEST_NAME = 5  # letters of it that have room there
MOST_NAMED = 20  # participants whose names stand beside their thresholds
THRESHOLD_UNITS = ("", "", "threshold", "cd/m^2/s")
Mean = tuple[float, float, float]  # threshold and its interval [cd/m^2/s]
UNITS = ("rate", "cd/m^2/s", "share detected", "1")


@dataclass(frozen=True, slots=True)
class _Scale:
    """What all panels share."""

    low: float  # slowest and fastest relative rate tested [%/s]
    high: float
    lowest_share: float  # where the axis of answers begins
    people: tuple[str, ...]  # from the most sensitive to the least: in this order in every panel
    two: bool  # whether of two intervals the right one was to be found
    zero: bool  # whether there are catch trials, drawn at the left end of the axis
    several: bool  # directions or durations

    @property
    def named(self) -> bool:
        """Whether the participants' names have room."""
        return len(self.people) <= MOST_NAMED

    @property
    def zero_at(self) -> float:
        """Where on the logarithmic axis "no change" is put [%/s]."""
        return self.low / 2


def psychometric_figure(
    fits: Sequence[ThresholdFit], simulated: bool = False
) -> tuple[Figure, tuple[PlottedPoint, ...]]:
    """Draw the psychometric functions of all participants, a panel for each screen and factor.

    Rates are relative to the panel's initial luminance, so that all panels share one axis. Below each panel
    are the participants' thresholds with their credible intervals, in the same order everywhere.

    Parameters
    ----------
    fits, simulated : sequence of ThresholdFit, bool
        One per participant and level, and whether participants were simulated; the figure says so.
    """
    levels, scale = by_level(fits), _scale(fits)
    origin = Origin.SIMULATED if simulated else Origin.RECORDED
    points: list[PlottedPoint] = []
    with style.look():
        em, left = PAGE.em, 4.2 * PAGE.em
        width = PAGE.width - left - 1.2 * em
        rows = _panel_rows(list(levels), int(np.clip(width / (LEAST_WIDTH * em), 1, MOST_COLUMNS)))
        lines, above = style.heading_lines(*_heading(fits, simulated), width, em)
        unusable = any(fit.threshold.flag in UNUSABLE for fit in fits)
        entries = 4 + scale.zero + unusable
        columns = 3 if unusable else entries
        top = above + (1.6 * -(-entries // columns) + 0.8 + TITLES) * em
        each = 0.75 if scale.named else 0.45
        strip = float(np.clip(each * len(scale.people), 1.5, 15.0)) * em
        height = (PAGE.height - top) / len(rows) - strip - (TITLES + BELOW) * em
        height = float(np.clip(height, 7 * em, 10 * em))
        row_height = height + strip + (TITLES + BELOW) * em
        cell = width / max(map(len, rows))
        figure = style.new_figure(top + len(rows) * row_height - (TITLES - 1.6) * em)
        full_width, full_height = figure.get_size_inches()
        style.lines_at(figure, left, lines)
        small = 0.9 * style.text_size()
        for row, keys in enumerate(rows):
            down = top + row * row_height
            answers = "correct [%]" if scale.two else "“yes” [%]"
            style.text_at(figure, 0.6 * em, down + height / 2, answers, rotation=90, va="center")
            for column, level in enumerate(keys):
                at = left + column * cell
                panel = style.axes_at(figure, at, down, cell - em, height)
                below = style.axes_at(figure, at, down + height + 0.3 * em, cell - em, strip)
                mean = _mean_threshold(levels[level])
                points += _draw_level((panel, below), level, levels[level], scale, mean, origin)
                panel.tick_params(labelbottom=False, labelleft=column == 0)
                below.tick_params(left=False, labelleft=scale.named and column == 0)
                what, found = _titles(level, levels[level], scale, mean)
                style.text_at(figure, at, down - 2.75 * em, what, va="bottom", fontsize=small)
                style.text_at(
                    figure, at, down - 0.4 * em, found, va="bottom", fontsize=small, color=style.LIMIT
                )
        key = {own.get_label(): own for axes in figure.axes for own in axes.get_legend_handles_labels()[0]}
        figure.legend(
            handles=list(key.values()),
            loc="upper left",
            ncols=columns,
            fontsize=small,
            bbox_to_anchor=(left / full_width, 1 - (above + 0.3 * em) / full_height),
        )
        words = f"rate of change, per initial luminance [%/s]{';  0: catch trials' if scale.zero else ''}"
        style.text_at(figure, left, full_height - em, words, va="bottom")
    return figure, tuple(points)


def _titles(
    level: RampLevelKey, fits: Sequence[ThresholdFit], scale: _Scale, mean: Mean | None
) -> tuple[str, str]:
    """Return what stands above a panel: the level, and its mean threshold with how well that is known."""
    arrow = "↓" if level.direction is Direction.DOWN else "↑"
    way = f", {arrow} {level.ramp_duration:g} s" if scale.several else ""
    what = f"{level.screen}, b = {level.factor:.3g}\n{style.short(level.luminance)} cd/m²{way}"
    if mean is None:
        return what, "no threshold"
    people = len({fit.threshold.participant_id for fit in fits})
    known = "" if 1 < people < FEWEST_FOR_INTERVALS else f"\n({bounds(*mean[1:])})"
    return what, f"{style.short(mean[0])} cd/m²/s{known}"


def _mean_threshold(fits: Sequence[ThresholdFit]) -> Mean | None:
    """Return the mean of the thresholds that can be used; None without any."""
    usable = [fit.threshold for fit in fits if fit.threshold.flag not in UNUSABLE]
    return level_means(usable)[0][1:] if usable else None


def _draw_level(
    above_and_below: tuple[Axes, Axes],
    level: RampLevelKey,
    fits: Sequence[ThresholdFit],
    scale: _Scale,
    mean: Mean | None,
    origin: Origin,
) -> list[PlottedPoint]:
    """Draw one level: functions, answers and false alarms above, thresholds below; return the numbers."""
    title = f"{level.screen}, factor {level.factor:g}, {level.direction.value}, {level.ramp_duration:g} s"
    panel, strip = above_and_below
    plot = Plot(panel, title, origin, UNITS)
    _draw_functions(panel, fits, scale, with_mean=mean is not None)
    _draw_answers(plot, fits, scale)
    _draw_thresholds(strip, plot, fits, scale)
    for axes in above_and_below:
        if mean is not None:
            at = 100 * mean[0] / level.luminance
            label = "mean, threshold" if len(scale.people) > 1 else "threshold"
            axes.axvline(at, color=style.LIMIT, linewidth=0.08 * style.text_size(), label=label, zorder=1)
        _set_rate_axis(axes, scale)
    if mean is not None:
        plot.note("mean threshold", None, mean[0], n=len(fits), ends=mean[1:], units=THRESHOLD_UNITS)
    strip.spines["left"].set_visible(False)
    return plot.points


def _draw_functions(axes: Axes, fits: Sequence[ThresholdFit], scale: _Scale, *, with_mean: bool) -> None:
    """Draw each participant's function thinly, and their mean."""
    relative = np.geomspace(scale.low / 1.2, scale.high * 1.2, 121)
    curves = [yes_probability(relative * fit.threshold.luminance / 100, fit.fit.function) for fit in fits]
    size = style.text_size()
    thin: dict[str, Any] = {"linewidth": size / 11, "alpha": float(np.clip(4 / len(fits), 0.15, 0.8))}
    for curve in curves:
        axes.plot(relative, curve, color=style.PARTICIPANT, label="a participant", zorder=2, **thin)
    if len(curves) > 1 and with_mean:
        axes.plot(relative, np.mean(curves, axis=0), color=style.LIMIT, label="mean, threshold", zorder=3)
    axes.axhline(
        THRESHOLD_PROBABILITY, color=style.MUTED, linewidth=size / 16, linestyle=(0, (4, 3)), zorder=1
    )
    margin = 0.04 * (1 - scale.lowest_share)
    ticks = [tick for tick in (0, 0.25, 0.5, 0.75, 1) if tick >= scale.lowest_share]
    axes.set(ylim=(scale.lowest_share - margin, 1 + margin), yticks=ticks)
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f}")


def _draw_answers(plot: Plot, fits: Sequence[ThresholdFit], scale: _Scale) -> None:
    """Draw the shares of successes over the rates, and at no change the false alarms; note each person's."""
    axes, size = plot.axes, style.text_size()
    rates, yes, trials = drawn_answers(fits)
    edge: dict[str, Any] = {
        "facecolor": style.INK,
        "edgecolor": "white",
        "linewidth": size / 22,
        "clip_on": False,
        "zorder": 4,
    }
    label = f"share of {'correct answers' if scale.two else '“yes”'}, area: trials"
    axes.scatter(rates, yes / trials, s=(0.75 * size) ** 2 * trials / trials.max(), label=label, **edge)
    for fit in fits:
        who, counts = f"participant {fit.threshold.participant_id}", fit.fit.counts
        for rate, hits, n in zip(counts.rates, counts.n_yes, counts.n_trials, strict=True):
            plot.note(who, float(rate), float(hits / n), n=int(n))
        if counts.catch_trials:
            plot.note(f"{who}, catch trials", 0.0, counts.false_alarm_rate, n=counts.catch_trials)
    caught = [fit.fit.counts for fit in fits if fit.fit.counts.catch_trials]
    if caught:
        alarms = [counts.catch_yes / counts.catch_trials for counts in caught]
        zero = np.full(len(caught), scale.zero_at)
        axes.scatter(
            zero, alarms, s=(0.4 * size) ** 2, color=style.PARTICIPANT, alpha=0.5, linewidth=0, zorder=3
        )
        pooled = sum(counts.catch_yes for counts in caught) / sum(counts.catch_trials for counts in caught)
        diamond: dict[str, Any] = {
            "marker": "D",
            "linestyle": "none",
            "markersize": 0.6 * size,
            "mew": 0,
            "zorder": 4,
        }
        axes.plot(scale.zero_at, pooled, color=style.INK, label="false alarms", **diamond)


def _draw_thresholds(strip: Axes, plot: Plot, fits: Sequence[ThresholdFit], scale: _Scale) -> None:
    """Draw the thresholds with their intervals, one below the other; hollow ones cannot be used."""
    size = style.text_size()
    dot = float(np.clip(4.5 / len(scale.people), 0.13, 0.32)) * size
    look_of_dot: dict[str, Any] = {
        "marker": "o",
        "markevery": [1],
        "markersize": dot,
        "mec": style.INK,
        "mew": dot / 8,
    }
    for t in (fit.threshold for fit in fits):
        line, face = (":", "white") if t.flag in UNUSABLE else ("-", style.INK)
        places = 100 * np.array([t.ci_low, t.threshold, t.ci_high]) / t.luminance
        row = np.full(3, scale.people.index(t.participant_id))
        label = "threshold, 95 % credible" if line == "-" else "cannot be used"
        strip.plot(
            places,
            row,
            line,
            color=style.PARTICIPANT,
            linewidth=max(dot / 5, 0.4),
            mfc=face,
            label=label,
            **look_of_dot,
        )
        ends, who = (t.ci_low, t.ci_high), f"participant {t.participant_id}"
        plot.note("threshold", None, t.threshold, who, t.n_trials, ends, THRESHOLD_UNITS)
    strip.set(ylim=(len(scale.people) - 0.3, -0.7))
    if scale.named:
        names = [who if len(who) <= LONGEST_NAME else f"{who[: LONGEST_NAME - 1]}…" for who in scale.people]
        strip.set_yticks(range(len(names)), names, fontsize=0.68 * size)


def _set_rate_axis(axes: Axes, scale: _Scale) -> None:
    """Give some axes the common logarithmic axis of relative rates, with "no change" at its left end."""
    axes.set_xscale("log")
    axes.set_xlim(scale.zero_at / 1.25 if scale.zero else scale.low / 1.4, scale.high * 1.25)
    at = [tick for tick in TICKS if scale.low * 0.9 <= tick <= scale.high * 1.1]
    names = [f"{tick:g}" for tick in at]
    if scale.zero:
        at, names = [scale.zero_at, *at], ["0", *names]
        axes.axvline(scale.low / 1.4, color=style.FAINT, linewidth=style.text_size() / 16, zorder=0)
    axes.set_xticks(at, names)
    axes.set_xticks([], minor=True)


def by_level(fits: Sequence[ThresholdFit]) -> dict[RampLevelKey, list[ThresholdFit]]:
    """Return the fits of each level, lowest threshold first."""
    return by_joined_level(sorted(fits, key=lambda fit: fit.threshold.threshold), level_of_fit)


def _scale(fits: Sequence[ThresholdFit]) -> _Scale:
    rates = [100 * fit.fit.counts.rates / fit.threshold.luminance for fit in fits]
    two = fits[0].threshold.procedure is Procedure.TWO_INTERVAL
    levels = by_level(fits)
    shares = [yes / trials for _, yes, trials in map(drawn_answers, levels.values())]
    relative: dict[str, list[float]] = {}
    for t in (fit.threshold for fit in fits):
        relative.setdefault(t.participant_id, []).append(float(np.log(t.threshold / t.luminance)))
    return _Scale(
        low=float(min(r.min() for r in rates)),
        high=float(max(r.max() for r in rates)),
        lowest_share=min(0.5, *(float(share.min()) for share in shares)) if two else 0.0,
        people=tuple(sorted(relative, key=lambda who: (np.mean(relative[who]), who))),
        two=two,
        zero=any(fit.fit.counts.catch_trials for fit in fits),
        several=len({(level.direction, level.ramp_duration) for level in levels}) > 1,
    )


def _panel_rows(levels: list[RampLevelKey], columns: int) -> list[list[RampLevelKey]]:
    """Return the levels in rows: a new row for each screen and condition, brighter levels to the right."""
    blocks: dict[tuple[object, ...], list[RampLevelKey]] = {}
    for level in sorted(levels, key=level_order):  # white, then gray
        blocks.setdefault((level.screen, level.direction, level.ramp_duration), []).append(level)
    rows: list[list[RampLevelKey]] = []
    for block in blocks.values():
        own = sorted(block, key=lambda level: level.luminance)
        rows += [own[k : k + columns] for k in range(0, len(own), columns)]
    return rows


def _heading(fits: Sequence[ThresholdFit], simulated: bool) -> tuple[str, str]:
    people = len({fit.threshold.participant_id for fit in fits})
    catches = sum({fit.threshold.participant_id: fit.threshold.n_catch for fit in fits}.values())
    two = fits[0].threshold.procedure is Procedure.TWO_INTERVAL
    verb = "found" if two else "seen"
    what = "the interval with a change of luminance" if two else "a change of luminance"
    who = f"{people} {'simulated ' if simulated else ''}participant{'s' if people > 1 else ''}"
    ramps = f"{sum(fit.threshold.n_trials for fit in fits)} ramps"
    catch = "" if two else f" and {catches} catch trials"
    several = len({(fit.threshold.direction, fit.threshold.ramp_duration) for fit in fits}) > 1
    known = "95 % credible interval" if people == 1 else "geometric mean, 95 % confidence interval"
    below = " Below: each participant's threshold, the most sensitive first." if people > 1 else ""
    return f"How often {what} is {verb}", (
        f"{who}, {ramps}{catch}. Above each panel: screen and brightness factor, initial luminance"
        f"{', direction and duration' if several else ''}, and the rate {verb} in "
        f"{100 * THRESHOLD_PROBABILITY:.0f} % of the trials, but for lapses ({known}).{below}"
    )


def drawn_answers(fits: Sequence[ThresholdFit]) -> tuple[Array, Integers, Integers]:
    """Return relative rates [%/s], successes and trials, summed over the participants of a level.

    Adaptive placement asks many rates a few times; shares of two or three answers would be dots at 0, 50 and
    100 %. Those are put together; a group lies at the mean ln(rate) of its trials.
    """
    relative = (np.round(100 * fit.fit.counts.rates / fit.threshold.luminance, 9) for fit in fits)
    own = (replace(fit.fit.counts, rates=rates) for fit, rates in zip(fits, relative, strict=True))
    pooled = pooled_counts(list(own))
    rates, yes, trials = pooled.rates, pooled.n_yes, pooled.n_trials
    if trials.min() >= LEAST_IN_BIN:
        return rates, yes, trials
    starts = bin_starts(trials, LEAST_IN_DOT)
    total = np.add.reduceat(trials, starts)
    middle = np.exp(np.add.reduceat(trials * np.log(rates), starts) / total)
    return middle, np.add.reduceat(yes, starts), total
