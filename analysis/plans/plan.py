"""What a plan is, whatever is planned: rows, an answer in words, a figure, and the files of these."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from evenlight.analysis import figure_style as style
from evenlight.analysis.plans.questions import Row
from evenlight.analysis.plans.questions import people_in_words as people_in_words
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.results import Result
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json

if TYPE_CHECKING:
    import pandas as pd

LOOKS = (
    cycler(color=[style.OURS, style.INK, style.BASELINE, style.LIMIT, style.PARTICIPANT, style.LOST])
    + cycler(marker=["o", "s", "D", "^", "v", "P"])
    + cycler(
        linestyle=["-", (0, (5, 1.6)), (0, (2.5, 1.4)), (0, (1, 1.2)), (0, (6, 1.4, 1, 1.4)), (0, (3, 3))]
    )
)


class Panel(NamedTuple):
    """A panel of the figure: a column over another, and what is wanted of it."""

    x: str
    y: str
    label: str
    wanted: float | None = None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Plan(Result):
    """A plan of an experiment."""

    made_by: ClassVar = "plan"
    title: str
    rows: tuple[Row, ...]  # for each number of participants, and each test, or each design with so many ramps
    answer: tuple[str, ...]  # what it comes to, in sentences, the most important first
    said: tuple[str, ...]  # the same as a terminal says it, with what it rests on
    key_figures: tuple[KeyFigure, ...]
    about: Mapping[str, Any]  # what else `plan.json` says
    provenance: Provenance
    figure: Figure

    @property
    def heading(self) -> str:
        """What is planned."""
        return self.title

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What it comes to, and the key figures."""
        return self.answer[0], self.key_figures

    @property
    def figures(self) -> Mapping[str, Figure]:
        """Its one figure."""
        return {"plan": self.figure}

    def to_frame(self) -> pd.DataFrame:
        """Return the rows as a pandas table: the columns of `plan.csv`."""
        return frame_of(self.rows)

    def write(self, folder: Path) -> None:
        """Write `plan.csv`, `plan.json` and `plan.png`."""
        rows = [mapping_from_record(row) for row in self.rows]
        content = {"in_words": list(self.answer), "simulated": True, **self.about, "rows": rows}
        write_rows(folder / "plan.csv", type(self.rows[0]), self.rows)
        write_json(folder / "plan.json", content | {"provenance": mapping_from_record(self.provenance)})
        style.write_figure(folder / "plan.png", self.figure)


def frame_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Return rows as a pandas table."""
    import pandas as pd

    return pd.DataFrame([mapping_from_record(row) for row in rows])


def plan_figure(
    title: str, about: str, lines: Mapping[str, pd.DataFrame], rows: list[list[Panel]], heights: list[float]
) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure of columns of tables, each table a line by its label, and the panels by column.

    A value is drawn with its ends (`COLUMN_low`, `COLUMN_high`). Over participants, an axis with plain
    numbers where some were tried, lines are set off from each other, so that their bars can be told apart.
    """
    mosaic = [["key", "key"], *([own.y for own in row for _ in range(2 // len(row))] for row in rows)]
    figure, axes = style.panels(title, about, mosaic, [max(1.7 * len(lines) - 4, 1), *heights], apart=5)
    for own in (panel for row in rows for panel in row):
        axes[own.y].set_prop_cycle(LOOKS)
        for k, (label, line) in enumerate(lines.items()):
            columns = line[[own.x, own.y, f"{own.y}_low", f"{own.y}_high"]]
            at, value, low, high = columns.astype(float).dropna().drop_duplicates().to_numpy().T
            at = at * 1.012**k if own.x == "participants" else at
            ends = [value - low, high - value]
            axes[own.y].errorbar(
                at, value, yerr=ends, elinewidth=0.8, linewidth=1.1, label=style.drawable(label)
            )
        axes[own.y].set(xlabel=own.x.replace("minutes", "minutes per participant"), ylabel=own.label)
        if own.wanted is not None:
            axes[own.y].axhline(own.wanted, color=style.MUTED, ls=(0, (4, 3)), lw=0.9, marker="", zorder=1)
        if own.x == "participants":
            numbers = sorted({n for line in lines.values() for n in line[own.x]})
            plain_logarithmic(axes[own.y], "x", numbers)
            axes[own.y].set_xlim(numbers[0] / 1.12, numbers[-1] * 1.12)
    axes["key"].legend(*axes[rows[0][0].y].get_legend_handles_labels(), loc="upper left", handlelength=3.0)
    axes["key"].set_axis_off()
    return figure, axes


def plain_logarithmic(axes: Axes, which: str, ticks: Sequence[float]) -> None:
    """Make an axis, "x" or "y", logarithmic, with plain numbers at some ticks."""
    axes.set(**{f"{which}scale": "log"})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")
