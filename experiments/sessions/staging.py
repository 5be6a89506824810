"""Opening a session's stage, on a window or without one: then frames are counted and none is drawn."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator, Rig
from evenlight.experiments.calibration_age import utc_now
from evenlight.experiments.headset.headset_stage import HeadsetStage
from evenlight.experiments.recordings import (
    DECIMALS,
    LUMINANCE_DECIMALS,
    ClipRecording,
    RampRecording,
    frames_of_refreshes,
)
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.search_stage import OffscreenPainter, SearchTracker
from evenlight.experiments.sessions.task import PressKey
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import (
    KEY_DECIMALS,
    Clip,
    PausePressed,
    RampInterval,
    SearchResult,
    SearchView,
    ShownClip,
    ShownInterval,
    Stage,
)
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.protocols import KeyPress
from evenlight.hardware.rig import backlights_smallest_factor, open_backlight, opened_triggers
from evenlight.hardware.rig_windows import open_keyboard, open_pointer, open_window
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.stimuli.ramp import frame_count, ramp_luminance

OpenPainter = Callable[[], AbstractContextManager[OffscreenPainter]]


@dataclass(frozen=True, slots=True)
class Staging:
    """How a session is staged."""

    # None with a person; "data" without a window, "visual" through the window, with a simulated observer
    simulation: str | None = None
    real_time: bool = False  # whether a rehearsal that is seen goes at the pace of a session
    screenshots: Path | None = None  # folder for a picture of every kind of screen

    @property
    def simulated(self) -> bool:
        """Whether a simulated observer answers."""
        return self.simulation is not None

    def utc(self) -> str:
        """Return the time of day; empty in a rehearsal, which is the same whenever it is run."""
        return "" if self.simulated else utc_now()


def smallest_factor(staging: Staging, rig: Rig) -> float:
    """Return the lowest brightness factor that a session may ask for; 0 where pixels make the brightness.

    A rehearsal without a window opens no device of the computer, which may be another than the rig's: there
    any factor will do, unless the backlight is a simulated one.
    """
    elsewhere = staging.simulation == "data" and rig.backlight != "simulated"
    if elsewhere or rig.actuator is Actuator.PIXELS:
        return 0.0
    return backlights_smallest_factor(rig)


@contextmanager
def open_stage(
    staging: Staging,
    rig: Rig,
    display: Display,
    page_luminance: float,
    pages: Pages,
    headset: HeadsetWindow | None,
) -> Iterator[tuple[Stage, PressKey | None]]:
    """Yield the stage of a session, and what presses the keys of a rehearsal; None where a person does.

    Parameters
    ----------
    staging : Staging
        With a person or a simulated observer, on a window or without one.
    rig : Rig
        The devices.
    display : Display
        The rig's calibrated display.
    page_luminance : float
        Of the ground of pages [cd/m^2].
    pages : Pages
        What answers are called, in a headset.
    headset : HeadsetWindow or None
        The rig's, open; closed with the stage.
    """
    if staging.simulation == "data":
        frames = RefreshClock(rig.refresh_rate)
        keyboard = SimulatedKeyboard(frames.now)
        with BlindStage(rig, frames, keyboard, lambda: OffscreenPainter(display)) as blind:
            yield blind, keyboard.queue
        return
    counted = staging.simulated and not staging.real_time
    clock = RefreshClock(rig.refresh_rate) if counted else None
    with opened_triggers(rig.triggers) as triggers:
        window = open_window(rig, clock, rehearsal=staging.simulated, headset=headset)
        try:
            simulated = SimulatedKeyboard(window.now) if staging.simulated else None
            keys = simulated or open_keyboard(window)
            shown = rig, display, page_luminance
            stage: WindowStage
            if isinstance(window, HeadsetWindow):
                stage = HeadsetStage(
                    window, keys, *shown, pages, screenshots=staging.screenshots, triggers=triggers
                )
            else:
                backlight = open_backlight(rig, window.now)
                mouse = (lambda: None) if staging.simulated else (lambda: open_pointer(window))
                stage = WindowStage(window, keys, *shown, backlight, staging.screenshots, mouse, triggers)
        except BaseException:
            window.close()
            raise
        with stage:
            yield stage, simulated.queue if simulated else None


class BlindStage(Stage):
    """Counts the frames of a session, and shows none.

    Parameters
    ----------
    rig : Rig
        Refresh rate and pause key.
    clock : RefreshClock
        Moved on by each frame.
    keyboard : SimulatedKeyboard
        Who answers, on this clock.
    open_painter : callable, optional
        Returns what draws rings without a window, for the luminance around those that are searched for; it is
        closed with the stage.
    """

    def __init__(
        self,
        rig: Rig,
        clock: RefreshClock,
        keyboard: SimulatedKeyboard,
        open_painter: OpenPainter | None = None,
    ) -> None:
        self._rig, self._clock, self._keyboard = rig, clock, keyboard
        self._open_painter, self._opened = open_painter, ExitStack()

    def now(self) -> float:
        """Return the time on the stage's clock [s]."""
        return self._clock.now()

    def apparatus(self) -> dict[str, str]:
        """Return what the devices say of themselves."""
        return {"window": "none", "clock": "refreshes counted", **self._keyboard.apparatus()}

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> KeyPress:
        """Let time pass until one of some keys (any, where none is given) is pressed; return it."""
        self._keyboard.clear()
        while True:
            self._advance()
            for press in self._keyboard.pressed():
                if press.name in keys or not keys:
                    return press
            self._require_press(text)

    def ask(self, question: str, keys: Sequence[str], luminance: float) -> KeyPress:
        """Let time pass until one of the keys is pressed; its time counts from the first frame.

        Raises `PausePressed` if the pause key was pressed.
        """
        self._presses()
        onset = self._advance()
        while True:
            for press in self._presses():
                if press.name in keys:
                    return KeyPress(press.name, round(max(0.0, press.time - onset), KEY_DECIMALS))
            self._require_press(question)
            self._advance()

    def wait(self, seconds: float, luminance: float, pixel_value: float | None = None) -> None:
        """Let time pass [s]. Raises `PausePressed` if the pause key was pressed."""
        if seconds > 0:
            self._clock.advance(1 + frame_count(seconds, self._rig.refresh_rate))
        self._presses()

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        """Count the frames of an interval. Raises `PausePressed` if the pause key was pressed meanwhile."""
        recording = RampRecording(self._rig.refresh_rate)
        seconds = interval.adaptation + interval.duration + interval.hold
        for frame in range(frame_count(seconds, self._rig.refresh_rate)):
            time = round(frame / self._rig.refresh_rate, DECIMALS)
            intended = ramp_luminance(
                time,
                interval.initial_luminance,
                interval.final_luminance,
                interval.adaptation,
                interval.duration,
            )
            recording.note(self._advance(), round(float(intended), LUMINANCE_DECIMALS))
            self._presses()
        return recording.result()

    def play(self, clip: Clip) -> ShownClip:
        """Count the refreshes of a clip. Raises `PausePressed` if the pause key was pressed meanwhile."""
        recording = ClipRecording(self._rig.refresh_rate)
        for frame in frames_of_refreshes(clip, self._rig.refresh_rate).tolist():
            recording.note(self._advance(), frame, float(clip.factors[frame]))
            self._presses()
        return recording.result()

    def search(self, view: SearchView) -> SearchResult:
        """Count the refreshes until the key `found` is pressed or the time is over.

        The luminance around the ring is that of a picture drawn without a window. Raises `PausePressed` if
        the pause key was pressed.
        """
        background = self._painter.picture(view.scene, view.camera.position, view.ring).background_luminance
        searching = SearchTracker(view, self._rig, pixels_per_degree=1.0)  # no mouse is moved
        self._presses()
        while not searching.over:
            direction = searching.direction(self._clock.now() + 1 / self._rig.refresh_rate)
            searching.note(self._advance(), direction)
            searching.take(self._presses())
        return searching.result(background)

    @functools.cached_property
    def _painter(self) -> OffscreenPainter:
        """What draws rings; made for the first search, for it needs a graphics driver."""
        if self._open_painter is None:
            raise ValueError("a stage without a window needs a painter of rings for a search")
        return self._opened.enter_context(self._open_painter())

    def close(self) -> None:
        """Let go of the keyboard."""
        self._opened.close()
        self._keyboard.close()

    def _advance(self) -> float:
        return self._clock.advance()

    def _presses(self) -> list[KeyPress]:
        """Return the keys pressed, or raise `PausePressed` if the pause key is among them."""
        presses = self._keyboard.pressed()
        if any(press.name == self._rig.keys.pause for press in presses):
            raise PausePressed
        return presses

    def _require_press(self, text: str) -> None:
        """Raise if no key is to come, for without a person the session would stand still for ever."""
        if not self._keyboard.waiting():
            raise RuntimeError(f"no one answers {text.strip()[:40]!r}: no key press is queued")
