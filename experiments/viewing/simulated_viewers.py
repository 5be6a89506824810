"""Simulated participants of the three viewing experiments, drawn and asked in one way.

An answer is a function of seed, participant and trial alone, so that participant k is the same
however many there are, and a session that was interrupted goes on as it would have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Protocol, cast

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.rig import Actuator, Keys
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchDesign
from evenlight.data_schema.recordings.viewing import LOWEST_RATING, ComparisonDesign, RatingDesign
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_observer import MEDIAN_RATE_LIMIT
from evenlight.experiments.sessions.search_stage import OffscreenPainter, picture_side
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing.comparison_observer import (
    ChangeViews,
    ComparisonViewing,
)
from evenlight.experiments.viewing.rating_observer import (
    DetailViews,
    RatingViewing,
)
from evenlight.experiments.viewing.ring_views import RingViews, SearchViewing
from evenlight.experiments.viewing.search_observer import (
    SearchAnswer,
)
from evenlight.experiments.viewing.search_schedule import (
    VERSIONS,
    planned_search,
    search_points,
)
from evenlight.method.preset_files import load_rate_limit
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.place_files import PRACTICE_SIZE

ViewingDesign = RatingDesign | ComparisonDesign | SearchDesign


class Viewing(Protocol):
    """What simulated participants of one experiment see, and of whom they are drawn."""

    @property
    def purposes(self) -> tuple[Purpose, Purpose]:
        """What the random numbers of a person, and of an answer, are for."""

    @property
    def population(self) -> Any:
        """How participants differ."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Return a participant."""

    def answer(self, person: Any, planned: Any, rng: np.random.Generator) -> Any:
        """Return what a participant answers to a trial."""

    def truth(self, person: Any) -> dict[str, Any]:
        """Return what is true of a participant, for the file beside the data."""

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return what is true of the stimuli for all participants."""


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
        self.person = person or viewing.draw(generator_for(*session, viewing.purposes[0]))

    def answer(self, planned: Any, trial_index: int) -> Any:
        """Return the answer to a trial, always the same one."""
        chance = generator_for(*self._session, self.viewing.purposes[1], trial_index)
        return self.viewing.answer(self.person, planned, chance)

    def truth(self) -> dict[str, Any]:
        """Return what is true of the participant."""
        true: dict[str, Any] = self.viewing.truth(self.person)
        return true


@contextmanager
def open_viewing(
    design: ViewingDesign,
    stimuli: Sequence[LoadedStimulus],
    display: Display,
    actuator: Actuator = Actuator.PIXELS,
) -> Iterator[Viewing]:
    """Yield what simulated participants of an experiment see; the kind of the design says which one.

    The actuator matters to a search only: where pixels make the brightness, nothing is darker than black.

    Raises
    ------
    InputError
        If the stimuli lack something; for a search, if the machine has no OpenGL.
    """
    if isinstance(design, RatingDesign):
        yield RatingViewing(DetailViews(stimuli))
    elif isinstance(design, ComparisonDesign):
        yield ComparisonViewing(ChangeViews(stimuli, display), load_rate_limit(MEDIAN_RATE_LIMIT))
    else:
        largest = Ring(0.0, 0.0, PRACTICE_SIZE * design.ring_gap, design.ring_contrast, ORIENTATIONS[0])
        with OffscreenPainter(display, picture_side(largest, display)) as painter:
            yield SearchViewing(RingViews(painter, display, actuator), design.time_limit)


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
        answer: Response | SearchAnswer | int = self._viewer.answer(planned, trial_index)
        if isinstance(answer, Response):
            return self._keys.first if answer is Response.FIRST else self._keys.second
        if isinstance(answer, SearchAnswer):
            # Asked in a session only after the ring was found, and then there is an orientation.
            return self._keys.orientations[ORIENTATIONS.index(answer.orientation or ORIENTATIONS[0])]
        return self._keys.ratings[answer - LOWEST_RATING]

    def search_time(self, planned: Any, trial_index: int) -> float | None:
        """Return when a ring is found, since the scene appeared [s]; None if it is not."""
        return cast(SearchAnswer, self._viewer.answer(planned, trial_index)).found_after


def viewing_answers(
    setting: SessionSetting, rng: np.random.Generator
) -> Callable[[tuple[int, int]], ViewingAnswers]:
    """Return what makes the answers of a session, for its seed and place in the data set.

    Everything that is to be drawn for the observer's sake is drawn here, before a window opens.

    Parameters
    ----------
    setting : SessionSetting
        Design, stimuli, display and keys.
    rng : numpy.random.Generator
        Draws the observer.

    Raises
    ------
    InputError
        If the stimuli lack something; for a search, if the machine has no OpenGL.
    """
    design = cast(ViewingDesign, setting.manifest.design)
    # In a thread of its own: a graphics context without a window would stay the current one of this thread,
    # and then no window could be opened.
    with ThreadPoolExecutor(max_workers=1) as thread:
        viewing = thread.submit(_seen, design, setting).result()
    person = viewing.draw(rng)
    return lambda session: ViewingAnswers(SimulatedViewer(viewing, session, person), setting.rig.keys)


def _seen(design: ViewingDesign, setting: SessionSetting) -> Viewing:
    """Return what a session's observer sees, all of it seen."""
    with open_viewing(design, setting.stimuli, setting.display, setting.rig.actuator) as viewing:
        if isinstance(viewing, SearchViewing):
            _look_at_all(viewing, setting)
        return viewing


def _look_at_all(viewing: SearchViewing, setting: SessionSetting) -> None:
    """See all rings that a session may show, wherever in the data set its participant stands."""
    design = cast(SearchDesign, setting.manifest.design)
    viewing.views.prepare(
        planned_search(design, point, version, place, ORIENTATIONS[0], block)
        for point in search_points(design, setting.stimuli, setting.display, setting.rig.actuator)
        for version in VERSIONS
        for block in (0, 1)  # of practice, and of the session
        for place in (1, 2)
    )
