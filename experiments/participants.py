"""Who sits at the keys of a session: a person, or a simulated observer that presses them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from evenlight.data_schema.rig import Keys
from evenlight.experiments.keyed_chance import Purpose, generator_for
from evenlight.stimuli.looking import steps_to

READING_TIME = 0.5  # [s] a simulated participant looks at a page
ANSWERING_TIME = (0.4, 0.9)  # [s] shortest, and mean of what comes on top (choice: practised people)

PressKey = Callable[[str, float], None]


class Answers(Protocol):
    """What a simulated observer answers in the trials of one session."""

    def key(self, planned: Any, trial_index: int) -> str:
        """Return the key that is pressed when a trial is asked about."""

    def search_time(self, planned: Any, trial_index: int) -> float | None:
        """Return when a ring is found, since the scene appeared [s]; None if it is not."""


class Person:
    """A person: presses keys by themselves."""

    def see_page(self, keys: Sequence[str]) -> None:
        """Be shown a page."""

    def see_trial(self, planned: object, trial_index: int) -> None:
        """Have been shown a trial."""

    def begin_search(self, planned: object, trial_index: int) -> None:
        """Be about to search a scene."""


class SimulatedParticipant:
    """A simulated observer at the keys.

    Parameters
    ----------
    answers : Answers
        What the observer answers: functions of the trial and its place, so that a session that was
        interrupted goes on exactly as it would have.
    press : callable
        Presses a key, by name, after a time [s].
    keys : Keys
        Which key means what.
    session : (int, int)
        Seed of the session and place of the participant, of which response times are functions.
    """

    def __init__(self, answers: Answers, press: PressKey, keys: Keys, session: tuple[int, int]) -> None:
        self._answers, self._press, self._keys, self._session = answers, press, keys, session

    def see_page(self, keys: Sequence[str]) -> None:
        """Read a page and press the usual key."""
        self._press(keys[0], READING_TIME)

    def see_trial(self, planned: Any, trial_index: int) -> None:
        """Press the key of the answer, a while after the question will be there."""
        shortest, mean = ANSWERING_TIME
        rng = generator_for(*self._session, Purpose.ANSWERING_TIMES, trial_index)
        self._press(self._answers.key(planned, trial_index), shortest + float(rng.exponential(mean)))

    def begin_search(self, planned: Any, trial_index: int) -> None:
        """Turn to the ring by then, and press the key when it will be found, if it will."""
        after = self._answers.search_time(planned, trial_index)
        if after is not None:
            turns = self._turns_to(planned)
            for k, key in enumerate(turns, start=1):
                self._press(key, after * k / (len(turns) + 1))
            self._press(self._keys.found, after)

    def _turns_to(self, planned: Any) -> list[str]:
        """Return the keys that turn the view to the ring of a search."""
        columns, keys = planned.columns, self._keys
        right, up = steps_to(columns["ring_azimuth"], columns["ring_altitude"], planned.camera.altitude)
        sideways = keys.turn_right if right > 0 else keys.turn_left
        return [sideways] * abs(right) + [keys.turn_up if up > 0 else keys.turn_down] * abs(up)
