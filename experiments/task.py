"""What a session needs of an experiment, so that all experiments share one session mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from evenlight.experiments.pages import Pages
from evenlight.experiments.stage import Stage


@dataclass(frozen=True, slots=True)
class TrialPlace:
    """Where in a data set an answered trial goes.

    Attributes
    ----------
    participant_id, session_id : str
        Whose.
    trial_index : int
        Place among the session's answered trials, from 0.
    attempt : int
        1, or more where the trial was shown before and interrupted.
    simulated : bool
        Whether a simulated observer answers.
    """

    participant_id: str
    session_id: str
    trial_index: int
    attempt: int
    simulated: bool


@dataclass(frozen=True, slots=True)
class Conducted:
    """A trial that was shown and answered.

    Attributes
    ----------
    trial : record
        Its row.
    frames : tuple of records
        What the display showed, one for each interval; empty without a display.
    """

    trial: Any
    frames: tuple[Any, ...]


class Participant(Protocol):
    """Who sits at the keys: a person, of whom the program knows nothing, or a simulated observer."""

    def see_page(self, keys: Sequence[str]) -> None:
        """Be shown a page that waits for one of some keys, the usual one first."""

    def see_trial(self, planned: Any, trial_index: int) -> None:
        """Have been shown a trial, right before the question."""

    def begin_search(self, planned: Any, trial_index: int) -> None:
        """Be about to search a scene."""


class Task(Protocol):
    """An experiment: its trials in order, how one is conducted, and what is said about it."""

    @property
    def n_trials(self) -> int:
        """Usable trials that the design asks for."""

    @property
    def trials_between_breaks(self) -> int:
        """0 for no breaks."""

    @property
    def neutral_luminance(self) -> float:
        """Of pages, and of uniform fields that are no stimulus [cd/m^2]."""

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""

    @property
    def seconds(self) -> float:
        """How long a trial may take at most; 0 where it has no limit [s]."""

    @property
    def instructions(self) -> str:
        """Name of the page with the instructions."""

    def prepare(self, stage: Stage) -> None:
        """Make ready what takes long, and refuse what the stage cannot show; before the session begins.

        Raises
        ------
        InputError
            If something cannot be shown.
        """

    def practice(self) -> Sequence[Any]:
        """Return the trials for practice."""

    def next_trial(self) -> Any | None:
        """Return the trial to be shown next, or None at the end; the same until `take` is called."""

    def take(self, trial: Any) -> None:
        """Take an answered trial, just given or read from an interrupted session."""

    def conduct(
        self, planned: Any, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> Conducted:
        """Show a trial and take the answer. Raises `PausePressed` if the pause key was pressed."""

    def feedback(self, trial: Any, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice; empty for nothing."""

    def is_right(self, trial: Any) -> bool | None:
        """Return whether a trial was answered rightly, None where no answer is right or wrong."""

    def is_flagged(self, trial: Any) -> bool:
        """Return whether a trial is left out of the analysis."""
