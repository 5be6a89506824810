"""The figure of the search over time: share of the rings found, where ours dims and where it brightens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    MUTED,
    OURS,
    PAGE,
    Medium,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.search.search_shares import clustered_share
from evenlight.analysis.search.search_sides import Side
from evenlight.analysis.search.search_trials import SearchTable
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.statistic import Origin, PlottedPoint

STEPS = 45


@dataclass(frozen=True, slots=True)
class FoundOverTime:
    """Share of the rings found until a time, of one version on one side.

    Attributes
    ----------
    panel, version : str
        Which side, and which version.
    locations, n : int
        How many locations, and searches.
    times, share : array (k,)
        Time [s], and the share found until then.
    low, high : array (k,)
        95 % band over people; nan for one person.
    """

    panel: str
    version: str
    locations: int
    n: int
    times: Array
    share: Array
    low: Array
    high: Array


def found_over_time(table: SearchTable) -> tuple[FoundOverTime, ...]:
    """Return the shares found over time, up to the shortest limit: until then every search is watched.

    So there is nothing censored within, and one minus the Kaplan-Meier curve is the share itself, whose band
    can respect that a person's searches are alike.
    """
    sides = table.sides[table.location]
    curves = []
    for panel, side in (("ours dims", Side.DIMMED), ("ours brightens", Side.BRIGHTENED)):
        for version, ours in (("ours", True), ("baseline", False)):
            own = table.some((sides == side) & (table.ours == ours))
            if own.times.size:
                curves.append(_curve(own, panel, version, float(table.limits.min())))
    return tuple(curves)


def _curve(own: SearchTable, panel: str, version: str, limit: float) -> FoundOverTime:
    """Return one curve with its band."""
    times = np.linspace(0.0, limit, STEPS + 1)
    shares = [clustered_share(own.found & (own.times <= time), own.participant) for time in times]
    value, low, high = (
        np.array([np.nan if end is None else end for end in ends])
        for ends in zip(*((s.value, s.ci_low, s.ci_high) for s in shares), strict=True)
    )
    locations = int(np.unique(own.location).size)
    return FoundOverTime(panel, version, locations, own.times.size, times, value, low, high)


def curves_figure(
    curves: tuple[FoundOverTime, ...], heading: tuple[str, str], medium: Medium = PAGE
) -> Figure:
    """Draw the share of the rings found over time.

    Parameters
    ----------
    curves : tuple of FoundOverTime
        At least one.
    heading : (str, str)
        Title and subtitle.
    medium : Medium
        Where it is shown.
    """
    panels = list(dict.fromkeys(curve.panel for curve in curves))
    with look(medium):
        em = medium.em
        left, gap = 4.6 * em, 2.2 * em
        width = (medium.width - left - 1.5 * em - gap) / 2
        lines, above = heading_lines(*heading, medium.width - 2 * em, em)
        top, height = above + 2.2 * em, 0.62 * width
        figure = new_figure(medium, top + height + 4.2 * em)
        lines_at(figure, em, lines)
        for number, panel in enumerate(panels):
            axes = axes_at(figure, left + number * (width + gap), top, width, height)
            _draw_panel(axes, [curve for curve in curves if curve.panel == panel])
            if number == 0:
                axes.set_ylabel("rings found [%]")
                axes.legend(loc="lower right", bbox_to_anchor=(0.98, 0.04))
            else:
                axes.set_yticklabels([])
    return figure


def curves_points(curves: tuple[FoundOverTime, ...], origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return every number that the figure draws."""
    return tuple(
        PlottedPoint(
            curve.panel, curve.version, "", float(time), 100 * float(share), "search time", "s",
            "rings found", "%", origin, low=_percent(low), high=_percent(high), n=curve.n,
        )
        for curve in curves
        for time, share, low, high in zip(curve.times, curve.share, curve.low, curve.high, strict=True)
    )  # fmt: skip


def _percent(share: float) -> float | None:
    """Return a share in percent; None for none."""
    return None if np.isnan(share) else 100 * float(share)


def _draw_panel(axes: Axes, curves: list[FoundOverTime]) -> None:
    """Draw both versions on one side."""
    size = text_size()
    for curve in curves:
        colour = OURS if curve.version == "ours" else BASELINE
        axes.plot(curve.times, 100 * curve.share, color=colour, zorder=3, label=f"{curve.version}, 95 % band")
        axes.fill_between(
            curve.times, 100 * curve.low, 100 * curve.high, color=colour, alpha=0.16, linewidth=0
        )
    axes.set(xlim=(0, curves[0].times[-1]), ylim=(0, 100), xlabel="search time [s]")
    axes.set_yticks(range(0, 101, 20))
    axes.grid(color=FAINT, linewidth=size / 18)
    title = f"{curves[0].panel}: {curves[0].locations} locations, {curves[0].n} searches each"
    axes.annotate(title, (0.0, 1.0), xycoords="axes fraction", xytext=(0, 0.6 * size),
                  textcoords="offset points", color=MUTED)  # fmt: skip
