"""When frames appear: uniform grids are recovered from rounded time stamps, other times are kept."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.stimuli.video.video_source import frame_times, rate_from_number, uniform_times

MILLISECOND = Fraction(1, 1000)
rates = st.sampled_from(
    [Fraction(24000, 1001), Fraction(25), Fraction(30000, 1001), Fraction(60), Fraction(25, 2)]
)


@given(rate=rates, frames=st.integers(2, 400), offset=st.integers(-5000, 5000))
def test_time_stamps_in_milliseconds_become_the_exact_grid(rate, frames, offset):
    stamps = [offset + round(k * 1000 / rate) for k in range(frames)]
    found = frame_times(stamps, MILLISECOND, rates=[rate])
    np.testing.assert_allclose(found.times, [float(k / rate) for k in range(frames)], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.durations, float(1 / rate), rtol=1e-12)


@pytest.mark.slow
@given(rate=rates, frames=st.integers(1200, 3000))
def test_a_long_grid_is_recovered_without_a_claimed_rate(rate, frames):
    # After 1200 frames, 24 and 24000/1001 Hz are 50 ms apart: only one of them explains the stamps.
    found = frame_times([round(k * 1000 / rate) for k in range(frames)], MILLISECOND)
    assert found.times[-1] == pytest.approx(float((frames - 1) / rate), abs=1e-12)


def test_truncated_time_stamps_count_as_rounded_ones():
    stamps = [int(k * 1000 * 1001 / 30000) for k in range(100)]
    found = frame_times(stamps, MILLISECOND, rates=[Fraction(30000, 1001)])
    assert found.times[99] == pytest.approx(99 * 1001 / 30000, abs=1e-12)


def test_a_wrong_claim_is_not_believed():
    found = frame_times(range(0, 4000, 40), MILLISECOND, rates=[Fraction(30)])
    assert found.times[99] == pytest.approx(3.96, abs=1e-12)


def test_varying_steps_are_kept_and_the_last_frame_lasts_as_its_packet_says():
    found = frame_times([100, 140, 240, 260], MILLISECOND, last=70, rates=[Fraction(25)])
    np.testing.assert_allclose(found.times, [0, 0.04, 0.14, 0.16])
    np.testing.assert_allclose(found.durations, [0.04, 0.1, 0.02, 0.07])


def test_a_last_frame_of_unknown_duration_lasts_as_long_as_the_median():
    found = frame_times([0, 10, 110, 140], MILLISECOND)
    assert found.durations[-1] == pytest.approx(0.03)  # the median of 10, 100 and 30 ms


def test_a_coarse_tick_does_not_turn_varying_steps_into_a_grid():
    # 0, 1, 3 ticks lie within half a tick of the grid 0, 1.5, 3, but they are two different steps.
    found = frame_times([0, 1, 3], Fraction(1, 25))
    np.testing.assert_allclose(found.times, [0, 0.04, 0.12])


def test_frames_at_the_same_time_are_marked_as_unseen_but_the_last_of_them():
    found = frame_times([0, 40, 40, 120], MILLISECOND, last=40)
    np.testing.assert_allclose(found.durations, [0.04, 0, 0.08, 0.04])
    assert found.shown == 3


@given(
    steps=st.lists(st.integers(0, 500), min_size=1, max_size=50).filter(any),
    shuffle=st.randoms(use_true_random=False),
)
def test_times_start_at_zero_never_fall_and_durations_fill_them(steps, shuffle):
    stamps = np.concatenate([[7], 7 + np.cumsum(steps)]).tolist()
    shuffle.shuffle(stamps)
    found = frame_times(stamps, MILLISECOND)
    assert found.times[0] == 0
    assert (np.diff(found.times) >= 0).all()
    np.testing.assert_allclose(found.times[:-1] + found.durations[:-1], found.times[1:], atol=1e-12)
    assert found.durations[-1] > 0


@pytest.mark.parametrize(
    ("last", "claimed", "expected"), [(200, [Fraction(10)], 0.2), (0, [Fraction(10)], 0.1), (0, [], 0.04)]
)
def test_a_single_frame_lasts_as_its_packet_or_the_rate_says(last, claimed, expected):
    assert frame_times([5], MILLISECOND, last, claimed).durations.tolist() == [pytest.approx(expected)]


def test_uniform_times_do_not_drift():
    times = uniform_times(10**6, Fraction(30000, 1001)).times
    assert times[999_999] == 999_999 * 1001 / 30000


def test_times_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        uniform_times(3, Fraction(25)).times[0] = 1


@pytest.mark.parametrize(
    ("number", "ratio"),
    [(29.97, (30000, 1001)), (23.976, (24000, 1001)), (59.94, (60000, 1001)), (12.5, (25, 2)), (24, (24, 1))],
)
def test_broadcast_rates_are_meant_as_ratios_over_1001(number, ratio):
    assert rate_from_number(number) == Fraction(*ratio)


@pytest.mark.parametrize("number", [0, -1, float("nan"), float("inf"), 1e-9, 1e9])
def test_impossible_rates_are_refused(number):
    with pytest.raises(ValueError, match="need a frame rate from"):
        rate_from_number(number)
