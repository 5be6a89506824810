"""What the figures of sweeps share: panels on a page, shares over time, and points with error bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from evenlight.analysis.figure_style import (
    FAINT,
    INK,
    MUTED,
    OURS,
    PAGE,
    Medium,
    heading_lines,
    lines_at,
    new_figure,
    text_size,
)
from evenlight.data_schema.recordings.sweep import SweepPhase

ROWS, COLUMNS = 2, 2  # of panels on a page
ROW = 3.0  # [inch] height of a row of panels with their names of axes, on a page of the report

PHASE_MARKS = {
    SweepPhase.WARM_UP: ("s", MUTED, "warm-up"),
    SweepPhase.SWEEP: ("o", INK, "sweep"),
    SweepPhase.DRIFT: ("D", OURS, "repeat at the end"),
}


def page_of_panels(medium: Medium, heading: tuple[str, str]) -> tuple[Figure, list[Axes]]:
    """Return a figure with a heading and four panels, two in a row, and the panels in reading order.

    Parameters
    ----------
    medium : Medium
        Where it is shown.
    heading : (str, str)
        Title, and the line below it.
    """
    em = medium.em
    lines, above = heading_lines(*heading, medium.width - 6 * em, em)
    whole = above + ROWS * ROW * medium.width / PAGE.width
    figure = new_figure(medium, whole)
    lines_at(figure, 5.5 * em, lines)
    grid = figure.add_gridspec(
        ROWS, COLUMNS, left=5.5 * em / medium.width, right=1 - 1.5 * em / medium.width,
        top=1 - (above + 2.6 * em) / whole, bottom=4.2 * em / whole,
        wspace=0.26, hspace=0.46,
    )  # fmt: skip
    return figure, [figure.add_subplot(grid[row, column]) for row in range(ROWS) for column in range(COLUMNS)]


def name_panel(axes: Axes, letter: str, words: str) -> None:
    """Write the letter of a panel and what it shows above it."""
    axes.set_title(f"{letter}  {words}", loc="left", pad=0.7 * text_size(), fontweight="bold")


def draw_points(axes: Axes, x: ArrayLike, y: ArrayLike, half: ArrayLike, label: str) -> None:
    """Draw measured points with their error bars."""
    size = text_size()
    axes.errorbar(x, y, yerr=half, fmt="o", color=INK, ms=0.42 * size, capsize=0.2 * size,
                  elinewidth=size / 10, capthick=size / 10, label=label, zorder=4)  # fmt: skip


def half_width(errors: ArrayLike, freedom: float) -> NDArray[np.float64]:
    """Return half the 95 % confidence interval of means with some standard errors.

    Parameters
    ----------
    errors : array_like
        Standard errors.
    freedom : float
        Degrees of freedom that they are known with (Student's t); 0 for errors that are assumed.

    >>> half_width([1.0, 2.0], 10).round(3).tolist()  # t of 10 degrees of freedom: 2.228
    [2.228, 4.456]
    """
    quantile = stats.t.ppf(0.975, freedom) if freedom > 0 else stats.norm.ppf(0.975)
    return float(quantile) * np.asarray(errors, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class TimedReading:
    """One reading of a sweep.

    Attributes
    ----------
    phase : SweepPhase
        What for.
    time : float
        When, since the sweep began [s].
    level : float
        Pixel value or brightness factor that was shown.
    value : float
        What was read.
    """

    phase: SweepPhase
    time: float
    level: float
    value: float


def from_level_means(readings: Sequence[TimedReading]) -> list[tuple[SweepPhase, float, float]]:
    """Return phase, time [s] and deviation [%] of readings that tell of warm-up and drift.

    Only of levels that were read outside of the sweep too; the deviation is from the level's mean in the
    sweep. A level whose mean is 0 tells nothing.

    >>> swept, again = TimedReading(SweepPhase.SWEEP, 0, 1, 2.0), TimedReading(SweepPhase.DRIFT, 9, 1, 1.5)
    >>> from_level_means([swept, again])[1]
    (<SweepPhase.DRIFT: 'drift'>, 9, -25.0)
    """
    repeated = {r.level for r in readings if r.phase is not SweepPhase.SWEEP}
    means = {
        level: float(np.mean([r.value for r in readings if r.level == level and r.phase is SweepPhase.SWEEP]))
        for level in repeated
    }
    shown = [r for r in readings if means.get(r.level, 0.0) > 0]
    return [(r.phase, r.time, 100 * (r.value / means[r.level] - 1)) for r in shown]


def draw_over_time(axes: Axes, readings: Sequence[TimedReading], quantity: str) -> None:
    """Draw the readings that tell of warm-up and drift over time, each from its level's mean.

    Parameters
    ----------
    axes : Axes
        Where.
    readings : sequence of TimedReading
        All of a sweep.
    quantity : str
        What was read.
    """
    shown = from_level_means(readings)
    if not shown:
        axes.set_axis_off()
        words = "neither a warm-up nor a repeat at the end was read"
        axes.text(0.0, 0.5, words, color=MUTED, transform=axes.transAxes)
        return
    for phase, (mark, colour, name) in PHASE_MARKS.items():
        own = [(time / 60, percent) for what, time, percent in shown if what is phase]
        if own:
            axes.plot(*zip(*own, strict=True), mark, color=colour, ms=0.36 * text_size(), mew=0, label=name,
                      zorder=3)  # fmt: skip
    axes.axhline(0, color=FAINT, linewidth=text_size() / 11, zorder=1)
    axes.set(xlabel="time since the sweep began [min]", ylabel=f"{quantity}, from its level's mean [%]")
    widen(axes, 1.2)
    legend_in(axes, "best")


def widen(axes: Axes, least: float) -> None:
    """Let the vertical axis reach at least so far to both sides of 0, so that noise does not look large."""
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -least), max(high, least))


Corner = Literal["best", "lower right", "upper left", "upper right"]


def legend_in(axes: Axes, place: Corner, columns: int = 1) -> None:
    """Put the legend into a corner of some axes, clear of their frame."""
    axes.legend(loc=place, ncols=columns, borderaxespad=0.6)


def plain_log_scale(axes: Axes) -> None:
    """Give some axes a logarithmic vertical scale with plain numbers."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
