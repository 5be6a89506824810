"""A sweep as the command asks for it: its rig and design loaded, its progress shown."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from evenlight.data_schema.session import SessionStatus
from evenlight.experiments.calibration_age import require_young
from evenlight.experiments.run_sweep import SweepRequest, run_sweep

if TYPE_CHECKING:
    from evenlight.experiments.staging import Staging

INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal


def sweep_request(
    task: str, rig: str, design: str | None, staging: Staging, place: tuple[Path, str, str], seed: int | None
) -> SweepRequest:
    """Return a sweep that is to be run.

    Parameters
    ----------
    task : str
        "luminance-sweep" or "power-sweep".
    rig, design : str
        Presets or toml files; no design for the task's default.
    staging : Staging
        In earnest, or rehearsed.
    place : (Path, str, str)
        Data set, session, and who measures.
    seed : int or None
        Of the order of levels.

    Raises
    ------
    InputError
        If rig or design cannot be used.
    """
    from evenlight.experiments.design_files import load_sweep_design
    from evenlight.hardware.rig_files import load_rig
    from evenlight.method.preset_files import load_display

    loaded, display_name = load_rig(rig)
    new = display_name.endswith(".toml") and not Path(display_name).exists()  # what the sweep is to measure
    return SweepRequest(
        task=task,
        dataset=place[0],
        session_id=place[1],
        rig=loaded,
        display=None if new else load_display(display_name),
        design=load_sweep_design(task, design) if design else None,
        staging=staging,
        measured_by=place[2],
        seed=seed,
    )


def require_young_display(request: SweepRequest, *, accepted: bool) -> None:
    """Refuse a power sweep that takes its luminances from a display that was measured too long ago.

    A luminance sweep is what makes it young again, and a rehearsal is the same whenever it is run.
    """
    goes_by_it = request.task == "power-sweep" and request.rig.luminance_meter == "none"
    if goes_by_it and request.display is not None and not request.staging.simulated:
        require_young(request.display, request.rig.calibration_age_limit, accepted=accepted)


def run_sweep_as_asked(request: SweepRequest, quiet: bool) -> Path | None:
    """Run a sweep with its progress on the terminal; return its folder if it is complete."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console, done = Console(stderr=True), 0
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    off = quiet or not console.is_terminal or request.rig.luminance_meter == "manual"
    with Progress(*columns, console=console, transient=True, disable=off) as bars:
        bar = bars.add_task(request.task, total=None)

        def show(readings: int, planned: int, level: str) -> None:
            nonlocal done
            done = readings
            bars.update(bar, completed=readings, total=planned, description=f"{request.task}: {level}")

        try:
            outcome = run_sweep(request, show)
        except BaseException as error:
            if isinstance(error, Exception | SystemExit):
                raise
            print(
                f"evenlight: interrupted after {done} readings; all of them are safe, go on with --resume",
                file=sys.stderr,
            )
            sys.exit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)
    words = f"{outcome.done} of {outcome.planned} readings in {outcome.folder}"
    if outcome.status is not SessionStatus.COMPLETE:
        if not quiet:
            print(f"evenlight: stopped after {words}; go on with --resume", file=sys.stderr)
        return None
    if not quiet:
        typer.echo(f"complete: {words}")
    return outcome.folder
