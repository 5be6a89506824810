"""The experiments by name: what each is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_observer import ramp_answers
from evenlight.experiments.ramp.ramp_task import ramp_task
from evenlight.experiments.sessions.task import AnswersOf, SessionSetting, Task
from evenlight.experiments.viewing.comparison_task import ComparisonTask
from evenlight.experiments.viewing.rating_task import RatingTask
from evenlight.experiments.viewing.search_task import SearchTask
from evenlight.experiments.viewing.simulated_viewers import viewing_answers


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment.

    Attributes
    ----------
    task : callable
        Makes its task in a setting.
    answers : callable
        Makes the answers of a simulated observer in a setting, drawn by a generator.
    shows_videos : bool
        Whether the videos of its sequences are shown.
    """

    task: Callable[[SessionSetting], Task]
    answers: Callable[[SessionSetting, np.random.Generator], AnswersOf]
    shows_videos: bool = False

    @staticmethod
    def sequences(design: Any) -> tuple[str, ...]:
        """Return the sequences of a design; none where no video or scene is shown."""
        return tuple(getattr(design, "sequences", ()))


_EXPERIMENTS = {
    "ramp": Experiment(ramp_task, ramp_answers),
    "rating": Experiment(RatingTask, viewing_answers, shows_videos=True),
    "comparison": Experiment(ComparisonTask, viewing_answers, shows_videos=True),
    "search": Experiment(SearchTask, viewing_answers),
}


def experiment(name: str) -> Experiment:
    """Return an experiment by its name, a key of `data_schema.session.DESIGN_OF_TASK`."""
    return _EXPERIMENTS[name]


def simulated_answers(setting: SessionSetting) -> AnswersOf:
    """Return what makes the answers of a session's simulated observer.

    The observer is that of the participant's id: simulated participant 01 is the same in every session and
    rehearsal. The answers need the session's seed and place in the data set, which come later.

    Raises
    ------
    InputError
        If something that the observer sees cannot be had.
    """
    who = int(sha256_of_bytes(setting.manifest.participant_id.encode())[:12], 16)
    return experiment(setting.manifest.task).answers(setting, generator_for(who, 0, Purpose.PERSON))
