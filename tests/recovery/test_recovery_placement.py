"""Recovery by each task and placement: 200 simulated participants, from schedule to fitted threshold.

Each has two levels, so that a bias has a standard error of 0.7 to 1.2 %, and a coverage of 95 % one of
1.1 %: a true bias of 0 passes the 2 % nearly always, one of 4 % hardly ever. Seeds are fixed, so that a test
says the same every time. Larger studies stand in docs/decisions/placement.md.
"""

import functools

import numpy as np
import pytest
from recovered_thresholds import MODES, Recovery, recover

PARTICIPANTS = 200
SEED = 2024
RAMPS = {
    "paper (yes/no, constant)": 48,  # as in the preset
    "yes/no, targeted": 40,  # as in the preset
    "two intervals, constant": 96,
    "two intervals, targeted": 64,
    "two intervals, psi-marginal": 64,
}


@functools.cache
def recovered(name: str) -> Recovery:
    return recover(MODES[name], RAMPS[name], PARTICIPANTS, SEED)


@pytest.mark.parametrize("name", RAMPS)
def test_the_threshold_is_off_by_less_than_two_percent_on_average(name: str) -> None:
    assert abs(recovered(name).bias) < 0.02


@pytest.mark.parametrize("name", RAMPS)
def test_the_95_percent_interval_covers_the_truth_in_92_to_98_percent(name: str) -> None:
    assert 0.92 <= recovered(name).coverage <= 0.98


@pytest.mark.parametrize("name", RAMPS)
def test_the_stated_standard_error_is_no_less_than_the_error_that_is_made(name: str) -> None:
    # Where few trials say little about the width, the prior makes the stated one larger: up to a third.
    stated = float(np.sqrt(np.mean(recovered(name).stated ** 2)))
    assert 0.9 < stated / recovered(name).scatter < 1.35


def test_adaptive_placement_needs_fewer_trials_for_the_same_precision() -> None:
    assert RAMPS["yes/no, targeted"] < RAMPS["paper (yes/no, constant)"]
    assert recovered("yes/no, targeted").scatter < recovered("paper (yes/no, constant)").scatter
    assert RAMPS["two intervals, targeted"] < RAMPS["two intervals, constant"]
    assert recovered("two intervals, targeted").scatter < recovered("two intervals, constant").scatter
