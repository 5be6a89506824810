"""The command `evenlight import`."""

from __future__ import annotations

import enum
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display

_Texts = list[str] | None


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
            typer.Argument(help="CSV or TSV, PsychoPy's CSV, jsPsych's CSV or JSON; may be several."),
        ],
        task: Annotated[ImportTask, typer.Option(help="What its trials are.")],
        out: Annotated[Path, typer.Option(help="Folder of the data set, to be made.")],
        column: Annotated[_Texts, typer.Option(help="OURS=THEIRS: which column it is; repeatable.")] = None,
        unit: Annotated[_Texts, typer.Option(help="OURS=UNIT, e.g. search_time=ms; repeatable.")] = None,
        value: Annotated[
            _Texts, typer.Option(help="OURS:OURVALUE=THEIRVALUE, e.g. version:ours=TBM; repeatable.")
        ] = None,
        constant: Annotated[_Texts, typer.Option(help="OURS=VALUE for all rows; repeatable.")] = None,
        wide: Annotated[
            _Texts,
            typer.Option(help="OURS=PATTERN of columns, e.g. rating={sequence}_{version}; repeatable."),
        ] = None,
        only: Annotated[
            _Texts, typer.Option(help="THEIRS=VALUE: take only rows with that; repeatable.")
        ] = None,
        mapping: Annotated[
            Path | None,
            typer.Option(help="TOML with tables that say the same: columns, units, values.OURS, …"),
        ] = None,
        display: Annotated[
            str | None, typer.Option(help="What was looked at: preset or file; needed for ramps.")
        ] = None,
        simulated: Annotated[bool, typer.Option("--simulated", help="Simulated observers answered.")] = False,
        quiet: Annotated[bool, typer.Option("--quiet", help="No closing lines.")] = False,
    ) -> None:
        """Import another program's table of trials as a data set; what it does not tell stays unknown."""
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
        told = import_dataset(ImportRequest(tuple(file), task.value, meaning, panel, simulated), out)
        if not quiet:
            for line in told:
                typer.echo(line)

    return import_table
