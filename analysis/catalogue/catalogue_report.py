"""The files of a catalogue: its tables, a figure, and a report with a gallery of the results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evenlight.analysis.catalogue.catalogue_figure import catalogue_figure
from evenlight.analysis.catalogue.entries import CATALOGUE, ERRORS, FIGURE, REPORT
from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.player.player_content import PLAYER
from evenlight.analysis.report import Card, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_sections import CLAIM, provenance_section
from evenlight.analysis.tracks.objective_words import less_or_more
from evenlight.analysis.wording import percent
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.catalogue import CatalogueError, CatalogueRow

SHOWN = 20  # rows of a table of the report, at most
UNITS = {BudgetUnit.FACTOR: "mean factor", BudgetUnit.POWER: "share of full power", BudgetUnit.WATT: "W"}


def write_catalogue(
    rows: Sequence[CatalogueRow], folder: Path, out: Path, shared: float | None = None
) -> None:
    """Write what came of a catalogue into a folder.

    Parameters
    ----------
    rows, folder : sequence of CatalogueRow, Path
        Of each video; for `catalogue.csv`, `errors.csv`, `catalogue.png` and `report.html`.
    out : Path
        Where the folders of the results are: a gallery shows those that are there.
    shared : float, optional
        The budget that all share, if they do.
    """
    write_rows(folder / CATALOGUE, CatalogueRow, rows)
    failed = [CatalogueError(row.name, row.video, row.error) for row in rows if row.error]
    write_rows(folder / ERRORS, CatalogueError, failed)
    made = [row for row in rows if not row.error]
    pictures: tuple[Picture, ...] = ()
    if made:
        png = png_bytes(catalogue_figure(made))
        write_whole(folder / FIGURE, png)
        caption = "Over the videos: power saved, gain over constant dimming, differences of loss, gap."
        pictures = (Picture(png, caption),)
    sections = [_overview(made, pictures, shared), *_failures(failed), *_gallery(made, out)]
    sections.append(provenance_section({"catalogue": provenance_now()}))
    write_report(folder / REPORT, Report("A catalogue of brightness tracks", lead_of(rows), tuple(sections)))


def lead_of(rows: Sequence[CatalogueRow]) -> str:
    """Return what came of a catalogue in a sentence."""
    made = [row for row in rows if not row.error]
    failed = len(rows) - len(made)
    words = f"{len(made)} of {len(rows)} videos have a track"
    if not failed:
        words = f"All {len(rows)} videos have a track" if len(rows) > 1 else "The video has a track"
    gains = [row.gain for row in made if row.gain is not None]
    if gains:
        gain = less_or_more(float(np.median(gains)))
        words += f"; in the median their loss differs {gain} than with constant dimming"
    return f"{words}. {failed} failed: {ERRORS} says why." if failed else f"{words}."


def _overview(made: Sequence[CatalogueRow], pictures: tuple[Picture, ...], shared: float | None) -> Section:
    """Return the distributions over the videos, and those that gained least."""
    shown, worked = (sum(some) for some in ([r.duration or 0 for r in made], [r.seconds or 0 for r in made]))
    text = [f"{_time(shown)} of video were optimized; that took the workers {_time(worked)}."]
    if shared is not None and made:
        text.append(
            f"All share one budget of {shared:g} ({UNITS[made[0].budget_unit or BudgetUnit.FACTOR]}): each "
            "has as much of it as evens out the losses of all videos, found by its price."
        )
    least = sorted((row for row in made if row.gain is not None), key=lambda row: row.gain or 0.0)[:SHOWN]
    table = Table(
        f"Videos that gained least over constant dimming{_of(len(least), len(made))}; {CATALOGUE} has all.",
        ("video", "frames", "budget", "spread", "constant", "less [%]", "gap [%]", "power [W]", "full [W]"),
        tuple(
            (
                row.name, row.frames, row.budget, row.objective, row.objective_baseline,
                100 * (row.gain or 0.0), 100 * (row.gap or 0.0), row.mean_power, row.full_power,
            )
            for row in least
        ),
    )  # fmt: skip
    return Section("What was gained", (*text, CLAIM), (table,) if least else (), pictures)


def _time(seconds: float) -> str:
    """Return a time in hours, minutes or seconds.

    >>> _time(5400.0), _time(90.0), _time(6.0)
    ('1.5 hours', '1.5 minutes', '6 seconds')
    """
    size, unit = next(
        pair for pair in ((3600, "hours"), (60, "minutes"), (0, "seconds")) if seconds >= pair[0]
    )
    return f"{seconds / max(size, 1):.3g} {unit}"


def _of(some: int, every: int) -> str:
    """Return of how many these are some; nothing if all are there."""
    return f", {some} of {every}" if some < every else ""


def _failures(failed: Sequence[CatalogueError]) -> list[Section]:
    """Return the videos that failed, if any did."""
    if not failed:
        return []
    shown = failed[:SHOWN]
    rows = tuple((one.name, one.error) for one in shown)
    table = Table(f"Videos without a track{_of(len(shown), len(failed))}.", ("video", "why"), rows)
    return [Section("What failed", ("Run the same command again after you have fixed them.",), (table,))]


def _gallery(made: Sequence[CatalogueRow], out: Path) -> list[Section]:
    """Return a picture of each result, which leads to its player page, or to its figure."""
    cards = []
    for row in made:
        figure = f"{row.name}/track.png"
        page = f"{row.name}/{PLAYER}"
        gain = "nothing to gain" if row.gain is None else f"{less_or_more(row.gain)} spread"
        target = page if (out / page).is_file() else figure
        cards.append(Card(target, figure, row.name, f"{gain}, gap {percent(row.gap or 0.0)}"))
    return [Section("All tracks", cards=tuple(cards))] if cards else []
