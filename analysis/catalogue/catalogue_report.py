"""What came of a catalogue: its tables, a figure of all videos, a report with a gallery of the results."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evenlight.analysis import figure_style as style
from evenlight.analysis.catalogue.entries import CATALOGUE, FIGURE, REPORT
from evenlight.analysis.player.player_page import PLAYER
from evenlight.analysis.report import Card, KeyFigure, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_sections import CLAIM, provenance_section
from evenlight.analysis.results import Result
from evenlight.analysis.tracks.track_figure import clipped
from evenlight.analysis.tracks.track_words import less_or_more
from evenlight.analysis.wording import percent
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.tracks.catalogue import CatalogueRow

if TYPE_CHECKING:
    import pandas as pd

SHOWN = 20  # rows of a table of the report, at most
NAMED = 40  # videos whose names fit beside the figure
LONGEST_NAME = 26  # characters
LEAST = {  # columns of the report's table, and what they are multiplied by
    "frames": ("frames", 1),
    "budget": ("budget", 1),
    "difference [points]": ("objective", 100),
    "constant [points]": ("objective_baseline", 100),
    "less [%]": ("gain", 100),
    "gap [%]": ("gap", 100),
    "power [W]": ("mean_power", 1),
    "full [W]": ("full_power", 1),
}
CAPTION = (
    "Each row is a video, that whose loss is the most uneven under constant dimming on top. Left: mean "
    "difference of contrast loss between two of its frames, with constant dimming and with its track; a "
    "stroke is the least that any track can have. Right: power saved, as with constant dimming."
)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Catalogue(Result):
    """What came of the videos of a catalogue."""

    made_by: ClassVar = "catalogue"
    rows: tuple[CatalogueRow, ...]  # of each video
    out: Path  # where the folders of the results are: a gallery shows those that are there

    @property
    def heading(self) -> str:
        """What it is."""
        return "A catalogue of brightness tracks"

    @property
    def made(self) -> list[CatalogueRow]:
        """The rows of videos that have a result."""
        return [row for row in self.rows if not row.error]

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What came out, and the key figures."""
        made, count = self.made, len(self.rows)
        failed, cards = count - len(made), []
        words = f"{len(made)} of {count} videos have a track"
        if not failed:
            words = f"All {count} videos have a track" if count > 1 else "The video has a track"
        if gains := [row.gain for row in made if row.gain is not None]:
            gain = less_or_more(float(np.median(gains)))
            words += f"; in the median their loss differs {gain} than with constant dimming"
            ours, constant = (np.median(_points(made, name)) for name in ("objective", "objective_baseline"))
            beside, worst = f"{constant:.2f} with constant dimming", f"worst {less_or_more(min(gains))}"
            what = "difference of loss between two frames, median"
            cards.append(KeyFigure(f"{ours:.2f} points", what, beside))
            cards.append(KeyFigure(gain, "than with constant dimming, median", worst))
        if saved := _saved(made):
            of = f"of {len(saved)} video{'s' * (len(saved) > 1)}"
            cards.append(KeyFigure(f"{100 * np.median(saved):.0f} %", "of power saved, median", of))
        if damaged := sum(bool(row.frames_held or row.frames_skipped) for row in made):
            words += f". Of {damaged}, damage cost pictures, which {CATALOGUE} counts"
        if failed:
            words += f". {failed} failed: {CATALOGUE} says why"
            cards.append(
                KeyFigure(f"{failed} of {count}", "videos failed", f"{CATALOGUE} says why", warns=True)
            )
        return f"{words}.", tuple(cards)

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figure of all videos, if any has a result."""
        return {"catalogue": _figure(self.made)} if self.made else {}

    def to_frame(self) -> pd.DataFrame:
        """Return a row for each video: the columns of `catalogue.csv`."""
        import pandas as pd

        return pd.DataFrame([mapping_from_record(row) for row in self.rows])

    def write(self, folder: Path) -> None:
        """Write `catalogue.csv`, `catalogue.png`, `report.html`; its gallery leads from there to `out`."""
        write_rows(folder / CATALOGUE, CatalogueRow, self.rows)
        caption = "Difference of loss between two frames, and power saved, of each video."
        drawn = (style.write_figure(folder / FIGURE, figure) for figure in self.figures.values())
        pictures = tuple(Picture(png, caption) for png in drawn)
        lead, key_figures = self.first_lines
        sections = (
            *([_overview(self.made, pictures)] if self.made else []),
            *_failures([row for row in self.rows if row.error]),
            *_gallery(self.made, self.out, folder),
            provenance_section({"catalogue": provenance_now()}),
        )
        write_report(folder / REPORT, Report(self.heading, lead, sections, key_figures=key_figures))


def _points(made: Sequence[CatalogueRow], name: str) -> Array:
    """Return a column of losses in percentage points, 0 where a row has none."""
    return np.array([100 * (getattr(row, name) or 0.0) for row in made])


def _saved(made: Sequence[CatalogueRow]) -> list[float]:
    """Return the shares of the power at full brightness that are saved, where they are known."""
    return [1 - row.mean_power / row.full_power for row in made if row.mean_power and row.full_power]


def _figure(made: Sequence[CatalogueRow]) -> Figure:
    """Draw what the caption says of each video with a result; few are named, of many the rows are narrow."""
    rows = sorted(made, key=lambda row: row.objective_baseline or 0.0)  # the last is on top
    named = len(rows) <= NAMED
    with style.look():
        em = style.PAGE.em
        title = f"{len(rows)} videos" if len(rows) > 1 else "1 video"
        lines, above = style.heading_lines(title, CAPTION, style.PAGE.width - 4 * em, em)
        height = max(1.8 * len(rows), 5) if named else 44
        figure = style.new_figure(above + (height + 9) * em)
        style.lines_at(figure, 2 * em, lines)
        names = [style.drawable(clipped(row.name, LONGEST_NAME)) for row in rows] if named else []
        left = (3 + 0.62 * max(map(len, names), default=3)) * em
        width = style.PAGE.width - left - 5 * em
        upper = style.axes_at(figure, left, above + 3 * em, 0.68 * width, height * em)
        right = style.axes_at(figure, left + 0.74 * width, above + 3 * em, 0.26 * width, height * em)
        size = 5.5 if named else 2.2
        _draw_spreads(upper, rows, size)
        saved = {k: 100 * share for k, row in enumerate(rows) for share in _saved([row])}
        right.barh([*saved], [*saved.values()], 0.6 if named else 1.0, color=style.OURS)
        right.set(xlabel="power saved [%]" if saved else "power saved: not known", xlim=(0, 100))
        for axes in (upper, right):
            axes.set_ylim(-0.7, len(rows) - 0.3)
            axes.set_yticks(range(len(names)), names if axes is upper else [""] * len(names))
        upper.set_ylabel("" if named else "videos")
    return figure


def _draw_spreads(axes: Axes, rows: Sequence[CatalogueRow], size: float) -> None:
    places = range(len(rows))
    ours, constant, bound = (
        _points(rows, name) for name in ("objective", "objective_baseline", "lower_bound")
    )
    axes.hlines(places, ours, constant, color=style.INK, linewidth=size / 5, alpha=0.5, zorder=1)
    axes.plot(bound, places, "|", color=style.MUTED, ms=2 * size, label="least possible")
    axes.plot(constant, places, "o", color=style.BASELINE, ms=size, label="constant dimming")
    axes.plot(ours, places, "o", color=style.OURS, ms=size, label="track")
    axes.set(xlabel="difference of loss between two frames [points]", xlim=(0, None))
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.4)


def _overview(made: Sequence[CatalogueRow], pictures: tuple[Picture, ...]) -> Section:
    shown, worked = (sum(some) for some in ([r.duration or 0 for r in made], [r.seconds or 0 for r in made]))
    text = f"{_time(shown)} of video were optimized; that took the workers {_time(worked)}."
    least = sorted((row for row in made if row.gain is not None), key=lambda row: row.gain or 0.0)[:SHOWN]
    columns = {  # those that any row has: power may not be known
        title: column
        for title, column in LEAST.items()
        if any(_scaled(row, *column) is not None for row in least)
    }
    table = Table(
        f"Videos that gained least over constant dimming{_of(len(least), len(made))}; {CATALOGUE} has all. "
        "Difference: mean difference of contrast loss between two frames. Gap: what a better track could "
        "gain at most.",
        ("video", *columns),
        tuple((row.name, *(_scaled(row, *column) for column in columns.values())) for row in least),
    )
    return Section("What was gained", (text, CLAIM), (table,) if least else (), pictures)


def _scaled(row: CatalogueRow, name: str, scale: float) -> float | None:
    value = getattr(row, name)
    return None if value is None else scale * value


def _time(seconds: float) -> str:
    size, unit = next(
        pair for pair in ((3600, "hours"), (60, "minutes"), (0, "seconds")) if seconds >= pair[0]
    )
    return f"{seconds / max(size, 1):.3g} {unit}"


def _of(some: int, every: int) -> str:
    return f", {some} of {every}" if some < every else ""


def _failures(failed: Sequence[CatalogueRow]) -> list[Section]:
    shown = failed[:SHOWN]
    rows = tuple((one.name, one.error) for one in shown)
    table = Table(f"Videos without a track{_of(len(shown), len(failed))}.", ("video", "why"), rows)
    text = "Run the same command again after you have fixed them."
    return [Section("What failed", (text,), (table,))] if failed else []


def _gallery(made: Sequence[CatalogueRow], out: Path, place: Path) -> list[Section]:
    """Return a picture of each result, which leads to its player page, or to its figure."""
    way, cards = Path(os.path.relpath(out.resolve(), place.resolve())), []
    for row in made:
        own = way / row.name
        gain = "nothing to gain" if row.gain is None else f"loss differs {less_or_more(row.gain)}"
        target = own / (PLAYER if (out / row.name / PLAYER).is_file() else "track.png")
        picture = own / "track.png"
        cards.append(
            Card(target.as_posix(), picture.as_posix(), row.name, f"{gain}, gap {percent(row.gap or 0.0)}")
        )
    return [Section("All tracks", cards=tuple(cards))] if cards else []
