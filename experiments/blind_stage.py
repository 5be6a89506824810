"""The stage of a rehearsal without a window: nothing is drawn, and time goes with frames that would be."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack

from evenlight.data_schema.rig import Rig
from evenlight.experiments.clip_recording import ClipRecording, frames_of_refreshes
from evenlight.experiments.ramp_recording import LUMINANCE_DECIMALS, RampRecording
from evenlight.experiments.refreshes import DECIMALS
from evenlight.experiments.ring_views import RingPainter
from evenlight.experiments.searching import Searching
from evenlight.experiments.stage import (
    KEY_DECIMALS,
    Clip,
    PausePressed,
    RampInterval,
    Searched,
    SearchView,
    ShownClip,
    ShownInterval,
)
from evenlight.hardware.clocks import RefreshClock
from evenlight.hardware.protocols import KeyPress
from evenlight.hardware.simulated_keyboard import SimulatedKeyboard
from evenlight.stimuli.ramp import frame_count, ramp_luminance

OpenPainter = Callable[[], AbstractContextManager[RingPainter]]


class BlindStage(AbstractContextManager["BlindStage"]):
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

    def prepare(self, pages: Sequence[str], questions: Sequence[str]) -> None:
        """Set nothing: there is no window that a text could be too long for."""

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> KeyPress:
        """Let time pass until one of some keys is pressed, and return which and when."""
        self._keyboard.clear()
        while True:
            self._advance()
            for press in self._keyboard.pressed():
                if press.name in keys:
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

    def wait(self, seconds: float, luminance: float) -> None:
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

    def prepare_clip(self, clip: Clip) -> None:
        """Do nothing: no video is read."""

    def play(self, clip: Clip) -> ShownClip:
        """Count the refreshes of a clip. Raises `PausePressed` if the pause key was pressed meanwhile."""
        recording = ClipRecording(self._rig.refresh_rate)
        for frame in frames_of_refreshes(clip, self._rig.refresh_rate).tolist():
            recording.note(self._advance(), frame, float(clip.factors[frame]))
            self._presses()
        return recording.result()

    def room(self) -> None:
        """Return None: nothing is shown."""

    def prepare_scene(self, name: str) -> None:
        """Do nothing: no scene is shown."""

    def search(self, view: SearchView) -> Searched:
        """Count the refreshes until the key `found` is pressed or the time is over.

        The luminance around the ring is that of a picture drawn without a window. Raises `PausePressed` if
        the pause key was pressed.
        """
        background = self._painter.picture(view.scene, view.camera.position, view.ring).background_luminance
        searching = Searching(view, self._rig, pixels_per_degree=1.0)  # nobody moves a mouse
        self._presses()
        while not searching.over:
            direction = searching.direction(self._clock.now() + 1 / self._rig.refresh_rate)
            searching.note(self._advance(), direction)
            searching.take(self._presses())
        return searching.result(background)

    @functools.cached_property
    def _painter(self) -> RingPainter:
        """What draws rings; made for the first search, for it needs a graphics driver."""
        if self._open_painter is None:
            raise ValueError("a stage without a window needs a painter of rings for a search")
        return self._opened.enter_context(self._open_painter())

    def close(self) -> None:
        """Let go of the keyboard."""
        self._opened.close()
        self._keyboard.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _advance(self) -> float:
        """Let a refresh pass, and return the time then [s]."""
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
            raise RuntimeError(f"nobody answers {text.strip()[:40]!r}: no key press is queued")
