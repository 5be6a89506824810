"""The command `evenlight run`: one session with a participant, or its rehearsal."""

from __future__ import annotations

import dataclasses
import enum
import functools
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.seeds import require_seed

if TYPE_CHECKING:
    from evenlight.experiments.conduct_session import Progress as SessionProgress
    from evenlight.experiments.run_session import SessionOutcome, SessionRequest

EXPERIMENTS = ("ramp", "rating", "comparison", "search")
SWEEPS = ("luminance-sweep", "power-sweep")
TASKS = (*EXPERIMENTS, *SWEEPS)
ID = re.compile("(?=.*[0-9])[0-9A-Za-z]+")  # with a digit: a name has none
INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal


class Simulation(enum.Enum):
    """How a session is rehearsed."""

    DATA = "data"  # without a window
    VISUAL = "visual"  # through the real window


def run(
    task: Annotated[
        str,
        typer.Argument(
            help="Experiment: ramp, rating, comparison, search; or luminance-sweep, power-sweep of a display."
        ),
    ],
    session: Annotated[str, typer.Option(help="Session: letters and digits, e.g. 01.")],
    rig: Annotated[str, typer.Option(help="Rig: a toml file, or the preset simulated.")],
    out: Annotated[Path, typer.Option(help="Folder of the data set; sessions are added to it.")],
    participant: Annotated[
        str | None,
        typer.Option(help="Participant: letters and digits, no name; of a sweep, who measures (optional)."),
    ] = None,
    design: Annotated[
        str | None,
        typer.Option(help="Design: a preset (paper, quick, ...) or a toml file; default paper."),
    ] = None,
    stimuli: Annotated[
        Path | None,
        typer.Option(help="Folder with a track, and a video, for each sequence of a viewing experiment."),
    ] = None,
    simulate: Annotated[
        Simulation | None,
        typer.Option(help="Rehearse with a simulated observer: data, without a window; visual, through it."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted session.")] = False,
    seed: Annotated[
        int | None, typer.Option(help="Seed of order, placement and noise; otherwise drawn and recorded.")
    ] = None,
    language: Annotated[str | None, typer.Option(help="Of the pages; otherwise the rig's.")] = None,
    pages: Annotated[
        Path | None, typer.Option(help="Folder with your own pages in place of those that come along.")
    ] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Rehearse at the pace of a session, not as fast as it goes.")
    ] = False,
    screenshots: Annotated[
        Path | None, typer.Option(help="Folder for a picture of every kind of screen, as it was drawn.")
    ] = None,
    old_calibration_ok: Annotated[
        bool,
        typer.Option("--old-calibration-ok", help="Accept a display that was measured too long ago."),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress, no closing line.")] = False,
) -> Path | None:
    """Run one session of an experiment with a participant, or a sweep of a display, or rehearse it."""
    if task not in TASKS:
        raise InputError(f"task {task!r} cannot be run; there is {', '.join(map(repr, TASKS))}")
    if participant is None and task not in SWEEPS:
        raise InputError(f"--participant is missing: the task {task} is a session with one, such as 01")
    for option, value in (("--participant", participant), ("--session", session)):
        if value is not None and not ID.fullmatch(value):
            raise InputError(
                f"{option} must be letters and digits, a digit among them, such as 01, got {value!r}"
            )
    if seed is not None:
        require_seed(seed)
    if simulate is not Simulation.VISUAL and real_time:
        raise InputError("--real-time goes with --simulate visual: a session with a person always runs so")
    if simulate is Simulation.DATA and screenshots is not None:
        raise InputError("--screenshots needs a window, which --simulate data does not open")
    from evenlight.experiments.calibration_age import require_young
    from evenlight.experiments.design_files import load_task_design
    from evenlight.experiments.pages import load_pages
    from evenlight.experiments.run_session import SessionRequest
    from evenlight.experiments.staging import Staging
    from evenlight.hardware.rig_files import load_rig
    from evenlight.method.preset_files import load_display

    staging = Staging(simulate.value if simulate else None, real_time, screenshots)
    if task in SWEEPS:
        of_people: dict[str, object] = {"--stimuli": stimuli, "--pages": pages, "--language": language}
        of_people |= {"--real-time": real_time or None, "--screenshots": screenshots}
        for option, given in of_people.items():
            if given is not None:
                raise InputError(f"{option} is for sessions with people; leave it out of {task}")
        from evenlight.experiments.sweep_request import (
            require_young_display,
            run_sweep_as_asked,
            sweep_request,
        )

        asked = sweep_request(task, rig, design, staging, (out, session, participant or ""), seed)
        require_young_display(asked, accepted=old_calibration_ok)
        return run_sweep_as_asked(dataclasses.replace(asked, resume=resume), quiet)
    loaded, display_name = load_rig(rig)
    try:
        display = load_display(display_name)
    except InputError as error:
        raise InputError(
            f"the display of the rig {loaded.name!r} is not to be had, and without it no luminance can "
            f"be drawn: {error}"
        ) from error
    request = SessionRequest(
        task=task,
        dataset=out,
        participant_id=participant or "",
        session_id=session,
        rig=loaded,
        display=display,
        design=load_task_design(task, design) if design else None,
        pages=load_pages(language or loaded.language, pages),
        staging=staging,
        seed=seed,
        resume=resume,
        stimuli=stimuli,
        # A rehearsal is the same whenever it is run: the calibration's age does not matter to it.
        old_calibration=""
        if staging.simulated
        else require_young(display, loaded.calibration_age_limit, accepted=old_calibration_ok),
    )
    outcome = _run_with_progress(request, quiet)
    if not quiet:
        _close(outcome)
    return None


def run_command(fit_sweep: Callable[[Path], list[str]]) -> Callable[..., None]:
    """Return the command `run`, which hands the folder of a sweep that is complete to a fit.

    Parameters
    ----------
    fit_sweep : callable
        Writes the results of a sweep into its folder, and returns what is to be said of them.
    """

    @functools.wraps(run)
    def run_then_fit(**asked: Any) -> None:
        complete = run(**asked)
        if complete is None:
            return
        said = fit_sweep(complete)
        if not asked["quiet"]:
            for line in said:
                typer.echo(line)

    return run_then_fit


def _run_with_progress(request: SessionRequest, quiet: bool) -> SessionOutcome:
    """Run a session, with its progress on the experimenter's terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from evenlight.experiments.run_session import run_session

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    done = 0
    with Progress(
        *columns, console=console, transient=True, disable=quiet or not console.is_terminal
    ) as bars:
        words = f"participant {request.participant_id}, session {request.session_id}"
        bar = bars.add_task(words, total=None)

        def show(progress: SessionProgress) -> None:
            nonlocal done
            done = progress.done
            flagged = f"{progress.flagged} flagged" if progress.flagged else ""
            said = ", ".join(part for part in (words, progress.practised, flagged) if part)
            bars.update(bar, completed=progress.done, total=progress.planned, description=said)

        try:
            return run_session(request, show)
        except BaseException as error:
            if isinstance(error, Exception | SystemExit):
                raise
            # Interrupted or told to end: elsewhere nothing is left then, here everything is.
            print(
                f"evenlight: interrupted after {done} trials; all of them are safe, go on with --resume",
                file=sys.stderr,
            )
            sys.exit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)


def _close(outcome: SessionOutcome) -> None:
    """Say how a session ended."""
    from evenlight.data_schema.dataset_layout import EVENTS
    from evenlight.data_schema.session import SessionStatus

    flagged = f", {outcome.flagged} flagged" if outcome.flagged else ""
    words = f"{outcome.done} of {outcome.planned} trials{flagged} in {outcome.folder}"
    if outcome.status is SessionStatus.DECLINED:
        print("evenlight: the participant declined; no trial was shown", file=sys.stderr)
    elif outcome.status is not SessionStatus.COMPLETE:
        print(f"evenlight: stopped after {words}; go on with --resume", file=sys.stderr)
    elif outcome.done < outcome.planned:
        print(
            f"evenlight: complete with {words}; flagged trials are left out of the analysis ({EVENTS})",
            file=sys.stderr,
        )
    else:
        typer.echo(f"complete: {words}")
