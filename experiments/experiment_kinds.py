"""The experiments by name: what each is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_task import RampTask
from evenlight.experiments.ramp.ramp_viewing import ramp_viewing
from evenlight.experiments.sessions.task import AnswersOf, SessionSetting, Task
from evenlight.experiments.viewing.comparison_observer import comparison_viewing
from evenlight.experiments.viewing.comparison_task import ComparisonTask
from evenlight.experiments.viewing.rating_observer import rating_viewing
from evenlight.experiments.viewing.rating_task import RatingTask
from evenlight.experiments.viewing.ring_views import search_viewing
from evenlight.experiments.viewing.search_task import SearchTask
from evenlight.experiments.viewing.simulated_viewers import OpenViewing, viewing_answers


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment."""

    title: str  # what it is, in the name of a simulated data set
    task: Callable[[SessionSetting], Task]  # makes its task in a setting
    # opens what its simulated observers see in a setting; None for tasks without one
    viewing: OpenViewing | None
    shows_videos: bool = True  # whether the videos of its sequences are shown
    # by language: pages that do not lie in `pages/`, by their names
    pages: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


# By the names of `data_schema.recordings.session.TASKS`.
EXPERIMENTS = {
    "ramp": Experiment("ramp calibration", RampTask, ramp_viewing, shows_videos=False),
    "rating": Experiment("detail rating", RatingTask, rating_viewing),
    "comparison": Experiment("artifact comparison", ComparisonTask, comparison_viewing),
    "search": Experiment("Landolt-ring search", SearchTask, search_viewing, shows_videos=False),
}


def simulated_answers(setting: SessionSetting) -> AnswersOf:
    """Return what makes the answers of a session's simulated observer.

    The observer is that of the participant's id: simulated participant 01 is the same in every session and
    rehearsal. The answers need the session's seed and place in the data set, which come later.

    Raises
    ------
    InputError
        If something that the observer sees cannot be had, or the task has no simulated observer.
    """
    who = int(sha256_of_bytes(setting.manifest.participant_id.encode())[:12], 16)
    chance = generator_for(who, 0, Purpose.PERSON)
    task = setting.manifest.task
    open_viewing = EXPERIMENTS[task].viewing
    if open_viewing is None:
        raise InputError(f"--simulate: the task {task!r} declares no simulated observer")
    return viewing_answers(open_viewing, setting, chance)
