"""Plays a video in its versions, time and again, and records the power of the panel meanwhile.

`PowerRecording` fills the files: samples, clocks, and what was shown when. Before and after the video three
flashes mark the time, for a meter without a synchronisation input.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.dataset_layout import (
    BACKLIGHT_SETTINGS,
    CLOCK_PINGS,
    FLASHES,
    FLIPS,
    POWER_LOG,
    POWER_SAMPLES,
)
from evenlight.data_schema.recordings.instrument_logs import (
    BacklightSetting,
    ClockPing,
    FlashMark,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.recordings.rig import Corner, PhotodiodePatch, Rig
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import recording_folder
from evenlight.experiments.calibration_age import require_young, utc_now
from evenlight.experiments.playback.play_options import (
    FilmOptions,
    HeadsetOptions,
    PowerOptions,
    interrupted,
)
from evenlight.experiments.playback.play_video import video_request
from evenlight.experiments.playback.player import (
    Dimming,
    Playback,
    PlaybackDevices,
    Player,
    open_devices,
)
from evenlight.experiments.playback.track_refusals import floor_note
from evenlight.experiments.showing import Screen, draw_patch
from evenlight.experiments.stage import PausePressed
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError, PowerMeter
from evenlight.hardware.rig import is_simulated, open_power_meter
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.preset_files import load_power_model
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.ramp import frame_count
from evenlight.stimuli.renderers import AnyFieldRenderer

if TYPE_CHECKING:
    import moderngl


SEED = 1  # of a simulated meter's noise
WITH_SYNC = {"board", "ppk2", "simulated"}  # power meters with a synchronisation input
PATCH = PhotodiodePatch(Corner.BOTTOM_LEFT)
FLASH_COUNT, FLASH_SECONDS = 3, 0.5  # bright, and dark between
DARK, BRIGHT = 0.2, 1.0  # brightness factors of the white screen
PINGS_AT_ONCE = 5  # the one that took the shortest bounds the clocks' difference best
# [Hz] From 1000 on, the energy of single frames is within 1 % (docs/decisions/power-synchronisation.md).
RATES = (1000.0, 500.0, 250.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)


def measure_power(film: FilmOptions, options: PowerOptions) -> Path:
    """Play a video in every version in turn and record the power; return the folder of the samples.

    Raises
    ------
    InputError
        If video, track, display and meter do not go together, or an option cannot be.
    InstrumentError
        If the meter fails; what came before is in the folder.
    """
    asked = video_request(film, HeadsetOptions())
    rig = asked.rig
    if rig.in_headset:
        raise InputError("power is measured of a panel, and a headset's is out of reach: give another --rig")
    require_power_meter(rig, sync_patch=options.sync_patch)
    if options.power_model is not None:
        model = load_power_model(options.power_model)  # a slip is told before anything is played
        if not film.simulate:
            require_young(model, rig.calibration_age_limit, accepted=film.old_calibration_ok)
    if not film.quiet and (note := floor_note(asked.loaded.track, rig)):
        typer.echo(note)
    folder = require_output(options.out)
    order = measured_order(options.passes)
    playback = asked.playback([dimming.value for dimming in order])
    turns = itertools.count(1)

    def say(words: str) -> None:
        turn = next(turns)
        if not film.quiet:
            typer.echo(f"measuring {words}, {turn} of {len(order)}")

    try:
        with recording_folder(folder, POWER_LOG), ExitStack() as stack:
            settings = None
            if rig.backlight != "none":
                settings = stack.enter_context(AppendedRows(folder / BACKLIGHT_SETTINGS, BacklightSetting))
            noted = None if settings is None else lambda setting: settings.append([setting], to_disk=False)
            opened = open_devices(rig, asked.display, simulated=film.simulate, any_rate=False, noted=noted)
            devices = stack.enter_context(opened)
            shown = asked.shown_on(devices)
            if not film.quiet:
                typer.echo(shown)
            log = _log(playback, devices, film, options, shown, asked.loaded.sha256)
            whole = _play_measured(devices, Player(devices, playback, say), options, log, film.simulate)
    except BaseException as error:
        if isinstance(error, Exception | SystemExit):
            raise
        words = f"`evenlight fit {folder} --out FOLDER` analyses what was recorded"
        raise interrupted(error, words) from None
    if not whole:
        print("evenlight: ended before its end; what was measured until then follows", file=sys.stderr)
    return folder


def require_power_meter(rig: Rig, *, sync_patch: bool) -> None:
    """Refuse a rig without a power meter, and a mark for a meter that cannot see it."""
    if rig.power_meter == "none":
        raise InputError(
            f"the rig {rig.name!r} names no power meter: set `power_meter`, "
            "as `evenlight measure list` has them, to the file of --rig (`evenlight new rig desk.rig.toml` "
            "writes one)"
        )
    if sync_patch and not _has_sync(rig.power_meter):
        raise InputError(
            f"--sync-patch is for a photodiode on a meter's synchronisation input, and {rig.power_meter} has "
            "none; without it the clocks are compared by flashes"
        )


def _has_sync(power_meter: str) -> bool:
    """Return whether a power meter has a synchronisation input.

    >>> _has_sync("board:/dev/ttyACM0"), _has_sync("simulated:scpi")
    (True, False)
    """
    return bool(WITH_SYNC & set(power_meter.split(":")[: 2 if is_simulated(power_meter) else 1][-1:]))


def require_output(folder: Path) -> Path:
    """Return the folder of a measurement; refuse one with other things in it."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(
            f"{folder}: holds something already, and measurements are never overwritten; give a new folder "
            "with --out"
        )
    return folder


def measured_order(passes: int) -> tuple[Dimming, ...]:
    """Return the versions in the order in which they are played: each time round begins with another.

    So a slow drift of the panel falls on all versions alike.

    >>> [dimming.value for dimming in measured_order(2)]
    ['ours', 'baseline', 'full', 'baseline', 'full', 'ours']
    """
    versions = (Dimming.OURS, Dimming.BASELINE, Dimming.FULL)
    turns = [turn % len(versions) for turn in range(passes)]
    return tuple(version for turn in turns for version in (*versions[turn:], *versions[:turn]))


def _play_measured(
    devices: PlaybackDevices, player: Player, options: PowerOptions, log: PowerLog, simulated: bool
) -> bool:
    name, now = devices.rig.power_meter, devices.window.now
    simulation = _simulation(devices) if simulated or is_simulated(name) else None
    if simulated and not is_simulated(name):
        name = "simulated"
    with ExitStack() as stack:
        meter = stack.enter_context(open_power_meter(name, now, simulation))
        said = {f"power meter: {key}": value for key, value in meter.apparatus().items()}
        log = dataclasses.replace(log, apparatus=log.apparatus | said)
        recording = stack.enter_context(
            PowerRecording(
                options.out, log, options.sample_rate_hz, meter, now,
                simulation.panel if simulation else None, patch=options.sync_patch,
            )
        )  # fmt: skip
        player.observe(recording)
        try:
            flash(player.showing, player.fields, recording)
            whole = player.play()
            if whole:
                flash(player.showing, player.fields, recording)
        except PausePressed:
            whole = False
        except InstrumentError as error:
            words = f"`evenlight fit {options.out} --out FOLDER` analyses what was recorded until then"
            raise InstrumentError(f"{error}; {words}", error.fault, error.code) from None
        return whole


def _simulation(devices: PlaybackDevices) -> Simulation:
    """Return a simulated panel that is dimmed by its backlight, and has the display's luminances."""
    window, display = devices.window, devices.display
    physics = PanelPhysics(
        peak_luminance=display.peak_luminance, black_level=display.black_level, gamma=display.gamma
    )
    panel = SimulatedPanel(physics, window.now)
    return Simulation(panel, np.random.default_rng(SEED), window.now, lambda seconds: None)


def _log(
    playback: Playback,
    devices: PlaybackDevices,
    film: FilmOptions,
    options: PowerOptions,
    shown: str,
    track_sha256: str,
) -> PowerLog:
    """Return what a measurement is, but for what its meter says of itself."""
    rig = devices.rig
    simulated = film.simulate or any(is_simulated(name) for name in (rig.power_meter, rig.backlight))
    return PowerLog(
        simulated=simulated,
        video=playback.video.name,
        duration=playback.duration,
        passes=tuple(dimming.value for dimming in playback.order),
        refresh_rate=rig.refresh_rate,
        sample_rate=options.sample_rate_hz or RATES[0],
        mean_factor=float(np.mean(playback.factors[Dimming.OURS])),
        baseline_factor=float(playback.factors[Dimming.BASELINE][0]),
        sync_connected=options.sync_patch or (simulated and _has_sync(rig.power_meter)),
        apparatus=devices.window.apparatus(),
        provenance=provenance_now(inputs={"track": track_sha256}),
        started="" if film.simulate else utc_now(),
        shown=shown,
    )


def flash(on: Screen, fields: AnyFieldRenderer, recording: PowerRecording) -> None:
    """Show three flashes of white, dark before and after each, and sample the meter after every refresh."""
    times = itertools.count()
    for factor in (*(DARK, BRIGHT) * FLASH_COUNT, DARK):
        for number in range(frame_count(FLASH_SECONDS, on.rig.refresh_rate)):
            pixels = on.brightness.of_picture(factor)
            white = float(dimmed_luminance(on.display.peak_luminance, pixels, on.display))
            on.show(fields, Field(white), next(times))
            if number == 0:
                recording.flashed(factor)
            else:
                recording.take_samples()


class PowerRecording(AbstractContextManager["PowerRecording"]):
    """The power meter at work beside a player, which it observes, and the files that it fills.

    Parameters
    ----------
    folder, log : Path, PowerLog
        Where the files go, and what is recorded; the log's sample rate becomes what the meter achieves.
    rate, meter : float or None, PowerMeter
        The meter, which is started here and stopped at the end, and the rate that it is asked for [Hz]; None
        for the highest of `RATES` that it has.
    clock : callable
        That of the flips [s].
    panel : SimulatedPanel, optional
        A simulated panel, which is told what is shown.
    patch : bool, optional
        Whether a corner of the picture is black or white as the synchronisation line is low or high, for a
        photodiode on the meter's input.

    Raises
    ------
    InputError
        If a file is there already.
    InstrumentError
        If the meter does not start.
    """

    def __init__(
        self,
        folder: Path,
        log: PowerLog,
        rate: float | None,
        meter: PowerMeter,
        clock: Callable[[], float],
        panel: SimulatedPanel | None = None,
        *,
        patch: bool = False,
    ) -> None:
        self._meter, self._clock, self._panel, self._patch = meter, clock, panel, patch
        self._order, self._pass = log.passes, -1
        self._sync, self._last_frame = False, (-1, -1)  # pass and video frame
        with ExitStack() as stack:
            log = dataclasses.replace(log, sample_rate=_started(meter, rate))
            write_json_record(folder / POWER_LOG, log)
            tables = ((POWER_SAMPLES, PowerSample), (CLOCK_PINGS, ClockPing), (FLIPS, PlayedFlip))
            self._tables = {
                name: stack.enter_context(AppendedRows(folder / name, cls))
                for name, cls in (*tables, (FLASHES, FlashMark))
            }
            self._open = stack.pop_all()
        self.compare_clocks()

    def begin(self) -> None:
        """Take note that the video begins, once more."""
        self._pass += 1
        self.compare_clocks()

    def before_flip(self, framebuffer: moderngl.Framebuffer, video_frame: int) -> None:
        """Change the synchronisation line with every new video frame; draw the corner that shows it."""
        if self._last_frame != (self._pass, video_frame):
            self._last_frame, self._sync = (self._pass, video_frame), not self._sync
        if self._patch:
            draw_patch(framebuffer, framebuffer.size, PATCH, lit=self._sync)

    def after_flip(self, flip: float, video_frame: int, factor: float, achieved: float) -> None:
        """Record a refresh, right after it."""
        if self._panel is not None:
            self._panel.set_backlight(achieved)
            self._panel.set_sync(self._sync)
        shown = PlayedFlip(
            self._pass, self._order[self._pass], flip, video_frame, factor, achieved, self._sync
        )
        self._tables[FLIPS].append([shown], to_disk=False)
        self.take_samples()

    def flashed(self, factor: float) -> None:
        """Take a change of a flash marker, right after it appeared."""
        if self._panel is not None:
            self._panel.set_backlight(factor)
        self._tables[FLASHES].append([FlashMark(self._clock(), factor)])
        self.take_samples()

    def take_samples(self) -> None:
        """Write down the samples that came; at once."""
        self._tables[POWER_SAMPLES].append(self._meter.samples(), to_disk=False)

    def compare_clocks(self) -> None:
        """Compare the meter's clock with the computer's, some times in a row.

        Never while a video is played: the answer takes time, and more of it if it gets lost.
        """
        for _ in range(PINGS_AT_ONCE):
            try:
                ping = self._meter.ping()
            except InstrumentError as error:
                if error.fault not in TRANSIENT:
                    raise
                continue  # there are others; a meter that stays silent is told by its samples
            if ping is not None:
                self._tables[CLOCK_PINGS].append([ping], to_disk=False)

    def close(self) -> None:
        """Stop the meter, write down its last samples, and close the files."""
        with self._open:
            self._tables[POWER_SAMPLES].append(self._meter.stop())
            self.compare_clocks()

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.close()
        else:  # what broke it is told; the meter may be gone
            with self._open, suppress(InstrumentError):
                self._tables[POWER_SAMPLES].append(self._meter.samples())


def _started(meter: PowerMeter, rate: float | None) -> float:
    """Start a meter at a rate, or at the highest of `RATES` that it has, and return the one achieved [Hz]."""
    if rate is not None:
        return meter.start(rate)
    for possible in RATES:
        try:
            return meter.start(possible)
        except InstrumentError as error:
            if error.fault is not Fault.REFUSED or possible == RATES[-1]:
                raise
    raise AssertionError("RATES is empty")
