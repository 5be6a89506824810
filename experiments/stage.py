"""Where a session happens: pages, ramps and questions, on a window or without one."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.hardware.presentation.headset_window import ShownFrame
from evenlight.hardware.protocols import KeyPress
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.video.video_source import VideoSource

KEY_DECIMALS = 6  # of a response time [s]: what a key's time says, without the rounding of a difference


class PausePressed(Exception):  # noqa: N818 - it is no error: the pause key was pressed
    """The pause key was pressed while something was shown, or what was shown could not be seen.

    Parameters
    ----------
    why : str, optional
        In words, for the log.
    """

    def __init__(self, why: str = "paused") -> None:
        super().__init__(why)


class SkipPressed(PausePressed):
    """The operator broke off what was shown; it is shown again without a pause."""


class SessionStopped(Exception):  # noqa: N818 - it is no error: it was asked for, or the display fails
    """The session was stopped, for a reason."""


@dataclass(frozen=True, slots=True)
class RampInterval:
    """A uniform field: constant, changing linearly in luminance, constant again.

    Attributes
    ----------
    initial_luminance, final_luminance : float
        L before and after the ramp, reflected light included [cd/m^2].
    pixel_value : float
        L' of the uniform screen at full brightness, in [0, 1]; what the pixels show if the backlight makes
        the brightness.
    adaptation, duration, hold : float
        Constant luminance before the ramp, the ramp, constant luminance after it [s].
    noise_seed : int
        Of the dithering noise.
    label : str
        Number of the interval, shown during the adaptation; empty for none.
    mark_contrast : float
        Weber contrast of the fixation mark against the field, once the number is gone; 0 for no mark.
    """

    initial_luminance: float
    final_luminance: float
    pixel_value: float
    adaptation: float
    duration: float
    hold: float
    noise_seed: int
    label: str = ""
    mark_contrast: float = 0.0


@dataclass(frozen=True, slots=True)
class ShownInterval:
    """What the display showed of an interval."""

    onset: float  # when the first frame appeared, on the stage's clock [s]
    flip_times: tuple[float, ...]  # of each frame, since the first [s]
    intended_luminance: tuple[float, ...]  # of each frame [cd/m^2]
    # frames that were read back, and their mean luminance [cd/m^2]
    probe_frames: tuple[int, ...] = ()
    probe_luminance: tuple[float, ...] = ()
    # as the backlight reported; empty where pixels make the brightness
    backlight_factors: tuple[float, ...] = ()
    frames_dropped: int = 0  # refreshes that passed without a new frame


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video with the brightness factor of each of its frames.

    Attributes
    ----------
    video : VideoSource or None
        The video, shown in the window's middle. None where nothing is shown, in a rehearsal without a window.
    times : array, (N,)
        When each of its frames appears, since the first [s].
    duration : float
        Of the whole video [s].
    factors : array, (N,)
        b of each of its frames, in (0, 1].
    noise_seed : int
        Of the dithering noise.
    seconds : float or None
        How much of it is shown, from its beginning [s]; None for all.
    label : str
        Number of the interval, shown on a uniform field before the video; empty for none.
    scale : float or None
        Pixels of the window per pixel of the video, of which the middle is shown that fits; None shows it
        pixel by pixel, and it must fit as a whole.
    """

    video: VideoSource | None
    times: NDArray[np.float64]
    duration: float
    factors: NDArray[np.float64]
    noise_seed: int
    seconds: float | None = None
    label: str = ""
    scale: float | None = None


@dataclass(frozen=True, slots=True)
class ShownClip:
    """What the display showed of a clip."""

    onset: float  # when the first frame appeared, on the stage's clock [s]
    flip_times: tuple[float, ...]  # of each refresh, since the first [s]
    video_frames: tuple[int, ...]  # frame of the video that each refresh showed, from 0
    factors: tuple[float, ...]  # brightness factor that each refresh showed
    # as the backlight reported; empty where pixels make the brightness
    backlight_factors: tuple[float, ...] = ()
    # refreshes that were read back, the mean luminance of the video's middle then, and what it was to be
    # [cd/m^2]
    probe_refreshes: tuple[int, ...] = ()
    probe_luminance: tuple[float, ...] = ()
    probe_intended: tuple[float, ...] = ()
    frames_dropped: int = 0  # refreshes that passed without a new frame
    # how much longer than asked for the uniform field before the clip was shown, because too little of the
    # video was read yet [s]
    waited: float = 0.0


@dataclass(frozen=True, slots=True)
class SearchView:
    """A scene that is looked around in from one point, with a ring in it.

    Attributes
    ----------
    scene : str
        Name of the scene.
    camera : Camera
        Where from, and the first direction of view; its focal length is the display's, so that everything has
        its true size on the visual field.
    ring : Ring
        The ring: direction, gap, contrast, orientation.
    factor : float
        Brightness factor b of the scene.
    time_limit : float
        After which it ends [s].
    field_of_view : float
        How far one may look from the first direction, to each side [deg].
    noise_seed : int
        Of the dithering noise.
    """

    scene: str
    camera: Camera
    ring: Ring
    factor: float
    time_limit: float
    field_of_view: float
    noise_seed: int


@dataclass(frozen=True, slots=True)
class SearchResult:
    """How a search went."""

    onset: float  # when the scene appeared, on the stage's clock [s]
    found_after: float | None  # when the key was pressed, since the onset [s]; None if it was not
    flip_times: tuple[float, ...]  # of each refresh, since the first [s]
    # direction of view of each refresh, from the first one and from the horizon [deg]
    azimuths: tuple[float, ...]
    altitudes: tuple[float, ...]
    # mean luminance I that the display emits around the ring at full brightness [cd/m^2]
    background_luminance: float
    # as the backlight reported; empty where pixels make the brightness
    backlight_factors: tuple[float, ...] = ()
    frames_dropped: int = 0  # refreshes that passed without a new frame


@dataclass(frozen=True, slots=True)
class SentTrigger:
    """A trigger that told other recorders what is shown."""

    label: str  # a name of `data_schema.recordings.rig.TriggerCodes`
    code: int  # what was sent
    time: float  # of the flip that it belongs to, on the stage's clock [s]
    delay: float | None  # from there until the devices had taken it [s]; None if none took it
    failures: tuple[str, ...] = ()  # of devices that did not take it; they are not tried again


class Stage(AbstractContextManager["Stage"]):
    """Shows what a session asks for, and takes the keys pressed; what shows nothing has less to do."""

    @abstractmethod
    def now(self) -> float:
        """Return the time on the stage's clock [s]."""

    @abstractmethod
    def apparatus(self) -> dict[str, str]:
        """Return what the devices say of themselves."""

    def prepare(self, pages: Sequence[str], questions: Sequence[str], font: Path | None = None) -> None:
        """Set some texts before the session begins; from then on in a lab's own font, if one is given.

        Raises
        ------
        InputError
            If one of them cannot be shown: it does not fit, or has letters that the font lacks.
        """

    @abstractmethod
    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> KeyPress:
        """Show a page until one of some keys is pressed (any, where none is given); return which and when."""

    @abstractmethod
    def ask(self, question: str, keys: Sequence[str], luminance: float) -> KeyPress:
        """Show a question on a field of some luminance until one of the keys is pressed.

        The time of the key press returned counts from the first flip that showed the question. Raises
        `PausePressed` if the pause key was pressed.
        """

    @abstractmethod
    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        """Show an interval. Raises `PausePressed` if the pause key was pressed meanwhile."""

    def prepare_clip(self, clip: Clip) -> None:
        """Begin to read a clip, so that it can begin when it is asked for.

        Raises
        ------
        InputError
            If the video has not as many frames as the clip.
        """

    @abstractmethod
    def play(self, clip: Clip) -> ShownClip:
        """Show a video with its brightness. Raises `PausePressed` if the pause key was pressed meanwhile.

        Raises
        ------
        InputError
            If the video is larger than the window, or cannot be read to its end.
        """

    def room(self) -> tuple[int, int] | None:
        """Return width and height of what can be shown on [pixels]; None where nothing is shown."""
        return None

    def prepare_scene(self, name: str) -> None:
        """Make a scene ready to be searched, where it is not yet; the first time may take a while."""

    @abstractmethod
    def search(self, view: SearchView) -> SearchResult:
        """Show a scene to look around in until the key `found` is pressed or the time is over.

        Raises `PausePressed` if the pause key was pressed.

        Raises
        ------
        InputError
            If there is no such scene, or the ring's gap is too small for the display.
        """

    @abstractmethod
    def wait(self, seconds: float, luminance: float, pixel_value: float | None = None) -> None:
        """Show a uniform field for a time [s]. Raises `PausePressed` if the pause key was pressed.

        With a pixel value, the field's brightness is made as that of a ramp with it is; without, by pixels.
        """

    def triggers_sent(self) -> list[SentTrigger]:
        """Return the triggers sent since the last call, in order."""
        return []

    def tell(self, progress: str) -> None:
        """Say to an operator who sees what a participant does not how far the session is."""

    def seen_in_headset(self) -> list[Sequence[ShownFrame]]:
        """Return the frames of each interval that was shown since the last call; none outside a headset."""
        return []

    @abstractmethod
    def close(self) -> None:
        """Close window and devices."""

    def __exit__(self, *_: object) -> None:
        self.close()
