"""Claims about which readings of a sweep contradict the others. All luminances are made by hand."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Mapping

import numpy as np
import pytest

from evenlight.method.suspect_readings import (
    LUMINANCE_TOLERANCE,
    POWER_TOLERANCE,
    Suspicion,
    suspect_readings,
)

VALUES = np.arange(17) / 16
TRUE = 0.1 + 100 * VALUES**2.2
DARK = float("nan")


def judged(wrong: Mapping[tuple[int, int], float], true: np.ndarray = TRUE, repeats: int = 3) -> Suspicion:
    """Judge readings of 17 levels that scatter by 0.1 % and 0.001, with wrong ones by repeat and level."""
    rng = np.random.default_rng(5)
    read = true * (1 + 0.001 * rng.standard_normal((repeats, 17))) + 0.001 * rng.standard_normal(
        (repeats, 17)
    )
    for place, value in wrong.items():
        read[place] = value
    return suspect_readings(read.ravel(), np.tile(VALUES, repeats), LUMINANCE_TOLERANCE)


def places(mask: np.ndarray) -> set[tuple[int, int]]:
    return {(int(place) // 17, int(place) % 17) for place in np.flatnonzero(mask)}


@pytest.mark.parametrize(
    "wrong",
    [
        {(1, 13): 7.25},  # of 63.4
        {(0, 16): 55.0},  # white; the levels from 0.75 on lie above
        {(2, 0): 63.4},  # black that reads bright
        {(2, 0): 0.15},  # black by half too bright: 0.05, and 0.02 is tolerated
        {(1, 8): DARK},  # "too dark for the meter", of 22
        {(0, 8): 19.0},  # between its neighbours, which are 16.3 and 28
        {(0, 13): 7.25, (1, 13): 12.0},  # two of three, and the third fits between its neighbours
        {(0, 13): 7.25, (1, 13): 7.25},  # two that agree, far from where their level can be
        {(0, 3): 9.0, (2, 3): 0.001, (1, 15): 1.0, (2, 10): 99.0},
        dict.fromkeys([(0, 2), (1, 5), (2, 7), (0, 9), (1, 14), (2, 16)], 500.0),
    ],
)
def test_wrong_readings_are_told_and_no_other(wrong: dict[tuple[int, int], float]) -> None:
    found = judged(wrong)
    assert places(found.left_out) == set(wrong)
    assert not found.out_of_order.any()


def test_what_is_tolerated_of_any_meter_is_no_suspicion() -> None:
    assert not judged({(1, 13): TRUE[13] * 1.015, (0, 0): 0.115}).left_out.any()


def test_the_same_reading_again_is_no_suspicion_where_no_difference_is_tolerated() -> None:
    # A panel off draws 0 W, of which no share can be tolerated.
    read = np.tile([0.0, 1 / 3, 2 / 3], 10)
    assert not suspect_readings(read, read, POWER_TOLERANCE).left_out.any()


def test_readings_of_a_level_none_of_which_agree_are_all_left_out() -> None:
    # White as 70, 85 and 100, and its neighbour as 66, 66, 66: any of them may be right.
    below = np.minimum(TRUE, 66.0)
    assert places(judged({(0, 16): 70.0, (1, 16): 85.0, (2, 16): 100.0}, below).left_out) == {
        (0, 16),
        (1, 16),
        (2, 16),
    }


def test_readings_that_agree_are_believed_whatever_the_neighbours_say() -> None:
    # A display that limits the current of a white screen: 90 % of its next level, in every repeat.
    limited = TRUE.copy()
    limited[16] = 0.9 * limited[15]
    found = judged({}, limited)
    assert not found.left_out.any()
    assert found.out_of_order.any()
    assert {level for _, level in places(found.out_of_order)} <= {15, 16}


def test_the_only_reading_of_a_level_is_told_by_its_neighbours() -> None:
    assert places(judged({(0, 13): 7.25}, repeats=1).left_out) == {(0, 13)}
    assert not judged({(0, 13): 60.0}, repeats=1).left_out.any()


def test_black_under_range_is_none_and_one_value_among_it_is_wrong() -> None:
    dark = {(repeat, level): DARK for repeat in range(3) for level in range(2)}
    assert not judged(dark).left_out.any()
    assert places(judged({**dark, (1, 0): 5.0}).left_out) == {(1, 0)}


def test_rounding_is_no_contradiction() -> None:
    # A meter whose last digit is 0.1, at a black of 0.1 with noise of 0.06.
    rng = np.random.default_rng(2)
    for _ in range(50):
        read = np.round(TRUE + 0.06 * rng.standard_normal((3, 17)), 1)
        found = suspect_readings(read.ravel(), np.tile(VALUES, 3), LUMINANCE_TOLERANCE)
        assert not found.left_out.any()


@pytest.mark.parametrize("share", [-0.3, 0.5])
def test_what_all_levels_do_alike_is_no_contradiction(share: float) -> None:
    # From 30 % below, or 50 % above, to warm within the sweep.
    warmth = 1 + share * np.exp(-np.arange(51) / 25)
    read = np.tile(TRUE, 3) * warmth
    order = np.concatenate([17 * k + np.random.default_rng(k).permutation(17) for k in range(3)])
    levels = np.tile(VALUES, 3)[order]
    read = np.tile(TRUE, 3)[order] * warmth
    assert not suspect_readings(read, levels, LUMINANCE_TOLERANCE).left_out.any()
    read[30] *= 1.1
    assert np.flatnonzero(suspect_readings(read, levels, LUMINANCE_TOLERANCE).left_out).tolist() == [30]


@pytest.mark.parametrize(("n_levels", "repeats"), [(256, 3), (256, 5), (51, 5)])
def test_a_bad_reading_of_a_table_in_ascending_order_takes_no_other_with_it(
    n_levels: int, repeats: int
) -> None:
    levels = np.tile(np.linspace(0, 1, n_levels), repeats)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        read = (0.2 + 99.8 * levels**2.2) * (1 + 0.005 * rng.standard_normal(levels.size))
        wrong = int(rng.integers(levels.size // 5, levels.size))
        read[wrong] *= 3
        found = suspect_readings(read, levels, LUMINANCE_TOLERANCE).left_out
        assert np.flatnonzero(found).tolist() == [wrong]


@pytest.mark.real_time
@pytest.mark.parametrize("repeats", [1, 1000])
def test_20_000_readings_take_little_time_and_memory(repeats: int) -> None:
    # Of each with each, one array alone would have 3 GB.
    levels = np.tile(np.linspace(0, 1, 20_000 // repeats), repeats)
    read = (0.2 + 99.8 * levels**2.2) * (1 + 0.005 * np.random.default_rng(1).standard_normal(levels.size))
    read[9_990] *= 5
    tracemalloc.start()
    begun = time.process_time()
    found = suspect_readings(read, levels, LUMINANCE_TOLERANCE)
    seconds, (_, most) = time.process_time() - begun, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert np.flatnonzero(found.left_out).tolist() == [9_990]
    assert most < 200e6
    assert seconds < 2.0


def test_powers_of_a_milliwatt_are_judged_as_those_of_a_watt() -> None:
    factors = np.tile(np.arange(1, 11) / 10, 3)
    for unit in (1.0, 1e-3):
        read = unit * (0.3 + 0.4 * factors) * (1 + 0.001 * np.random.default_rng(1).standard_normal(30))
        assert not suspect_readings(read, factors, POWER_TOLERANCE).left_out.any()
        read[14] *= 1.05
        assert np.flatnonzero(suspect_readings(read, factors, POWER_TOLERANCE).left_out).tolist() == [14]


def test_two_readings_of_which_either_may_be_wrong_are_both_left_out() -> None:
    # As the first two of a sweep may be: black as 10, white as 1.
    assert suspect_readings([10.0, 1.0], [0.0, 1.0], LUMINANCE_TOLERANCE).left_out.all()
    assert suspect_readings([10.0, 1.0], [1.0, 1.0], LUMINANCE_TOLERANCE).left_out.all()


def test_nothing_that_was_read_is_nothing_to_suspect() -> None:
    assert not suspect_readings([], [], LUMINANCE_TOLERANCE).left_out.size
    assert not suspect_readings([DARK, DARK], [0.0, 1.0], LUMINANCE_TOLERANCE).left_out.any()
    assert not suspect_readings([0.0, 0.0], [0.0, 1.0], LUMINANCE_TOLERANCE).left_out.any()
