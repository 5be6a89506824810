"""Plays a video with its track on a window, until it ends or the user ends it; and the log of it."""

from __future__ import annotations

import enum
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import BacklightSetting
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.storage.tables import csv_text
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.experiments.playback.clip_player import ClipPlayer, RefreshObserver
from evenlight.experiments.showing import Brightness, Screen, Screenshots
from evenlight.experiments.stage import Clip, PausePressed, ShownClip
from evenlight.hardware.backlights import LoggedBacklight
from evenlight.hardware.presentation.headset_window import HeadsetWindow, ShownFrame
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.protocols import Backlight, KeyPress, ResponseDevice, Window
from evenlight.hardware.rig import open_backlight
from evenlight.hardware.rig_windows import (
    open_headset,
    open_keyboard,
    open_window,
    open_window_of_any_rate,
    with_headset,
)
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.stimuli.eyes.surfaces import Surface
from evenlight.stimuli.page_image import centred_image
from evenlight.stimuli.renderers import field_renderer
from evenlight.stimuli.video.video_source import VideoSource

NOISE_SEED = 1  # nothing is compared with another playing: any will do
CAPTION_SIZE = 1.0  # in multiples of a page's text
CAPTION_SIZE_IN_HEADSET = 2.4  # 4 degrees high, for few pixels
CAPTION_PLACE = 0.42  # below the middle, in heights of the window
LOG_COLUMNS = (
    "pass",
    "version",
    "refresh",
    "flip_time_s",
    "refreshes_dropped",
    "video_frame",
    "factor",
    "backlight_factor",
    "pixels_per_degree",
)
# More of them in a headset: where its head was in the runtime's axes and how it was turned, as predicted.
HEAD_COLUMNS = (
    *(f"head_{axis}_m" for axis in ("right", "up", "back")),
    *(f"head_q{part}" for part in "xyzw"),
    "tracked",
    "focused",
    "visible",
    "refreshes_missed_by_runtime",
    "recentred",
)
GAZE_COLUMNS = tuple(f"gaze_{axis}" for axis in ("right", "up", "back"))  # of a unit vector, if ever known
NEXT, MENU = "trigger", "menu"  # of a controller
LOG_SUFFIXES = (".csv", ".jsonl")


class Dimming(enum.Enum):
    """How a video is dimmed."""

    OURS = "ours"  # by its track
    BASELINE = "baseline"  # constantly, at equal power
    FULL = "full"  # not at all


SWITCHES = {"1": Dimming.OURS, "2": Dimming.BASELINE, "3": Dimming.FULL}


def dropped_words(count: int, *, timed: bool) -> str:
    """Return how many refreshes were dropped, which a rehearsal, whose clock goes with them, cannot know."""
    return f"{count} dropped" if timed else "not timed in this rehearsal"


@dataclass(frozen=True, slots=True, eq=False)
class Playback:
    """What is played, and how."""

    video: VideoSource
    times: NDArray[np.float64]  # (N,): when each of its frames appears [s]
    duration: float  # of the video [s]
    # the brightness factor b of each frame, (N,), for each dimming
    factors: Mapping[Dimming, NDArray[np.float64]]
    order: tuple[Dimming, ...]  # what is shown, one after the other
    loop: bool = False  # whether it begins again at the end, until the user ends it
    captions: bool = False  # whether the picture says how it is dimmed
    screenshots: Path | None = None  # folder for a picture of the screen
    scale: float | None = None  # as that of a `Clip`
    surface: Surface | None = None  # what it lies on in a headset


@dataclass(frozen=True, slots=True)
class PlaybackDevices:
    """What is played on."""

    window: Window
    keyboard: ResponseDevice
    backlight: Backlight | None
    rig: Rig
    display: Display


@contextmanager
def open_devices(
    rig: Rig,
    display: Display,
    *,
    simulated: bool,
    any_rate: bool,
    noted: Callable[[BacklightSetting], None] | None = None,
    gaze: bool = False,
) -> Iterator[PlaybackDevices]:
    """Yield the devices of a rig, open.

    Parameters
    ----------
    rig : Rig
        The rig.
    display : Display
        Its display.
    simulated : bool
        Whether time goes with the flips, and no person sits at the keys.
    any_rate : bool
        Whether the rig takes the refresh rate that the window is found to have.
    noted : callable, optional
        Is told every setting of the backlight.
    gaze : bool, optional
        Whether a headset's runtime is asked where the eyes look, for a log.
    """
    with ExitStack() as stack:
        if rig.in_headset:
            headset = stack.enter_context(open_headset(rig, waits=not simulated, gaze=gaze))
            rig, display = with_headset(rig, display, headset.facts())
            clock = RefreshClock(rig.refresh_rate) if simulated else None
            window: Window = open_window(rig, clock, rehearsal=simulated, headset=headset)
        elif simulated:
            window = open_window(rig, RefreshClock(rig.refresh_rate), rehearsal=True)
        elif any_rate:
            window, rig = open_window_of_any_rate(rig)
        else:
            window = open_window(rig)
        stack.callback(window.close)
        keyboard = SimulatedKeyboard(window.now) if simulated else open_keyboard(window)
        stack.callback(keyboard.close)
        backlight = open_backlight(rig, window.now)
        if backlight is not None:
            stack.callback(backlight.close)
            if noted is not None:
                backlight = LoggedBacklight(backlight, window.now, noted)
        yield PlaybackDevices(window, keyboard, backlight, rig, display)


@dataclass(frozen=True, slots=True)
class Pass:
    """One time through a video."""

    shown: ShownClip  # what the display showed
    versions: tuple[str, ...]  # how each refresh was dimmed: ours, baseline or full; of a walk: walk
    heads: tuple[ShownFrame, ...] = ()  # in a headset, what its runtime says of each refresh


class Player:
    """Plays on some devices.

    Parameters
    ----------
    devices : PlaybackDevices
        What on.
    playback : Playback
        What.
    tell : callable
        Is told how the video is dimmed, whenever that changes.
    """

    def __init__(self, devices: PlaybackDevices, playback: Playback, tell: Callable[[str], None]) -> None:
        window, rig, display = devices.window, devices.rig, devices.display
        self._devices, self._playback, self._tell = devices, playback, tell
        brightness = Brightness(display, rig.actuator, devices.backlight, window.now)
        screenshots = Screenshots(playback.screenshots)
        self.showing = Screen(window, rig, display, brightness, screenshots, self._take_keys)
        self.fields = field_renderer(window, display, rig.dither)
        self._player = ClipPlayer(self.showing, self.fields, playback.surface)
        self._dimming = playback.order[0]
        self._factors = np.empty(len(playback.times))
        self._versions: list[str] = []
        self._heads: list[ShownFrame] = []
        self.passes: list[Pass] = []

    def observe(self, observer: RefreshObserver) -> None:
        """Report every refresh to an observer; from then on keys do not switch the version."""
        self._player.observer = observer

    def play(self) -> bool:
        """Play all of it, straight ahead of a headset's head, and return whether it was played to its end."""
        if isinstance(self._devices.window, HeadsetWindow):
            self._devices.window.recentre()
        while True:
            for dimming in self._playback.order:
                if not self._play_once(dimming):
                    return False
            if not self._playback.loop:
                return True

    def _play_once(self, dimming: Dimming) -> bool:
        playback, whole = self._playback, True
        self._dim(dimming)
        self._versions.clear()
        self._heads.clear()
        clip = Clip(
            playback.video, playback.times, playback.duration, self._factors, NOISE_SEED, scale=playback.scale
        )
        black = self._devices.display.black_level + self._devices.display.reflected_luminance
        try:
            self._player.play(clip, black)
        except PausePressed:
            whole = False
        finally:
            if self._player.recording is not None and len(self._player.recording.refreshes):
                shown = self._player.recording.result()
                # What interrupts may come before the last refresh's own were taken.
                versions = (*self._versions, self._dimming.value)[: len(shown.flip_times)]
                self.passes.append(Pass(shown, versions, tuple(self._heads)))
        return whole

    def _dim(self, dimming: Dimming) -> None:
        """Dim what follows in a way: the player takes each frame's factor when it shows it."""
        self._dimming = dimming
        self._factors[:] = self._playback.factors[dimming]
        self._tell(dimming.value)
        if self._playback.captions:
            size = CAPTION_SIZE_IN_HEADSET if self._devices.rig.in_headset else CAPTION_SIZE
            self._player.caption = caption(dimming.value, self._devices.window.size(), size)

    def _take_keys(self) -> None:
        """Switch to another dimming by its key; raise `PausePressed` if the pause key was pressed."""
        heads = heads_of(self._devices.window)
        if self._player.recording is not None:  # of a refresh of the video, not of what comes before it
            self._versions.append(self._dimming.value)
            self._heads += heads
        for press in pressed_on(self._devices):
            if ends(press, self._devices.rig):
                raise PausePressed
            if press.name in SWITCHES and self._player.observer is None:
                self._dim(SWITCHES[press.name])
            if self._devices.rig.in_headset and press.name == NEXT:
                every = tuple(Dimming)
                self._dim(every[(every.index(self._dimming) + 1) % len(every)])


def pressed_on(devices: PlaybackDevices) -> list[KeyPress]:
    """Return the keys pressed since the last call, and what was pressed on a headset's controllers."""
    window = devices.window
    return [*devices.keyboard.pressed(), *(window.presses() if isinstance(window, HeadsetWindow) else ())]


def ends(press: KeyPress, rig: Rig) -> bool:
    """Return whether a key ends what is shown: the pause key, or the menu button of a controller."""
    return press.name == rig.keys.pause or (rig.in_headset and press.name == MENU)


def heads_of(window: Window) -> list[ShownFrame]:
    """Return what a headset's runtime says of the refreshes since the last call; nothing of a screen."""
    return window.shown_frames() if isinstance(window, HeadsetWindow) else []


def caption(text: str, size: tuple[int, int], letters: float = CAPTION_SIZE) -> NDArray[np.uint8]:
    """Return a word at the foot of a page, (height, width) of coverage."""
    return np.roll(centred_image(text, size, letters), round(CAPTION_PLACE * size[1]), axis=0)


def require_log_file(path: Path) -> None:
    """Refuse a log that is neither csv nor jsonl, or is there already."""
    if path.suffix not in LOG_SUFFIXES:
        raise InputError(f"--log {path}: give a file that ends in .csv or .jsonl")
    if path.is_file():
        raise InputError(f"--log {path}: is there already; give another name")


def write_log(
    path: Path, passes: Sequence[Pass], refresh_rate: float, pixels_per_degree: float | None = None
) -> None:
    """Write the log of some passes on a display of some refresh rate [Hz].

    `refreshes_dropped` counts those that passed without a new frame right before a refresh;
    `pixels_per_degree` is that of the video as it was shown, empty if not known. Of a headset there are
    `HEAD_COLUMNS` too, and `GAZE_COLUMNS` if it was ever known where the eyes look; its flips are the display
    times that the runtime predicts.
    """
    in_headset = any(one.heads for one in passes)
    columns = (*LOG_COLUMNS, *HEAD_COLUMNS) if in_headset else LOG_COLUMNS
    if any(head.gaze for one in passes for head in one.heads):
        columns = (*columns, *GAZE_COLUMNS)
    rows = [
        [*row, pixels_per_degree, *_head_cells(head)][: len(columns)]
        for number, one in enumerate(passes, start=1)
        for row, head in zip_longest(_rows(number, one, refresh_rate), one.heads)
    ]
    if path.suffix == ".csv":
        write_whole(path, csv_text(columns, [["" if cell is None else cell for cell in row] for row in rows]))
    else:
        lines = (json.dumps(dict(zip(columns, row, strict=True))) for row in rows)
        write_whole(path, "".join(f"{line}\n" for line in lines))


def _rows(number: int, one: Pass, refresh_rate: float) -> Iterator[list[Any]]:
    shown = one.shown
    steps = np.diff(shown.flip_times, prepend=-1 / refresh_rate)
    dropped = np.maximum(np.rint(steps * refresh_rate).astype(int) - 1, 0).tolist()
    backlight: Sequence[float | None] = shown.backlight_factors or [None] * len(dropped)
    columns = (one.versions, shown.flip_times, dropped, shown.video_frames, shown.factors, backlight)
    for refresh, (version, time, missed, frame, factor, reported) in enumerate(zip(*columns, strict=True)):
        yield [number, version, refresh, time, missed, frame, factor, reported]


def _head_cells(shown: ShownFrame | None) -> list[Any]:
    """Return what a runtime says of a refresh, for both columns; nothing of one that was interrupted."""
    if shown is None:
        return [None] * len(HEAD_COLUMNS + GAZE_COLUMNS)
    said = shown.tracked, shown.focused, shown.visible, shown.late, shown.recentred
    return [*shown.head.position, *shown.head.orientation, *said, *(shown.gaze or 3 * [None])]
