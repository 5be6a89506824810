"""The figures of the interaction: time over brightness ratio, and rings found over time on either side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import Bbox

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    drawable,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.search.search_locations import LocationLine
from evenlight.analysis.search.search_shares import FoundOverTime
from evenlight.analysis.search.search_trials import Location
from evenlight.data_schema.analysis_results import Origin, PlottedPoint

TICKS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0)
LINE_STEPS = 61
MOST_NAMED = 4
STEPS_ASIDE = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.5, -4.5, 6.0, -6.0)  # of a name [lines of text]
FURTHEST = math.log(12.0)  # an interval beyond is drawn with an arrow


def brightness_figure(
    locations: Sequence[Location],
    effects: Mapping[int, FixedEffect],
    line: LocationLine | str,
    heading: tuple[str, str],
    medium: FigureFormat = PAGE,
) -> Figure:
    """Draw the ratio of times at each location over the ratio of brightness, and the line through them.

    Parameters
    ----------
    locations : sequence of Location
        Where people searched.
    effects : mapping of int to FixedEffect
        Of ours at each of them, in ln(time).
    line : LocationLine or str
        Through them, or why there is none.
    heading : (str, str)
        Title and subtitle.
    medium : FigureFormat
        Where it is shown.
    """
    shown = _shown(locations, effects)
    with look(medium):
        em = medium.em
        left = 5.2 * em
        width = medium.width - left - 1.5 * em
        lines, above = heading_lines(*heading, medium.width - 2 * em, em)
        height = 0.5 * width
        figure = new_figure(medium, above + 1.4 * em + height + 6.4 * em)
        lines_at(figure, em, lines)
        axes = axes_at(figure, left, above + 1.4 * em, width, height)
        _frame(axes, shown)
        if not isinstance(line, str):
            _draw_line(axes, line, _line_places(line, [x for x, _, _ in shown]))
        _draw_locations(axes, shown)
        _name_the_odd(axes, shown)
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, -4.0 * em / height), ncols=4)
    return figure


def brightness_points(
    locations: Sequence[Location],
    effects: Mapping[int, FixedEffect],
    line: LocationLine | str,
    n: int,
    origin: Origin,
) -> tuple[PlottedPoint, ...]:
    """Return every number that the figure draws."""
    axes = ("brightness of ours / baseline", "1", "search time of ours / baseline", "1", origin)
    points = [
        PlottedPoint("times", "location", name, math.exp(x), math.exp(effect.estimate or 0.0), *axes,
                     low=_exp(effect.ci_low), high=_exp(effect.ci_high), n=n)
        for x, effect, name in _shown(locations, effects)
    ]  # fmt: skip
    if not isinstance(line, str):
        x = _line_places(line, [x for x, _, _ in _shown(locations, effects)])
        points += [
            PlottedPoint("times", "line over locations", "", math.exp(at), math.exp(y), *axes,
                         low=math.exp(low), high=math.exp(high), n=len(line.locations))
            for at, y, low, high in zip(x, *line.band(x), strict=True)
        ]  # fmt: skip
    return tuple(points)


_Shown = tuple[float, FixedEffect, str]


def _shown(locations: Sequence[Location], effects: Mapping[int, FixedEffect]) -> list[_Shown]:
    """Return ln(brightness ratio), effect and name of each location that has both."""
    found = []
    for k, effect in effects.items():
        x = locations[k].ln_ratio
        if x is not None and effect.estimate is not None:
            found.append((x, effect, locations[k].name.replace("_", " ").replace("/", ": ")))
    return found


def _exp(value: float | None) -> float | None:
    """Return e^value of a value that is there."""
    return None if value is None else math.exp(value)


def _line_places(line: LocationLine, x: Sequence[float]) -> np.ndarray:
    """Return where the line is drawn: from the most dimmed to the most brightened location."""
    return np.linspace(min(x), max(x), LINE_STEPS)


def _frame(axes: Axes, shown: list[_Shown]) -> None:
    """Set the axes: both logarithmic, with the lines of no difference."""
    size = text_size()
    x = [place for place, _, _ in shown] or [0.0]
    reached = [min(abs(end), FURTHEST) for _, e, _ in shown for end in (e.ci_low, e.ci_high) if end]
    widest = 1.12 * max([abs(place) for place in x] + [0.1])
    reach = 1.08 * max([*reached, 0.3])
    axes.set(xlim=(-widest, widest), ylim=(-reach, reach))
    axes.axhline(0.0, color=INK, linewidth=size / 10, zorder=1)
    axes.axvline(0.0, color=MUTED, linewidth=size / 12, linestyle=(0, (1, 2)), zorder=1)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(FixedLocator([math.log(tick) for tick in TICKS]))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{math.exp(value):.3g}"))
        axis.set_minor_locator(NullLocator())
    axes.set_xlabel("brightness factor of ours / baseline")
    axes.set_ylabel("search time of ours / baseline")
    for words, across, down, ha, va in (
        ("← ours dims", 0.0, 1.0, "left", "bottom"),
        ("ours brightens →", 1.0, 1.0, "right", "bottom"),
        (" ours slower", 0.0, 0.99, "left", "top"),
        (" ours faster", 0.0, 0.01, "left", "bottom"),
    ):
        axes.text(across, down, words, transform=axes.transAxes, ha=ha, va=va, color=MUTED)


def _draw_line(axes: Axes, line: LocationLine, x: np.ndarray) -> None:
    """Draw the line through the locations, and its band, as far as there are locations."""
    middle, low, high = line.band(x)
    axes.plot(x, middle, color=OURS, zorder=3, label="line over locations")
    axes.fill_between(
        x, low, high, color=OURS, alpha=0.14, linewidth=0, zorder=0.5, label="its 95 % confidence band"
    )


def _draw_locations(axes: Axes, shown: list[_Shown]) -> None:
    """Draw each location with its interval."""
    size = text_size()
    low_end, high_end = axes.get_ylim()
    for x, effect, _ in shown:
        low = low_end if effect.ci_low is None else max(effect.ci_low, low_end)
        high = high_end if effect.ci_high is None else min(effect.ci_high, high_end)
        axes.plot([x, x], [low, high], color=BASELINE, linewidth=size / 8, alpha=0.75, zorder=2)
    axes.plot([x for x, _, _ in shown], [e.estimate or 0.0 for _, e, _ in shown], "o", color=BASELINE,
              ms=0.62 * size, mec="white", mew=size / 14, zorder=4, label="a location, 95 %")  # fmt: skip


def _name_the_odd(axes: Axes, shown: list[_Shown]) -> None:
    """Name the locations whose interval excludes a ratio of 1, each where it covers no other."""
    size = text_size()
    odd = [item for item in shown if item[1].p_value is not None and item[1].p_value < 0.05]
    to_points = axes.transData.transform
    per_point = axes.figure.dpi / 72
    taken = [Bbox(_bar(axes, item)) for item in shown]
    inside = axes.get_window_extent()
    for x, effect, name in sorted(odd, key=lambda item: item[1].p_value or 0.0)[:MOST_NAMED]:
        words = drawable(name)
        wide, high = (per_point * length for length in (0.52 * 0.9 * size * len(words), 1.2 * size))
        across, height = to_points((x, effect.estimate or 0.0))
        boxes = [
            Bbox.from_bounds(
                across + (gap if side > 0 else -gap - wide), height + step * high - high / 2, wide, high
            )
            for step in STEPS_ASIDE
            for side in (1, -1)
            for gap in (0.7 * size * per_point,)
        ]
        within = [box for box in boxes if inside.x0 <= box.x0 and box.x1 <= inside.x1
                  and inside.y0 <= box.y0 and box.y1 <= inside.y1] or boxes  # fmt: skip
        best = min(within, key=lambda box: sum(box.overlaps(other) for other in taken))
        taken.append(best)
        leftwards = best.x1 < across
        end = (best.x1 if leftwards else best.x0), (best.y0 + best.y1) / 2
        left, up = axes.transData.inverted().transform(end)
        axes.text(left, up, words, va="center",
                  ha="right" if leftwards else "left", fontsize=0.9 * size, zorder=5)  # fmt: skip


def _bar(axes: Axes, item: _Shown) -> np.ndarray:
    """Return the corners of what is drawn of a location, in pixels."""
    x, effect, _ = item
    bottom, top = axes.get_ylim()
    low = bottom if effect.ci_low is None else max(effect.ci_low, bottom)
    high = top if effect.ci_high is None else min(effect.ci_high, top)
    half = np.array([0.3 * text_size() * axes.figure.dpi / 72, 0.0])
    ends = axes.transData.transform([(x, low), (x, high)])
    return np.array([ends[0] - half, ends[1] + half])


def curves_figure(
    curves: tuple[FoundOverTime, ...], heading: tuple[str, str], medium: FigureFormat = PAGE
) -> Figure:
    """Draw the share of the rings found over time.

    Parameters
    ----------
    curves : tuple of FoundOverTime
        At least one.
    heading : (str, str)
        Title and subtitle.
    medium : FigureFormat
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
    searches = ", ".join(f"{curve.version} {curve.n}" for curve in curves)
    title = f"{curves[0].panel} (searches: {searches})"
    axes.annotate(title, (0.0, 1.0), xycoords="axes fraction", xytext=(0, 0.6 * size),
                  textcoords="offset points", color=MUTED)  # fmt: skip
