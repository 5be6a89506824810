"""Claims about lost and duplicated samples: counted by sequence number, used once, bridged and said."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.analysis.played_power.power_recording import (
    Samples,
    count_samples,
    energy_knots,
    samples_once,
)
from evenlight.data_schema.errors import InputError


def samples(
    sequence: list[int], power: list[float] | None = None, times: list[float] | None = None
) -> Samples:
    """Samples a second apart by their count, unless their times are given."""
    time = np.array(sequence if times is None else times, dtype=float)
    watts = np.ones(len(sequence)) if power is None else np.array(power)
    return Samples(np.array(sequence), time, time + 0.01, watts, np.zeros(len(sequence), dtype=bool))


def test_lost_and_repeated_samples_are_counted_by_sequence_number() -> None:
    """3 and 7, 8 are missing; 5 comes twice: of 9 s, 3 were bridged, the longest gap 2 s."""
    once, again = samples_once(samples([1, 2, 4, 5, 5, 6, 9, 10]), "power.csv")
    count = count_samples(once, again)
    assert (count.n_samples, count.n_lost, count.n_duplicated) == (7, 3, 1)
    assert count.duration == 9
    assert count.bridged_share == pytest.approx(3 / 9)
    assert count.longest_gap == pytest.approx(2.0)


def test_a_sample_that_comes_again_later_is_used_once() -> None:
    once, again = samples_once(samples([1, 2, 3, 1, 2, 4]), "power.csv")
    assert once.sequence.tolist() == [1, 2, 3, 4]
    assert again == 2


@given(st.lists(st.floats(0.1, 2.0), min_size=2, max_size=30))
def test_without_losses_energy_at_the_end_of_a_sample_is_the_sum_of_means_times_intervals(
    power: list[float],
) -> None:
    knots = energy_knots(samples(list(range(len(power))), power))
    assert knots.energy.tolist() == pytest.approx([sum(power[1 : k + 1]) for k in range(len(power))])


@given(st.lists(st.integers(1, 4), min_size=2, max_size=30), st.floats(0.1, 2.0))
def test_constant_power_gives_power_times_duration_whatever_is_lost(steps: list[int], power: float) -> None:
    sequence = np.cumsum(steps).tolist()
    knots = energy_knots(samples(sequence, [power] * len(sequence)))
    assert knots.energy[-1] == pytest.approx(power * (sequence[-1] - sequence[0]))
    assert np.all(np.diff(knots.times) > 0)


def test_a_meter_that_pauses_without_counting_has_a_gap_too() -> None:
    """Its sample after 10 s is a mean over one interval, not over ten."""
    once = samples([1, 2, 3, 4, 5], times=[1.0, 2.0, 3.0, 13.0, 14.0])
    count = count_samples(once, 0)
    assert count.n_lost == 0
    assert count.longest_gap == pytest.approx(9.0)


@pytest.mark.parametrize(
    ("sequence", "power", "times", "words"),
    [
        ([5, 6, 1, 2], None, None, "line 4: sequence 1 comes after higher ones and is no repetition"),
        ([5, 6, 6], [1.0, 2.0, 3.0], None, "line 4: sequence 6 is there twice, with another content"),
        ([1, 2, 3], None, [1.0, 3.0, 2.0], "line 4: device_time_s 2.000000 is not after 3.000000"),
        ([1, 2, 3], None, [1.0, 2.0, 2.0], "line 4: device_time_s 2.000000 is not after 2.000000"),
        ([1, 1, 2, 3], None, [1.0, 1.0, 2.0, 1.5], "line 5: device_time_s 1.500000 is not after 2.000000"),
        ([1], None, None, r"holds 1 sample\(s\)"),
    ],
)
def test_what_cannot_be_one_measurement_is_refused_with_its_line(
    sequence: list[int], power: list[float] | None, times: list[float] | None, words: str
) -> None:
    with pytest.raises(InputError, match=f"power.csv.*{words}"):
        samples_once(samples(sequence, power, times), "power.csv")
