"""The figures of the controller: tuned gains (loss over time, stability), and a sweep over targets."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
    short,
    text_at,
    text_size,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.control import LoopReport, TargetRow, TuningReport
from evenlight.method.online.control_curves import ControlledTrack
from evenlight.method.online.tuning import FrameGains, open_loop

REAL, IMAGINARY = (-1.6, 0.6), (-1.5, 0.4)  # of the plane of L that is shown


def tuning_figure(
    report: TuningReport, times: Array, runs: tuple[ControlledTrack, ControlledTrack]
) -> Figure:
    """Draw the loss with the gains before and after tuning, and both loops in the plane of L (Nyquist).

    Parameters
    ----------
    report, times : TuningReport, array, (N,)
        What was found, and the times of the frames [s].
    runs : (ControlledTrack, ControlledTrack)
        Before and after, without a budget.
    """
    em = PAGE.em
    with look(PAGE):
        left, width = 5.8 * em, PAGE.width - 7.3 * em
        lines, above = heading_lines(*_heading(report), PAGE.width - left - em, em)
        top, high = above + 2.4 * em, 12 * em
        below = top + high + 5.6 * em
        figure = new_figure(PAGE, below + 26 * em)
        lines_at(figure, left, lines)
        _draw_losses(axes_at(figure, left, top, width, high), report, times, runs)
        plane = axes_at(figure, left, below, 24 * em, 24 * em * np.ptp(IMAGINARY) / np.ptp(REAL))
        _draw_loops(plane, report)
        _write_margins(figure, left + 27 * em, below, report)
    return figure


def _heading(report: TuningReport) -> tuple[str, str]:
    """Return title and subtitle."""
    before, after = report.before, report.after
    change = 100 * (1 - after.rms_error / before.rms_error) if before.rms_error > 0 else 0.0
    outcome = f"{change:.0f} % nearer to" if change >= 0.5 else "no nearer to"
    return (
        f"Gains tuned on {report.video.replace('_', ' ')}",
        f"With them the loss stays {outcome} a fixed target of {short(report.target_loss)} (root mean "
        f"square error {short(before.rms_error)} before, {short(after.rms_error)} after; SD "
        f"{short(before.sd_loss)} and {short(after.sd_loss)}).",
    )


def _draw_losses(
    axes: Axes, report: TuningReport, times: Array, runs: tuple[ControlledTrack, ControlledTrack]
) -> None:
    """Draw the loss over time with both gains, and the target."""
    before, after = runs
    axes.plot(times, before.contrast_loss, color=BASELINE, linewidth=1.0, label="gains as given")
    axes.plot(times, after.contrast_loss, color=OURS, linewidth=1.2, label="gains tuned")
    axes.axhline(report.target_loss, color=INK, linestyle=(0, (1, 2)), linewidth=1.0, label="target")
    top = max(float(run.contrast_loss.max()) for run in runs)
    end = float(times[-1] + after.durations[-1])
    axes.set(ylim=(0, 1.06 * max(top, report.target_loss, 1e-6)), xlim=(times[0], end))
    axes.set(xlabel="time [s]", ylabel="contrast loss [1]")
    legend_above(axes)


def _draw_loops(axes: Axes, report: TuningReport) -> None:
    """Draw L over frequency for both gains, the point -1, and the region that the gain margin leaves free."""
    least = 10 ** (report.least_gain_margin_db / 20)
    axes.axvspan(REAL[0], -1 / least, color=LIMIT, alpha=0.08, linewidth=0)
    axes.axhline(0, color=FAINT, linewidth=0.8, zorder=0)
    axes.axvline(0, color=FAINT, linewidth=0.8, zorder=0)
    axes.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor=MUTED, linestyle=":", linewidth=0.8))
    frequency, frames = np.geomspace(1e-3, math.pi, 2000), report.gain_rate / report.frame_rate
    for loop, colour in ((report.before, BASELINE), (report.after, OURS)):
        gains = FrameGains(loop.proportional, loop.integral * frames, loop.derivative / frames)
        around = open_loop(gains, report.slope, frequency)
        axes.plot(around.real, around.imag, color=colour)
        axes.plot(around.real[-1], around.imag[-1], "o", color=colour, ms=0.5 * text_size())
    axes.plot(-1, 0, "x", color=LIMIT, ms=0.9 * text_size(), mew=1.6)
    axes.annotate("rings", (-1, 0), xytext=(-8, 8), textcoords="offset points", ha="right", color=LIMIT)
    axes.set(xlim=REAL, ylim=IMAGINARY)
    axes.set(xlabel="real part of the open loop L", ylabel="imaginary part")


def _write_margins(figure: Figure, left: float, top: float, report: TuningReport) -> None:
    """Write the gains and margins of both beside the plane."""
    line = 1.6 * PAGE.em
    for loop, colour, name in (
        (report.before, BASELINE, "gains as given"), (report.after, OURS, "gains tuned")
    ):  # fmt: skip
        for words in (name, *_margin_words(loop)):
            text_at(figure, left, top, words, color=colour if words is name else INK)
            top += line
        top += 0.6 * line
    notes = (
        f"Gains for frames of 1/{report.gain_rate:.4g} s; loop at the slope {short(report.slope)},",
        f"steeper than which {100 * (1 - report.quantile):.3g} % of the frames are "
        f"(steepest {short(report.steepest_slope)}).",
        f"Shaded: a gain margin below {report.least_gain_margin_db:.0f} dB; phase margin asked for",
        f"{report.least_phase_margin:.0f}°. Dots: waves of two frames. Dotted: a gain of 1.",
    )
    for words in notes:
        text_at(figure, left, top, words, color=MUTED, fontsize=0.92 * text_size())
        top += 0.9 * line


def _margin_words(loop: LoopReport) -> tuple[str, ...]:
    """Return gains and margins in words."""
    gain = "none needed" if loop.gain_margin_db is None else f"{loop.gain_margin_db:.1f} dB"
    phase = "no gain of 1" if loop.phase_margin is None else f"{loop.phase_margin:.0f}°"
    peak = "not stable" if loop.sensitivity_peak is None else f"{loop.sensitivity_peak:.2f}"
    return (
        f"K_p {loop.proportional:.3g}, K_i {loop.integral:.3g}, K_d {loop.derivative:.3g}",
        f"gain margin {gain}, phase margin {phase}",
        f"waves of the content amplified at most: {peak}",
        f"held back in {100 * loop.share_limited:.0f} % of the time",
    )


def target_figure(rows: Sequence[TargetRow], name: str, about: tuple[int, float]) -> Figure:
    """Draw mean brightness, mean loss and its standard deviation over the target.

    Parameters
    ----------
    rows, name : sequence of TargetRow, str
        By rising target; of the video.
    about : (int, float)
        Its number of frames, and the lowest factor allowed.
    """
    em, (n_frames, lowest) = PAGE.em, about
    with look(PAGE):
        left, gap = 5.2 * em, 5.6 * em
        width = (PAGE.width - left - 2 * gap - 1.5 * em) / 3
        lines, above = heading_lines(*_sweep_heading(rows, name, n_frames), PAGE.width - left - em, em)
        top, height = above + 2.4 * em, 14 * em
        figure = new_figure(PAGE, top + height + 4.4 * em)
        lines_at(figure, left, lines)
        panels = [axes_at(figure, left + k * (width + gap), top, width, height) for k in range(3)]
        target = np.array([row.target_loss for row in rows])
        reach = 1.06 * max(float(target.max()), *(row.mean_loss for row in rows), 1e-6)
        factor, loss, spread = panels
        factor.axhline(lowest, color=MUTED, linestyle=(0, (1, 2)), linewidth=1.0)
        factor.text(reach, lowest - 0.02, "lowest allowed", color=MUTED, va="top", ha="right")
        factor.plot(target, [row.mean_factor for row in rows], "o-", color=OURS)
        factor.set(ylim=(0, 1.03), ylabel="mean brightness factor [1]")
        loss.plot([0, reach], [0, reach], color=FAINT)
        loss.text(0.93 * reach, 0.84 * reach, "as asked", color=MUTED, ha="right", va="top")
        loss.plot(target, [row.mean_loss for row in rows], "o-", color=OURS)
        loss.set(ylim=(0, reach), ylabel="mean contrast loss [1]")
        constant = [row.sd_loss_constant for row in rows]
        ours = [row.sd_loss for row in rows]
        spread.plot(target, constant, "o--", color=BASELINE, label="constant")
        spread.plot(target, ours, "o-", color=OURS, label="controlled")
        spread.set(ylim=(0, 1.08 * max(*constant, *ours, 1e-6)), ylabel="SD of the loss over time [1]")
        legend_above(spread)
        for axes in panels:
            axes.set(xlim=(0, reach), xlabel="target contrast loss [1]")
            axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    return figure


def _sweep_heading(rows: Sequence[TargetRow], name: str, n_frames: int) -> tuple[str, str]:
    """Return title and subtitle."""
    ratios = [row.sd_loss / row.sd_loss_constant for row in rows if row.sd_loss_constant > 0]
    steady = (
        f"; the loss varies {min(ratios):.2f} to {max(ratios):.2f} times as much as with constant dimming of "
        "equal mean brightness"
        if ratios
        else ""
    )
    return (
        f"What tolerating a loss of contrast saves: {name.replace('_', ' ')}",
        f"{n_frames} frames, online controller, each point a run of its own{steady}.",
    )
