"""Lets a user walk as `evenlight walk SCENE` is asked to: the walk, its log, and what is said of it."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.storage.result_folders import result_folder
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh
from evenlight.experiments.playback.headset_dimming import HeadsetDimmer
from evenlight.experiments.playback.headset_walk import HeadsetWalk
from evenlight.experiments.playback.live_dimming import LiveDimmer
from evenlight.experiments.playback.live_record import (
    LOG,
    LiveDimming,
    asked_budget,
    dimming_in_words,
    live_control,
    write_live,
)
from evenlight.experiments.playback.loss_meters import open_meter
from evenlight.experiments.playback.picture_luminance import LateLuminance
from evenlight.experiments.playback.play_options import LiveOptions, WalkOptions, interrupted
from evenlight.experiments.playback.play_video import rig_of
from evenlight.experiments.playback.player import (
    Pass,
    PlaybackDevices,
    dropped_words,
    open_devices,
    require_log_file,
    write_log,
)
from evenlight.experiments.playback.walk import Walk, write_path
from evenlight.hardware.presentation.simulated_input import SimulatedHeldKeys
from evenlight.hardware.rig_windows import open_held_keys, open_pointer
from evenlight.method.choices import Device
from evenlight.method.preset_files import display_for, load_rate_limit
from evenlight.stimuli.commands import size_in
from evenlight.stimuli.scenes.content.catalogue import SCENES, files_sha256, is_walk_file, scene_to_walk
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW, NARROWEST, WIDEST
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

SIZE = 640, 360  # where nothing else is asked for


def require_walk(walk: WalkOptions, live: LiveOptions) -> None:
    """Refuse a walk that cannot be.

    Raises
    ------
    InputError
        If an option cannot be, or two do not go together.
    """
    if not live.dims and walk.out is not None:
        raise InputError(
            "--out keeps what a controller did: give --target-loss or --budget with it, or --log FILE for "
            "the frames alone"
        )
    if live.target_loss is not None and not 0 <= live.target_loss <= 1:
        raise InputError(f"--target-loss must lie in 0 to 1, got {live.target_loss:g}")
    if not (walk.scene in SCENES or is_walk_file(walk.scene)):
        raise InputError(
            f"no scene {walk.scene!r} to walk in: there are {', '.join(SCENES)}; or give a file, of a scene "
            "in glTF or a camera path in JSON (docs/scenes.md)"
        )
    if walk.factor is not None and not 0 < walk.factor <= 1:
        raise InputError(f"--factor must be above 0 and at most 1, got {walk.factor:g}")
    if walk.seconds is not None and not walk.seconds > 0:
        raise InputError(f"--seconds must be above 0, got {walk.seconds:g}")
    if walk.simulate and walk.seconds is None:
        raise InputError("a walk ends with escape, which no one presses with --simulate: give --seconds")
    if (way := walk.record) is not None:
        if way.suffix != ".json":
            raise InputError(f"--record {way}: give a file that ends in .json")
        if way.is_file():
            raise InputError(f"--record {way}: is there already; give another name")
        if not way.absolute().parent.is_dir():
            raise InputError(f"--record {way}: there is no folder {way.parent}; make it first")
    if walk.log is not None:
        require_log_file(walk.log)
    if walk.field_of_view is not None and not NARROWEST <= walk.field_of_view <= WIDEST:
        raise InputError(
            f"--field-of-view must lie in {NARROWEST:g} to {WIDEST:g} degrees, got {walk.field_of_view:g}"
        )
    if walk.rig is not None and walk.size is not None:
        raise InputError("--size is of a window without a rig; the rig has a size of its own")


def walk_as_asked(walk: WalkOptions, live: LiveOptions) -> str:
    """Let the user walk, and return a summary in one line.

    Whatever ends the walk, its way and its log are written as far as it went.

    Raises
    ------
    InputError
        If an option cannot be.
    """
    require_walk(walk, live)
    rig, display = rig_of(
        walk.rig,
        walk.display_name,
        lambda: display_for(load_rate_limit(live.rate_limit)),
        size_in(walk.size) or SIZE,
    )
    scene_to_walk(walk.scene)  # whatever is wrong with it is said before a window opens
    dimming, budget = None, asked_budget(live, display)
    if live.dims:
        other_ok = walk.other_display_ok
        dimming = LiveDimming.asked_for(live, display, budget, other_display_ok=other_ok)
        bounds = dimming.controller.settings
        low, high = bounds.lowest_factor, bounds.highest_factor
        if walk.factor is not None and not low <= walk.factor <= high:
            raise InputError(
                f"--factor of a dimmed walk must lie in {low:g} to {high:g}, got {walk.factor:.15g}"
            )
    device = Device(live.device)
    if walk.out is None:
        return _ended(walk, _walked(walk, rig, display, dimming, device))
    with result_folder(walk.out, "walk", force=walk.force) as folder:
        outcome = _walked(walk, rig, display, dimming, device)
        if outcome.ended_by is not None and not outcome.rows:
            raise outcome.ended_by
        assert outcome.record is not None  # `require_walk` has seen to it
        write_live(folder, outcome.record, outcome.rows)
    outcome.said += f"; the log is in {walk.out / LOG}"
    return _ended(walk, outcome)


@dataclass(slots=True)
class _Outcome:
    """How a walk went in words, what was recorded of it, and what cut it short, if any."""

    said: str
    kept: bool  # whether anything of it is in a file
    ended_by: BaseException | None
    rows: list[LiveRefresh]
    record: LiveControl | None


def _ended(walk: WalkOptions, outcome: _Outcome) -> str:
    """Return how a walk went; if something cut it short, say what is kept and end as that has it."""
    error = outcome.ended_by
    if error is None:
        return outcome.said
    if isinstance(error, Exception | SystemExit) or not (outcome.kept or walk.out is not None):
        raise error
    raise interrupted(error, outcome.said)


def _drawn_field_of_view(walk: WalkOptions) -> float | None:
    """Return the angle that the window is to span [deg]; None at true size, if its pixels' angle is known."""
    unknown = walk.field_of_view is None and walk.rig is None and walk.display is None
    return FIELD_OF_VIEW if unknown else walk.field_of_view


def _dim(
    shown: Walk,
    walk: WalkOptions,
    devices: PlaybackDevices,
    dimming: LiveDimming,
    device: Device,
    stack: ExitStack,
) -> str:
    """Let a walk be dimmed until the end of a stack, and return what measures the loss."""
    context, patient, light = devices.window.context(), walk.simulate, None
    if devices.rig.in_headset:
        light = LateLuminance(context, shown.pictures, shown.display, patient=patient)
    meter = open_meter(
        context, shown.pictures, shown.display, lowest_factor=dimming.controller.settings.lowest_factor,
        device=device, patient=patient, light=light,
    )  # fmt: skip
    stack.callback(meter.close)
    given = dimming.controller, meter, walk.factor, 1 / devices.rig.refresh_rate, dimming.governor()
    shown.dimmer = (
        LiveDimmer(*given) if light is None else HeadsetDimmer(*given, light=light, display=shown.display)
    )
    return meter.name


def _walked(
    walk: WalkOptions, rig: Rig, display: Display, dimming: LiveDimming | None, device: Device
) -> _Outcome:
    """Let the user walk, write the way and the frames, and return the outcome."""
    measured_by, ended_by = "", None
    if rig.in_headset and walk.field_of_view is not None:
        raise InputError("--field-of-view is of a window: what a headset spans its runtime says")
    with ExitStack() as stack:
        any_rate, gaze = walk.rig is None, walk.log is not None
        opened = open_devices(rig, display, simulated=walk.simulate, any_rate=any_rate, gaze=gaze)
        devices = stack.enter_context(opened)
        given, window = (devices, walk.scene, walk.factor or 1.0, walk.screenshots), devices.window
        shown = HeadsetWalk(*given) if rig.in_headset else Walk(*given, _drawn_field_of_view(walk))
        if dimming is not None:
            measured_by = _dim(shown, walk, devices, dimming, device, stack)
        straight_on = SimulatedHeldKeys(window.now, [("w", 0.0, float("inf"))])
        held = straight_on if walk.simulate else open_held_keys(window)
        if held is None:
            raise InputError("this window does not tell which keys are held down, and no one can walk in it")
        stack.callback(held.close)
        pointer = None if walk.simulate else open_pointer(window)
        if pointer is not None:
            stack.callback(pointer.close)
        try:
            shown.walk(held, pointer, walk.seconds)
        except BaseException as error:  # what there is of the walk is kept; then it goes on its way
            ended_by = error
    words, rows, record = [_refreshes_in_words(shown, walk)], [], None
    if dimming is not None and shown.dimmer is not None:
        rows = shown.dimmer.rows
        seen = walk.scene, shown.display, measured_by
        counted = shown.pictures.seen
        hidden = None if counted is None else float(1 - counted.mean())
        hashes = {} if shown.path is None else {"scene": files_sha256(shown.path)}
        record = live_control(dimming, seen, rows, simulated=walk.simulate, files=hashes)
        record = replace(record, hidden_share=hidden)
        words += filter(None, [dimming_in_words(record, dimming.budget, rows)])
    if rig.in_headset:
        words.append("drawn for both eyes, as wide as the headset sees")
    else:
        width = field_of_view_on(shown.display, shown.pictures.size[0])
        true_size = ", at true size" if _drawn_field_of_view(walk) is None else ""
        words.append(f"{width:.3g}° wide{true_size}")
    files = _written(shown, walk, devices.rig.refresh_rate)
    return _Outcome("; ".join(words + files), bool(files), ended_by, rows, record)


def _refreshes_in_words(shown: Walk, walk: WalkOptions) -> str:
    """Return for how long a scene was walked in, and how many refreshes were dropped."""
    times = shown.recording.refreshes.times() if shown.way else (0.0,)
    dropped = dropped_words(shown.recording.refreshes.dropped(), timed=not walk.simulate)
    return f"{walk.scene}: {len(shown.recording.refreshes)} refreshes in {times[-1]:.1f} s, {dropped}"


def _written(shown: Walk, walk: WalkOptions, refresh_rate: float) -> list[str]:
    """Write frames and way of a walk as far as it went, and return in words where they are."""
    said = []
    if walk.log is not None and shown.way:
        frames = shown.recording.result()
        one = Pass(frames, ("walk",) * len(frames.flip_times), tuple(shown.heads))
        write_log(walk.log, [one], refresh_rate, shown.display.pixels_per_degree)
        said.append(f"the frames are in {walk.log}")
    if walk.record is not None and shown.way and shown.way[-1][0] > 0:
        write_path(walk.record, walk.scene, shown.way, shown.path)
        said.append(f"the way is in {walk.record}")
    return said
