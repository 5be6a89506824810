"""The experiments by name: what each is made of. A new one gets an entry, and nothing else changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.rig import Rig
from evenlight.data_schema.session import SessionManifest
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.task import Task


@dataclass(frozen=True, slots=True)
class Setting:
    """What a session is made from, beside its manifest.

    Attributes
    ----------
    manifest : SessionManifest
        Design, display, seed, place in the data set.
    rig : Rig
        What it runs on now.
    stimuli : sequence of LoadedStimulus
        Of a viewing experiment.
    smallest_factor : float
        The lowest that the backlight can be asked for.
    """

    manifest: SessionManifest
    rig: Rig
    stimuli: Sequence[LoadedStimulus] = ()
    smallest_factor: float = 0.0

    @property
    def session(self) -> tuple[int, int]:
        """Seed, and place in the data set."""
        return self.manifest.provenance.seed or 0, self.manifest.order_index

    @property
    def display(self) -> Display:
        """The display."""
        return self.manifest.display


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment.

    Attributes
    ----------
    task : callable
        Makes its task in a setting.
    sequences : callable
        Names the sequences of its design; none where no video or scene is shown.
    shows_videos : bool
        Whether the videos of its sequences are shown.
    """

    task: Callable[[Setting], Task]
    sequences: Callable[[Any], tuple[str, ...]]
    shows_videos: bool


def experiment(name: str) -> Experiment:
    """Return an experiment by its name, a key of `data_schema.session.DESIGN_OF_TASK`."""
    return _EXPERIMENTS[name]


def _ramp(setting: Setting) -> Task:
    from evenlight.experiments.ramp_task import RampTask

    return RampTask(
        setting.manifest.design,  # type: ignore[arg-type] # the manifest checks that it is the task's
        setting.display,
        *setting.session,
        setting.rig,
        smallest_factor=setting.smallest_factor,
    )


def _rating(setting: Setting) -> Task:
    from evenlight.experiments.rating_task import RatingTask

    design: Any = setting.manifest.design
    return RatingTask(design, setting.stimuli, setting.session, setting.rig)


def _comparison(setting: Setting) -> Task:
    from evenlight.experiments.comparison_task import ComparisonTask

    design: Any = setting.manifest.design
    return ComparisonTask(design, setting.stimuli, setting.session, setting.rig)


def _search(setting: Setting) -> Task:
    from evenlight.experiments.search_task import SearchTask

    design: Any = setting.manifest.design
    return SearchTask(design, setting.stimuli, setting.session, setting.rig, setting.display)


_EXPERIMENTS = {
    "ramp": Experiment(_ramp, lambda design: (), shows_videos=False),
    "rating": Experiment(_rating, lambda design: tuple(design.sequences), shows_videos=True),
    "comparison": Experiment(_comparison, lambda design: tuple(design.sequences), shows_videos=True),
    "search": Experiment(_search, lambda design: tuple(design.sequences), shows_videos=False),
}
