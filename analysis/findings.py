"""What an analysis found, in the one shape in which every analysis hands it on: numbers, figures, words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evenlight.analysis.integrity.concern import Concern, cautious
from evenlight.analysis.report import Picture, Section
from evenlight.data_schema.analysis_results import PlottedPoint, Statistic
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.data_schema.storage.whole_files import write_whole


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure, and the numbers that are drawn in it.

    Attributes
    ----------
    name : str
        Stem of its files.
    png : bytes
        The figure, from `png_bytes`.
    caption : str
        What is to be seen; also the text for those who cannot see it.
    points : tuple of PlottedPoint
        Every number that is drawn.
    """

    name: str
    png: bytes
    caption: str
    points: tuple[PlottedPoint, ...]

    @property
    def picture(self) -> Picture:
        """The figure as a report shows it."""
        return Picture(self.png, self.caption)


@dataclass(frozen=True, slots=True)
class Findings:
    """What an analysis found.

    Attributes
    ----------
    name : str
        Stem of its files, e.g. "rating".
    lead : str
        What came out, in a sentence or two.
    statistics : tuple of Statistic
        Every number that the sections show, and those behind them.
    drawings : tuple of Drawing
        The figures that the sections show.
    sections : tuple of Section
        Of a report.
    warnings : tuple of str
        What is wrong but does not forbid the use.
    concerns : tuple of Concern
        What is wrong with the trials themselves; the warnings begin with them.
    presets : mapping of str to record
        Files that other commands take as presets, by name.
    """

    name: str
    lead: str
    statistics: tuple[Statistic, ...]
    drawings: tuple[Drawing, ...]
    sections: tuple[Section, ...]
    warnings: tuple[str, ...] = ()
    concerns: tuple[Concern, ...] = ()
    presets: Mapping[str, Any] = field(default_factory=dict)

    @property
    def cautious_lead(self) -> str:
        """What came out, after what is wrong with the trials."""
        return cautious(self.concerns, self.lead)

    def __repr__(self) -> str:
        n, drawn, parts = len(self.statistics), len(self.drawings), len(self.sections)
        return f"<Findings {self.name!r}: {n} numbers, {drawn} figures, {parts} sections>"


def write_findings(folder: Path, findings: Findings) -> None:
    """Write the table of findings, and each of their drawings, into one folder."""
    write_statistics(folder, findings)
    for drawing in findings.drawings:
        write_drawing(folder, drawing)
    for name, record in findings.presets.items():
        write_toml_record(folder / name, record)


def write_statistics(folder: Path, findings: Findings) -> None:
    """Write `NAME_statistics.csv`."""
    write_rows(folder / f"{findings.name}_statistics.csv", Statistic, findings.statistics)


def write_drawing(folder: Path, drawing: Drawing) -> None:
    """Write `DRAWING.png` and `DRAWING_points.csv`."""
    write_whole(folder / f"{drawing.name}.png", drawing.png)
    write_rows(folder / f"{drawing.name}_points.csv", PlottedPoint, drawing.points)
