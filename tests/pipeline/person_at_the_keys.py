"""Runs a session as with a participant, presses the keys of the computer's keyboard, and prints which.

The presses enter where PsychoPy's keyboard takes those of its driver, at the time of the driver's clock. A
virtual screen waits for no refresh, so that its refresh rate is measured and not minded.

Usage: person_at_the_keys.py DATASET
"""

import dataclasses
import json
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar

from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.experiments import run_session
from evenlight.experiments.sessions.pages import load_pages
from evenlight.experiments.sessions.staging import Staging
from evenlight.hardware import rig_windows as rig_module
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display

DESIGN = RampDesign(
    screens=("white",),
    factors=(0.5,),
    relative_rates=(0.1, 0.4),
    repetitions=2,
    catch_share=0.0,
    ramp_durations=(0.4,),
    adaptation_duration=0.1,
    hold_duration=0.1,
    pause_duration=0.1,
    practice_trials=1,
    trials_between_breaks=2,
    max_dropped_frames=1000,  # a busy machine drops some; what is flagged for it has tests of its own
)  # a trial for practice, and four; a break in the middle
ANSWERS = (("y", 0.3), ("y", 0.6), ("n", 0.3), ("n", 0.9), ("y", 0.4))  # key, and seconds until it is pressed
PAUSE_AFTER = 4  # trials answered; then the pause key is pressed
INTO_THE_RAMP = 0.3  # [s] from the answer before: 0.1 s of pause are over, and 0.6 s of ramp are not
READING_TIME = 0.3  # [s]


class Sitter:
    """Somebody who presses each page's key, and for each trial the next of some answers."""

    pressed: ClassVar[list[tuple[int, str, float]]] = []

    def __init__(self) -> None:
        self._timer = threading.Timer(0, print)
        self._paused = False

    def see_page(self, keys: Sequence[str]) -> None:
        """Press the page's first key, again and again until it is seen that the page is gone."""
        self._timer.cancel()
        self._later(READING_TIME, keys[0], again=True)

    def see_trial(self, planned: object, trial_index: int) -> None:
        """Press a key without meaning, then that of the answer, and once the pause key in the next ramp."""
        self._timer.cancel()
        key, delay = ANSWERS[trial_index]
        asked = time.monotonic()
        self._later(delay / 2, "q")
        self._later(
            delay, key, note=lambda: self.pressed.append((trial_index, key, time.monotonic() - asked))
        )
        if trial_index + 1 == PAUSE_AFTER and not self._paused:
            self._paused = True
            self._later(delay + INTO_THE_RAMP, "escape")

    def _later(
        self, seconds: float, key: str, again: bool = False, note: Callable[[], object] = lambda: None
    ) -> None:
        """Press a key after a time, later on a busy machine; a page's key is pressed again as long."""

        def act() -> None:
            note()
            press(key)
            if again:
                self._later(seconds, key, again)

        timer = threading.Timer(seconds, act)
        timer.daemon = True
        if again:
            self._timer = timer
        timer.start()


def press(name: str) -> None:
    """Press a key and let it go within one frame, as the driver would report it."""
    from psychopy import logging
    from psychopy.hardware import keyboard

    device = keyboard.KeyboardDevice._instance
    code = next(code for code, known in keyboard.keyNames.items() if known == name)
    now = logging.defaultClock.getLastResetTime() + logging.defaultClock.getTime()
    for down, when in ((True, now), (False, now + 0.08)):
        device.receiveMessage(device.parseMessage({"down": down, "keycode": code, "time": when}))


def main(dataset: Path) -> None:
    rig_module.require_refresh_rate = lambda rig, measured: None
    run_session.Participant = Sitter  # type: ignore[misc,assignment] # who sits there is a person to the session
    rig, display = load_rig("simulated")
    rig = dataclasses.replace(rig, window_size=(480, 300))  # pages find room, and a processor draws it soon
    request = run_session.SessionRequest(
        "ramp",
        dataset,
        "01",
        "01",
        rig,
        load_display(display),
        DESIGN,
        load_pages("en"),
        Staging(None),
        seed=5,
    )
    outcome = run_session.run_session(request)
    told = {"dataset": str(dataset), "status": outcome.status.value, "pressed": Sitter.pressed}
    print(json.dumps(told))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
