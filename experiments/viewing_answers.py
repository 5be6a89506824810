"""The answers of a simulated observer in a session of a viewing experiment, as keys and times."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, cast

import numpy as np

from evenlight.data_schema.ramp import Response
from evenlight.data_schema.rig import Keys
from evenlight.data_schema.search import ORIENTATIONS, SearchDesign
from evenlight.data_schema.viewing import LOWEST_RATING
from evenlight.experiments.experiment_kinds import Setting
from evenlight.experiments.search_observer import SearchAnswer
from evenlight.experiments.search_schedule import VERSIONS, planned_search, search_points
from evenlight.experiments.simulated_viewers import (
    SearchViewing,
    SimulatedViewer,
    Viewing,
    ViewingDesign,
    open_viewing,
)


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
    setting: Setting, rng: np.random.Generator
) -> Callable[[tuple[int, int]], ViewingAnswers]:
    """Return what makes the answers of a session, for its seed and place in the data set.

    Everything that is to be drawn for the observer's sake is drawn here, before a window opens.

    Parameters
    ----------
    setting : Setting
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


def _seen(design: ViewingDesign, setting: Setting) -> Viewing:
    """Return what a session's observer sees, all of it seen."""
    with open_viewing(design, setting.stimuli, setting.display, setting.rig.actuator) as viewing:
        if isinstance(viewing, SearchViewing):
            _look_at_all(viewing, setting)
        return viewing


def _look_at_all(viewing: SearchViewing, setting: Setting) -> None:
    """See all rings that a session may show, wherever in the data set its participant stands."""
    design = cast(SearchDesign, setting.manifest.design)
    viewing.views.prepare(
        planned_search(design, point, version, place, ORIENTATIONS[0], block)
        for point in search_points(design, setting.stimuli, setting.display, setting.rig.actuator)
        for version in VERSIONS
        for block in (0, 1)  # of practice, and of the session
        for place in (1, 2)
    )
