"""The command `evenlight validate`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import QuietOption

if TYPE_CHECKING:
    from evenlight.data_schema.checking.file_checks import CheckedFile
    from evenlight.data_schema.result_request import ResultRequest

MOST_SHOWN = 20  # problems of one file, files not checked: a thousand of the same do not help


def validate_command(
    problems_of: Callable[[ResultRequest], Iterable[tuple[str, str]]],
) -> Callable[..., None]:
    """Return the command, with what knows the options of others: keys of a request, and what is wrong."""

    def validate(
        path: Annotated[Path, typer.Argument(help="A data set, a folder of results, or a single file.")],
        quiet: QuietOption = False,
    ) -> None:
        """Check data sets, results, rigs and displays for mistakes. It ends with 1 if there are any."""
        _validate(path, quiet, problems_of)

    return validate


def _validate(
    path: Path, quiet: bool, problems_of: Callable[[ResultRequest], Iterable[tuple[str, str]]]
) -> None:
    from evenlight.data_schema.checking.validation import KNOWN
    from evenlight.data_schema.checking.validation import validate as checked_files
    from evenlight.data_schema.result_request import ResultRequest
    from evenlight.data_schema.storage.text_files import read_text, toml_line_numbers

    ok, wrong, problems = 0, 0, 0
    unknown = []
    for checked in checked_files(path):
        if not checked.words:
            unknown.append(f"not checked  {checked.path}")
            continue
        if isinstance(checked.record, ResultRequest):
            lines = toml_line_numbers(read_text(checked.path, checked.words))
            for key, problem in problems_of(checked.record):
                checked.blame(f"asked: {problem}", lines.get(("asked", key), 0))
        ok, wrong = (ok, wrong + 1) if checked.problems else (ok + 1, wrong)
        problems += len(checked.problems)
        _show(checked, quiet)
    if not ok and not wrong:
        raise InputError(f"{path}: nothing that Evenlight knows; expected {KNOWN}")
    if not quiet:
        _show_some(unknown, "not checked  and {} files more")
        found = f"{_count(problems, 'problem')} in {_count(wrong, 'file')}" if problems else "no problem"
        typer.echo(f"{found}; {ok} ok, {len(unknown)} not checked")
    if problems:
        raise typer.Exit(1)


def _show(checked: CheckedFile, quiet: bool) -> None:
    _show_some(
        [f"problem      {problem}" for problem in checked.problems],
        f"problem      {checked.path}: and {{}} problems more",
    )
    if quiet:
        return
    if not checked.problems:
        typer.echo(f"ok           {checked.path} ({checked.words})")
    for note in checked.notes:
        typer.echo(f"note         {note}")


def _show_some(lines: list[str], rest: str) -> None:
    for line in lines[:MOST_SHOWN]:
        typer.echo(line)
    if len(lines) > MOST_SHOWN:
        typer.echo(rest.format(len(lines) - MOST_SHOWN))


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
