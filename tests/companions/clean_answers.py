"""Answers of people with whom nothing is wrong, drawn without a line of the simulated participants."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.analysis.ramp_loading import RampData
from evenlight.analysis.session_loading import Session, TaskData
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.search import SearchDesign, SearchTrial
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import (
    ComparisonDesign,
    ComparisonTrial,
    RatingDesign,
    RatingTrial,
    Version,
)

NAMES = ("library", "gym", "living_room", "basement")
BENCH = Display("bench", 100.0, 0.1, 2.2, 60.0)
DESIGNS = {"rating": RatingDesign(), "comparison": ComparisonDesign(), "search": SearchDesign()}
RATES = (0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12)  # of the initial luminance [1/s]


def sessions_of(task: str, trials: list[Any], design: Any = None) -> tuple[Session[Any], ...]:
    """A session for each participant and session identifier, complete and with as many trials as designed."""
    own: dict[tuple[str, str], list[Any]] = {}
    for trial in trials:
        own.setdefault((trial.participant_id, trial.session_id), []).append(trial)
    return tuple(
        Session(
            Path(f"sub-{who}", f"ses-{visit}"),
            SessionManifest(
                participant_id=who, session_id=visit, task=task, simulated=False,
                status=SessionStatus.COMPLETE, n_trials=len(rows), display=BENCH,
                design=design or DESIGNS[task], provenance=Provenance(),
            ),
            tuple(rows),
        )
        for (who, visit), rows in own.items()
    )  # fmt: skip


def data_of(task: str, trials: list[Any]) -> TaskData[Any]:
    """Trials of a viewing task as its data."""
    return TaskData(task, sessions_of(task, trials), False, "0" * 64, ())


def ramp_data_of(trials: list[RampTrial], design: RampDesign) -> RampData:
    """Ramps as the data of a calibration."""
    sessions = sessions_of("ramp", trials, design)
    return RampData("ramp", sessions, False, "0" * 64, (), display=BENCH)


def ratings(rng: np.random.Generator, people: int = 17) -> list[RatingTrial]:
    """One rating of each version of each sequence, ours 0.6 points better; its place counterbalanced."""
    return list(_ratings(rng, people))


def _ratings(rng: np.random.Generator, people: int) -> Iterator[RatingTrial]:
    for k in range(people):
        person = rng.normal(3.2, 0.6)
        for place, s in enumerate(rng.permutation(4).tolist()):
            first = Version.OURS if (k + s) % 2 else Version.BASELINE
            for shown in (1, 2):
                version = first if shown == 1 else _other(first)
                quality = person + 0.6 * (version is Version.OURS) + 0.2 * s + rng.normal(0, 0.8)
                yield rating(
                    k, NAMES[s], version, shown, min(max(round(quality), 1), 5), 2 * place + shown - 1
                )


def _other(version: Version) -> Version:
    return Version.BASELINE if version is Version.OURS else Version.OURS


def rating(who: int, name: str, version: Version, place: int | None, given: int, index: int) -> RatingTrial:
    """One rating of a sequence."""
    return RatingTrial(
        f"{who:02d}", "01", index, name, version, 1, place, 0.5, given, 0.5 + 0.001 * index, False,
        onset=30.0 * index + 0.001 * who,
    )  # fmt: skip


def comparisons(
    rng: np.random.Generator, people: int = 17, repetitions: int = 1, chosen: float = 0.55
) -> list[ComparisonTrial]:
    """Answers of people who choose ours with differing probabilities; its interval counterbalanced."""
    trials = []
    for k in range(people):
        share = 1 / (1 + math.exp(-rng.normal(math.log(chosen / (1 - chosen)), 0.6)))
        for repetition in range(1, repetitions + 1):
            for s in rng.permutation(4).tolist():
                interval = 1 + (k + s + repetition) % 2
                ours = bool(rng.random() < share)
                index = len(trials) % (4 * repetitions)
                trials.append(comparison(k, NAMES[s], interval, ours, (repetition, index)))
    return trials


def comparison(
    who: int, name: str, interval: int | None, ours: bool, place: tuple[int, int]
) -> ComparisonTrial:
    """One comparison; its repetition and index."""
    response = Response.FIRST if ours == (interval == 1) else Response.SECOND
    return ComparisonTrial(
        f"{who:02d}", "01", place[1], name, place[0], interval, 0.5, 0.5, response, 0.5, False,
        onset=60.0 * place[1] + 0.001 * who,
    )  # fmt: skip


def searches(rng: np.random.Generator, people: int = 17, places: int = 12) -> list[SearchTrial]:
    """Two searches at each place, the second half faster; ours dims some places and brightens others."""
    trials = []
    easy = rng.normal(0, 0.4, places)
    gain = np.linspace(-0.5, 0.5, places)  # ln of ours' brightness over the baseline's
    for k in range(people):
        person = rng.normal(1.6, 0.3)
        for half in (0, 1):
            for j in rng.permutation(places).tolist():
                version = Version.OURS if (k + j + half) % 2 else Version.BASELINE
                light = gain[j] if version is Version.OURS else 0.0
                ln_time = person + easy[j] - 0.25 * half - 0.5 * light + rng.normal(0, 0.7)
                index = len(trials) % (2 * places)
                trials.append(search(k, j, version, math.exp(ln_time), (half, index)))
    return trials


def search(who: int, spot: int, version: Version, seconds: float, place: tuple[int, int]) -> SearchTrial:
    """One search; its half of the session and index. Longer than 30 s is not found."""
    found = seconds < 30.0
    gap = 45 * ((who + spot + place[0]) % 8)
    factor = 0.5 * (1.0 + 0.05 * (spot - 5.5) * (version is Version.OURS))
    return SearchTrial(
        f"{who:02d}", "01", place[1], NAMES[spot % 4], f"place{spot}", version, factor, 1 + place[0], 0.0,
        0.0, 10.0, -0.15, -0.15, gap, 20.0, 4.0, 30.0, found, min(seconds, 30.0), gap if found else None,
        1.0 if found else None, False, block=1 + place[0], onset=40.0 * place[1] + 0.001 * who,
    )  # fmt: skip


def ramp_design(
    procedure: Procedure = Procedure.YES_NO, factors: tuple[float, ...] = (0.2, 1.0)
) -> RampDesign:
    """Six ramps of each rate at each factor, on a white screen."""
    return RampDesign(procedure=procedure, screens=("white",), factors=factors)


def ramps(
    rng: np.random.Generator, design: RampDesign, people: int = 10, drift: float = 0.0
) -> list[RampTrial]:
    """Answers that follow logistic functions of ln(rate), 5 % false alarms, in random order.

    ln(threshold) changes by the drift from the first to the last.
    """
    trials = []
    two = design.procedure is Procedure.TWO_INTERVAL
    for k in range(people):
        middle = rng.normal(math.log(0.028), 0.3)
        planned = [(f, r) for f in design.factors for r in RATES for _ in range(design.repetitions)]
        planned += [] if two else [(f, 0.0) for f in design.factors for _ in range(12)]
        for index, which in enumerate(rng.permutation(len(planned)).tolist()):
            factor, rate = planned[which]
            now = middle + drift * (index / len(planned) - 0.5)
            seen = 0.0 if rate == 0 else 1 / (1 + math.exp(-(math.log(rate) - now) / 0.3))
            guess = 0.5 if two else 0.05
            noticed = bool(rng.random() < guess + (0.98 - guess) * seen)
            trials.append(ramp(k, index, (factor, rate), noticed, int(rng.integers(1, 3)) if two else None))
    return trials


def ramp(
    who: int, index: int, level: tuple[float, float], noticed: bool, interval: int | None = None
) -> RampTrial:
    """One ramp of 5 s at a factor and a relative rate."""
    luminance = 100.0 * level[0]
    rate = level[1] * luminance
    answers = (Response.YES, Response.NO) if interval is None else (Response.FIRST, Response.SECOND)
    right = noticed if interval is None else noticed == (interval == 1)
    return RampTrial(
        f"{who:02d}", "01", index, "white", level[0], luminance, luminance - 5 * rate, rate, 5.0, rate == 0,
        answers[0 if right else 1], 0.5 + 0.001 * index, False,
        procedure=Procedure.YES_NO if interval is None else Procedure.TWO_INTERVAL, ramp_interval=interval,
        onset=9.5 * index + 0.001 * who,
    )  # fmt: skip
