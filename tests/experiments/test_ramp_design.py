"""The design of a ramp session: levels, conditions, blocks, passes, and what a display allows."""

import dataclasses
import itertools
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import Direction, Placement, Procedure, RampDesign
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.chance import williams_row
from evenlight.experiments.design_files import design_names, load_design, load_task_design
from evenlight.experiments.ramp.ramp_plan import ramp_conditions, ramp_levels, session_plan, trial_count
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.method.preset_files import load_display

DISPLAY = Display("bench", 100.0, 0.5, 2.0, 60.0)
TWO = RampDesign(procedure=Procedure.TWO_INTERVAL, repetitions=5)
SECONDS_PER_TRIAL = 9.0  # 1 before, 5 of ramp, 1 of hold, 1.5 to answer, 0.5 of pause


def plan(design: RampDesign, seed: int = 1, order_index: int = 0) -> tuple[PlannedTrial, ...]:
    return session_plan(design, DISPLAY, seed, order_index)


def cell(slot: PlannedTrial) -> tuple[object, ...]:
    return slot.level, slot.condition, slot.rate_index


def test_dimming_scales_the_black_level_too_and_reflected_light_not() -> None:
    # Gray 0.5, gamma 2: I = 0.25 · 99.5 + 0.5 = 25.375; b = 0.4 makes 10.15, and 3 are reflected.
    lit = Display("lit", 100.0, 0.5, 2.0, 60.0, reflected_luminance=3.0)
    design = RampDesign(factors=(0.4,), gray_pixel_value=0.5)
    white, gray = ramp_levels(design, lit)
    assert (white.screen, gray.screen) == ("white", "gray")
    assert white.luminance == pytest.approx(0.4 * 100 + 3)
    assert gray.luminance == pytest.approx(10.15 + 3)
    assert (white.pixel_value, gray.pixel_value) == (1.0, 0.5)


def test_a_design_of_one_screen_has_no_levels_of_the_other() -> None:
    assert {level.screen for level in ramp_levels(RampDesign(screens=("gray",)), DISPLAY)} == {"gray"}


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 12])
def test_each_block_stands_at_each_place_and_follows_each_other_block_equally_often(n: int) -> None:
    rows = [williams_row(n, row) for row in range(n if n % 2 == 0 else 2 * n)]
    times = len(rows) // n
    assert all(sorted(row) == list(range(n)) for row in rows)
    places = Counter((place, which) for row in rows for place, which in enumerate(row))
    assert set(places.values()) == {times}
    assert len(places) == n * n
    pairs = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert set(pairs.values()) == {times}
    assert len(pairs) == n * (n - 1)


def test_blocks_are_conditions_in_the_participants_row_of_the_square() -> None:
    design = RampDesign(
        screens=("white", "gray"), directions=(Direction.DOWN,), ramp_durations=(5.0, 8.0), repetitions=1
    )
    conditions = ramp_conditions(design)
    for order_index in range(6):
        slots = plan(design, order_index=order_index)
        blocks = [next(slot.condition for slot in slots if slot.block == block) for block in (1, 2, 3, 4)]
        assert blocks == [conditions[which] for which in williams_row(4, order_index)]
        assert [slot.block for slot in slots] == sorted(slot.block for slot in slots)
        assert len({(slot.block, slot.condition) for slot in slots}) == 4


@settings(max_examples=25)
@given(
    st.integers(0, 1000), st.integers(1, 4), st.floats(0.0, 0.5), st.sampled_from([(1.0,), (0.2, 0.6, 1.0)])
)
def test_every_ramp_comes_as_often_as_the_design_says(
    seed: int, repetitions: int, catch_share: float, factors: tuple[float, ...]
) -> None:
    design = RampDesign(factors=factors, repetitions=repetitions, catch_share=catch_share)
    slots = plan(design, seed)
    ramps = Counter(cell(slot) for slot in slots if not slot.is_catch)
    assert set(ramps.values()) == {repetitions}
    assert len(ramps) == 2 * len(factors) * len(design.relative_rates)
    assert (sum(ramps.values()), len(slots) - sum(ramps.values())) == trial_count(design)


def test_within_a_block_every_ramp_comes_once_before_any_comes_twice() -> None:
    ramps = [slot for slot in plan(RampDesign()) if not slot.is_catch and slot.block == 1]
    cells = 5 * 8
    for start in range(0, len(ramps), cells):
        assert len({cell(slot) for slot in ramps[start : start + cells]}) == cells


def test_adaptive_placement_visits_every_level_in_turn() -> None:
    design = RampDesign(placement=Placement.TARGETED, trials_per_level=20)
    ramps = [slot for slot in plan(design) if not slot.is_catch and slot.block == 2]
    assert Counter(slot.level for slot in ramps) == dict.fromkeys({slot.level for slot in ramps}, 20)
    # Two repetitions of five levels make a pass of ten.
    for start in range(0, len(ramps), 10):
        assert set(Counter(slot.level for slot in ramps[start : start + 10]).values()) == {2}


def test_catch_trials_have_their_share_and_are_spread_over_levels_and_time() -> None:
    slots = plan(RampDesign(catch_share=0.23))
    catches = Counter(slot.level for slot in slots if slot.is_catch)
    assert sum(catches.values()) / len(slots) == pytest.approx(0.23, abs=1 / len(slots))
    assert len(catches) == 10
    assert max(catches.values()) - min(catches.values()) <= 1
    # Every sixth of a block, a pass of 40 ramps, has its sixth of the catch trials, or one more or less.
    block = [slot.is_catch for slot in slots if slot.block == 1]
    ramps_before = np.cumsum(~np.array(block))
    for number in range(6):
        within = [c for c, n in zip(block, ramps_before, strict=True) if 40 * number < n < 40 * (number + 1)]
        assert abs(sum(within) - sum(block) / 6) <= 3


def test_two_intervals_hold_the_ramp_equally_often_at_every_rate_and_need_no_catch_trials() -> None:
    slots = plan(TWO)
    assert not any(slot.is_catch for slot in slots)
    for which in {cell(slot) for slot in slots}:
        intervals = [slot.ramp_interval for slot in slots if cell(slot) == which]
        assert sorted(Counter(intervals).values()) == [2, 3]  # five ramps: as even as it goes
    everywhere = Counter(slot.ramp_interval for slot in slots)
    # Which of the two has the odd one is chance: 80 of these; four standard deviations are 18.
    assert abs(everywhere[1] - everywhere[2]) <= 36
    assert all(slot.ramp_interval is None for slot in plan(RampDesign()))


def test_the_order_is_random_but_the_seeds_and_the_participants_own() -> None:
    design = RampDesign()
    assert plan(design, 1) == plan(design, 1)
    assert plan(design, 1) != plan(design, 2)
    white = [[cell(s) for s in plan(design, 1, k) if s.condition.screen == "white"] for k in (0, 1)]
    assert white[0] != white[1]


def test_the_default_session_lasts_at_most_ninety_minutes_without_its_breaks() -> None:
    assert sum(trial_count(RampDesign())) * SECONDS_PER_TRIAL <= 90 * 60


def test_the_paper_preset_shows_and_asks_what_the_record_does_unchanged() -> None:
    """Manifests without the newer keys are read with the record's defaults: sessions as they were then."""
    care = {"practice_trials": 6, "practice_correct": 0, "minutes_between_breaks": 0.0}
    assert dataclasses.replace(load_design("paper"), **care) == RampDesign()  # type: ignore[arg-type]
    assert load_task_design("ramp", None) == load_design("paper")


@pytest.mark.parametrize("name", design_names())
def test_every_preset_can_be_shown_on_the_papers_display(name: str) -> None:
    schedule = RampSchedule(load_design(name), load_display("varjo-xr3"), seed=1)
    assert schedule.n_trials == sum(trial_count(load_design(name)))
    assert schedule.next_trial() is not None


def test_an_unknown_design_is_named_with_what_there_is() -> None:
    with pytest.raises(InputError, match=r"recomended: no such design; did you mean 'recommended'\? give a"):
        load_design("recomended")


UP = RampDesign(
    procedure=Procedure.TWO_INTERVAL,
    factors=(0.5,),
    screens=("white",),
    directions=(Direction.UP, Direction.DOWN),
    relative_rates=(0.02, 0.1),
)


def test_up_and_down_set_out_from_the_same_luminance_and_end_as_far_from_it() -> None:
    # 50 cd/m² and 10 % per second for 5 s: 75 and 25.
    schedule = RampSchedule(dataclasses.replace(UP, relative_rates=(0.1,), repetitions=1), DISPLAY, seed=3)
    ends = {}
    for which in (0, 1):
        ramp = RampSchedule(
            dataclasses.replace(UP, relative_rates=(0.1,), repetitions=1), DISPLAY, seed=3, order_index=which
        ).next_trial()
        assert ramp is not None
        assert ramp.level.luminance == pytest.approx(50.0)
        ends[ramp.direction] = ramp.final_luminance
    assert ends == {Direction.UP: pytest.approx(75.0), Direction.DOWN: pytest.approx(25.0)}
    assert schedule.n_trials == 2


@pytest.mark.parametrize(
    ("design", "display", "actuator", "words"),
    [
        # 100 cd/m² rising by 2 % per second for 5 s: nothing is brighter than white.
        (
            dataclasses.replace(UP, factors=(1.0,)),
            DISPLAY,
            Actuator.PIXELS,
            r"brightest that 'bench' reaches",
        ),
        # Reflected light stays: 20 + 60, less 60 % of it, would be 32.
        (
            RampDesign(factors=(0.2,)),
            Display("sunny", 100.0, 0.5, 2.0, 60.0, reflected_luminance=60.0),
            Actuator.BACKLIGHT,
            r"beyond 60 cd/m\^2, the darkest that 'sunny' reaches",
        ),
        # Pixels cannot get below black: 0.2 · 7.9 = 1.58, less 60 %, is 0.63 cd/m².
        (
            RampDesign(factors=(0.2,), gray_pixel_value=0.2),
            Display("grayish", 100.0, 4.0, 2.0, 60.0),
            Actuator.PIXELS,
            r"beyond 4 cd/m\^2, the darkest that 'grayish' reaches by its pixels",
        ),
    ],
)
def test_a_ramp_that_the_display_would_cut_off_is_refused(
    design: RampDesign, display: Display, actuator: Actuator, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        RampSchedule(design, display, seed=1, actuator=actuator)


def test_a_backlight_gets_darker_than_black_pixels() -> None:
    design = RampDesign(factors=(0.2,), gray_pixel_value=0.2)
    display = Display("grayish", 100.0, 4.0, 2.0, 60.0)
    assert RampSchedule(design, display, seed=1, actuator=Actuator.BACKLIGHT).next_trial() is not None
    with pytest.raises(InputError, match="by its backlight"):
        RampSchedule(design, display, seed=1, actuator=Actuator.BACKLIGHT, smallest_factor=0.1)
