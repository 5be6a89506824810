"""Claims about drift and warm-up."""

import numpy as np
import pytest

from evenlight.analysis.sweeps.repeated_readings import (
    Noise,
    Repeats,
    change_at_the_end,
    late_change,
)

NOISE = Noise(floor=0.0, share=0.002, freedom=34)


def same(value: float, n: int = 3) -> Repeats:
    return Repeats(np.full(n, value), np.zeros(n))


def warm_up(change: float, time: float, minutes: int) -> Repeats:
    """White every minute: a panel that is off by `change` when cold, and by 1/e of it after `time` [s]."""
    times = 60.0 * np.arange(minutes + 1)
    return Repeats(200 * (1 + change * np.exp(-times / time)), times)


def test_the_change_at_the_end_has_the_interval_of_two_means() -> None:
    change = change_at_the_end([(same(100.0), same(102.0))], NOISE)
    assert change.share == pytest.approx(0.02)
    # 0.2 % · sqrt(1/3 + 1/3) · t(0.975, 34) = 0.2 % · 0.8165 · 2.032
    assert change.interval is not None
    assert np.ptp(change.interval) / 2 == pytest.approx(0.002 * 0.8165 * 2.032, rel=1e-3)
    assert change.is_large


def test_levels_are_pooled_by_how_well_they_are_known() -> None:
    # Six repeats against three: weights 1/(1/6 + 1/3) and 1/(2/3), as 2 to 1.5.
    change = change_at_the_end([(same(100.0, 6), same(101.0)), (same(50.0), same(50.0))], NOISE)
    assert change.share == pytest.approx(0.01 * 2 / 3.5)
    assert not change.is_large


def test_nothing_repeated_is_no_drift_of_zero() -> None:
    assert change_at_the_end([], NOISE).share is None
    assert change_at_the_end([(same(1.0), Repeats(np.empty(0), np.empty(0)))], NOISE).share is None


def test_a_long_warm_up_ends_steady_and_a_short_one_does_not() -> None:
    # -6 % with 400 s: over the last third of 30 minutes it changes by 6 % (e^-3 - e^-4.5) = 0.23 %, over
    # that of 10 minutes by 6 % (e^-1 - e^-1.5) = 0.87 % in 200 s, 2.6 % in ten minutes.
    long, short = late_change(warm_up(-0.06, 400.0, 30), NOISE), late_change(warm_up(-0.06, 400.0, 10), NOISE)
    assert long.share == pytest.approx(0.0023, abs=0.0005)
    assert not long.is_large
    assert not long.is_vague
    assert short.share == pytest.approx(0.026, abs=0.003)
    assert short.is_large


def test_a_warm_up_of_few_readings_leaves_it_open() -> None:
    few = late_change(warm_up(-0.06, 400.0, 3), NOISE)
    assert few.share is None
    assert few.is_vague
    brief = Repeats(np.full(6, 200.0), np.arange(6.0))  # six readings in as many seconds
    assert late_change(brief, NOISE).is_vague
