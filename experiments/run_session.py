"""Running one session: what it is made of, in which order its parts are opened, and how it ends."""

from __future__ import annotations

import dataclasses
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data_schema.dataset_layout import MANIFEST, TRIALS, session_folder
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.provenance import provenance_now, sha256_of_bytes, sha256_of_record
from data_schema.ramp import RampDesign
from data_schema.rig import Keys, Rig
from data_schema.session import SessionManifest, SessionStatus
from data_schema.text_files import read_json_record
from experiments.conduct_session import Cast, Progress, conduct_session
from experiments.dataset import enrol
from experiments.design import ramp_levels
from experiments.keyed_chance import Purpose, generator_for
from experiments.pages import Pages
from experiments.participants import Person, PressKey, SimulatedParticipant
from experiments.ramp_task import RampTask
from experiments.session_store import SessionStore, begin_session, resume_session
from experiments.simulated_observers import SimulatedObserver, draw_observer
from experiments.staging import Staging, open_stage, smallest_factor
from experiments.task import Participant
from method.preset_files import load_rate_limit

LARGEST_SEED = 2**31
REHEARSAL_SEED = 1
POPULATION = "surace2025"  # whose rate limit is the yes/no threshold of the median simulated observer


@dataclass(frozen=True, slots=True)
class SessionRequest:
    """What an experimenter asked for.

    Attributes
    ----------
    dataset : Path
        Where the session goes.
    participant_id, session_id : str
        Whose, and which visit.
    rig : Rig
        What it runs on.
    display : Display
        The rig's calibrated display.
    design : RampDesign or None
        What is shown; None for the default, or for that of the session to be resumed.
    pages : Pages
        What is said.
    staging : Staging
        With a window or without, with a person or a simulated observer.
    seed : int or None
        Of everything random; None for one drawn now.
    resume : bool
        Whether a session that is there already is to be gone on with.
    """

    dataset: Path
    participant_id: str
    session_id: str
    rig: Rig
    display: Display
    design: RampDesign | None
    pages: Pages
    staging: Staging
    seed: int | None = None
    resume: bool = False


@dataclass(frozen=True, slots=True)
class SessionOutcome:
    """How a session ended.

    Attributes
    ----------
    status : SessionStatus
        How far it got.
    done, planned : int
        Usable trials.
    flagged : int
        Trials left out of the analysis.
    folder : Path
        Where it lies.
    """

    status: SessionStatus
    done: int
    planned: int
    flagged: int
    folder: Path


def run_ramp_session(
    request: SessionRequest, report: Callable[[Progress], None] = lambda progress: None
) -> SessionOutcome:
    """Run a ramp session, new or resumed, and return how it ended.

    Whatever can be refused is refused before a file is written or a window opens.

    Raises
    ------
    InputError
        If the session is there already, or is not and was to be resumed; if it was begun with another
        display, design, seed or kind of participant; if a ramp cannot be shown on the display.
    """
    manifest = _resumed_manifest(request) if request.resume else _new_manifest(request)
    task = _task_of(manifest, request, smallest_factor(request.staging, request.rig))
    with open_stage(request.staging, request.rig, request.display, task.neutral_luminance) as (stage, press):
        stage.prepare(*request.pages.longest(request.rig.keys))
        store = _opened(request, manifest)
        task = _task_of(store.manifest, request)
        with store:
            participant = _participant(request, store, press)
            cast = Cast(task, stage, participant, request.pages, request.rig.keys)
            status = conduct_session(store, cast, report)
            done = sum(trial.usable for trial in store.trials)
            flagged = sum(task.is_flagged(trial) for trial in store.trials if not trial.practice)
            return SessionOutcome(status, done, task.n_trials, flagged, store.folder)


def _new_manifest(request: SessionRequest) -> SessionManifest:
    """Return the manifest of a session that is to begin, but for the participant's place in the data set."""
    folder = session_folder(request.dataset, request.participant_id, request.session_id)
    if (folder / MANIFEST).exists() or (folder / TRIALS).exists():
        raise InputError(
            f"{folder}: this session is there already and data are never overwritten; go on with it "
            "with --resume, or give another --session"
        )
    inputs = {"rig": sha256_of_record(request.rig), "display": sha256_of_record(request.display)}
    return SessionManifest(
        participant_id=request.participant_id,
        session_id=request.session_id,
        task="ramp",
        simulated=request.staging.simulated,
        status=SessionStatus.RUNNING,
        n_trials=0,
        display=request.display,
        design=request.design or RampDesign(),
        provenance=provenance_now(seed=_session_seed(request), inputs=inputs),
        rig=request.rig,
        pages=request.pages.digests,
        started=request.staging.utc(),
    )


def _essence(rig: Rig) -> Rig:
    """Return a rig without what may be another when a session is resumed: language and keys."""
    return dataclasses.replace(rig, language="en", keys=Keys())


def _session_seed(request: SessionRequest) -> int:
    """Return the seed of a session: of each participant and visit its own, with the same --seed too.

    Without --seed a rehearsal is the same every time, and a session with a person is not.
    """
    if request.seed is None and not request.staging.simulated:
        return secrets.randbelow(LARGEST_SEED)
    given = REHEARSAL_SEED if request.seed is None else request.seed
    digest = sha256_of_bytes(f"{given}/{request.participant_id}/{request.session_id}".encode())
    return int(digest[:12], 16) % LARGEST_SEED


def _resumed_manifest(request: SessionRequest) -> SessionManifest:
    """Return the manifest of the session to be resumed, or refuse what was asked for beside it."""
    folder = session_folder(request.dataset, request.participant_id, request.session_id)
    if not (folder / MANIFEST).is_file():
        return resume_session(request.dataset, request.participant_id, request.session_id).manifest
    manifest = read_json_record(SessionManifest, folder / MANIFEST)
    seed = manifest.provenance.seed
    differing = (
        ("--simulate", manifest.simulated, request.staging.simulated),
        ("--rig (its display)", manifest.display.fingerprint, request.display.fingerprint),
        ("--design", manifest.design, request.design or manifest.design),
        ("--rig", manifest.rig and _essence(manifest.rig), _essence(request.rig)),
        ("--seed", seed, seed if request.seed is None else _session_seed(request)),
    )
    for option, began, asked in differing:
        if began != asked:
            raise InputError(
                f"{folder}: {option} is not as it was when this session began; resume it with the same, or "
                "give another --session"
            )
    return manifest


def _task_of(manifest: SessionManifest, request: SessionRequest, smallest: float = 0.0) -> RampTask:
    """Return the experiment of a session; the backlight's smallest factor decides what may be shown."""
    return RampTask(
        manifest.design,
        manifest.display,
        manifest.provenance.seed or 0,
        manifest.order_index,
        request.rig,
        smallest_factor=smallest,
    )


def _opened(request: SessionRequest, manifest: SessionManifest) -> SessionStore:
    """Return the files of the session, open."""
    utc = request.staging.utc
    if request.resume:
        return resume_session(request.dataset, request.participant_id, request.session_id, utc)
    place = enrol(request.dataset, request.participant_id, manifest.simulated, manifest.provenance)
    # Another order of blocks in the next session of the same participant, too.
    earlier = len(list((request.dataset / f"sub-{request.participant_id}").glob("ses-*")))
    manifest = dataclasses.replace(manifest, order_index=place + earlier)
    manifest = dataclasses.replace(manifest, n_trials=_task_of(manifest, request).n_trials)
    return begin_session(request.dataset, manifest, utc)


def _participant(request: SessionRequest, store: SessionStore, press: PressKey | None) -> Participant:
    """Return who answers: a person, or the simulated observer of this session."""
    if press is None:
        return Person()
    manifest = store.manifest
    # Simulated participant 01 is the same in every session and rehearsal.
    who = int(sha256_of_bytes(manifest.participant_id.encode())[:12], 16)
    observer = _observer(manifest, generator_for(who, 0, Purpose.PERSON))
    session = (manifest.provenance.seed or 0, manifest.order_index)
    return SimulatedParticipant(observer, press, request.rig.keys, session)


def _observer(manifest: SessionManifest, rng: np.random.Generator) -> SimulatedObserver:
    """Return a simulated observer, drawn from the population."""
    luminances = tuple(level.luminance for level in ramp_levels(manifest.design, manifest.display))
    return draw_observer(load_rate_limit(POPULATION), luminances, rng)
