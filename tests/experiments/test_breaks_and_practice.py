"""Breaks by trials or by minutes; practice from clear to near threshold, in rounds, until enough is right."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from conducted_sessions import DESIGN, DISPLAY, OBSERVER, Stage, begun, conducted

from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, Response, session_minutes
from evenlight.data_schema.recordings.session import EventKind, SessionStatus
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.session_store import SessionStore, resume_session
from evenlight.experiments.sessions.task import PracticeRule
from evenlight.experiments.stage import PausePressed, ShownInterval

LONG = dataclasses.replace(
    DESIGN, catch_share=0.0, repetitions=10, adaptation_duration=4.0, hold_duration=4.0
)  # 20 ramps of 8.5 s, 1 s of pause, 0.4 s or more to answer: some 10.5 s each


def break_places(stage: Stage) -> list[int]:
    """After how many trials the breaks came."""
    breaks = [page for page in stage.pages if "Time for a break" in page]
    return [int(page.split("done ")[1].split(" of")[0]) for page in breaks]


def trials_in(minutes: float) -> float:
    """How many trials of `LONG` fit; a simulated person takes 0.4 s and 0.9 s more on average."""
    return 60 * minutes / (8.5 + 1.0 + 1.3)


def test_a_break_comes_after_minutes_where_those_are_over_first(tmp_path: Path) -> None:
    """One minute holds between 5 and 6 trials; the break comes after the one in which it ends."""
    design = dataclasses.replace(LONG, trials_between_breaks=0, minutes_between_breaks=1.0)
    stage = Stage({})
    conducted(begun(tmp_path / "lab", design), stage, design=design)
    places = break_places(stage)
    assert 5 < trials_in(1.0) < 6
    assert places[0] in (5, 6, 7)
    assert set(np.diff(places).tolist()) <= {5, 6, 7}
    assert 20 not in places  # never at the end


def test_the_minutes_count_from_the_last_break_of_either_kind(tmp_path: Path) -> None:
    """A break after every 4 trials is always first: a minute is never over since the last one."""
    design = dataclasses.replace(LONG, trials_between_breaks=4, minutes_between_breaks=1.0)
    stage = Stage({})
    conducted(begun(tmp_path / "lab", design), stage, design=design)
    assert break_places(stage) == [4, 8, 12, 16]


def test_the_time_of_a_session_counts_the_breaks_by_minutes() -> None:
    """9.5 s a trial: 10 minutes hold 63.2, so a break after every 64; 300 trials have four, not none."""
    design = RampDesign(trials_between_breaks=0, practice_trials=0)
    timed = dataclasses.replace(design, minutes_between_breaks=10.0)
    assert session_minutes(timed, 300) - session_minutes(design, 300) == pytest.approx(4.0)


PRACTICE = dataclasses.replace(
    DESIGN, relative_rates=(0.02, 0.08), practice_trials=6, practice_correct=5, practice_rounds=3
)  # 4 ramps and 2 trials without any
KEEN = dataclasses.replace(OBSERVER, sensitivity=1e-3, guess_rate=1e-9, lapse_rate=0.0)
BLIND = dataclasses.replace(KEEN, sensitivity=1e6)  # "no" to all: 2 of 6 right


class Eager(SimulatedObserver):
    """Says "yes" to everything: 4 of 6 right."""

    def answer(self, ramp: PlannedTrial, rng: np.random.Generator) -> Response:
        return Response.YES


EAGER = Eager(OBSERVER.limit, 1.0, {}, 1.6, 0.05, 0.02)


def pause(_: ShownInterval) -> ShownInterval:
    raise PausePressed


def details(store: SessionStore, kind: EventKind) -> list[str]:
    return [event.detail for event in store.events if event.kind is kind]


@pytest.mark.parametrize("procedure", list(Procedure))
def test_practice_goes_from_clear_ramps_to_the_middle_of_the_rates(procedure: Procedure) -> None:
    """From 0.08 to the geometric mean of 0.02 and 0.08, 0.04, in equal ratios."""
    schedule = RampSchedule(dataclasses.replace(PRACTICE, procedure=procedure), DISPLAY, seed=1)
    for number in range(3):
        ramps = [ramp for ramp in schedule.practice(number) if not ramp.is_catch]
        rates = np.array([ramp.rate / ramp.level.luminance for ramp in ramps])
        n = 4 if procedure is Procedure.YES_NO else 6
        np.testing.assert_allclose(rates, np.geomspace(0.08, 0.04, n))
    assert schedule.practice(0) != schedule.practice(1)


def test_who_sees_the_changes_practises_one_round(tmp_path: Path) -> None:
    store = begun(tmp_path / "lab", PRACTICE)
    stage = Stage({})
    assert conducted(store, stage, design=PRACTICE, observer=KEEN) is SessionStatus.COMPLETE
    assert sum(trial.practice for trial in store.trials) == 6
    assert details(store, EventKind.PRACTISED) == ["passed: 6 of 6 right, 5 needed"]
    assert not any("Another round" in page or "call the experimenter" in page for page in stage.pages)


@pytest.mark.parametrize(("observer", "right"), [(BLIND, 2), (EAGER, 4)])
def test_who_misses_changes_or_reports_what_is_not_there_practises_again_and_the_experimenter_is_told(
    tmp_path: Path, observer: SimulatedObserver, right: int
) -> None:
    store, stage = begun(tmp_path / "lab", PRACTICE), Stage({})
    conducted(store, stage, design=PRACTICE, observer=observer)
    assert sum(trial.practice for trial in store.trials) == 18
    assert details(store, EventKind.PRACTISED) == [f"not passed: {right} of 6 right, 5 needed"]
    assert sum("Another round of practice" in page for page in stage.pages) == 2
    assert sum(f"In the last round of practice {right} of 6" in page for page in stage.pages) == 1
    assert store.manifest.status is SessionStatus.COMPLETE  # the experimenter went on all the same


def test_a_session_broken_off_in_practice_goes_on_with_its_round(tmp_path: Path) -> None:
    """The sixth page, after consent, two keys, instructions and a feedback, is stopped at: one trial."""
    store = begun(tmp_path / "lab", PRACTICE)
    stage = Stage({1: pause})
    assert conducted(store, stage, "6", design=PRACTICE, observer=KEEN) is SessionStatus.ABORTED
    assert len(store.trials) == 1
    store = resume_session(tmp_path / "lab", "01", "01", utc=str)
    assert conducted(store, Stage({}), design=PRACTICE, observer=KEEN) is SessionStatus.COMPLETE
    assert sum(trial.practice for trial in store.trials) == 6


def test_a_rule_looks_at_whole_rounds_only() -> None:
    rule = PracticeRule(trials=3, correct=2)
    assert not rule.passed([])
    assert not rule.passed([True, True])
    assert rule.passed([True, False, True])
    assert not rule.passed([True, True, True, False, False, True])


def test_more_right_answers_than_trials_are_refused() -> None:
    with pytest.raises(ValueError, match="practice_correct must be at most practice_trials, 6, got 7"):
        RampDesign(practice_correct=7)
