"""The gate: what is checked of every task before any inference, viewing tasks and ramps alike."""

from __future__ import annotations

from typing import Any, TypeVar

from evenlight.analysis.integrity.answers import answers_of, in_order
from evenlight.analysis.integrity.concern import Concern, ConcernKind, noun_of, ordered
from evenlight.analysis.integrity.participants import (
    nothing_found,
    one_answer,
    swapped_ramps,
    swapped_versions,
)
from evenlight.analysis.integrity.repeated_rows import without_repeats
from evenlight.analysis.integrity.session_halves import half_concerns
from evenlight.analysis.integrity.version_order import order_concerns
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few

Data = TypeVar("Data", bound=TaskData[Any])


def checked(data: Data) -> tuple[Data, tuple[Concern, ...]]:
    """Return the data to be analysed, and what is wrong with them.

    Only repeated rows are left out; nothing else is excluded or changed.

    Parameters
    ----------
    data : TaskData
        All trials of a task, which may be a registered one: what its records do not say is not checked.

    Returns
    -------
    TaskData, tuple of Concern
        What threatens the conclusion comes first.
    """
    data, repeats = without_repeats(data)
    answers = answers_of(data)
    return data, ordered(
        (
            *order_concerns(answers),
            *repeats,
            *_more_trials(data),
            *half_concerns(answers),
            *nothing_found(answers),
            *one_answer(answers),
            *(swapped_ramps(in_order(data)) if data.task == "ramp" else swapped_versions(answers)),
        )
    )


def _more_trials(data: TaskData[Any]) -> tuple[Concern, ...]:
    """Return which sessions hold more trials than their design has."""
    sessions = []
    for own in data.sessions:
        held, designed = len(own.trials), own.manifest.n_trials
        if held > designed:
            name = f"{own.manifest.participant_id}/{own.manifest.session_id}"
            sessions.append(f"{name} ({held} instead of {designed})")
    if not sessions:
        return ()
    words = f"sessions hold more {noun_of(data.task)} than their design has: {first_few(sessions, 3)}"
    return (Concern(ConcernKind.MORE_TRIALS, words),)
