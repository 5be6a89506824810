"""Running one session: what it is made of, in which order its parts are opened, and how it ends."""

from __future__ import annotations

import dataclasses
import functools
import math
import secrets
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import provenance_now, sha256_of_bytes, sha256_of_file
from evenlight.data_schema.recordings.dataset_layout import MANIFEST, TRIALS, session_folder
from evenlight.data_schema.recordings.dataset_writing import enrol
from evenlight.data_schema.recordings.display_calibrations import require_joinable
from evenlight.data_schema.recordings.rig import Keys, Rig
from evenlight.data_schema.recordings.session import (
    Design,
    EventKind,
    SessionManifest,
    SessionStatus,
)
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.experiments.design_files import load_task_design
from evenlight.experiments.experiment_kinds import EXPERIMENTS, simulated_answers
from evenlight.experiments.playback.track_refusals import floor_note
from evenlight.experiments.sessions.conduct_session import SessionParts, conduct_session
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.session_store import SessionStore, begin_session, resume_session
from evenlight.experiments.sessions.staging import Staging, open_stage, smallest_factor
from evenlight.experiments.sessions.task import (
    Answers,
    Participant,
    PressKey,
    SessionSetting,
    SimulatedParticipant,
    Task,
)
from evenlight.experiments.stage import Stage
from evenlight.experiments.stimulus_folder import (
    LoadedStimulus,
    as_searched,
    load_stimuli,
    require_flat_screens,
)
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.hardware.rig_windows import (
    LARGEST_DEVIATION,
    open_headset,
    require_display,
    with_headset,
)

LARGEST_SEED = 2**31
REHEARSAL_SEED = 1


@dataclass(frozen=True, slots=True)
class SessionRequest:
    """What an experimenter asked for."""

    task: str  # which experiment
    dataset: Path  # where the session goes
    # whose, and which visit
    participant_id: str
    session_id: str
    rig: Rig  # what it runs on
    display: Display  # the rig's calibrated display
    # what is shown; None for the task's default, or for that of the session to be resumed
    design: Design | None
    pages: Pages  # what is said
    staging: Staging  # with a window or without, with a person or a simulated observer
    seed: int | None = None  # of everything random; None for one drawn now
    resume: bool = False  # whether a session that is there already is to be gone on with
    stimuli: Path | None = None  # folder with the sequences of a viewing experiment
    # what is wrong with the age of the display's calibration, which was accepted; else empty
    old_calibration: str = ""


@dataclass(frozen=True, slots=True)
class SessionOutcome:
    """How a session ended."""

    status: SessionStatus  # how far it got
    # usable trials
    done: int
    planned: int
    flagged: int  # trials left out of the analysis
    folder: Path  # where it lies
    reason: str = ""  # why it was stopped; empty otherwise


def run_session(
    request: SessionRequest,
    report: Callable[[int], None] = lambda usable: None,
    tell: Callable[[str], None] = lambda words: None,
) -> SessionOutcome:
    """Run a session, new or resumed, and return how it ended.

    Whatever can be refused is refused before a file is written or a window opens.

    Parameters
    ----------
    request : SessionRequest
        What was asked for.
    report : callable, optional
        Called with the usable trials so far, before the first and after each.
    tell : callable, optional
        Called before the session with what forbids nothing, and the experimenter should know.

    Raises
    ------
    InputError
        If the session is there already, or is not and was to be resumed; if it was begun with another task,
        display, design, stimuli, seed or kind of participant; if something cannot be shown on the display;
        if its ramps cannot be fitted together with those of the data set.
    """
    with _headset_of(request) as headset:
        if headset is not None:  # everything that is planned follows what its runtime says
            rig, display = with_headset(request.rig, request.display, headset.facts())
            request = dataclasses.replace(request, rig=rig, display=display)
        return _run(request, headset, report, tell)


def _headset_of(request: SessionRequest) -> AbstractContextManager[HeadsetWindow | None]:
    """Return the headset of a session, open; None where there is none, or nothing is shown."""
    if not request.rig.in_headset or request.staging.simulation == "data":
        return nullcontext()
    waits = not request.staging.simulated or request.staging.real_time
    return open_headset(request.rig, waits=waits, gaze=True)


def _run(
    request: SessionRequest,
    headset: HeadsetWindow | None,
    report: Callable[[int], None],
    tell: Callable[[str], None],
) -> SessionOutcome:
    """Run a session as `run_session` does, its headset open if it has one."""
    began = _began(request) if request.resume else None
    if began and headset is not None:
        request = _with_headset_of(began, request)
    design = (began and began.design) or request.design or load_task_design(request.task, None)
    stimuli = _stimuli(request, design)
    manifest = began or _new_manifest(request, design, stimuli)
    _refuse_other_than_began(request, manifest, stimuli)
    recalibrated = require_joinable(request.dataset, manifest)
    if recalibrated:
        tell(recalibrated)
    if request.rig.in_headset and headset is None:
        tell("no headset is asked: its refresh rate and pixels per degree are those of the rig's files")
    if stimuli and request.staging.simulation != "data":
        require_display(request.rig)  # before the scenes of a search are lit, which may take minutes
    setting = SessionSetting(manifest, request.rig, stimuli, smallest_factor(request.staging, request.rig))
    make_task = EXPERIMENTS[request.task].task
    task = make_task(setting)
    simulated = simulated_answers(setting) if request.staging.simulated else None
    staged = open_stage(
        request.staging, request.rig, request.display, task.neutral_luminance, request.pages, headset
    )
    with staged as (stage, press):
        stage.prepare(*request.pages.longest(request.rig.keys), request.pages.font)
        task.prepare(stage)
        for words in session_notes(stimuli, request.rig, stage.room()):
            tell(words)
        store = _opened(request, manifest, setting)
        setting = dataclasses.replace(setting, manifest=store.manifest)
        task = make_task(setting)
        with store:
            if request.old_calibration:
                store.note(EventKind.OLD_CALIBRATION, request.old_calibration)
            if recalibrated:
                store.note(EventKind.RECALIBRATED, recalibrated)
            participant = _participant(setting, simulated, press)
            cast = SessionParts(task, stage, participant, request.pages, request.rig.keys)
            status = conduct_session(store, cast, _told_to_operator(request, task, stage, report))
            done = sum(trial.usable for trial in store.trials)
            flagged = sum(task.is_flagged(trial) for trial in store.trials if not trial.practice)
            reason = store.events[-1].detail if status is SessionStatus.ABORTED else ""
            return SessionOutcome(status, done, task.n_trials, flagged, store.folder, reason)


def _told_to_operator(
    request: SessionRequest, task: Task, stage: Stage, report: Callable[[int], None]
) -> Callable[[int], None]:
    """Return a report that also tells the operator of a headset how far the session is."""

    def told(usable: int) -> None:
        now = min(usable + 1, task.n_trials)
        stage.tell(f"participant {request.participant_id}, {request.task}, trial {now} of {task.n_trials}")
        report(usable)

    return told


def _stimuli(request: SessionRequest, design: Design) -> tuple[LoadedStimulus, ...]:
    names = tuple(getattr(design, "sequences", ()))
    if names and request.stimuli is None:
        raise InputError(
            f"--stimuli is missing: the task {request.task} needs a folder with {', '.join(names)}, "
            "each made with `evenlight optimize`"
        )
    if not names and request.stimuli is not None:
        raise InputError(f"--stimuli is for the viewing experiments; the task {request.task} has none")
    if request.stimuli is None:
        return ()
    shows_videos = EXPERIMENTS[request.task].shows_videos
    shown = shows_videos and request.staging.simulation != "data"
    stimuli = load_stimuli(request.stimuli, names, request.display, with_video=shown)
    if request.rig.in_headset:
        require_flat_screens(stimuli)
    return stimuli if shows_videos else as_searched(stimuli)


def session_notes(
    stimuli: tuple[LoadedStimulus, ...], rig: Rig, room: tuple[int, int] | None
) -> Iterator[str]:
    """Yield what a window of some size shows of each video, and what its track does not count."""
    for each in stimuli if room else ():
        if room and each.geometry and each.geometry.scale is not None:
            yield each.geometry.in_words(each.name, room)
        if note := floor_note(each.track, rig):
            yield note.removeprefix("note: ")


def _new_manifest(
    request: SessionRequest, design: Design, stimuli: tuple[LoadedStimulus, ...]
) -> SessionManifest:
    """Return the manifest of a session that is to begin, but for the participant's place in the data set."""
    folder = session_folder(request.dataset, request.participant_id, request.session_id)
    if (folder / MANIFEST).exists() or (folder / TRIALS).exists():
        raise InputError(
            f"{folder}: this session is there already and data are never overwritten; go on with it "
            "with --resume, or give another --session"
        )
    inputs = {"rig": sha256_of_record(request.rig), "display": sha256_of_record(request.display)}
    if request.rig.backlight_curve:
        inputs["backlight_curve"] = sha256_of_file(Path(request.rig.backlight_curve))
    return SessionManifest(
        participant_id=request.participant_id,
        session_id=request.session_id,
        task=request.task,
        simulated=request.staging.simulated,
        status=SessionStatus.RUNNING,
        n_trials=0,
        display=request.display,
        design=design,
        provenance=provenance_now(seed=_session_seed(request), inputs=inputs),
        rig=request.rig,
        pages=request.pages.digests,
        started=request.staging.utc(),
        stimuli=tuple(each.stimulus for each in stimuli),
    )


def _with_headset_of(began: SessionManifest, request: SessionRequest) -> SessionRequest:
    """Return a request with the figures a session began with, where the runtime says nearly the same now."""
    rig, display = request.rig, request.display
    near = functools.partial(math.isclose, rel_tol=LARGEST_DEVIATION)
    if began.rig and near(rig.refresh_rate, began.rig.refresh_rate):
        rig = dataclasses.replace(rig, refresh_rate=began.rig.refresh_rate)
    if began.display and near(display.pixels_per_degree, began.display.pixels_per_degree):
        display = dataclasses.replace(display, pixels_per_degree=began.display.pixels_per_degree)
    return dataclasses.replace(request, rig=rig, display=display)


def _essence(rig: Rig) -> Rig:
    """Return a rig without what may be another when a session is resumed: language, keys, paths, devices."""
    plain = dataclasses.replace(rig, language="en", keys=Keys(), backlight_curve="")
    plain = dataclasses.replace(plain, triggers=(), photodiode_patch=None)
    return dataclasses.replace(plain, luminance_meter="none", power_meter="none")


def _session_seed(request: SessionRequest) -> int:
    """Return the seed of a session: of each participant and visit its own, with the same --seed too.

    Without --seed a rehearsal is the same every time, and a session with a person is not.
    """
    if request.seed is None and not request.staging.simulated:
        return secrets.randbelow(LARGEST_SEED)
    given = REHEARSAL_SEED if request.seed is None else request.seed
    digest = sha256_of_bytes(f"{given}/{request.participant_id}/{request.session_id}".encode())
    return int(digest[:12], 16) % LARGEST_SEED


def _began(request: SessionRequest) -> SessionManifest:
    folder = session_folder(request.dataset, request.participant_id, request.session_id)
    if not (folder / MANIFEST).is_file():
        return resume_session(request.dataset, request.participant_id, request.session_id).manifest
    manifest = read_json_record(SessionManifest, folder / MANIFEST)
    if manifest.task != request.task:
        raise InputError(f"{folder}: this session is of the task {manifest.task!r}, not {request.task!r}")
    if manifest.status is SessionStatus.IMPORTED:
        raise InputError(f"{folder}: this session was imported; nothing is resumed, give another --session")
    return manifest


def _refuse_other_than_began(
    request: SessionRequest, manifest: SessionManifest, stimuli: tuple[LoadedStimulus, ...]
) -> None:
    """Refuse what was asked for beside a session that is there already."""
    if not request.resume:
        return
    folder = session_folder(request.dataset, request.participant_id, request.session_id)
    seed, seen = manifest.provenance.seed, tuple(each.stimulus for each in stimuli)
    if all(each.pixels_per_degree is None for each in manifest.stimuli):  # written before it was recorded
        seen = tuple(dataclasses.replace(each, pixels_per_degree=None) for each in seen)
    differing = (
        ("--simulate", manifest.simulated, request.staging.simulated),
        (
            "--rig (its display)",
            manifest.display and manifest.display.fingerprint,
            request.display.fingerprint,
        ),
        ("--design", manifest.design, request.design or manifest.design),
        ("--rig", manifest.rig and _essence(manifest.rig), _essence(request.rig)),
        ("--seed", seed, seed if request.seed is None else _session_seed(request)),
        ("--stimuli", manifest.stimuli, seen),
    )
    for option, began, asked in differing:
        if began != asked:
            remedy = "leave it out" if option == "--design" else "resume it with the same"
            raise InputError(
                f"{folder}: {option} is not as it was when this session began; {remedy}, or give another "
                "--session"
            )


def _opened(request: SessionRequest, manifest: SessionManifest, setting: SessionSetting) -> SessionStore:
    utc = request.staging.utc
    if request.resume:
        return resume_session(request.dataset, request.participant_id, request.session_id, utc)
    place = enrol(request.dataset, request.participant_id, manifest.simulated, manifest.provenance)
    # Another order in the next session of the same participant, too; other experiments have their own orders.
    earlier = _sessions_of_task(request.dataset / f"sub-{request.participant_id}", request.task)
    manifest = dataclasses.replace(manifest, order_index=place + earlier)
    task = EXPERIMENTS[request.task].task(dataclasses.replace(setting, manifest=manifest))
    return begin_session(request.dataset, dataclasses.replace(manifest, n_trials=task.n_trials), utc)


def _sessions_of_task(folder: Path, task: str) -> int:
    manifests = folder.glob(f"ses-*/{MANIFEST}")
    return sum(read_json_record(SessionManifest, path).task == task for path in manifests)


def _participant(
    setting: SessionSetting, simulated: Callable[[tuple[int, int]], Answers] | None, press: PressKey | None
) -> Participant:
    """Return who answers: a person, or the simulated observer of this session."""
    if simulated is None or press is None:
        return Participant()
    return SimulatedParticipant(simulated(setting.session), press, setting.rig.keys, setting.session)
