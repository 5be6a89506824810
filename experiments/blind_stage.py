"""The stage of a rehearsal without a window: nothing is drawn, and time goes with frames that would be."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager

from data_schema.rig import Rig
from experiments.ramp_recording import DECIMALS, LUMINANCE_DECIMALS, RampRecording
from experiments.stage import KEY_DECIMALS, PausePressed, RampInterval, ShownInterval
from hardware.clocks import RefreshClock
from hardware.protocols import KeyPress
from hardware.simulated_keyboard import SimulatedKeyboard
from stimuli.ramp import frame_count, ramp_luminance


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
    """

    def __init__(self, rig: Rig, clock: RefreshClock, keyboard: SimulatedKeyboard) -> None:
        self._rig, self._clock, self._keyboard = rig, clock, keyboard

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

    def close(self) -> None:
        """Let go of the keyboard."""
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
