"""The course of a session: what comes next, and that a broken session goes on as the unbroken one."""

import dataclasses
import functools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.recordings.ramp import (
    Direction,
    Placement,
    Procedure,
    RampDesign,
    RampTrial,
    Response,
    TrialFlag,
)
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.method.preset_files import load_rate_limit

DISPLAY = Display("bench", 100.0, 0.5, 2.0, 60.0)
SEED = 5
OBSERVER = SimulatedObserver(
    load_rate_limit("surace2025"), 1.0, {}, width=1.6, guess_rate=0.1, lapse_rate=0.02
)
SMALL = RampDesign(
    factors=(0.3, 0.6),
    directions=(Direction.DOWN, Direction.UP),
    relative_rates=(0.005, 0.02, 0.1),
    repetitions=2,
    trials_per_level=6,
    practice_trials=6,
)
DESIGNS = {
    (procedure, placement): dataclasses.replace(SMALL, procedure=procedure, placement=placement)
    for procedure in Procedure
    for placement in Placement
}


def answered(
    design: RampDesign, ramp: PlannedTrial, index: int, flag: TrialFlag = TrialFlag.NONE, **changed: object
) -> RampTrial:
    response = OBSERVER.answer(ramp, generator_for(SEED, 0, Purpose.ANSWERS, index))
    columns = {
        "participant_id": "01",
        "session_id": "01",
        "trial_index": index,
        "simulated": True,
        "flag": flag,
    }
    trial = RampTrial(**ramp.columns, **columns, response=response, response_time=None)
    assert trial.procedure is design.procedure
    return dataclasses.replace(trial, **changed)


def go_on(
    schedule: RampSchedule, design: RampDesign, start: int = 0, flagged: frozenset[int] = frozenset()
) -> list[RampTrial]:
    """Answer what is left; trials with an index in `flagged` are flagged."""
    trials: list[RampTrial] = []
    while (ramp := schedule.next_trial()) is not None:
        index = start + len(trials)
        flag = TrialFlag.DROPPED_FRAMES if index in flagged else TrialFlag.NONE
        trials.append(answered(design, ramp, index, flag))
        schedule.take(trials[-1])
    return trials


@functools.cache
def unbroken(procedure: Procedure, placement: Placement, flagged: frozenset[int]) -> list[RampTrial]:
    design = DESIGNS[procedure, placement]
    return go_on(RampSchedule(design, DISPLAY, SEED), design, flagged=flagged)


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.sampled_from(Procedure),
    st.sampled_from(Placement),
    st.floats(0, 1),
    st.sampled_from([frozenset[int](), frozenset({3, 4, 17}), frozenset(range(40, 60))]),
)
def test_a_session_taken_up_from_its_records_goes_on_as_the_unbroken_one(
    procedure: Procedure, placement: Placement, where: float, flagged: frozenset[int]
) -> None:
    design = DESIGNS[procedure, placement]
    whole = unbroken(procedure, placement, flagged)
    split = round(where * len(whole))
    fresh = RampSchedule(design, DISPLAY, SEED)
    for trial in whole[:split]:
        fresh.take(record_from_mapping(RampTrial, mapping_from_record(trial), "line"))  # as from its file
    assert go_on(fresh, design, split, flagged) == whole[split:]


@pytest.mark.parametrize(("procedure", "placement"), DESIGNS)
def test_a_session_has_as_many_usable_trials_as_it_says(procedure: Procedure, placement: Placement) -> None:
    schedule = RampSchedule(DESIGNS[procedure, placement], DISPLAY, SEED)
    # White and gray, up and down, two factors: 8 cells of 6 ramps; in yes/no another 12 without change.
    assert schedule.n_trials == (60 if procedure is Procedure.YES_NO else 48)
    assert sum(trial.usable for trial in unbroken(procedure, placement, frozenset())) == schedule.n_trials
    flagged = unbroken(procedure, placement, frozenset({3, 4, 17}))
    assert sum(trial.usable for trial in flagged) == schedule.n_trials
    assert len(flagged) == schedule.n_trials + 3


def test_the_next_trial_is_the_same_until_it_is_taken() -> None:
    schedule = RampSchedule(DESIGNS[Procedure.YES_NO, Placement.TARGETED], DISPLAY, SEED)
    first = schedule.next_trial()
    assert schedule.next_trial() is first


def test_a_flagged_trial_counts_for_nothing_and_is_shown_again_at_the_end() -> None:
    design = DESIGNS[Procedure.TWO_INTERVAL, Placement.CONSTANT]
    plain = unbroken(Procedure.TWO_INTERVAL, Placement.CONSTANT, frozenset())
    flagged = unbroken(Procedure.TWO_INTERVAL, Placement.CONSTANT, frozenset({3}))
    assert [trial.rate for trial in flagged[:-1]] == [trial.rate for trial in plain]
    again, before = flagged[-1], flagged[3]
    assert (again.rate, again.factor, again.ramp_interval) == (
        before.rate,
        before.factor,
        before.ramp_interval,
    )
    assert again.block == 5  # after the four conditions
    kept = dataclasses.replace(design, repeat_flagged=False)
    assert len(go_on(RampSchedule(kept, DISPLAY, SEED), kept, flagged=frozenset({3}))) == 48


def test_a_flagged_answer_does_not_move_adaptive_placement() -> None:
    # Trial 0 flagged: whatever its answer was, everything after is the same.
    design = DESIGNS[Procedure.YES_NO, Placement.PSI_MARGINAL]
    continued = []
    for response in (Response.YES, Response.NO):
        schedule = RampSchedule(design, DISPLAY, SEED)
        ramp = schedule.next_trial()
        assert ramp is not None
        schedule.take(answered(design, ramp, 0, TrialFlag.DROPPED_FRAMES, response=response))
        continued.append(go_on(schedule, design, 1))
    assert continued[0] == continued[1]


def test_a_display_that_always_drops_frames_does_not_keep_anybody_for_ever() -> None:
    design = DESIGNS[Procedure.YES_NO, Placement.TARGETED]
    everything = frozenset(range(1000))
    trials = go_on(RampSchedule(design, DISPLAY, SEED), design, flagged=everything)
    assert len(trials) == 60 + 60 / 4  # a quarter is shown again


def test_a_session_of_an_earlier_version_that_showed_more_of_them_again_is_still_read() -> None:
    """Then a trial was shown three times, however many there were: 60 trials that were shown 70 times."""
    design = DESIGNS[Procedure.YES_NO, Placement.CONSTANT]
    schedule = RampSchedule(design, DISPLAY, SEED)
    go_on(schedule, design, flagged=frozenset(range(1000)))
    assert schedule.next_trial() is None
    assert schedule.n_left == 0
    again = schedule._queued()
    assert again is not None
    schedule.take(answered(design, again, 75))


def test_practice_is_clear_has_trials_without_change_and_does_not_move_the_schedule() -> None:
    for (procedure, _), design in DESIGNS.items():
        schedule = RampSchedule(design, DISPLAY, SEED)
        practice = schedule.practice()
        assert practice == schedule.practice()
        assert len(practice) == 6
        assert all(ramp.practice and ramp.block == 0 for ramp in practice)
        assert sum(ramp.is_catch for ramp in practice) == (2 if procedure is Procedure.YES_NO else 0)
        for ramp in practice:
            assert ramp.is_catch or ramp.rate == pytest.approx(0.1 * ramp.level.luminance)
        first = schedule.next_trial()
        schedule.take(answered(design, practice[0], 0))
        assert schedule.next_trial() is first


def test_participants_differ_under_the_same_seed() -> None:
    design = DESIGNS[Procedure.TWO_INTERVAL, Placement.CONSTANT]
    one, other = (
        RampSchedule(design, DISPLAY, SEED, order_index=k) for k in (0, 4)
    )  # the same row of blocks
    trials = [[(t.rate, t.ramp_interval) for t in go_on(s, design)] for s in (one, other)]
    assert trials[0] != trials[1]


def test_records_of_another_design_or_seed_are_refused() -> None:
    design = DESIGNS[Procedure.YES_NO, Placement.CONSTANT]
    trial = unbroken(Procedure.YES_NO, Placement.CONSTANT, frozenset())[0]
    other = RampSchedule(dataclasses.replace(design, factors=(0.2, 0.5)), DISPLAY, SEED)
    with pytest.raises(
        InputError, match=r"trial 0 of participant 01 is .*factor .*; a session goes on only with those"
    ):
        other.take(trial)
    done = RampSchedule(design, DISPLAY, SEED)
    go_on(done, design)
    with pytest.raises(InputError, match="no further trial"):
        done.take(trial)


def test_adaptive_placement_needs_a_range_to_move_in() -> None:
    design = RampDesign(placement=Placement.TARGETED, relative_rates=(0.02,))
    with pytest.raises(InputError, match=r"targeted placement moves between .* got only 0\.02; give two"):
        RampSchedule(design, DISPLAY, SEED)


def test_ramps_of_longer_duration_make_the_same_changes() -> None:
    # Half of 20 % per second over twice the time: the same final luminance for each of the rates.
    design = RampDesign(
        screens=("white",),
        factors=(1.0,),
        ramp_durations=(2.5, 5.0),
        relative_rates=(0.02, 0.2),
        repetitions=1,
    )
    trials = go_on(RampSchedule(design, DISPLAY, SEED), design)
    ends = {
        duration: sorted(
            round(t.final_luminance, 9) for t in trials if t.duration == duration and not t.is_catch
        )
        for duration in (2.5, 5.0)
    }
    assert ends == {2.5: [50.0, 95.0], 5.0: [50.0, 95.0]}
