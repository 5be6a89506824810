"""The gate: what is checked of every task before any inference, viewing tasks and ramps alike.

Rows that are there twice: the first is kept, later ones are left out, and both are said.

The checks see a table with a row for each trial. Its columns are those of the trial's record, so that a
registered task with the columns of one that comes along is checked without a word of its own. A column that
is missing or null is unknown: nothing is checked that rests on it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeVar

import pandas as pd

from evenlight.analysis.integrity.checks import CHECKS, CHECKS_OF_RAMPS, usual_order
from evenlight.analysis.integrity.concern import Concern, ConcernKind, noun_of, ordered
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few, spaced
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign, Response
from evenlight.data_schema.recordings.viewing import Version

SHORTEST_TIME = 0.1  # [s] nobody finds anything faster; 0 s has no logarithm
ROUNDING = 1e-6  # [s] what floating point leaves of a time rounded to 0.01 s, so that two agree by chance
FEW_TIMES = 4  # answers to an item; of more, some take the same time in ms by chance
FEW_CELLS = 3  # of a participant, below which everybody's say how often an item was answered
CELL = ("participant", "item", "ours", "repetition")
MOMENT = ["participant", "item", "ours", "given", "time", "onset"]  # what two answers share by no chance
RAMP = ("screen", "factor", "direction", "duration")
DIFFERENT = ("item", "level", "given", "shown")  # columns of which it counts only what is the same
NUMBERS = ("ours", "second", "answer", "found", "repetition", "visit", "rate", "time", "onset")
Data = TypeVar("Data", bound=TaskData[Any])


def checked(data: Data) -> tuple[Data, tuple[Concern, ...]]:
    """Return the data to be analysed, and what is wrong with them, first what threatens the conclusion.

    Only repeated rows are left out; nothing else is excluded or changed.

    Parameters
    ----------
    data : TaskData
        All trials of a task, which may be a registered one: what its records do not say is not checked.
    """
    if not data.trials:
        return data, ()
    table = _trial_table(data)
    repeats = _repeats(table, _designed_counts(data))
    checks = CHECKS_OF_RAMPS if data.task == "ramp" else CHECKS
    noun, first = noun_of(data.task), []
    if len(repeats):
        again = [f"{who} ({n})" for who, n in table.participant[repeats].value_counts(sort=False).items()]
        repeat, are = ("repeats", "is") if len(repeats) == 1 else ("repeat", "are")
        words = (
            f"{len(repeats)} of {len(table)} {noun} {repeat} what the same participant had answered before, "
            f"and {are} left out: {first_few(again)}"
        )
        first.append(Concern(ConcernKind.REPEATED_ROWS, words))
        gone = set(map(id, table.trial[repeats]))
        kept = (replace(own, trials=_without(own.trials, gone)) for own in data.sessions)
        data = replace(data, sessions=tuple(kept), rows=_without(data.rows, gone))
    sizes = ((_session_of(own.manifest), len(own.trials), own.manifest.n_trials) for own in data.sessions)
    if sessions := [f"{key} ({n} instead of {right})" for key, n, right in sizes if n > right]:
        words = f"sessions hold more {noun} than their design has: {first_few(sessions, 3)}"
        first.append(Concern(ConcernKind.MORE_TRIALS, words))
    found = (concern for check in checks for concern in check(table.drop(repeats), data.task))
    return data, ordered((*first, *found))


def confounded_order(data: TaskData[Any]) -> str:
    """Return in which order two versions came if it was nearly always the same one; empty if it was not."""
    second = _trial_table(data).second.dropna()
    where, most = usual_order(second)
    always = "always" if most == len(second) else "nearly always"
    return f"the track was {always} shown {where}" if where else ""


def _without(trials: Iterable[Any], gone: set[int]) -> tuple[Any, ...]:
    return tuple(trial for trial in trials if id(trial) not in gone)


def _repeats(table: pd.DataFrame, designed: dict[str, float]) -> pd.Index[int]:
    """Return the rows that come again: copies, and more of a cell than a session or a participant has.

    Copies share the time of the answer, unless it is rounded; of what comes often, as ramps do, the onset
    too.
    """
    ramp = table.rate.notna()
    fine = bool(((table.time - table.time.round(2)).abs() > ROUNDING).any())
    often = ramp | (
        table.groupby(["participant", "item", "ours"], dropna=False).time.transform("size") > FEW_TIMES
    )
    measured = table[table.time.notna() & ~table.simulated & table.onset.notna().where(often, fine)]
    gone = table.index.isin(measured.index[measured.duplicated(MOMENT)])
    # How often each participant mostly answered a cell: once, or once in each of several sittings. A second
    # sitting is none of repeats then, and a session that was broken off and begun anew is one.
    counts = table[table.counted & ~ramp].groupby([*CELL], dropna=False).size()
    own, everybody = counts.groupby("participant"), float(counts.quantile(interpolation="lower"))
    usual = own.quantile(interpolation="lower").where(own.size() >= FEW_CELLS, everybody)
    limits = {("session", *CELL): table.session.map(designed), CELL: table.participant.map(usual)}
    for cell, most in limits.items():
        place = table[table.counted & ~gone].groupby([*cell], dropna=False).cumcount()
        gone |= place.reindex(table.index) >= most
    return table.index[gone]


def _designed_counts(data: TaskData[Any]) -> dict[str, float]:
    """Return how often a cell may come in each session whose design says so."""
    counts: dict[str, float] = {}
    for session in data.sessions:
        design, key = session.manifest.design, _session_of(session.manifest)
        if not isinstance(design, RampDesign) and design is not None:
            counts[key] = 1  # a second one has a repetition of its own
        elif isinstance(design, RampDesign) and design.placement is Placement.CONSTANT:
            counts[key] = design.repetitions
    return counts


def _trial_table(data: TaskData[Any]) -> pd.DataFrame:
    """Return the trials that count, in the order in which they were answered; NaN is unknown, or -1."""
    timed = {_session_of(own.manifest) for own in data.sessions if own.manifest.order_known}
    sessions = (sorted(session.trials, key=lambda trial: trial.trial_index) for session in data.sessions)
    trials = [*itertools.chain.from_iterable(sessions), *data.rows]
    table = pd.DataFrame([_row(trial, _session_of(trial) in timed) for trial in trials])
    table = table.astype(dict.fromkeys(NUMBERS, float))
    table[[*DIFFERENT]] = table[[*DIFFERENT]].apply(lambda column: pd.factorize(column)[0])
    if table.visit.notna().any():
        place = [table.session, table.item]
        baseline, ours = (
            table.visit.where(table.ours == version).groupby(place).transform("min") for version in (0, 1)
        )
        known = (table.ours == 1) & baseline.notna() & (ours != baseline)
        table["second"] = (ours > baseline).astype(float).where(known)
    # Of many repetitions in a random order one version may lead for long: only the first counts.
    pairs = table[table.second.notna() & table.ours.notna()]
    table.loc[pairs.index[pairs.duplicated(["session", "item"])], "second"] = math.nan
    return table


def _session_of(record: Any) -> str:
    return f"{record.participant_id}/{record.session_id}"


def _row(trial: Any, timed: bool) -> dict[str, Any]:
    def known(*columns: str) -> Any:
        return next((value for name in columns if (value := getattr(trial, name, None)) is not None), None)

    ramp, search = hasattr(trial, "rate"), hasattr(trial, "search_time")
    level = tuple(known(name) for name in (RAMP if ramp else ("sequence", "keypoint")))
    item = (*level, known("rate"))
    version, place = known("version"), known("ours_interval", "place_in_pair")
    ours = None if version is None else version is Version.OURS
    shown = known("ours_interval", "ramp_interval", "ring_orientation")
    unknown = hasattr(trial, "ours_interval") and known("ours_interval") is None  # the version is the answer
    return {
        "trial": trial,
        "participant": trial.participant_id,
        "session": _session_of(trial),
        "item": item,  # what was shown, apart from the version
        "level": level,  # and of ramps apart from the rate
        "words": " ".join(spaced(str(part)) for part in item if part),
        "ours": ours,  # its version; unknown where a trial shows both or none
        # Whether ours was the second of two versions, once for each pair: not with its baseline.
        "second": None if ours is False or place is None else place == 2,
        "answer": _number(known),  # rating; 1 for ours or noticed, else 0; ln(search time / s)
        "given": None if unknown else known("rating", "response", "reported_orientation"),
        "shown": (item, version) if shown is None else shown,  # what it should depend on
        "found": known("found"),  # of what was searched for
        "repetition": known("repetition"),
        # Whether it comes as often as its item, version and repetition, and not as often as it likes.
        "counted": not trial.is_catch if ramp else search or hasattr(trial, "repetition"),
        "visit": (trial.trial_index if timed else trial.block) if search else None,
        "timed": timed,  # whether the rows of its session are in the order of time
        "rate": known("rate"),
        "two": known("procedure") is Procedure.TWO_INTERVAL,
        "time": known("response_time"),
        "onset": known("onset") if ramp else None,
        "simulated": getattr(trial, "simulated", False),
    }


def _number(known: Callable[..., Any]) -> float | None:
    if (value := known("rating", "success", "chose_ours")) is not None:
        return float(value)
    if (seconds := known("search_time")) is not None:
        return math.log(max(seconds, SHORTEST_TIME))
    interval, response = known("ours_interval"), known("response")
    if interval is None or response not in (Response.FIRST, Response.SECOND):
        return None
    return float((response is Response.FIRST) == (interval == 1))
