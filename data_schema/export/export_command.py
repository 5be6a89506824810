"""The command `evenlight export`."""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import Annotated

import typer

from evenlight.option_panels import QuietOption


class DatasetStandard(enum.Enum):
    """A standard for data sets."""

    PSYCH_DS = "psych-ds"
    BIDS = "bids"


def export(
    dataset: Annotated[Path, typer.Argument(help="The data set, a folder of sessions.")],
    out: Annotated[Path, typer.Option(help="Folder for the exported data set, which is made.")],
    to: Annotated[
        DatasetStandard, typer.Option(help="Which layout. Evenlight reads both back.")
    ] = DatasetStandard.PSYCH_DS,
    quiet: QuietOption = False,
) -> None:
    """Check a data set, and write it in a standard layout (Psych-DS, BIDS) to share it."""
    from evenlight.data_schema.export.exporting import export_bids, export_psych_ds, notes_on_study

    tables = (export_psych_ds if to is DatasetStandard.PSYCH_DS else export_bids)(dataset, out)
    for note in notes_on_study(dataset):
        print(f"evenlight: note: {note}", file=sys.stderr)
    if not quiet:
        typer.echo(f"{tables} table{'' if tables == 1 else 's'} of trials in {out}, laid out as {to.value}")
