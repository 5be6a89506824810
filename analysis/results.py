"""What every analysis gives: a result that can be asked for its rows, figures and first lines, and saved."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from matplotlib.figure import Figure

from evenlight.analysis.figure_style import png_bytes, write_figure
from evenlight.analysis.integrity.concern import Concern
from evenlight.analysis.report import KeyFigure, Picture, Section
from evenlight.data_schema.analysis_results import PlottedPoint, Statistic
from evenlight.data_schema.arguments import must_be_one_of, path
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.storage.result_folders import result_folder
from evenlight.data_schema.storage.tables import write_rows

if TYPE_CHECKING:
    from os import PathLike

    import pandas as pd


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure, and the numbers that are drawn in it.

    Attributes
    ----------
    name : str
        Stem of its files.
    figure : Figure
        Drawn, in `figure_style.look`.
    caption : str
        What is to be seen; also the text for those who cannot see it.
    points : tuple of PlottedPoint
        Every number that is drawn.
    """

    name: str
    figure: Figure
    caption: str
    points: tuple[PlottedPoint, ...]

    @property
    def png(self) -> bytes:
        """The figure as a file."""
        return png_bytes(self.figure)

    @property
    def picture(self) -> Picture:
        """The figure as a report shows it."""
        return Picture(self.png, self.caption)


class Result(ABC):
    """What every analysis answers, in Python as in its report: the first lines, the figures, a table, files.

    A kind of result has `lead`, `key_figures` and `figures`, and says what `to_frame` and `write` are.
    """

    __slots__ = ()
    made_by: ClassVar = "analyze"  # whose results its files are

    @property
    @abstractmethod
    def heading(self) -> str:
        """What it is, in a few words: the title of its report."""

    @property
    @abstractmethod
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What came out, and the key figures: how its report begins."""

    @property
    @abstractmethod
    def figures(self) -> Mapping[str, Figure]:
        """Its figures, by name."""

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """Return its numbers as a pandas table."""

    @abstractmethod
    def write(self, folder: Path) -> None:
        """Write its files into a folder that is there."""

    def summary(self) -> str:
        """Return the first lines of the report: what came out, and the key figures."""
        lead, key_figures = self.first_lines
        return "\n".join([lead, *(f"  {own.in_words}" for own in key_figures)])

    def plot(self, name: str | None = None) -> Figure | dict[str, Figure]:
        """Return the figure that is named, else the only one there is, or all of them by name.

        Raises
        ------
        InputError
            If there is no such figure.
        """
        figures = dict(self.figures)
        if name is None:
            return figures if len(figures) != 1 else next(iter(figures.values()))
        if not isinstance(name, str) or name not in figures:
            raise must_be_one_of("name", name, figures)
        return figures[name]

    def save(self, folder: str | PathLike[str], *, force: bool = False) -> None:
        """Write its files into a folder of their own.

        Parameters
        ----------
        folder : str or path
            Which is made, or takes the place of one with an earlier result of the same kind.
        force : bool, optional
            Whether to remove anything else that lies in it.

        Raises
        ------
        InputError
            If anything else lies in it, another program writes it, or it cannot be written.
        """
        with result_folder(path("folder", folder), self.made_by, force=force) as made:
            self.write(made)

    def __repr__(self) -> str:
        return f"<{self.heading}>\n{self.summary()}"

    def __eq__(self, other: object) -> bool:
        """Return whether another result has the same first lines and numbers."""
        numbers = other.to_frame() if isinstance(other, Result) else None
        return numbers is not None and repr(self) == repr(other) and self.to_frame().equals(numbers)

    def __hash__(self) -> int:
        return hash(repr(self))

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the heading, the first lines and the first figure."""
        lead, key_figures = self.first_lines
        figures = [
            f'<img src="data:image/png;base64,{b64encode(png_bytes(figure)).decode()}" '
            f'alt="{escape(name)}" style="max-width: 36em; width: 100%">'
            for name, figure in itertools.islice(self.figures.items(), 1)
        ]
        items = "".join(f"<li>{escape(own.in_words)}</li>" for own in key_figures)
        words = f"<p><strong>{escape(self.heading)}</strong></p><p>{escape(lead)}</p><ul>{items}</ul>"
        return words + "".join(figures)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Analysis(Result):
    """What the statistics of a task found.

    Attributes
    ----------
    name : str
        Stem of its files, e.g. "rating".
    lead : str
        What came out, in a sentence or two, after what is wrong with the trials, if anything is.
    rows : tuple of Statistic
        Every number that the sections show, and those behind them.
    drawings : tuple of Drawing
        The figures that the sections show.
    sections : tuple of Section
        Of a report.
    warnings : tuple of str
        What is wrong but does not forbid the use.
    concerns : tuple of Concern
        What is wrong with the trials themselves; lead and warnings begin with them.
    key_figures : tuple of KeyFigure
        What came out and how sure it is, three or four.
    """

    name: str
    lead: str
    rows: tuple[Statistic, ...]
    drawings: tuple[Drawing, ...]
    sections: tuple[Section, ...]
    warnings: tuple[str, ...] = ()
    concerns: tuple[Concern, ...] = ()
    key_figures: tuple[KeyFigure, ...] = ()

    @property
    def heading(self) -> str:
        """What it is, in a few words."""
        return f"Analysis of {self.name}: {len(self.rows)} numbers"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What came out, and the key figures."""
        return self.lead, self.key_figures

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figures, by name."""
        return {own.name: own.figure for own in self.drawings}

    @property
    def statistics(self) -> pd.DataFrame:
        """Every number with its interval, test and p value: the columns of `*_statistics.csv`."""
        return self.to_frame()

    def to_frame(self) -> pd.DataFrame:
        """Return every number with its interval, test and p value: the columns of `*_statistics.csv`."""
        import pandas as pd

        return pd.DataFrame([mapping_from_record(row) for row in self.rows])

    def write(self, folder: Path) -> None:
        """Write `NAME_statistics.csv`, and each figure with the numbers that it draws."""
        self.write_numbers(folder)
        for drawing in self.drawings:
            write_drawing(folder, drawing)

    def write_numbers(self, folder: Path) -> None:
        """Write `NAME_statistics.csv`."""
        write_rows(folder / f"{self.name}_statistics.csv", Statistic, self.rows)


def write_drawing(folder: Path, drawing: Drawing) -> None:
    """Write `DRAWING.png` and `DRAWING_points.csv`."""
    write_figure(folder / f"{drawing.name}.png", drawing.figure)
    write_rows(folder / f"{drawing.name}_points.csv", PlottedPoint, drawing.points)
