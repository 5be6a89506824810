"""Running one sweep: a display measured level by level, new or gone on with, or readings imported."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import provenance_now, sha256_of_file
from evenlight.data_schema.recordings.dataset_layout import sweep_folder
from evenlight.data_schema.recordings.dataset_writing import require_dataset
from evenlight.data_schema.recordings.rig import Keys, Rig
from evenlight.data_schema.recordings.session import EventKind, SessionStatus
from evenlight.data_schema.recordings.sweep import (
    DESIGN_OF_SWEEP,
    LuminanceSweepDesign,
    SweepDesign,
    SweepManifest,
    SweepPhase,
)
from evenlight.experiments.sessions.staging import Staging
from evenlight.experiments.stage import PausePressed
from evenlight.experiments.sweeps.doubtful_reading import doubt_of_last
from evenlight.experiments.sweeps.import_sweep import import_sweep, is_imported
from evenlight.experiments.sweeps.same_instruments import KINDS, known_again, without_addresses
from evenlight.experiments.sweeps.sweep_devices import (
    SweepDevices,
    SweepLevel,
    SweepSetting,
    names_of_meters,
    open_sweep_devices,
)
from evenlight.experiments.sweeps.sweep_readings import (
    PlannedReading,
    SweepReader,
    SweepStore,
    begin_sweep,
    planned_readings,
    read_sweep_manifest,
    refuse_existing,
    resume_sweep,
)
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.rig import is_simulated
from evenlight.hardware.rig_files import TABLE

DEFAULT_SEED = 1  # of the order of levels


@dataclass(frozen=True, slots=True)
class SweepRequest:
    """What was asked for."""

    task: str  # "luminance-sweep" or "power-sweep"
    dataset: Path  # where the sweep goes
    session_id: str  # which sweep
    rig: Rig  # what it runs on
    display: Display | None  # the rig's display, where it was measured before
    # what is measured; None for the task's default, or for that of the sweep to be gone on with
    design: SweepDesign | None
    staging: Staging  # in earnest, or rehearsed
    measured_by: str = ""  # who measures, as a code
    seed: int | None = None  # of the order of levels, and of simulated noise
    resume: bool = False  # whether a sweep that is there already is to be gone on with

    @property
    def goes_by_display(self) -> bool:
        """Whether luminances are those of the display as measured before: it must not be too old.

        A luminance sweep renews the calibration, and a rehearsal is the same whenever it is run.
        """
        by_display = self.task == "power-sweep" and self.rig.luminance_meter == "none"
        return by_display and not self.staging.simulated


@dataclass(frozen=True, slots=True)
class SweepRun:
    """How a sweep ended: how far it got, its readings and those planned, and where it lies."""

    status: SessionStatus
    done: int
    planned: int
    folder: Path


def run_sweep(
    request: SweepRequest, report: Callable[[int, int, str], None] = lambda done, planned, level: None
) -> SweepRun:
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
    if manifest.status is SessionStatus.COMPLETE:  # what is missing are its results
        return SweepRun(manifest.status, manifest.n_readings, manifest.n_readings, _folder(request))
    if is_imported(request.rig.luminance_meter, request.task) and not request.staging.simulated:
        count, folder = import_sweep(request.dataset, manifest, resume=request.resume)
        return SweepRun(SessionStatus.COMPLETE, count, count, folder)
    seed = manifest.provenance.seed or 0
    asking = _MeterPrompt()
    setting = SweepSetting(request.rig, request.task, request.staging, manifest.display, seed)
    with open_sweep_devices(setting, asking) as devices:
        with_factors = devices.screen.makes_factors
        by_hand = request.rig.luminance_meter == "manual" and not request.staging.simulated
        plan = planned_readings(manifest.design, seed, with_factors=with_factors, by_hand=by_hand)
        if request.resume and manifest.n_readings != len(plan):
            raise InputError(
                f"{_folder(request)}: began with {manifest.n_readings} readings, and would now have "
                f"{len(plan)}; give another --session"
            )
        changes = known_again(manifest, request.rig, devices.apparatus)
        if isinstance(manifest.design, LuminanceSweepDesign) and manifest.design.factors and not with_factors:
            changes.append("brightness factors left out: no backlight, no display file")
        with _opened(request, dataclasses.replace(manifest, n_readings=len(plan))) as store:
            store.use_clock(devices.screen.now)
            if not store.happened(EventKind.STARTED):
                store.note(EventKind.STARTED)
            for change in changes:
                store.note(EventKind.CHANGED, change)
            store.change(apparatus=devices.apparatus)

            def tell(done: int, planned: int, level: str) -> None:
                asking.about = f"{done + 1} of {planned}, {level}"
                report(done, planned, level)

            status = _conduct(store, devices, plan, tell)
            return SweepRun(status, len(store.done), len(plan), store.folder)


def _conduct(
    store: SweepStore,
    devices: SweepDevices,
    plan: list[PlannedReading],
    report: Callable[[int, int, str], None],
) -> SessionStatus:
    """Make the readings that are not there yet; whatever ends it, the files say so."""
    reader, done = SweepReader(store, devices), store.done
    try:
        _warm_up_again(store, devices)
        begun = _beginning_of_warm_up(store, plan)
        for planned in plan:
            if planned.index in done:
                continue
            report(len(store.done), len(plan), _in_words(planned))
            _wait_until_due(store, devices, planned, begun)
            store.write(reader.read(planned))
            _read_again(store, reader, planned, report)
            report(len(store.done), len(plan), _in_words(planned))
    except PausePressed:
        store.note(EventKind.STOPPED, f"with the key {store.manifest.rig.keys.pause}")
        store.change(status=SessionStatus.ABORTED)
        return SessionStatus.ABORTED
    except BaseException as error:
        with suppress(InputError):
            store.note_failure(error)
            store.change(status=SessionStatus.ABORTED)
        if isinstance(error, InstrumentError):
            words = f"{error}; {len(store.done)} of {len(plan)} readings are safe, go on with --resume"
            raise InstrumentError(words, error.fault, error.code) from None
        raise
    store.note(EventKind.COMPLETED)
    store.change(status=SessionStatus.COMPLETE)
    return SessionStatus.COMPLETE


def _read_again(
    store: SweepStore,
    reader: SweepReader,
    planned: PlannedReading,
    report: Callable[[int, int, str], None],
) -> None:
    """Repeat a reading at once that contradicts those before it, as often as the design allows; keep all."""
    n_readings = store.manifest.n_readings
    for attempt in range(1, store.manifest.design.retries + 1):
        doubt = doubt_of_last(store.readings)
        if not doubt:
            return
        store.note(EventKind.READING_DOUBTED, f"{doubt}; read again", store.readings[-1].index, attempt)
        report(len(store.done), n_readings, f"{_in_words(planned)}, again")
        index = max(n_readings, *(reading.index + 1 for reading in store.readings))
        store.write(dataclasses.replace(reader.read(planned), index=index, again_of=planned.index))


def _beginning_of_warm_up(store: SweepStore, plan: list[PlannedReading]) -> float:
    """Return from when the times of the warm-up's readings count, since the sweep began [s].

    In a resumed sweep the display has lost the warmth of as much time as it was away; the readings that are
    left keep their distances.
    """
    read = [plan[r.index].due for r in store.readings if r.phase is SweepPhase.WARM_UP]
    if not read:
        return store.now()
    lost = read[-1] if store.away is None else min(store.away, read[-1])
    return store.now() - read[-1] + lost


def _wait_until_due(store: SweepStore, devices: SweepDevices, planned: PlannedReading, begun: float) -> None:
    """Show the level of the warm-up until its next reading is due; after the warm-up, wait for nothing."""
    if planned.phase is not SweepPhase.WARM_UP or planned.due <= 0:
        return
    devices.screen.show(planned.level)
    devices.screen.wait(max(begun + planned.due - store.now(), 0.0))


def _warm_up_again(store: SweepStore, devices: SweepDevices) -> None:
    """Show white for as long as a sweep was away that was interrupted after its warm-up.

    At most for the design's warm-up, and for that where no clock tells how long it was away.
    """
    if not store.readings or store.readings[-1].phase is SweepPhase.WARM_UP:
        return
    longest = store.manifest.design.warm_up
    seconds = longest if store.away is None else min(longest, store.away)
    factor = None if isinstance(store.manifest.design, LuminanceSweepDesign) else 1.0
    devices.screen.show(SweepLevel(1.0, factor))
    store.note(EventKind.CONTINUED, f"after {seconds:.0f} s of white, for the display to be warm again")
    devices.screen.wait(seconds)


class _MeterPrompt:
    """Asks the person who reads a meter, and says what about."""

    about = ""  # which reading, and what is shown

    def __call__(self, question: str) -> str:
        return input(f"{self.about}: {question}")


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
    refuse_existing(folder)
    pixels_per_degree = display.pixels_per_degree if display else rig.pixels_per_degree
    if pixels_per_degree is None and request.task == "luminance-sweep":
        raise InputError(
            f"the rig {rig.name!r} has no display file yet, so add `pixels_per_degree` to it: how many "
            "pixels one degree of the visual field takes at its viewing distance"
        )
    if display is None and request.task == "power-sweep" and rig.luminance_meter == "none":
        raise InputError(
            f"the rig {rig.name!r} has neither a luminance meter nor a measured display, and power is fitted "
            "over luminance: set `luminance_meter`, or run luminance-sweep first"
        )
    return SweepManifest(
        session_id=request.session_id,
        task=request.task,
        simulated=_simulated(request),
        status=SessionStatus.RUNNING,
        n_readings=0,
        design=request.design or DESIGN_OF_SWEEP[request.task](),
        rig=rig,
        display_name=display.name if display else rig.name,
        pixels_per_degree=pixels_per_degree,
        peak_luminance=display.peak_luminance if display else None,
        provenance=provenance_now(
            seed=DEFAULT_SEED if request.seed is None else request.seed,
            inputs=_inputs(rig),
        ),
        display=display,
        measured_by=request.measured_by,
        started=request.staging.utc(),
    )


def _simulated(request: SweepRequest) -> bool:
    """Return whether anything that a sweep measures, or measures with, is simulated."""
    meters = names_of_meters(request.rig, request.task, rehearsed=request.staging.simulated)
    return request.staging.simulated or any(is_simulated(name) for name in (*meters, request.rig.backlight))


def _inputs(rig: Rig) -> dict[str, str]:
    inputs = {"rig": sha256_of_record(rig)}
    if rig.backlight_curve:
        inputs["backlight_curve"] = sha256_of_file(Path(rig.backlight_curve))
    return inputs


def _began(request: SweepRequest) -> SweepManifest:
    """Return the manifest of the sweep to be gone on with; refuse what is not as it was."""
    folder = _folder(request)
    manifest = read_sweep_manifest(folder)
    simulated = _simulated(request)
    seed = manifest.provenance.seed
    rigs = _essence(manifest.rig), _essence(request.rig)
    differing = (
        *(
            (f"--rig: {meter} = {getattr(request.rig, meter)!r}", *(getattr(rig, meter) for rig in rigs))
            for meter in KINDS.values()
        ),
        ("--simulate", manifest.simulated, simulated),
        ("--rig", *rigs),
        ("--design", manifest.design, request.design or manifest.design),
        ("--seed", seed, seed if request.seed is None else request.seed),
        (
            "backlight_curve",
            *(each.get("backlight_curve") for each in (manifest.provenance.inputs, _inputs(request.rig))),
        ),
    )
    for option, began, asked in differing:
        if began != asked:
            raise InputError(
                f"{folder}: {option} is not as it was when this sweep began; resume it with the same, or "
                "give another --session"
            )
    return manifest


def _essence(rig: Rig) -> Rig:
    """Return a rig without what may be another when a sweep is resumed: paths to its files, ports, keys."""
    meter = rig.luminance_meter
    if meter.startswith(TABLE):
        meter = TABLE + Path(meter.removeprefix(TABLE)).name
    plain = dataclasses.replace(rig, backlight_curve="", keys=Keys(), language="en", luminance_meter=meter)
    return without_addresses(plain)


def _opened(request: SweepRequest, manifest: SweepManifest) -> SweepStore:
    utc = request.staging.utc
    if request.resume:
        return resume_sweep(request.dataset, request.task, request.session_id, utc)
    require_dataset(request.dataset, manifest.simulated, manifest.provenance)
    return begin_sweep(request.dataset, manifest, utc)


def _folder(request: SweepRequest) -> Path:
    return sweep_folder(request.dataset, request.task, request.session_id)
