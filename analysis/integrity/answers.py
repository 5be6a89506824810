"""The trials of any task as the gate sees them: who answered what to which item, in which version, when.

Everything is read from the columns of a trial's record, so that a registered task with the columns of one
that comes along is checked without a word of its own. A column that is missing or null is unknown: nothing is
checked that rests on it.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import spaced
from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.viewing import Version

SHORTEST_TIME = 0.1  # [s] nobody finds anything faster; 0 s has no logarithm
RAMP = attrgetter("screen", "factor", "direction", "duration", "rate")
NEVER = 10**9  # later than any trial
FIRST, SECOND = 1, 2  # intervals, and places in a pair


@dataclass(frozen=True, slots=True)
class Answers:
    """The trials of a task; what is not known of one is NaN.

    Attributes
    ----------
    task : str
        Which.
    people : tuple of str
        The participants.
    sessions : tuple of (str, str)
        Participant and session.
    items : tuple of str
        What was shown, apart from the version.
    participant, session, item : array (n,) of int
        Of each trial: who, when, and what was shown apart from the version.
    ours : array (n,)
        1 for our version, 0 for the baseline; NaN where a trial shows both or none.
    ours_second : array (n,)
        Whether ours was the second of the two versions.
    answer : array (n,)
        Rating; 1 for choosing ours or noticing a ramp, else 0; ln(search time / s).
    given, shown : array (n,) of int
        The answer as it was given, and what it should depend on; -1 where unknown.
    found : array (n,)
        Whether a thing that was searched for was found.
    later : array (n,) of bool
        Whether it is of the later half of its session.
    timed : array (n,) of bool
        Whether the rows of its session are known to be in the order of time: not those of imported tables.
    """

    task: str
    people: tuple[str, ...]
    sessions: tuple[tuple[str, str], ...]
    items: tuple[str, ...]
    participant: Integers
    session: Integers
    item: Integers
    ours: Array
    ours_second: Array
    answer: Array
    given: Integers
    shown: Integers
    found: Array
    later: Mask
    timed: Mask


def answers_of(data: TaskData[Any]) -> Answers:
    """Return the trials of a task as arrays, in the order of sessions and trials."""
    trials = in_order(data)
    sessions = [key_of(trial) for trial in trials]
    people, participant = numbered(trial.participant_id for trial in trials)
    names, session = numbered(sessions)
    in_time = {key_of(own.manifest) for own in data.sessions if own.manifest.order_known}
    timed = np.array([key in in_time for key in sessions], dtype=bool)
    items = [item_of(trial) for trial in trials]
    kinds, item = numbered(items)
    ours = _floats(_is_ours(trial) for trial in trials)
    second = _floats(_ours_second(trial) for trial in trials)
    if any(hasattr(trial, "search_time") for trial in trials):
        when = [t.trial_index if own else t.block for t, own in zip(trials, timed.tolist(), strict=True)]
        second = _second_visits(list(zip(sessions, items, strict=True)), ours, when)
    return Answers(
        task=data.task,
        people=tuple(people),
        sessions=tuple(names),
        items=tuple(" ".join(spaced(str(part)) for part in kind if part) for kind in kinds),
        participant=participant,
        session=session,
        item=item,
        ours=ours,
        ours_second=second,
        answer=_floats(_number(trial) for trial in trials),
        given=_known(given_of(trial) for trial in trials),
        shown=_known(_shown(trial) for trial in trials),
        found=_floats(getattr(trial, "found", None) for trial in trials),
        later=_later(session),
        timed=timed,
    )


def in_order(data: TaskData[Any]) -> list[Any]:
    """Return the trials that count, in the order in which they were answered."""
    sessions = (sorted(session.trials, key=lambda trial: trial.trial_index) for session in data.sessions)
    return [*(trial for own in sessions for trial in own), *data.rows]


def key_of(record: Any) -> tuple[str, str]:
    """Return the participant and the session of a trial, or of a manifest."""
    return record.participant_id, record.session_id


def item_of(trial: Any) -> tuple[Hashable, ...]:
    """Return what a trial showed, apart from the version."""
    if hasattr(trial, "rate"):
        return RAMP(trial)
    return getattr(trial, "sequence", ""), getattr(trial, "keypoint", "")


def numbered(keys: Iterable[Any]) -> tuple[list[Any], Integers]:
    """Return the different keys in the order in which they come, and the number of each key among them.

    >>> numbered("abca")[1].tolist()
    [0, 1, 2, 0]
    """
    numbers: dict[Any, int] = {}
    found = [numbers.setdefault(key, len(numbers)) for key in keys]
    return list(numbers), np.array(found, dtype=np.int64)


def _is_ours(trial: Any) -> bool | None:
    """Return whether a trial shows our version; None if it shows both, or none."""
    version = getattr(trial, "version", None)
    return None if version is None else version is Version.OURS


def _ours_second(trial: Any) -> bool | None:
    """Return whether ours was the second of the two versions that are judged together."""
    if (interval := getattr(trial, "ours_interval", None)) is not None:
        return bool(interval == SECOND)
    place, ours = getattr(trial, "place_in_pair", None), _is_ours(trial)
    return None if place is None or ours is None else (place == SECOND) is ours


def _number(trial: Any) -> float | None:
    """Return the answer as a number."""
    for name in ("rating", "success", "chose_ours"):
        if (value := getattr(trial, name, None)) is not None:
            return float(value)
    if (seconds := getattr(trial, "search_time", None)) is not None:
        return math.log(max(seconds, SHORTEST_TIME))
    interval, response = getattr(trial, "ours_interval", None), getattr(trial, "response", None)
    if interval is None or response not in (Response.FIRST, Response.SECOND):
        return None
    return float((response is Response.FIRST) == (interval == FIRST))


def given_of(trial: Any) -> Hashable:
    """Return the answer as it was given; None where it is the version, the intervals being unknown."""
    if getattr(trial, "ours_interval", FIRST) is None:
        return None
    names = ("rating", "response", "reported_orientation")
    return next((value for name in names if (value := getattr(trial, name, None)) is not None), None)


def _shown(trial: Any) -> Hashable:
    """Return what the answer should depend on."""
    names = ("ours_interval", "ramp_interval", "ring_orientation")
    known = next((value for name in names if (value := getattr(trial, name, None)) is not None), None)
    return (item_of(trial), getattr(trial, "version", None)) if known is None else known


def _second_visits(places: Sequence[Hashable], ours: Array, when: Sequence[int]) -> Array:
    """Return whether ours came second among the visits of a person to a place; NaN where that is unknown."""
    first: dict[Hashable, list[int]] = {}
    for place, version, time in zip(places, ours.tolist(), when, strict=True):
        times = first.setdefault(place, [NEVER, NEVER])
        times[int(version)] = min(times[int(version)], time)
    known = (first[place] for place in places)
    return _floats(None if NEVER in own or own[0] == own[1] else own[1] > own[0] for own in known)


def _later(session: Integers) -> Mask:
    """Return which trials are of the later half of their session; the middle one of an odd number is not."""
    sizes = np.bincount(session)
    order = np.argsort(session, kind="stable")
    place = np.empty_like(session)
    place[order] = np.arange(session.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return 2 * place + 1 > sizes[session]


def _floats(values: Iterable[float | None]) -> Array:
    """Return numbers, NaN for what is None."""
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)


def _known(values: Iterable[Hashable]) -> Integers:
    """Return the number of each value among the different ones, -1 for what is None."""
    listed = list(values)
    missing = np.array([value is None for value in listed], dtype=bool)
    return np.where(missing, -1, numbered(listed)[1]) if listed else np.zeros(0, dtype=np.int64)
