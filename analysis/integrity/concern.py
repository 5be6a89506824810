"""What is wrong with the trials of a task, and how a report says it first."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass

LEVEL = 0.001  # of every check over a whole data set: eight of them raise less than 1 % of false alarms
MOST_SAID = 3  # in the first sentence; the warnings name all


class ConcernKind(enum.Enum):
    """What may be wrong."""

    VERSION_ORDER = "version confounded with order"
    REPEATED_ROWS = "repeated rows"
    MORE_TRIALS = "more trials than the design has"
    UNREAD = "sessions that are not read"
    HALVES = "halves of a session that differ"
    NOTHING_FOUND = "nothing found"
    ONE_ANSWER = "always one answer"
    SWAPPED = "swapped answers"


@dataclass(frozen=True, slots=True)
class Concern:
    """Something that is wrong with the trials.

    Attributes
    ----------
    kind : ConcernKind
        What.
    words : str
        The same with its figures, as a clause that follows a colon or a semicolon.
    threatens : bool
        Whether it threatens the conclusion, and not only its precision.
    """

    kind: ConcernKind
    words: str
    threatens: bool = False


def noun_of(task: str) -> str:
    """Return what the trials of a task are called.

    >>> noun_of("rating"), noun_of("search")
    ('ratings', 'searches')
    """
    return "searches" if task == "search" else f"{task.replace('_', ' ')}s"


def ordered(concerns: Iterable[Concern]) -> tuple[Concern, ...]:
    """Return concerns, those that threaten the conclusion first."""
    return tuple(sorted(concerns, key=lambda concern: not concern.threatens))


def cautious(concerns: Iterable[Concern], lead: str) -> str:
    """Return what came out after a first sentence that says what is wrong, if anything is.

    >>> cautious([Concern(ConcernKind.HALVES, "the halves differ")], "Ours is better.")
    'Caution: the halves differ. Ours is better.'
    """
    words = [concern.words for concern in ordered(concerns)]
    if not words:
        return lead
    more = len(words) - MOST_SAID
    rest = [f"and {more} more warning{'s' * (more > 1)}"] if more > 0 else []
    return f"Caution: {'; '.join(words[:MOST_SAID] + rest)}. {lead}"
