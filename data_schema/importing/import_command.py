"""The command `evenlight import`."""

from __future__ import annotations

import enum
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.data_schema.importing.import_request import OPTIONS, SETTINGS, ImportRequest, import_request
from evenlight.option_panels import QuietOption, asked, output

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display

_Texts = list[str] | None
_Text = str | None


class ImportTask(enum.Enum):
    """A task whose trials can be imported."""

    RATING = "rating"
    COMPARISON = "comparison"
    SEARCH = "search"
    RAMP = "ramp"


def _told(name: str) -> Any:
    """Return the option of a name, which tells what a table means or how its file is read."""
    metavar, said = (OPTIONS | SETTINGS)[name]
    panel = "What the file's columns mean" if name in OPTIONS else "How the file is read"
    return typer.Option(metavar=metavar, help=said, rich_help_panel=panel)


def import_command(load_display: Callable[[str], Display]) -> Callable[..., None]:
    """Return the command, with what finds a display by a preset's name or a path."""

    def import_table(
        file: Annotated[
            list[Path],
            typer.Argument(help="Tables of trials: CSV, TSV, JSON, Excel, OpenDocument, SPSS, Stata."),
        ],
        task: Annotated[ImportTask, asked(help="What the trials are.")],
        out: Annotated[Path, output(help="Folder of the data set, which is made.")],
        column: Annotated[_Texts, _told("column")] = None,
        unit: Annotated[_Texts, _told("unit")] = None,
        value: Annotated[_Texts, _told("value")] = None,
        constant: Annotated[_Texts, _told("constant")] = None,
        wide: Annotated[_Texts, _told("wide")] = None,
        only: Annotated[_Texts, _told("only")] = None,
        mapping: Annotated[
            Path | None, asked(help="Toml file that says the same as the options for columns and reading.")
        ] = None,
        names: Annotated[_Text, _told("names")] = None,
        scale: Annotated[_Text, _told("scale")] = None,
        missing: Annotated[_Texts, _told("missing")] = None,
        participant_from: Annotated[_Text, _told("participant_from")] = None,
        encoding: Annotated[_Text, _told("encoding")] = None,
        sheet: Annotated[_Text, _told("sheet")] = None,
        display: Annotated[
            _Text, asked(help="Display that was looked at: a preset or a toml file. Needed for ramps.")
        ] = None,
        simulated: Annotated[
            bool, asked("--simulated", help="The answers are those of simulated observers.")
        ] = False,
        quiet: QuietOption = False,
    ) -> None:
        """Make a data set of another program's table of trials; what it does not tell stays unknown."""
        given = locals()
        from evenlight.data_schema.importing.import_dataset import import_dataset

        said = {name: given[name] for name in (*OPTIONS, *SETTINGS) if given[name]}
        texts = {name: [each] if isinstance(each, str) else each for name, each in said.items()}
        panel = None if display is None else load_display(display)
        request = ImportRequest(task.value, tuple(file), panel, simulated)
        told = import_dataset(import_request(request, texts, mapping), out)
        if not quiet:
            for line in told:
                typer.echo(line)

    return import_table
