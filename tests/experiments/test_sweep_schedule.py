"""The order of a sweep's readings."""

from collections import Counter

import pytest

from evenlight.data_schema.recordings.sweep import LuminanceSweepDesign, PowerSweepDesign, SweepPhase
from evenlight.experiments.sweeps.sweep_readings import planned_readings

DESIGN = LuminanceSweepDesign(
    pixel_values=(0.0, 0.25, 0.5, 1.0),
    factors=(0.5, 1.0),
    repeats=4,
    warm_up=100.0,
    warm_up_interval=40.0,
    drift_pixel_values=(1.0,),
)


def of_phase(readings, phase):
    return [reading for reading in readings if reading.phase is phase]


def test_every_level_is_read_as_often_as_the_design_says():
    swept = of_phase(planned_readings(DESIGN, seed=3), SweepPhase.SWEEP)
    assert set(Counter(reading.level for reading in swept).values()) == {4}
    assert len(swept) == 4 * (4 + 2)
    assert len(of_phase(planned_readings(DESIGN, seed=3), SweepPhase.DRIFT)) == 4


def test_each_repeat_has_an_order_of_its_own():
    swept = of_phase(planned_readings(DESIGN, seed=3), SweepPhase.SWEEP)
    orders = {tuple(reading.level for reading in swept if reading.repeat == repeat) for repeat in range(1, 5)}
    assert len(orders) > 1
    assert all(len(set(order)) == 6 for order in orders)  # every level once in each


def test_the_order_is_that_of_the_seed():
    assert planned_readings(DESIGN, seed=3) == planned_readings(DESIGN, seed=3)
    assert planned_readings(DESIGN, seed=3) != planned_readings(DESIGN, seed=4)


def test_the_warm_up_is_read_at_its_beginning_every_interval_and_at_its_end():
    warm = of_phase(planned_readings(DESIGN, seed=3), SweepPhase.WARM_UP)
    assert [reading.due for reading in warm] == [0.0, 40.0, 80.0, 100.0]
    assert {reading.level.pixel_value for reading in warm} == {1.0}


@pytest.mark.parametrize("design", [LuminanceSweepDesign(warm_up=0.0), PowerSweepDesign(warm_up=0.0)])
def test_a_sweep_without_warm_up_begins_with_one_bright_reading(design):
    first = planned_readings(design, seed=3)[0]
    assert (first.phase, first.level.pixel_value, first.due) == (SweepPhase.WARM_UP, 1.0, 0.0)
    assert len(of_phase(planned_readings(design, seed=3), SweepPhase.WARM_UP)) == 1


def test_what_no_device_makes_is_left_out():
    swept = of_phase(planned_readings(DESIGN, seed=3, with_factors=False), SweepPhase.SWEEP)
    assert {reading.level.factor for reading in swept} == {None}


def test_indices_count_through():
    readings = planned_readings(DESIGN, seed=3)
    assert [reading.index for reading in readings] == list(range(len(readings)))


def test_a_reading_that_is_typed_in_is_asked_for_twice_while_the_panel_warms_up() -> None:
    """At the beginning, and at the end: nobody types one every half minute."""
    every = of_phase(planned_readings(DESIGN, seed=3), SweepPhase.WARM_UP)
    by_hand = of_phase(planned_readings(DESIGN, seed=3, by_hand=True), SweepPhase.WARM_UP)
    assert len(every) > 3
    assert [reading.due for reading in by_hand] == [every[0].due, every[-1].due]
