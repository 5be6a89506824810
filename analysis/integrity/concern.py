"""What is wrong with the trials of a task, and how a report says it first."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass

LEVEL = 0.001  # of every check over a whole data set: eight of them raise less than 1 % of false alarms
LONGEST = 60  # words of a lead
CAUTION = "Caution: "
# How many a lead names, and how many of these with their figures: as many as its length allows, the first
# always; of a lead that is long by itself that is more than its length.
WAYS = ((3, 3), (3, 2), (3, 1), (2, 1), (1, 1))


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
    SERIAL = "serial dependence"
    NO_THRESHOLD = "no threshold in the answers"


@dataclass(frozen=True, slots=True)
class Concern:
    """Something that is wrong with the trials."""

    kind: ConcernKind
    words: str  # the same with its figures, as a clause that follows a colon or a semicolon
    threatens: bool = False  # the conclusion, and not only its precision
    short: str = ""  # its words in a lead, where they can be fewer


def noun_of(task: str) -> str:
    """Return what the trials of a task are called, such as "searches"."""
    return "searches" if task == "search" else f"{task.replace('_', ' ')}s"


def ordered(concerns: Iterable[Concern]) -> tuple[Concern, ...]:
    """Return concerns, those that threaten the conclusion first."""
    return tuple(sorted(concerns, key=lambda concern: not concern.threatens))


def cautious(concerns: Iterable[Concern], lead: str) -> str:
    """Return what came out after a first sentence that says what is wrong, if anything is.

    A lead that has such a sentence keeps it, after what is added. The warnings of a report name all concerns
    with their figures; a lead names what it has room for, some by their kind.

    >>> halves = Concern(ConcernKind.HALVES, "the halves differ")
    >>> said = cautious([halves], "Ours is better.")
    >>> said
    'Caution: the halves differ. Ours is better.'
    >>> cautious([Concern(ConcernKind.UNREAD, "1 of 3 sessions is not read")], said)
    'Caution: 1 of 3 sessions is not read; the halves differ. Ours is better.'
    """
    own = ordered(concerns)
    if not own:
        return lead
    told = lead.removeprefix(CAUTION)
    then = ". " if told == lead else "; "
    leads = [f"{CAUTION}{_named(own, *way)}{then}{told}" for way in WAYS]
    return next((words for words in leads if len(words.split()) <= LONGEST), leads[-1])


def _named(concerns: tuple[Concern, ...], most: int, with_figures: int) -> str:
    full = [own.short or own.words for own in concerns[:with_figures]]
    kinds = [own.kind.value for own in concerns[with_figures:most]]
    more = max(len(concerns) - most, 0)
    rest = [f"and {more} more warning{'s' * (more > 1)}"] * (more > 0)
    return "; ".join(dict.fromkeys((*full, *kinds, *rest)))
