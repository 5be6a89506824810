"""What simulated observers answer in a session, by the experiment they take part in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.ramp import Response
from evenlight.data_schema.rig import Keys
from evenlight.experiments.design import PlannedRamp, ramp_levels
from evenlight.experiments.experiment_kinds import Setting
from evenlight.experiments.keyed_chance import Purpose, generator_for
from evenlight.experiments.participants import Answers
from evenlight.experiments.simulated_observers import SimulatedObserver, answer_generator, draw_observer
from evenlight.method.preset_files import load_rate_limit

POPULATION = "surace2025"  # whose rate limit is the yes/no threshold of the median simulated observer

AnswersOf = Callable[[tuple[int, int]], Answers]


def simulated_answers(setting: Setting) -> AnswersOf:
    """Return what makes the answers of a session's simulated observer.

    The observer is that of the participant's id: simulated participant 01 is the same in every session and
    rehearsal. The answers need the session's seed and place in the data set, which come later.

    Raises
    ------
    InputError
        If something that the observer sees cannot be had.
    """
    who = int(sha256_of_bytes(setting.manifest.participant_id.encode())[:12], 16)
    return _ANSWERS[setting.manifest.task](setting, generator_for(who, 0, Purpose.PERSON))


class RampAnswers:
    """Answers to ramps."""

    def __init__(self, observer: SimulatedObserver, keys: Keys, session: tuple[int, int]) -> None:
        self._observer, self._session = observer, session
        self._key_of = {
            Response.YES: keys.yes,
            Response.NO: keys.no,
            Response.FIRST: keys.first,
            Response.SECOND: keys.second,
        }

    def key(self, planned: PlannedRamp, trial_index: int) -> str:
        """Return the key that is pressed when a trial is asked about."""
        response = self._observer.answer(planned, answer_generator(*self._session, trial_index))
        return self._key_of[response]

    def search_time(self, planned: Any, trial_index: int) -> None:
        """Return None: nothing is searched for."""


def _ramp(setting: Setting, rng: np.random.Generator) -> AnswersOf:
    """Return what answers ramps: an observer drawn from the population."""
    design: Any = setting.manifest.design
    luminances = tuple(level.luminance for level in ramp_levels(design, setting.display))
    observer = draw_observer(load_rate_limit(POPULATION), luminances, rng)
    return lambda session: RampAnswers(observer, setting.rig.keys, session)


def _viewing(setting: Setting, rng: np.random.Generator) -> AnswersOf:
    """Return what answers a viewing experiment."""
    from evenlight.experiments.viewing_answers import viewing_answers

    return viewing_answers(setting, rng)


_ANSWERS: dict[str, Callable[[Setting, np.random.Generator], AnswersOf]] = {
    "ramp": _ramp,
    "rating": _viewing,
    "comparison": _viewing,
    "search": _viewing,
}
