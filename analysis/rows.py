"""Numbers as rows, and tables and figures as views of them.

An analysis adds each number once, as a row. A table of the report picks rows by what they are (`Rows.view`);
a figure draws through a `Plot`, which notes what it draws. So no number is written in two places.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from matplotlib.axes import Axes

from evenlight.analysis.inference.fixed_effects import SEPARATING
from evenlight.analysis.inference.paired_effects import LEVEL, Effect
from evenlight.analysis.report import Cell, Table
from evenlight.analysis.wording import of_track, p_in_words, p_text, percent
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic

Column = Callable[[Statistic | None], Sequence[Cell]]
NOT_BOUNDED = "not bounded"


class Rows(list[Statistic]):
    """The numbers of an analysis, in the order in which they are read."""

    def __init__(self, origin: Origin) -> None:
        super().__init__()
        self.origin = origin

    def add(
        self,
        table: str,
        group: str,
        what: str,
        unit: str,
        method: str,
        effect: Effect | float | None,
        n: int | None = None,
        *,
        p: float | None = None,
        p_adjusted: float | None = None,
        flag: str = "",
        level: float = LEVEL,
        origin: Origin | None = None,
    ) -> None:
        """Add a number: an effect with its interval, or a plain one; `flag` says why there is none.

        Parameters are the fields of `Statistic`; `level` counts only where the effect has an interval, and p
        is that of the effect if there is no other.
        """
        own = effect if isinstance(effect, Effect) else Effect(effect)
        bounded = own.ci_low is not None or own.ci_high is not None
        self.append(
            Statistic(
                table=table,
                group=group,
                what=what,
                value=own.value,
                unit=unit,
                origin=origin or self.origin,
                ci_low=own.ci_low,
                ci_high=own.ci_high,
                interval=level if bounded else None,
                p_value=own.p_value if p is None else p,
                p_adjusted=p_adjusted,
                n=n,
                method=method,
                flag=flag or own.flag,
            )
        )

    def find(self, table: str, group: str, what: str) -> Statistic | None:
        """Return a row, or None."""
        return next((r for r in self if (r.table, r.group, r.what) == (table, group, what)), None)

    def separated(self) -> list[str]:
        """Return the first effect of a model that runs to infinity, as the answers separate: a warning."""
        endless = (r for r in self.of("model") if any(flag.value in r.flag for flag in SEPARATING))
        return [f"{of_track(r.what)}: {r.flag}" for r in itertools.islice(endless, 1)]

    def of(self, table: str, beginning: str = "") -> list[Statistic]:
        """Return the rows of a table whose name begins so; the beginning is taken off."""
        own = [r for r in self if r.table == table and r.what.startswith(beginning)]
        return [replace(r, what=r.what.removeprefix(beginning)) for r in own]

    def view(
        self,
        caption: str,
        groups: Mapping[str, str],
        columns: Sequence[tuple[str, str, Column]],
        names: Sequence[str],
    ) -> Table:
        """Return a table with a row per group.

        Parameters
        ----------
        caption : str
            What it lists.
        groups : mapping of str to str
            The rows: the group in the statistics, and the words in the first column.
        columns : sequence of (table, what, column)
            The statistic of each group that is looked up, and how it is shown: `number`, `with_interval`, …
        names : sequence of str
            Headers of all cells, that of the groups first.
        """
        cells = (
            (words, *(cell for table, what, show in columns for cell in show(self.find(table, group, what))))
            for group, words in groups.items()
        )
        return Table(caption, tuple(names), tuple(cells))


def table_of(
    caption: str,
    rows: Iterable[tuple[str, Statistic | None]],
    shows: Sequence[Column],
    names: Sequence[str],
) -> Table:
    """Return a table with a line for each of some rows: the words in its first column, and the row."""
    cells = ((words, *(cell for show in shows for cell in show(row))) for words, row in rows)
    return Table(caption, tuple(names), tuple(cells))


def number(row: Statistic | None, digits: int = 2) -> tuple[Cell]:
    """Return a value; no "-0.00"."""
    return (None if row is None or row.value is None else f"{row.value:z.{digits}f}",)


def significant(row: Statistic | None, digits: int = 2) -> tuple[Cell]:
    """Return a value with so many significant digits: one that is known to some percent only."""
    return (None if row is None or row.value is None else f"{row.value:.{digits}g}",)


def count(row: Statistic | None) -> tuple[Cell]:
    """Return a whole number."""
    return (None if row is None or row.value is None else int(row.value),)


def with_interval(row: Statistic | None, digits: int = 2) -> tuple[Cell, Cell]:
    """Return a value and its interval; one with a single end in words."""
    return (*number(row, digits), interval(row, digits))


def interval(row: Statistic | None, digits: int = 2) -> str | None:
    """Return the interval of a value, in words where it has one end."""
    low, high = (None, None) if row is None else (row.ci_low, row.ci_high)
    if low is not None and high is not None:
        return f"{low:z.{digits}f} to {high:z.{digits}f}"
    if low is not None:
        return f"above {low:z.{digits}f}"
    return None if high is None else f"below {high:z.{digits}f}"


def ratio_with_interval(row: Statistic | None, most: float) -> tuple[Cell, Cell]:
    """Return a ratio and its interval; what lies beyond `most`, what the data can hold, is not bounded."""
    value: Cell = number(row)[0]
    if row is not None and row.value is not None and not 1 / most <= row.value <= most:
        value = NOT_BOUNDED
    if row is None or (row.ci_low is None and row.ci_high is None):
        return value, None
    low = row.ci_low if row.ci_low is not None and row.ci_low > 1 / most else None
    high = row.ci_high if row.ci_high is not None and row.ci_high < most else None
    held = interval(replace(row, ci_low=low, ci_high=high))
    if held and (low is None or high is None):
        held += ", no lower bound" if low is None else ", no upper bound"
    return value, held or NOT_BOUNDED


def how_sure(row: Statistic, most: float | None = None) -> str:
    """Return interval and p of a value, for what stands beside it; of a ratio with `most`, not beyond."""
    held = interval(row) if most is None else ratio_with_interval(row, most)[1]
    words = (
        f"{percent(row.interval or LEVEL, 0)} CI {held}" if held else "",
        "" if row.p_value is None else p_in_words(row.p_value),
    )
    return ", ".join(own for own in words if own)


def p(row: Statistic | None) -> tuple[Cell]:
    """Return a p value."""
    return (p_text(row.p_value) if row else None,)


def p_with_holm(row: Statistic | None) -> tuple[Cell, Cell]:
    """Return a p value and the adjusted one."""
    return (p_text(row.p_value), p_text(row.p_adjusted)) if row else (None, None)


def flag(row: Statistic | None) -> tuple[Cell]:
    """Return what to note."""
    return (row.flag or None if row else None,)


class Plot:
    """Axes of one panel that note every number drawn on them.

    Attributes
    ----------
    axes : Axes
        To draw on.
    points : list of PlottedPoint
        What was drawn.
    """

    def __init__(self, axes: Axes, panel: str, origin: Origin, units: tuple[str, str, str, str]) -> None:
        """Begin a panel; `units` are quantity and unit of the horizontal axis, then of the vertical one."""
        self.axes, self.points = axes, list[PlottedPoint]()
        self._panel, self._origin, self._units = panel, origin, units

    def note(
        self,
        series: str,
        x: float | None,
        y: float | None,
        label: str = "",
        n: int | None = None,
        ends: tuple[float | None, float | None] = (None, None),
        units: tuple[str, str, str, str] | None = None,
        origin: Origin | None = None,
    ) -> None:
        """Note a number that is drawn by hand."""
        self.points.append(
            PlottedPoint(
                self._panel, series, label, x, y, *(units or self._units), origin or self._origin, *ends, n
            )
        )

    def line(self, series: str, x: Sequence[float], y: Sequence[float], **look: Any) -> None:
        """Draw a line, and note its points."""
        for place, value in zip(x, y, strict=True):
            self.note(series, float(place), float(value))
        self.axes.plot(x, y, **look)

    def bar(self, series: str, x: float, y: float, n: int, *, across: bool = False, **look: Any) -> None:
        """Draw a bar at x, or across at y (`side` -1: to the left), and note it."""
        self.note(series, x, y, n=n)
        if across:
            self.axes.barh(y, look.pop("side", 1) * x, **look)
        else:
            self.axes.bar(x, y, **look)

    def interval(
        self,
        series: str,
        label: str,
        row: Statistic,
        at: float,
        size: float,
        units: tuple[str, str, str, str] | None = None,
        *,
        upright: bool,
        **look: Any,
    ) -> None:
        """Draw a value with its interval as a diamond on a line at a place of the other axis, and note it."""
        self.note(series, None, row.value, label, row.n, (row.ci_low, row.ci_high), units)
        if row.value is None:
            return
        if row.ci_low is not None and row.ci_high is not None:
            line = ([at, at], [row.ci_low, row.ci_high])
            self.axes.plot(*(line if upright else line[::-1]), linewidth=size / 6, **look)
        look["zorder"] = look.get("zorder", 2) + 1
        self.axes.plot(
            *((at, row.value) if upright else (row.value, at)), "D", markersize=0.62 * size, **look
        )
