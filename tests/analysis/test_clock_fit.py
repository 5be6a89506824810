"""Claims about a meter's clock: what it is put on the computer's with, how well, and what is said of it."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from played_power_truth import Conditions, Truth, chosen, play

from evenlight.analysis.played_power.clock_fit import (
    changes_of,
    fit_arrivals,
    fit_clock,
    fit_pings,
)
from evenlight.analysis.played_power.clock_line import ClockLine, ClockWindows, line_of
from evenlight.analysis.played_power.power_recording import Samples
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.played_power import ClockFit, ClockFlag, ClockMethod

CLIP = Conditions(frames=120, sample_rate=400.0)
DEAF = dataclasses.replace(CLIP, has_pings=False, has_flashes=False)


@cache
def truth(conditions: Conditions = CLIP, seed: int = 1) -> Truth:
    return play(conditions, np.random.default_rng(seed))


def changed(known: Truth, **changes: Any) -> ClockFit:
    """The clock of a recording in which something is otherwise."""
    return fit_clock(dataclasses.replace(known.recording, **changes))


def with_sync(known: Truth, level: NDArray[np.bool_]) -> Samples:
    return known.recording.samples._replace(sync=level)


def off(known: Truth, clock: ClockFit) -> float:
    """How far off a clock is at the ends of what was played [s]."""
    played = known.recording.flips.flip[[0, -1]]
    return float(np.abs(known.to_computer(line_of(clock).to_meter(played)) - played).max())


# Pings


def pings_of(line: ClockLine, at: Array, out: Array, back: Array) -> Array:
    computer = line.to_computer(at)
    return np.column_stack([computer - out, at, computer + back])


def test_pings_without_delay_give_the_clock() -> None:
    line, at, no = ClockLine(5.0, 1000.0, 80e-6), np.array([0.0, 10.0, 20.0]), np.zeros(3)
    found = fit_pings(pings_of(line, at, no, no), (0.0, 20.0))
    assert line_of(found).drift == pytest.approx(80e-6, abs=1e-9)
    assert line_of(found).to_computer(5.0) == pytest.approx(1005.0, abs=1e-8)
    assert found.bound == pytest.approx(0.0, abs=1e-7)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(1e-4, 0.05), st.floats(1e-4, 0.05)), min_size=2, max_size=12),
       st.floats(-5e-3, 5e-3))  # fmt: skip
def test_whatever_pings_take_the_clock_is_within_its_bound(
    legs: list[tuple[float, float]], drift: float
) -> None:
    line, at = ClockLine(0.0, 50.0, drift), 10.0 * np.arange(len(legs))
    out, back = np.array(legs).T
    found = fit_pings(pings_of(line, at, out, back), (0.0, float(at[-1])))
    assert found.bound is not None
    assert np.abs(line_of(found).to_computer(at) - line.to_computer(at)).max() <= found.bound + 1e-7


def test_slow_pings_do_not_bear_on_the_clock() -> None:
    rng = np.random.default_rng(0)
    line, at = ClockLine(0.0, 50.0, 50e-6), np.linspace(0, 60, 20)
    out, back = rng.uniform(0, 0.002, (2, 20))
    out[::2] += 0.5
    back[::2] += 0.5
    quick = fit_pings(pings_of(line, at, out, back)[1::2], (0.0, 60.0))
    every = fit_pings(pings_of(line, at, out, back), (0.0, 60.0))
    assert line_of(every).to_computer(at) == pytest.approx(line_of(quick).to_computer(at), abs=1e-7)


def test_a_ping_that_contradicts_the_others_is_left_out_and_counted() -> None:
    line, at, leg = ClockLine(0.0, 50.0, 50e-6), np.linspace(0, 60, 10), np.full(10, 0.001)
    pings = pings_of(line, at, leg, leg)
    pings[4, 1] += 0.3  # its clock cannot have been that late
    found = fit_pings(pings, (0.0, 60.0))
    assert (found.n_used, found.n_rejected, found.flags) == (9, 1, ())
    assert line_of(found).drift == pytest.approx(50e-6, abs=1e-6)


def test_a_clock_that_bends_is_flagged_and_its_bound_reaches_the_bend() -> None:
    """0.2 s off in the middle of a minute, with pings of 1 ms."""
    at, leg = np.linspace(0, 60, 13), np.full(13, 0.0005)
    bent = 50 + at + 0.2 * np.sin(np.pi * at / 60)
    found = fit_pings(np.column_stack([bent - leg, at, bent + leg]), (0.0, 60.0))
    assert ClockFlag.NOT_LINEAR in found.flags
    assert found.bound is not None
    assert found.bound >= np.abs(line_of(found).to_computer(at) - bent).max() - 1e-6


def test_one_ping_gives_the_offset_and_no_drift() -> None:
    found = fit_pings(np.array([[100.0, 7.0, 100.004]]), (7.0, 7.0))
    assert line_of(found).to_computer(7.0) == pytest.approx(100.002)
    assert line_of(found).drift == 0
    assert found.bound == pytest.approx(0.002, abs=1e-6)
    assert found.flags == (ClockFlag.OFFSET_ONLY,)


def test_the_centre_of_lines_through_windows_is_one_of_them() -> None:
    rng = np.random.default_rng(4)
    at = np.sort(rng.uniform(0, 30, 200))
    low = at + 3 - rng.uniform(0, 0.01, 200)
    windows = ClockWindows(at, low, low + 0.01)
    middle = windows.centre((0.0, 30.0)).to_computer(at)
    assert (middle >= low - 1e-7).all()
    assert (middle <= low + 0.01 + 1e-7).all()


# Edges


def test_edges_come_first_and_tell_drift_and_offset() -> None:
    clock = fit_clock(truth().recording)
    assert (clock.method, clock.flags) == (ClockMethod.EDGES, ())
    assert clock.bound is not None
    assert off(truth(), clock) < clock.bound < 1 / 400 / 2
    assert clock.n_used > 0.95 * 359


def test_without_edges_pings_are_used_and_it_is_said() -> None:
    clock = changed(truth(), samples=with_sync(truth(), np.zeros_like(truth().recording.samples.sync)))
    assert (clock.method, clock.flags) == (ClockMethod.PINGS, (ClockFlag.NO_EDGES,))


def test_edges_missing_for_a_whole_pass_are_bridged_and_it_is_said() -> None:
    flips, samples = truth().recording.flips, truth().recording.samples
    begun, ended = flips.flip[flips.pass_index == 1][[0, -1]]
    seen = truth().to_computer(samples.device_time)
    level = np.where((seen > begun) & (seen < ended), False, samples.sync)
    clock = changed(truth(), samples=with_sync(truth(), level))
    assert clock.method is ClockMethod.EDGES
    assert ClockFlag.EDGES_MISSING in clock.flags
    assert off(truth(), clock) < 0.001


@pytest.mark.parametrize("share", [0.02, 0.2])
def test_extra_and_missing_edges_do_not_move_the_clock(share: float) -> None:
    """Glitches: a sample of the other level makes two edges, or takes one away and puts it elsewhere."""
    rng = np.random.default_rng(2)
    level = truth().recording.samples.sync.copy()
    hit = rng.choice(len(level), int(share * 360), replace=False)
    level[hit] = ~level[hit]
    clock = changed(truth(), samples=with_sync(truth(), level))
    assert clock.method is ClockMethod.EDGES
    assert clock.n_rejected > 0
    assert off(truth(), clock) < 0.001


def test_an_inverted_input_is_turned_over_and_it_is_said() -> None:
    known = truth(dataclasses.replace(CLIP, inverted=True))
    clock = fit_clock(known.recording)
    assert clock.flags == (ClockFlag.INVERTED,)
    assert off(known, clock) < 0.001


def test_edges_alone_find_their_frames_by_the_pauses_between_passes() -> None:
    known = truth(DEAF)
    clock = fit_clock(known.recording)
    assert (clock.method, clock.flags) == (ClockMethod.EDGES, ())
    assert off(known, clock) < 0.001


def test_a_single_pass_and_nothing_but_edges_is_ambiguous_and_it_is_said() -> None:
    """A frame earlier and upside down, all but one edge fit as well."""
    clock = fit_clock(truth(dataclasses.replace(DEAF, passes=("ours",))).recording)
    assert ClockFlag.AMBIGUOUS in clock.flags


def test_a_level_that_has_nothing_to_do_with_frames_is_not_believed() -> None:
    rng = np.random.default_rng(3)
    noise = np.repeat(rng.random(len(truth().recording.samples.sync) // 29 + 1) < 0.5, 29)
    clock = changed(truth(), samples=with_sync(truth(), noise[: len(truth().recording.samples.sync)]))
    assert clock.method is ClockMethod.PINGS
    assert clock.flags == (ClockFlag.EDGES_UNUSABLE,)


def test_a_meter_slower_than_frames_goes_by_pings() -> None:
    """20 Hz: three frames from one sample to the next."""
    clock = fit_clock(truth(dataclasses.replace(CLIP, sample_rate=20.0)).recording)
    assert (clock.method, clock.flags) == (ClockMethod.PINGS, (ClockFlag.SAMPLED_TOO_SLOWLY,))


def test_pings_that_contradict_the_edges_are_named() -> None:
    """A tenth of a second, six frames: edges lie on their flips, and not where the pings have them."""
    pings = truth().recording.pings.copy()
    pings[:, 1] += 0.1
    clock = changed(truth(), pings=pings)
    assert clock.flags == (ClockFlag.DISAGREES,)
    assert off(truth(), clock) < 0.001


def test_flips_with_errors_of_their_own_still_give_the_clock() -> None:
    """2 ms of jitter in what the driver says: no line is between all samples, the weighted one is taken."""
    flips = truth().recording.flips
    rng = np.random.default_rng(5)
    late = flips._replace(flip=flips.flip + rng.uniform(-0.001, 0.001, len(flips.flip)))
    clock = changed(truth(), flips=late)
    assert clock.method is ClockMethod.EDGES
    assert off(truth(), clock) < 0.0015


def test_changes_are_flips_that_change_the_level() -> None:
    flips = truth(dataclasses.replace(CLIP, frames_per_second=24.0)).recording.flips
    changes = changes_of(flips)
    assert len(changes.time) == len(set(zip(flips.pass_index, flips.video_frame, strict=True))) - 1
    assert (changes.level[1:] != changes.level[:-1]).all()


# Flash markers


def test_flash_markers_before_and_after_give_offset_and_drift() -> None:
    known = truth(dataclasses.replace(CLIP, has_sync=False, has_pings=False))
    clock = fit_clock(known.recording)
    assert (clock.method, clock.flags, clock.n_used) == (ClockMethod.FLASHES, (), 12)
    assert clock.drift_ppm == pytest.approx(50.0, abs=10.0)
    assert off(known, clock) < 1e-4


def test_a_single_marker_gives_the_offset_and_it_is_said() -> None:
    known = truth(dataclasses.replace(CLIP, has_sync=False, has_pings=False))
    clock = changed(known, flashes=known.recording.flashes[:6])
    assert (clock.n_used, clock.flags) == (6, (ClockFlag.OFFSET_ONLY,))
    assert off(known, clock) < 0.003


def test_a_panel_whose_power_does_not_follow_gives_no_marker() -> None:
    """Pixels dim, the backlight does not: what is left is the arrival of the samples."""
    known = truth(dataclasses.replace(CLIP, has_sync=False, has_pings=False))
    rng = np.random.default_rng(6)
    samples = known.recording.samples
    flat = samples._replace(power=1 + 0.01 * rng.normal(size=len(samples.power)))
    clock = changed(known, samples=flat)
    assert clock.method is ClockMethod.ARRIVALS
    assert clock.flags == (ClockFlag.FLASHES_NOT_FOUND, ClockFlag.UNKNOWN_LATENCY)
    assert clock.bound is None


# Without any of them


def test_samples_that_carry_the_computers_time_are_taken_at_their_word() -> None:
    known = truth(dataclasses.replace(DEAF, has_sync=False))
    samples = known.recording.samples
    own = samples._replace(device_time=known.to_computer(samples.device_time))
    clock = changed(known, samples=own)
    assert (clock.method, clock.offset, clock.drift_ppm) == (ClockMethod.COMPUTER_TIME, 0.0, 0.0)
    assert clock.flags == (ClockFlag.UNKNOWN_LATENCY,)


def test_arrivals_are_never_early_and_the_soonest_decide() -> None:
    """Delays of 1 ms and more: the clock is late by that least delay, which nobody can tell."""
    known = truth(dataclasses.replace(DEAF, has_sync=False))
    clock = fit_clock(known.recording)
    assert clock.method is ClockMethod.ARRIVALS
    assert off(known, clock) == pytest.approx(0.001, abs=0.0005)


def test_a_few_samples_have_a_line_below_their_arrivals() -> None:
    """By hand: delays 3, 1, 2, 1.5 s at 0, 1, 2, 3 s; under 1.5 s lies the edge from 1 to 3 s."""
    time = np.array([0.0, 1.0, 2.0, 3.0])
    delays = np.array([3.0, 1.0, 2.0, 1.5])
    samples = Samples(np.arange(4), time, time + delays, np.ones(4), np.zeros(4, dtype=bool))
    line = line_of(fit_arrivals(samples))
    assert line.drift == pytest.approx(0.25)
    assert line.to_computer([1.0, 3.0]).tolist() == pytest.approx([2.0, 4.5])


def test_samples_chosen_at_random_keep_their_order() -> None:
    rows = np.array([0, 2, 3])
    assert chosen(truth().arrived, rows).sequence.tolist() == truth().arrived.sequence[rows].tolist()
