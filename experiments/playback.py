"""Plays a video with its track on a window, in the version of choice, until it ends or somebody ends it."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.power_log import BacklightSetting
from evenlight.data_schema.rig import Rig
from evenlight.experiments.brightness import Brightness
from evenlight.experiments.clip_player import ClipPlayer, Observer
from evenlight.experiments.play_log import Pass
from evenlight.experiments.screenshots import Screenshots
from evenlight.experiments.showing import Showing
from evenlight.experiments.stage import Clip, PausePressed
from evenlight.hardware.backlight_log import LoggedBacklight
from evenlight.hardware.clocks import RefreshClock
from evenlight.hardware.protocols import Backlight, ResponseDevice, Window
from evenlight.hardware.rig import open_backlight, open_keyboard, open_window, open_window_of_any_rate
from evenlight.hardware.simulated_keyboard import SimulatedKeyboard
from evenlight.stimuli.field_renderer import FieldRenderer
from evenlight.stimuli.page_image import centred_image
from evenlight.stimuli.video_source import VideoSource

NOISE_SEED = 1  # nothing is compared with another playing: any will do
CAPTION_SIZE = 1.0  # in multiples of a page's text
CAPTION_PLACE = 0.42  # below the middle, in heights of the window


class Dimming(enum.Enum):
    """How a video is dimmed."""

    OURS = "ours"  # by its track
    BASELINE = "baseline"  # constantly, at equal power
    FULL = "full"  # not at all


SWITCHES = {"1": Dimming.OURS, "2": Dimming.BASELINE, "3": Dimming.FULL}


@dataclass(frozen=True, slots=True, eq=False)
class Playback:
    """What is played, and how.

    Attributes
    ----------
    video : VideoSource
        The video.
    times : array, (N,)
        When each of its frames appears [s].
    duration : float
        Of the video [s].
    factors : mapping
        The brightness factor b of each frame, (N,), for each dimming.
    order : tuple of Dimming
        What is shown, one after the other.
    loop : bool
        Whether it begins again at the end, until somebody ends it.
    captions : bool
        Whether the picture says how it is dimmed.
    screenshots : Path or None
        Folder for a picture of the screen.
    """

    video: VideoSource
    times: NDArray[np.float64]
    duration: float
    factors: Mapping[Dimming, NDArray[np.float64]]
    order: tuple[Dimming, ...]
    loop: bool = False
    captions: bool = False
    screenshots: Path | None = None


@dataclass(frozen=True, slots=True)
class Devices:
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
) -> Iterator[Devices]:
    """Yield the devices of a rig, open.

    Parameters
    ----------
    rig : Rig
        The rig.
    display : Display
        Its display.
    simulated : bool
        Whether time goes with the flips, and nobody sits at the keys.
    any_rate : bool
        Whether the rig takes the refresh rate that the window is found to have.
    noted : callable, optional
        Is told every setting of the backlight.
    """
    with ExitStack() as stack:
        if simulated:
            window = open_window(rig, RefreshClock(rig.refresh_rate), rehearsal=True)
        elif any_rate:
            window, rig = open_window_of_any_rate(rig)
        else:
            window = open_window(rig)
        stack.callback(window.close)
        keyboard = SimulatedKeyboard(window.now) if simulated else open_keyboard()
        stack.callback(keyboard.close)
        backlight = open_backlight(rig, window.now)
        if backlight is not None:
            stack.callback(backlight.close)
            if noted is not None:
                backlight = LoggedBacklight(backlight, window.now, noted)
        yield Devices(window, keyboard, backlight, rig, display)


class Player:
    """Plays on some devices.

    Parameters
    ----------
    devices : Devices
        What on.
    playback : Playback
        What.
    tell : callable
        Is told how the video is dimmed, whenever that changes.
    """

    def __init__(self, devices: Devices, playback: Playback, tell: Callable[[str], None]) -> None:
        window, rig, display = devices.window, devices.rig, devices.display
        self._devices, self._playback, self._tell = devices, playback, tell
        brightness = Brightness(display, rig.actuator, devices.backlight, window.now)
        screenshots = Screenshots(playback.screenshots)
        self.showing = Showing(window, rig, display, brightness, screenshots, self._take_keys)
        self.fields = FieldRenderer(window.context(), display, window.bits(), rig.dither)
        self._player = ClipPlayer(self.showing, self.fields)
        self._dimming = playback.order[0]
        self._factors = np.empty(len(playback.times))
        self._versions: list[str] = []
        self.passes: list[Pass] = []

    def observe(self, observer: Observer) -> None:
        """Let somebody take note of every refresh; how the video is dimmed is not switched any more."""
        self._player.observer = observer

    def play(self) -> bool:
        """Play all of it, and return whether nobody ended it before."""
        while True:
            for dimming in self._playback.order:
                if not self._play_once(dimming):
                    return False
            if not self._playback.loop:
                return True

    def _play_once(self, dimming: Dimming) -> bool:
        """Play the video once, and return whether nobody ended it."""
        playback, whole = self._playback, True
        self._dim(dimming)
        self._versions.clear()
        clip = Clip(playback.video, playback.times, playback.duration, self._factors, NOISE_SEED)
        black = self._devices.display.black_level + self._devices.display.reflected_luminance
        try:
            self._player.play(clip, black)
        except PausePressed:
            whole = False
        finally:
            if self._player.recording is not None and len(self._player.recording.refreshes):
                shown = self._player.recording.result()
                versions = tuple(self._versions[-len(shown.flip_times) :])
                self.passes.append(Pass(shown, versions))
        return whole

    def _dim(self, dimming: Dimming) -> None:
        """Dim what follows in a way: the player takes each frame's factor when it shows it."""
        self._dimming = dimming
        self._factors[:] = self._playback.factors[dimming]
        self._tell(dimming.value)
        if self._playback.captions:
            self._player.caption = caption(dimming.value, self._devices.window.size())

    def _take_keys(self) -> None:
        """Switch to another dimming by its key; raise `PausePressed` if the pause key was pressed."""
        self._versions.append(self._dimming.value)
        for press in self._devices.keyboard.pressed():
            if press.name == self._devices.rig.keys.pause:
                raise PausePressed
            if press.name in SWITCHES and self._player.observer is None:
                self._dim(SWITCHES[press.name])


def caption(text: str, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a word at the foot of a page, (height, width) of coverage."""
    return np.roll(centred_image(text, size, CAPTION_SIZE), round(CAPTION_PLACE * size[1]), axis=0)
