"""The figure of a sweep over target losses: what tolerating a loss saves, and how steadily it is held."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    MUTED,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
)
from evenlight.data_schema.control import TargetRow


def target_figure(rows: Sequence[TargetRow], name: str, about: tuple[int, float]) -> Figure:
    """Draw mean brightness, mean loss and its standard deviation over the target.

    Parameters
    ----------
    rows : sequence of TargetRow
        By rising target.
    name : str
        Of the video.
    about : (int, float)
        Its number of frames, and the lowest factor allowed.
    """
    em, (n_frames, lowest) = PAGE.em, about
    with look(PAGE):
        left, gap = 5.2 * em, 5.6 * em
        width = (PAGE.width - left - 2 * gap - 1.5 * em) / 3
        lines, above = heading_lines(*_heading(rows, name, n_frames), PAGE.width - left - em, em)
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


def _heading(rows: Sequence[TargetRow], name: str, n_frames: int) -> tuple[str, str]:
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
