"""The command `evenlight import`."""

from __future__ import annotations

import enum
import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.option_panels import QuietOption, asked, output

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display

_Texts = list[str] | None
meaning_of = functools.partial(typer.Option, rich_help_panel="What the file's columns mean")


class ImportTask(enum.Enum):
    """A task whose trials can be imported."""

    RATING = "rating"
    COMPARISON = "comparison"
    SEARCH = "search"
    RAMP = "ramp"


def import_command(load_display: Callable[[str], Display]) -> Callable[..., None]:
    """Return the command, with what finds a display by a preset's name or a path."""

    def import_table(
        file: Annotated[
            list[Path],
            typer.Argument(help="Tables of trials: CSV or TSV, PsychoPy's CSV, jsPsych's CSV or JSON."),
        ],
        task: Annotated[ImportTask, asked(help="What the trials are.")],
        out: Annotated[Path, output(help="Folder of the data set, which is made.")],
        column: Annotated[
            _Texts, meaning_of(metavar="OURS=THEIRS", help="Name of a column in the file, for one of ours.")
        ] = None,
        unit: Annotated[
            _Texts, meaning_of(metavar="OURS=UNIT", help="Unit of a column, such as search_time=ms.")
        ] = None,
        value: Annotated[
            _Texts,
            meaning_of(
                metavar="OURS:VALUE=THEIRS",
                help="What a value is called in the file, such as version:ours=TBM.",
            ),
        ] = None,
        constant: Annotated[
            _Texts,
            meaning_of(
                metavar="OURS=VALUE", help="One value for all rows, where the file has no such column."
            ),
        ] = None,
        wide: Annotated[
            _Texts,
            meaning_of(
                metavar="OURS=PATTERN",
                help="For tables with a row per person: names of columns, as rating={sequence}_{version}.",
            ),
        ] = None,
        only: Annotated[
            _Texts, meaning_of(metavar="THEIRS=VALUE", help="Take only the rows with this value.")
        ] = None,
        mapping: Annotated[
            Path | None,
            meaning_of(
                help="Toml file that says the same, in tables: columns, units, values.OURS and so on."
            ),
        ] = None,
        scale: Annotated[
            str, meaning_of(metavar="LOWEST..HIGHEST", help="Scale of ratings, as 1..7 or 1..5:0.5 (steps).")
        ] = "",
        display: Annotated[
            str | None, asked(help="Display that was looked at: a preset or a toml file. Needed for ramps.")
        ] = None,
        simulated: Annotated[
            bool, asked("--simulated", help="The answers are those of simulated observers.")
        ] = False,
        quiet: QuietOption = False,
    ) -> None:
        """Make a data set of another program's table of trials; what it does not tell stays unknown."""
        from evenlight.data_schema.importing.import_dataset import import_dataset
        from evenlight.data_schema.importing.import_mapping import ImportRequest, import_mapping
        from evenlight.data_schema.recordings.session import TASKS

        given = {
            "column": column,
            "unit": unit,
            "value": value,
            "constant": constant,
            "wide": wide,
            "only": only,
        }
        options = {name: texts or () for name, texts in given.items()}
        meaning = import_mapping(TASKS[task.value].trial, options, mapping)
        panel = None if display is None else load_display(display)
        told = import_dataset(ImportRequest(tuple(file), task.value, meaning, panel, simulated, scale), out)
        if not quiet:
            for line in told:
                typer.echo(line)

    return import_table
