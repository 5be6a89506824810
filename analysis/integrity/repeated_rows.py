"""Rows that are there twice: the first is kept, later ones are left out, and both are said."""

from __future__ import annotations

import dataclasses
import statistics
from collections import Counter
from collections.abc import Hashable, Sequence
from itertools import compress, islice
from typing import Any, TypeVar

from evenlight.analysis.integrity.answers import given_of, in_order, item_of, key_of
from evenlight.analysis.integrity.concern import Concern, ConcernKind, noun_of
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few
from evenlight.data_schema.recordings.ramp import Placement, RampDesign

ROUNDING = 1e-6  # [s] what floating point leaves of a rounded time
FEW_CELLS = 3  # of a participant, below which everybody's say how often an item was answered
Data = TypeVar("Data", bound=TaskData[Any])


def without_repeats(data: Data) -> tuple[Data, tuple[Concern, ...]]:
    """Return the data without repeated rows, and what is to be said about them.

    Parameters
    ----------
    data : TaskData
        All trials of a task.

    Returns
    -------
    TaskData, tuple of Concern
        The same where nothing is repeated.
    """
    trials = in_order(data)
    are_repeats = _are_repeats(trials, _designed_counts(data))
    repeated = list(compress(trials, are_repeats))
    if not repeated:
        return data, ()
    rows = zip(trials, are_repeats, strict=True)
    sessions = tuple(
        dataclasses.replace(own, trials=tuple(t for t, again in islice(rows, len(own.trials)) if not again))
        for own in data.sessions
    )
    kept = tuple(trial for trial, again in rows if not again)
    again = Counter(trial.participant_id for trial in repeated)
    who = first_few([f"{name} ({count})" for name, count in again.items()])
    verbs = ("repeats", "is") if len(repeated) == 1 else ("repeat", "are")
    words = (
        f"{len(repeated)} of {len(trials)} {noun_of(data.task)} {verbs[0]} what the same participant had "
        f"answered before, and {verbs[1]} left out: {who}"
    )
    return dataclasses.replace(data, sessions=sessions, rows=kept), (
        Concern(ConcernKind.REPEATED_ROWS, words),
    )


def _are_repeats(trials: Sequence[Any], designed: dict[tuple[str, str], int]) -> list[bool]:
    """Return which rows come again: copies, and more of a cell than a session or a participant has."""
    usual, fine = _usual_counts(trials), _to_the_millisecond(trials)
    counts: Counter[Hashable] = Counter()
    moments: set[Hashable] = set()
    found = []
    for trial in trials:
        who, session, cell, moment = trial.participant_id, key_of(trial), cell_of(trial), _moment(trial, fine)
        many = bool(cell) and (
            (session in designed and counts[session, cell] >= designed[session])
            or (who in usual and counts[cell] >= usual[who])
        )
        found.append(many or (moment is not None and moment in moments))
        if not found[-1]:
            counts[session, cell] += 1
            counts[cell] += 1
            moments.add(moment)
    return found


def cell_of(trial: Any) -> tuple[Any, ...]:
    """Return participant, item, version and repetition; nothing where it may come as often as it likes."""
    if hasattr(trial, "rate"):
        return () if trial.is_catch else (trial.participant_id, item_of(trial))
    if not hasattr(trial, "repetition") and not hasattr(trial, "search_time"):
        return ()
    version = getattr(trial, "version", None)
    return trial.participant_id, item_of(trial), version, getattr(trial, "repetition", None)


def _designed_counts(data: TaskData[Any]) -> dict[tuple[str, str], int]:
    """Return how often a cell may come in each session whose design says so."""
    counts: dict[tuple[str, str], int] = {}
    for session in data.sessions:
        design, key = session.manifest.design, key_of(session.manifest)
        if not isinstance(design, RampDesign) and design is not None:
            counts[key] = 1  # a second one has a repetition of its own
        elif isinstance(design, RampDesign) and design.placement is Placement.CONSTANT:
            counts[key] = design.repetitions
    return counts


def _usual_counts(trials: Sequence[Any]) -> dict[str, int]:
    """Return how often each participant mostly answered a cell: once, or once in each of several sittings.

    So a second sitting is none of repeats, and a session that was broken off and begun anew is one.
    """
    cells = Counter(cell for trial in trials if not hasattr(trial, "rate") and (cell := cell_of(trial)))
    own: dict[str, list[int]] = {}
    for (who, *_), count in cells.items():
        own.setdefault(who, []).append(count)
    everybody = statistics.median_low(cells.values()) if cells else 1
    return {
        who: statistics.median_low(counts) if len(counts) >= FEW_CELLS else everybody
        for who, counts in own.items()
    }


def _moment(trial: Any, to_the_millisecond: bool) -> Hashable | None:
    """Return what two answers of a person share by no chance: item, version, answer and its measured time.

    Of ramps, which come often and are answered fast, the onset too.
    """
    time, onset = getattr(trial, "response_time", None), None
    if hasattr(trial, "rate"):
        onset = trial.onset
        to_the_millisecond = onset is not None
    if time is None or trial.simulated or not to_the_millisecond:
        return None
    return trial.participant_id, item_of(trial), getattr(trial, "version", None), given_of(trial), time, onset


def _to_the_millisecond(trials: Sequence[Any]) -> bool:
    """Return whether response times are finer than 0.01 s, so that two agree by no chance."""
    times = (getattr(trial, "response_time", None) for trial in trials)
    return any(time is not None and abs(time - round(time, 2)) > ROUNDING for time in times)
