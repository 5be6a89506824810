"""The command `evenlight watch`: how a session stands while it runs, seen from another terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST


def watch(
    dataset: Annotated[Path, typer.Argument(help="Folder of the data set that `evenlight run` writes to.")],
    participant: Annotated[str | None, typer.Option(help="Whose session. Otherwise the latest.")] = None,
    session: Annotated[str | None, typer.Option(help="Which session. Otherwise the latest.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Show the state once, and end.")] = False,
) -> None:
    """Watch a session while it runs, from another terminal: thresholds so far, dropped frames, time left."""
    from evenlight.experiments.live_view import watch_session

    watch_session(latest_session(dataset, participant, session), once)


def latest_session(dataset: Path, participant: str | None = None, session: str | None = None) -> Path:
    """Return the folder of the session that was written to last, of some participant or session if given.

    Raises
    ------
    InputError
        If there is none.
    """
    if not dataset.is_dir():
        raise InputError(f"{dataset}: no such folder; give the one that `evenlight run` has as --out")
    wanted = f"sub-{participant or '*'}/ses-{session or '*'}"
    logs = [path for path in dataset.glob(f"{wanted}/{EVENTS}") if path.with_name(MANIFEST).exists()]
    if not logs:
        who = f"participant {participant} has no session" if participant else "there is no session"
        raise InputError(f"{dataset}: {who}{f' {session}' if session else ''} that was run")
    return max(logs, key=lambda path: path.stat().st_mtime_ns).parent
