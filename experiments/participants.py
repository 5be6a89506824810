"""Who sits at the keys of a session: a person, or a simulated observer that presses them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from data_schema.ramp import Response
from data_schema.rig import Keys
from experiments.design import PlannedRamp
from experiments.keyed_chance import Purpose, generator_for
from experiments.simulated_observers import SimulatedObserver, answer_generator

READING_TIME = 0.5  # [s] a simulated participant looks at a page
ANSWERING_TIME = (0.4, 0.9)  # [s] shortest, and mean of what comes on top (choice: practised people)

PressKey = Callable[[str, float], None]


class Person:
    """A person: presses keys by themselves."""

    def see_page(self, keys: Sequence[str]) -> None:
        """Be shown a page."""

    def see_trial(self, planned: object, trial_index: int) -> None:
        """Have been shown a trial."""


class SimulatedParticipant:
    """A simulated observer at the keys.

    The answer to each trial is drawn with a generator of its own, so that a session that was interrupted goes
    on exactly as it would have.

    Parameters
    ----------
    observer : SimulatedObserver
        How well the participant sees.
    press : callable
        Presses a key, by name, after a time [s].
    keys : Keys
        Which key means what.
    session : (int, int)
        Seed of the session and place of the participant, of which answers and response times are functions.
    """

    def __init__(
        self, observer: SimulatedObserver, press: PressKey, keys: Keys, session: tuple[int, int]
    ) -> None:
        self._observer, self._press, self._session = observer, press, session
        self._key_of = {
            Response.YES: keys.yes,
            Response.NO: keys.no,
            Response.FIRST: keys.first,
            Response.SECOND: keys.second,
        }

    def see_page(self, keys: Sequence[str]) -> None:
        """Read a page and press the usual key."""
        self._press(keys[0], READING_TIME)

    def see_trial(self, planned: PlannedRamp, trial_index: int) -> None:
        """Press the key of the answer, a while after the question will be there."""
        response = self._observer.answer(planned, answer_generator(*self._session, trial_index))
        shortest, mean = ANSWERING_TIME
        rng = generator_for(*self._session, Purpose.ANSWERING_TIMES, trial_index)
        self._press(self._key_of[response], shortest + float(rng.exponential(mean)))
