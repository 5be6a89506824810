"""The command `evenlight run`: one session with a participant, one sweep of a display, or its rehearsal."""

from __future__ import annotations

import enum
import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.recordings.participant_ids import ID_RULE, is_participant_id
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS
from evenlight.option_panels import QuietOption, asked, expert, output, words_and_files

if TYPE_CHECKING:
    from evenlight.experiments.run_session import SessionOutcome, SessionRequest
    from evenlight.experiments.sweeps.run_sweep import SweepRequest

SWEEPS = ("luminance-sweep", "power-sweep")
INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal

rehearsal = functools.partial(typer.Option, rich_help_panel="Rehearsal")
pages_of = functools.partial(typer.Option, rich_help_panel="Pages that the participant reads")


class Rehearsal(enum.Enum):
    """How a session is rehearsed."""

    DATA = "data"  # without a window
    VISUAL = "visual"  # through the real window


def run(
    task: Annotated[
        str,
        typer.Argument(
            help="What to run: ramp (calibrates the rate limit), rating, comparison, search, or a task of "
            "your own; luminance-sweep and power-sweep measure a display.",
            autocompletion=words_and_files(*BUILT_IN_TASKS, *SWEEPS),
        ),
    ],
    session: Annotated[str, asked(help="Which session of the participant, such as 01.")],
    rig: Annotated[
        str,
        asked(
            help="The rig, a file that describes your display, keys and instruments (desk.rig.toml), or the "
            "preset simulated."
        ),
    ],
    out: Annotated[Path, output(help="Folder of the data set, to which the session is added.")],
    participant: Annotated[
        str | None, asked(help="A code of letters and digits, such as 01; never a name. Optional in sweeps.")
    ] = None,
    design: Annotated[
        str | None,
        asked(
            help="What is shown, and how often: a preset (paper, recommended, quick, ...) or a toml file.",
            show_default="paper; standard for sweeps",
        ),
    ] = None,
    stimuli: Annotated[
        Path | None,
        asked(help="rating, comparison, search: folder with a track, and a video, for each sequence."),
    ] = None,
    simulate: Annotated[
        Rehearsal | None,
        rehearsal(help="A simulated observer answers: data, without a window; visual, in the real window."),
    ] = None,
    resume: Annotated[bool, asked("--resume", help="Go on with a session that was interrupted.")] = False,
    seed: Annotated[
        int | None,
        expert(help="Seed of all that is random: order, places, noise. Otherwise drawn, and recorded."),
    ] = None,
    language: Annotated[
        str | None,
        pages_of(metavar="CODE", help="Language of the pages, such as en or de. Otherwise that of the rig."),
    ] = None,
    pages: Annotated[
        Path | None, expert(metavar="DIR", help="Folder with pages of your own, in place of Evenlight's.")
    ] = None,
    font: Annotated[
        Path | None, expert(help="Font for the pages, for scripts that DejaVu Sans does not have.")
    ] = None,
    real_time: Annotated[
        bool, expert("--real-time", help="With --simulate visual: at the pace of a session, not faster.")
    ] = False,
    screenshots: Annotated[
        Path | None,
        expert(metavar="DIR", help="Folder for a picture of every kind of screen, as it was drawn."),
    ] = None,
    old_calibration_ok: Annotated[
        bool,
        expert(
            "--old-calibration-ok", help="Accept a display that was measured longer ago than the rig allows."
        ),
    ] = False,
    quiet: QuietOption = False,
) -> Path | None:
    """Run a session with a participant, measure a display by a sweep, or rehearse either."""
    # It returns the folder of a complete sweep, for `analysis.measuring_commands`; the docstring is its help.
    from evenlight.data_schema.recordings.session import TASKS

    known = (*TASKS, *SWEEPS)
    if task not in known:
        raise InputError(f"task {task!r} cannot be run; there is {', '.join(map(repr, known))}")
    if participant is None and task not in SWEEPS:
        raise InputError(f"--participant is missing: the task {task} is a session with one, such as 01")
    for option, value in (("--participant", participant), ("--session", session)):
        if value is not None and not is_participant_id(value):
            raise InputError(f"{option} must be {ID_RULE}, got {value!r}")
    if seed is not None:
        require_seed(seed)
    if simulate is not Rehearsal.VISUAL and real_time:
        raise InputError("--real-time goes with --simulate visual: a session with a person always runs so")
    if simulate is Rehearsal.DATA and screenshots is not None:
        raise InputError("--screenshots needs a window, which --simulate data does not open")
    from evenlight.experiments.calibration_age import require_young
    from evenlight.experiments.design_files import load_sweep_design, load_task_design
    from evenlight.experiments.experiment_kinds import EXPERIMENTS
    from evenlight.experiments.run_session import SessionRequest
    from evenlight.experiments.sessions.pages import load_pages
    from evenlight.experiments.sessions.staging import Staging
    from evenlight.experiments.sweeps.run_sweep import SweepRequest
    from evenlight.hardware.rig_files import load_rig
    from evenlight.method.preset_files import load_display

    staging = Staging(simulate.value if simulate else None, real_time, screenshots)
    if task in SWEEPS:
        of_people: dict[str, object] = {"--stimuli": stimuli, "--pages": pages, "--language": language}
        of_people |= {"--font": font, "--real-time": real_time or None, "--screenshots": screenshots}
        for option, given in of_people.items():
            if given is not None:
                raise InputError(f"{option} is for sessions with people; leave it out of {task}")
        loaded, display_name = load_rig(rig)
        new = (
            display_name.endswith(".toml") and not Path(display_name).exists()
        )  # what the sweep is to measure
        sweep = SweepRequest(
            task=task,
            dataset=out,
            session_id=session,
            rig=loaded,
            display=None if new else load_display(display_name),
            design=load_sweep_design(task, design) if design else None,
            staging=staging,
            measured_by=participant or "",
            seed=seed,
            resume=resume,
        )
        if sweep.goes_by_display and sweep.display is not None:
            require_young(sweep.display, loaded.calibration_age_limit, accepted=old_calibration_ok)
        return _run_sweep(sweep, quiet)
    loaded, display_name = load_rig(rig)
    try:
        display = load_display(display_name)
    except InputError as error:
        raise InputError(
            f"the display of the rig {loaded.name!r} cannot be loaded, and without it no luminance can "
            f"be drawn: {error}; `evenlight new rig FILE` writes a rig and a display to fill in"
        ) from error
    request = SessionRequest(
        task=task,
        dataset=out,
        participant_id=participant or "",
        session_id=session,
        rig=loaded,
        display=display,
        design=load_task_design(task, design) if design else None,
        pages=load_pages(
            language or loaded.language, pages, EXPERIMENTS[task].pages, font, in_headset=loaded.in_headset
        ),
        staging=staging,
        seed=seed,
        resume=resume,
        stimuli=stimuli,
        # A rehearsal is the same whenever it is run: the calibration's age does not matter to it.
        old_calibration=""
        if staging.simulated
        else require_young(display, loaded.calibration_age_limit, accepted=old_calibration_ok),
    )
    _run_session(request, quiet)
    return None


@contextmanager
def _bar(words: str, counted: str, *, off: bool) -> Iterator[Callable[[int, int, str], None]]:
    """Yield what shows on the terminal how many trials or readings are done and planned, and what goes on."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console, done = Console(stderr=True), 0
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    shown = Progress(*columns, console=console, transient=True, disable=off or not console.is_terminal)
    with shown as bars, _told_if_interrupted(lambda: f"{done} {counted}"):
        bar = bars.add_task(words, total=None)

        def show(completed: int, planned: int, description: str) -> None:
            nonlocal done
            done = completed
            bars.update(bar, completed=completed, total=planned, description=description)

        yield show


@contextmanager
def _told_if_interrupted(done: Callable[[], str]) -> Iterator[None]:
    """Tell the operator after an interrupt what is safe: elsewhere nothing is left, here everything."""
    try:
        yield
    except BaseException as error:
        if isinstance(error, Exception | SystemExit):
            raise
        print(
            f"evenlight: interrupted after {done()}; all of them are safe, go on with --resume",
            file=sys.stderr,
        )
        sys.exit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)


def _run_sweep(request: SweepRequest, quiet: bool) -> Path | None:
    from evenlight.data_schema.recordings.session import SessionStatus
    from evenlight.experiments.sweeps.run_sweep import run_sweep

    off = quiet or request.rig.luminance_meter == "manual"
    with _bar(request.task, "readings", off=off) as show:
        outcome = run_sweep(request, lambda done, n, level: show(done, n, f"{request.task}: {level}"))
    words = f"{outcome.done} of {outcome.planned} readings in {outcome.folder}"
    if outcome.status is not SessionStatus.COMPLETE:
        if not quiet:
            print(f"evenlight: stopped after {words}; go on with --resume", file=sys.stderr)
        return None
    if not quiet:
        typer.echo(f"complete: {words}")
    return outcome.folder


def _run_session(request: SessionRequest, quiet: bool) -> None:
    """Run a session with a live view on the experimenter's terminal, and say how it ended."""
    from evenlight.data_schema.recordings.dataset_layout import TRIALS, session_folder
    from evenlight.experiments.live_view import live_view
    from evenlight.experiments.run_session import run_session

    folder = session_folder(request.dataset, request.participant_id, request.session_id)
    with (
        _told_if_interrupted(lambda: f"{_stored_trials(folder / TRIALS)} trials"),
        live_view(folder, quiet) as show,
    ):
        outcome = run_session(
            request,
            lambda usable: show(),
            lambda said: print(f"evenlight: note: {said}", file=sys.stderr),
        )
    if not quiet:
        _close(outcome)


def _stored_trials(path: Path) -> int:
    """Return how many trials are in a file, practice and flagged ones too; one that was torn is none."""
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def _close(outcome: SessionOutcome) -> None:
    from evenlight.data_schema.recordings.dataset_layout import EVENTS
    from evenlight.data_schema.recordings.session import SessionStatus

    flagged = f", {outcome.flagged} flagged" if outcome.flagged else ""
    words = f"{outcome.done} of {outcome.planned} trials{flagged} in {outcome.folder}"
    if outcome.status is SessionStatus.DECLINED:
        print("evenlight: the participant declined; no trial was shown", file=sys.stderr)
    elif outcome.status is not SessionStatus.COMPLETE:
        print(f"evenlight: stopped after {words}: {outcome.reason}; go on with --resume", file=sys.stderr)
    elif outcome.done < outcome.planned:
        print(
            f"evenlight: complete with {words}; flagged trials are left out of the analysis ({EVENTS})",
            file=sys.stderr,
        )
    else:
        typer.echo(f"complete: {words}")
