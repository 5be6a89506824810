"""Simulated participants of the viewing experiments, drawn and asked in one way.

An answer is a function of seed, participant and trial alone, so that participant k is the same
however many there are, and a session that was interrupted goes on as it would have.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import Any, cast

import numpy as np

from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.recordings.assumed_effect import AssumedEffect
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.data_schema.recordings.viewing import LOWEST_RATING
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.viewing.search_observer import SearchAnswer

POPULATION_SAMPLE = 200  # people over whom an assumed effect is averaged


class Viewing(AbstractContextManager["Viewing"]):
    """What simulated participants of one experiment see, and of whom they are drawn.

    Attributes
    ----------
    purposes : (Purpose, Purpose)
        What the random numbers of a person, and of an answer, are for.
    population : record or None
        How participants differ.
    """

    purposes: tuple[Purpose, Purpose] = (Purpose.VIEWER, Purpose.VIEWERS_ANSWERS)
    population: Any = None

    def __exit__(self, *_: object) -> None:
        """Close what was opened to see."""

    def prepare(self, setting: SessionSetting) -> None:
        """See all that a session may show, before its window opens."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Return a participant."""
        raise NotImplementedError  # the task's own; others here have a default

    def person_of(self, session: tuple[int, int]) -> Any:
        """Return the participant of a seed and a place in the data set, always the same one."""
        return self.draw(generator_for(*session, self.purposes[0]))

    def answer(self, person: Any, planned: Any, rng: np.random.Generator) -> Any:
        """Return what a participant answers to a trial."""
        raise NotImplementedError  # the task's own

    def columns(self, planned: Any) -> dict[str, Any]:
        """Return columns of a trial's row that only who sees it can tell."""
        return {}

    def truth(self, person: Any) -> dict[str, Any]:
        """Return what is true of a participant, for the file beside the data."""
        return mapping_from_record(person)

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return what is true of the stimuli for all participants."""
        return []

    def assumed(self, setting: SessionSetting) -> tuple[AssumedEffect, ...]:
        """Return the effects that the population truly has, which an analysis of its answers estimates."""
        return ()

    def truth_file(self, setting: SessionSetting, participants: list[dict[str, Any]]) -> dict[str, Any]:
        """Return what is true of a data set, one of its sessions being made in some setting."""
        return {
            "simulated": True,
            "task": setting.manifest.task,
            "seed": setting.session[0],
            "population": mapping_from_record(self.population) if self.population else {},
            "stimuli": self.shared_truth(),
            "participants": participants,
            "assumed": [mapping_from_record(effect) for effect in self.assumed(setting)],
        }

    def population_sample(self) -> list[Any]:
        """Return people of the population, always the same ones."""
        people = range(POPULATION_SAMPLE)
        return [self.draw(generator_for(0, place, self.purposes[0])) for place in people]


OpenViewing = Callable[[SessionSetting], AbstractContextManager[Viewing]]


class SimulatedViewer:
    """One simulated participant of a viewing experiment.

    Parameters
    ----------
    viewing : Viewing
        What is seen.
    session : (int, int)
        Seed, and the participant's place in the data set.
    person : record, optional
        Who it is; else drawn from the population, by seed and place.
    """

    def __init__(self, viewing: Any, session: tuple[int, int], person: Any = None) -> None:
        self.viewing, self._session = viewing, session
        self.person = person or viewing.person_of(session)

    def answer(self, planned: Any, trial_index: int) -> Any:
        """Return the answer to a trial, always the same one."""
        chance = generator_for(*self._session, self.viewing.purposes[1], trial_index)
        return self.viewing.answer(self.person, planned, chance)

    def truth(self) -> dict[str, Any]:
        """Return what is true of the participant."""
        true: dict[str, Any] = self.viewing.truth(self.person)
        return true


class ViewingAnswers:
    """Answers to videos and scenes.

    Parameters
    ----------
    viewer : SimulatedViewer
        Who answers.
    keys : Keys
        Which key means what.
    """

    def __init__(self, viewer: SimulatedViewer, keys: Keys) -> None:
        self._viewer, self._keys = viewer, keys

    def key(self, planned: Any, trial_index: int) -> str:
        """Return the key that is pressed when a trial is asked about."""
        answer: Response | SearchAnswer | int | str = self._viewer.answer(planned, trial_index)
        if isinstance(answer, str):
            return answer  # a key, of a task with keys of its own
        if isinstance(answer, Response):
            pressed: str = getattr(self._keys, answer.value)  # yes, no, first, second
            return pressed
        if isinstance(answer, SearchAnswer):
            # Asked in a session only after the ring was found, and then there is an orientation.
            return self._keys.orientations[ORIENTATIONS.index(answer.orientation or ORIENTATIONS[0])]
        return self._keys.ratings[answer - LOWEST_RATING]

    def search_time(self, planned: Any, trial_index: int) -> float | None:
        """Return when a ring is found, since the scene appeared [s]; None if it is not."""
        return cast(SearchAnswer, self._viewer.answer(planned, trial_index)).found_after


def viewing_answers(
    open_viewing: OpenViewing, setting: SessionSetting, rng: np.random.Generator
) -> Callable[[tuple[int, int]], ViewingAnswers]:
    """Return what makes the answers of a session, for its seed and place in the data set.

    Everything that is to be drawn for the observer's sake is drawn here, before a window opens.

    Parameters
    ----------
    open_viewing : callable
        Opens what is seen.
    setting : SessionSetting
        Design, stimuli, display and keys.
    rng : numpy.random.Generator
        Draws the observer.

    Raises
    ------
    InputError
        If the stimuli lack something; for a search, if the machine has no OpenGL.
    """
    # In a thread of its own: a graphics context without a window would stay the current one of this thread,
    # and then no window could be opened.
    with ThreadPoolExecutor(max_workers=1) as thread:
        viewing = thread.submit(_prepare_viewing, open_viewing, setting).result()
    person = viewing.draw(rng)
    return lambda session: ViewingAnswers(SimulatedViewer(viewing, session, person), setting.rig.keys)


def _prepare_viewing(open_viewing: OpenViewing, setting: SessionSetting) -> Viewing:
    """Return what a session's observer sees, all of it seen."""
    with open_viewing(setting) as viewing:
        viewing.prepare(setting)
        return viewing
