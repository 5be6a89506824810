"""The command `evenlight validate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from data_schema.errors import InputError

if TYPE_CHECKING:
    from data_schema.file_checks import CheckedFile

MOST_SHOWN = 20  # problems of one file; a thousand of the same help nobody


def validate(
    path: Annotated[Path, typer.Argument(help="Data set, folder of results, or a single file.")],
    quiet: Annotated[bool, typer.Option("--quiet", help="Show the problems only.")] = False,
) -> None:
    """Check files against data_schema; end with 1 if something is wrong with them."""
    from data_schema.validation import KNOWN
    from data_schema.validation import validate as checked_files

    counts = {"ok": 0, "problem": 0, "not checked": 0}
    problems = 0
    for checked in checked_files(path):
        verdict = "problem" if checked.problems else "ok" if checked.words else "not checked"
        counts[verdict] += 1
        problems += len(checked.problems)
        _show(checked, verdict, quiet)
    if not counts["ok"] and not counts["problem"]:
        raise InputError(f"{path}: nothing that Evenlight knows; expected {KNOWN}")
    if not quiet:
        typer.echo(_total(counts, problems))
    if problems:
        raise typer.Exit(1)


def _show(checked: CheckedFile, verdict: str, quiet: bool) -> None:
    """Show what was found in one file."""
    for problem in checked.problems[:MOST_SHOWN]:
        typer.echo(f"problem      {problem}")
    if len(checked.problems) > MOST_SHOWN:
        typer.echo(f"problem      {checked.path}: and {len(checked.problems) - MOST_SHOWN} problems more")
    if quiet:
        return
    if verdict == "ok":
        typer.echo(f"ok           {checked.path} ({checked.words})")
    elif verdict == "not checked":
        typer.echo(f"not checked  {checked.path}")
    for note in checked.notes:
        typer.echo(f"note         {note}")


def _total(counts: dict[str, int], problems: int) -> str:
    """Return the closing line."""
    found = f"{problems} problem{'' if problems == 1 else 's'} in {counts['problem']}"
    wrong = f"{found} file{'' if counts['problem'] == 1 else 's'}" if problems else "no problem"
    return f"{wrong}; {counts['ok']} ok, {counts['not checked']} not checked"
