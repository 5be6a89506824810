"""Answers of the artifact comparison, counted: how often each participant chose what."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.ramp import Response
from evenlight.data_schema.viewing import ComparisonDesign, ComparisonTrial

OURS_FIRST = 1  # interval


@dataclass(frozen=True, slots=True)
class Choices:
    """How often each participant chose one of two things.

    Attributes
    ----------
    participants : tuple of str
        Who, in order; only those with an answer.
    chosen, answers : array of int, (participants,)
        How often it was chosen, of how many answers.
    """

    participants: tuple[str, ...]
    chosen: NDArray[np.int64]
    answers: NDArray[np.int64]

    @property
    def scores(self) -> NDArray[np.int64]:
        """How much more often it was chosen than the other, (participants,): 0 on the average by guessing."""
        return np.asarray(2 * self.chosen - self.answers)

    @property
    def total(self) -> int:
        """All answers."""
        return int(self.answers.sum())

    @property
    def share(self) -> float:
        """Share of all answers."""
        return float(self.chosen.sum() / self.answers.sum())

    @property
    def one_each(self) -> bool:
        """Whether nobody answered twice, so that the answers are independent."""
        return bool((self.answers == 1).all())


def count_choices(
    trials: Iterable[ComparisonTrial], chosen: Callable[[ComparisonTrial], bool] | None = None
) -> Choices:
    """Return how often each participant chose something.

    Parameters
    ----------
    trials : iterable of ComparisonTrial
        Whose answers count.
    chosen : callable, optional
        Whether a trial's answer is what is counted; the modulated version, if none is given.
    """
    is_chosen = chosen or (lambda trial: trial.chose_ours)
    counts: dict[str, list[int]] = {}
    for trial in trials:
        own = counts.setdefault(trial.participant_id, [0, 0])
        own[0] += is_chosen(trial)
        own[1] += 1
    who = tuple(sorted(counts))
    table = np.array([counts[name] for name in who], dtype=np.int64).reshape(-1, 2)
    return Choices(who, table[:, 0], table[:, 1])


def chose_first(trial: ComparisonTrial) -> bool:
    """Return whether the first of the two videos was chosen, whichever it was."""
    return trial.response is Response.FIRST


def sequences_in(data: TaskData[ComparisonTrial]) -> tuple[str, ...]:
    """Return the sequences that were designed or answered, in the order of the design."""
    designed = (
        name
        for session in data.sessions
        if isinstance(session.manifest.design, ComparisonDesign)
        for name in session.manifest.design.sequences
    )
    return tuple(dict.fromkeys((*designed, *(trial.sequence for trial in data.trials))))
