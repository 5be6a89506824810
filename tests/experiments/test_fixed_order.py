"""Trials in a fixed order: handed out once, again where flagged, and only those of the session."""

from dataclasses import dataclass, replace
from typing import Any

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.experiments.sessions.fixed_order import MAX_SHOWINGS, FixedOrder, PlannedTrial


def planned(sequence: str, factor: float = 0.3, block: int = 1) -> PlannedTrial:
    return PlannedTrial(sequence=sequence, factor=factor, block=block)


@dataclass(frozen=True)
class Answered:
    sequence: str
    factor: float = 0.3
    block: int = 1
    flag: TrialFlag = TrialFlag.NONE
    trial_index: int = 0
    participant_id: str = "01"


FLAGGED = TrialFlag.DROPPED_FRAMES


def answer(order: FixedOrder, flag: TrialFlag = TrialFlag.NONE) -> PlannedTrial:
    trial = order.next_trial()
    assert trial is not None
    order.take(Answered(trial.sequence, trial.factor, trial.block, flag))
    return trial


def test_the_trials_come_in_their_order_and_the_next_one_waits_for_its_answer() -> None:
    order = FixedOrder([planned("gym"), planned("library")], repeat_flagged=True)
    assert order.next_trial() == order.next_trial() == planned("gym")
    assert [answer(order).sequence, answer(order).sequence] == ["gym", "library"]
    assert order.next_trial() is None
    assert order.n_trials == 2


def test_a_flagged_trial_comes_again_at_the_end_in_a_block_of_its_own() -> None:
    order = FixedOrder([planned("gym", block=1), planned("library", block=2)], repeat_flagged=True)
    answer(order, FLAGGED)
    answer(order)
    assert order.next_trial() == planned("gym", block=3)


def test_a_trial_that_is_flagged_each_time_is_shown_three_times_in_all() -> None:
    order = FixedOrder([planned(name) for name in "abcdefgh"], repeat_flagged=True)
    shown = 0
    while (trial := order.next_trial()) is not None:
        shown += trial.sequence == "a"
        answer(order, FLAGGED if trial.sequence == "a" else TrialFlag.NONE)
    assert shown == MAX_SHOWINGS


def test_a_quarter_of_the_trials_at_most_is_shown_again() -> None:
    """8 trials, all but the first flagged: 2 more, and what earlier versions showed is still read."""
    order = FixedOrder([planned(name) for name in "abcdefgh"], repeat_flagged=True)
    shown = 0
    while order.next_trial() is not None:
        answer(order, FLAGGED if shown else TrialFlag.NONE)
        shown += 1
    assert shown == 8 + 2
    order.take(Answered("d", block=2, flag=FLAGGED))
    assert order.next_trial() is None


def test_what_was_left_out_for_having_been_seen_before_is_not_shown_once_more() -> None:
    order = FixedOrder([planned("gym")], repeat_flagged=True)
    answer(order, TrialFlag.SEEN_BEFORE)
    assert order.next_trial() is None


def test_a_flagged_trial_is_not_shown_again_where_the_design_says_so() -> None:
    order = FixedOrder([planned("gym")], repeat_flagged=False)
    answer(order, FLAGGED)
    assert order.next_trial() is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sequence": "library"}, "sequence library, not gym"),
        ({"factor": 0.31}, "factor 0.31, not 0.3"),
        ({"block": 2}, "block 2, not 1"),
    ],
)
def test_a_trial_that_was_not_planned_is_refused_with_what_is_different(
    change: dict[str, Any], words: str
) -> None:
    order = FixedOrder([planned("gym")], repeat_flagged=True)
    with pytest.raises(InputError, match=words):
        order.take(replace(Answered("gym"), **change))


def test_a_number_that_was_written_and_read_is_still_the_planned_one() -> None:
    order = FixedOrder([planned("gym", 0.1 + 0.2)], repeat_flagged=True)
    order.take(Answered("gym", 0.3))
    assert order.next_trial() is None


def test_a_trial_after_the_last_is_refused() -> None:
    order = FixedOrder([], repeat_flagged=True)
    with pytest.raises(InputError, match="no further trial"):
        order.take(Answered("gym"))


def test_trials_of_another_class_are_refused_at_once_and_not_when_one_is_flagged() -> None:
    with pytest.raises(TypeError, match="planned trials are of the class PlannedTrial, got Answered"):
        FixedOrder([Answered("gym")], repeat_flagged=True)
