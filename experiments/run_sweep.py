"""Running one sweep: a display measured level by level, new or gone on with, and how it ends."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from data_schema.dataset_layout import SWEEP_MANIFEST, sweep_folder
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.provenance import provenance_now, sha256_of_record
from data_schema.rig import Keys, Rig
from data_schema.session import EventKind, SessionStatus
from data_schema.sweep import DESIGN_OF_SWEEP, LuminanceSweepDesign, SweepDesign, SweepManifest, SweepPhase
from experiments.dataset import require_dataset
from experiments.imported_sweep import import_sweep, is_imported
from experiments.stage import PausePressed
from experiments.staging import Staging
from experiments.sweep_devices import SweepDevices, names_of_meters, open_sweep_devices
from experiments.sweep_readings import Reader
from experiments.sweep_schedule import Level, PlannedReading, planned_readings
from experiments.sweep_store import SweepStore, begin_sweep, read_sweep_manifest, resume_sweep
from hardware.protocols import InstrumentError

DEFAULT_SEED = 1  # of the order of levels: nobody gets to know it by heart
LONGEST_REASON = 200  # letters of an error's message, in the log of events


@dataclass(frozen=True, slots=True)
class SweepRequest:
    """What was asked for.

    Attributes
    ----------
    task : str
        "luminance-sweep" or "power-sweep".
    dataset : Path
        Where the sweep goes.
    session_id : str
        Which sweep.
    rig : Rig
        What it runs on.
    display : Display or None
        The rig's display, where it was measured before.
    design : SweepDesign or None
        What is measured; None for the task's default, or for that of the sweep to be gone on with.
    staging : Staging
        In earnest, or rehearsed.
    measured_by : str
        Who measures, as a code.
    seed : int or None
        Of the order of levels, and of simulated noise.
    resume : bool
        Whether a sweep that is there already is to be gone on with.
    """

    task: str
    dataset: Path
    session_id: str
    rig: Rig
    display: Display | None
    design: SweepDesign | None
    staging: Staging
    measured_by: str = ""
    seed: int | None = None
    resume: bool = False


@dataclass(frozen=True, slots=True)
class SweepOutcome:
    """How a sweep ended: how far it got, its readings and those planned, and where it lies."""

    status: SessionStatus
    done: int
    planned: int
    folder: Path


def run_sweep(
    request: SweepRequest, report: Callable[[int, int, str], None] = lambda done, planned, level: None
) -> SweepOutcome:
    """Run a sweep, new or resumed, and return how it ended.

    Whatever can be refused is refused before a file is written or a device opens.

    Parameters
    ----------
    request : SweepRequest
        What was asked for.
    report : callable, optional
        Told how many readings are done, how many are planned, and what is shown, in words.

    Raises
    ------
    InputError
        If the sweep is there already, or is not and was to be resumed, or was begun with other things.
    InstrumentError
        If an instrument failed; all readings before are kept, and the sweep can be resumed.
    """
    names_of_meters(request.rig, request.task, rehearsed=request.staging.simulated)
    manifest = _began(request) if request.resume else _new_manifest(request)
    if is_imported(request.rig.luminance_meter, request.task) and not request.staging.simulated:
        count, folder = import_sweep(request.dataset, manifest)
        return SweepOutcome(SessionStatus.COMPLETE, count, count, folder)
    seed = manifest.provenance.seed or 0
    opened = open_sweep_devices(request.rig, request.task, request.staging, request.display, seed)
    with opened as devices:
        with_factors = devices.screen.makes_factors
        plan = planned_readings(manifest.design, seed, with_factors=with_factors)
        with _opened(request, dataclasses.replace(manifest, n_readings=len(plan))) as store:
            store.use_clock(devices.screen.now)
            if not store.happened(EventKind.STARTED):
                store.note(EventKind.STARTED)
            if (
                isinstance(manifest.design, LuminanceSweepDesign)
                and manifest.design.factors
                and not with_factors
            ):
                store.note(EventKind.CHANGED, "brightness factors left out: no backlight, no display file")
            store.change(apparatus=devices.apparatus)
            status = _conduct(store, devices, plan, report)
            return SweepOutcome(status, len(store.readings), len(plan), store.folder)


def _conduct(
    store: SweepStore,
    devices: SweepDevices,
    plan: list[PlannedReading],
    report: Callable[[int, int, str], None],
) -> SessionStatus:
    """Make the readings that are not there yet; whatever ends it, the files say so."""
    reader, done = Reader(store, devices), {reading.index for reading in store.readings}
    try:
        _warm_up_again(store, devices)
        for planned in plan:
            if planned.index in done:
                continue
            report(len(store.readings), len(plan), _in_words(planned))
            _wait_until_due(store, devices, planned)
            store.write(reader.read(planned))
    except PausePressed:
        store.note(EventKind.STOPPED, f"with the key {store.manifest.rig.keys.pause}")
        store.change(status=SessionStatus.ABORTED)
        return SessionStatus.ABORTED
    except BaseException as error:
        with suppress(InputError):
            store.note(EventKind.STOPPED, f"{type(error).__name__.strip('_')}: {error}"[:LONGEST_REASON])
            store.change(status=SessionStatus.ABORTED)
        if isinstance(error, InstrumentError):
            words = f"{error}; {len(store.readings)} of {len(plan)} readings are safe, go on with --resume"
            raise InstrumentError(words, error.fault, error.code) from None
        raise
    store.note(EventKind.COMPLETED)
    store.change(status=SessionStatus.COMPLETE)
    return SessionStatus.COMPLETE


def _wait_until_due(store: SweepStore, devices: SweepDevices, planned: PlannedReading) -> None:
    """Show the level of the warm-up until its next reading is due; after the warm-up, wait for nothing."""
    if planned.due <= 0:
        return
    warm_up = [reading for reading in store.readings if reading.phase is SweepPhase.WARM_UP]
    begun = warm_up[0].begun if warm_up else store.now()
    devices.screen.show(planned.level)
    left = begun + planned.due - store.now() - store.manifest.design.settle
    devices.screen.wait(max(left, 0.0))


def _warm_up_again(store: SweepStore, devices: SweepDevices) -> None:
    """Show white for as long as a resumed sweep was away, at most for the design's warm-up."""
    if not store.readings:
        return
    seconds = store.manifest.design.warm_up
    if store.readings[-1].utc and (now := store.utc()):
        away = datetime.fromisoformat(now) - datetime.fromisoformat(store.readings[-1].utc)
        seconds = min(seconds, max(away.total_seconds(), 0.0))
    factor = None if isinstance(store.manifest.design, LuminanceSweepDesign) else 1.0
    devices.screen.show(Level(1.0, factor))
    store.note(EventKind.CONTINUED, f"after {seconds:.0f} s of white, for the display to be warm again")
    devices.screen.wait(seconds)


def _in_words(planned: PlannedReading) -> str:
    """Return what is shown, for who waits for it."""
    if planned.phase is SweepPhase.WARM_UP:
        return "warming up"
    level = planned.level
    what = f"pixel value {level.pixel_value:g}" if level.factor is None else f"brightness {level.factor:g}"
    return f"{what}, at the end again" if planned.phase is SweepPhase.DRIFT else what


def _new_manifest(request: SweepRequest) -> SweepManifest:
    """Return the manifest of a sweep that is to begin, but for the number of its readings."""
    rig, display, folder = request.rig, request.display, _folder(request)
    if (folder / SWEEP_MANIFEST).exists():
        raise InputError(
            f"{folder}: this sweep is there already and data are never overwritten; go on with it with "
            "--resume, or give another --session"
        )
    pixels_per_degree = display.pixels_per_degree if display else rig.pixels_per_degree
    if pixels_per_degree is None and request.task == "luminance-sweep":
        raise InputError(
            f"the rig {rig.name!r} has no display file yet, so add `pixels_per_degree` to it: how many "
            "pixels one degree of the visual field takes at its viewing distance"
        )
    if display is None and request.task == "power-sweep" and rig.luminance_meter == "none":
        raise InputError(
            f"the rig {rig.name!r} has neither a luminance meter nor a measured display, and power is fitted "
            "over luminance: add `luminance_meter`, or run luminance-sweep first"
        )
    meters = names_of_meters(rig, request.task, rehearsed=request.staging.simulated)
    return SweepManifest(
        session_id=request.session_id,
        task=request.task,
        simulated=request.staging.simulated or any(name.startswith("simulated") for name in meters),
        status=SessionStatus.RUNNING,
        n_readings=0,
        design=request.design or DESIGN_OF_SWEEP[request.task](),
        rig=rig,
        display_name=display.name if display else rig.name,
        pixels_per_degree=pixels_per_degree,
        peak_luminance=display.peak_luminance if display else None,
        provenance=provenance_now(
            seed=DEFAULT_SEED if request.seed is None else request.seed,
            inputs={"rig": sha256_of_record(rig)},
        ),
        display=display,
        measured_by=request.measured_by,
        started=request.staging.utc(),
    )


def _began(request: SweepRequest) -> SweepManifest:
    """Return the manifest of the sweep to be gone on with; refuse what is not as it was."""
    folder = _folder(request)
    manifest = read_sweep_manifest(folder)
    meters = names_of_meters(request.rig, request.task, rehearsed=request.staging.simulated)
    simulated = request.staging.simulated or any(name.startswith("simulated") for name in meters)
    seed = manifest.provenance.seed
    differing = (
        ("--simulate", manifest.simulated, simulated),
        ("--rig", _essence(manifest.rig), _essence(request.rig)),
        ("--design", manifest.design, request.design or manifest.design),
        ("--seed", seed, seed if request.seed is None else request.seed),
    )
    for option, began, asked in differing:
        if began != asked:
            raise InputError(
                f"{folder}: {option} is not as it was when this sweep began; resume it with the same, or "
                "give another --session"
            )
    return manifest


def _essence(rig: Rig) -> Rig:
    """Return a rig without what does not matter to a sweep, which uses no curve: its path may be another."""
    return dataclasses.replace(rig, backlight_curve="", keys=Keys(), language="en")


def _opened(request: SweepRequest, manifest: SweepManifest) -> SweepStore:
    """Return the files of the sweep, open."""
    utc = request.staging.utc
    if request.resume:
        return resume_sweep(request.dataset, request.task, request.session_id, utc)
    require_dataset(request.dataset, manifest.simulated, manifest.provenance)
    return begin_sweep(request.dataset, manifest, utc)


def _folder(request: SweepRequest) -> Path:
    """Return where the sweep lies."""
    return sweep_folder(request.dataset, request.task, request.session_id)
