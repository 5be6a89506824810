"""Answers of a comparison, made up one by one, and the rows that the analysis makes of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

from comparison_levels import PEOPLE

from evenlight.analysis.comparison.comparison_results import compare
from evenlight.analysis.session_loading import Session, TaskData
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import ComparisonDesign, ComparisonTrial

NAMES = ("library", "gym", "living_room", "basement")
Answer = tuple[str, str, bool, int]  # participant, sequence, ours chosen, interval of ours


def data_of(answers: Sequence[Answer], sequences: tuple[str, ...] = NAMES, simulated: bool = True):
    """A data set with these answers, one session for each participant."""
    design = ComparisonDesign(sequences=sequences)
    sessions = []
    for who in sorted({answer[0] for answer in answers}):
        own = [answer for answer in answers if answer[0] == who]
        trials = tuple(
            ComparisonTrial(
                who, "01", k, name, 1, interval, 0.5, 0.5,
                Response.FIRST if ours == (interval == 1) else Response.SECOND, None, simulated,
            )
            for k, (_, name, ours, interval) in enumerate(own)
        )  # fmt: skip
        manifest = SessionManifest(
            participant_id=who, session_id="01", task="comparison", simulated=simulated,
            status=SessionStatus.COMPLETE, n_trials=len(trials), display=Display("bench", 100.0, 0.1, 2.2,
            60.0), design=design, provenance=Provenance(),
        )  # fmt: skip
        sessions.append(Session(Path(who), manifest, trials))
    return TaskData("comparison", tuple(sessions), simulated, "0" * 64, ())


def answers_of(
    chosen: Callable[[int, int], bool], people: int = PEOPLE, repetitions: int = 1
) -> list[Answer]:
    """Answers of so many people about the four sequences, ours first in every other."""
    return [
        (f"{who:02d}", NAMES[s], chosen(who, s), 1 + (who + s + r) % 2)
        for who, s, r in itertools.product(range(people), range(4), range(repetitions))
    ]


def rows_of(answers: Sequence[Answer], margin: float = 0.15) -> tuple[Statistic, ...]:
    """The rows of these answers, without figures."""
    return tuple(compare(data_of(answers), 1, margin).rows)


def row(rows: Sequence[Statistic], table: str, group: str, what: str) -> Statistic:
    """The row of these words, or the one that begins with them."""
    own = [s for s in rows if (s.table, s.group) == (table, group)]
    (one,) = [s for s in own if s.what == what] or [s for s in own if s.what.startswith(what)]
    return one
