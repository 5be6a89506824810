"""Claims about energies of frames: how near they come to a simulated truth, and what they need for that."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from played_power_truth import Conditions, Truth, chosen, play, times_of

from evenlight.analysis.played_power.clock_fit import fit_clock
from evenlight.analysis.played_power.clock_line import ClockLine, line_of
from evenlight.analysis.played_power.pass_power import frame_energies
from evenlight.analysis.played_power.power_recording import samples_once
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.played_power import LEFT_OUT, ClockFit, ClockMethod
from evenlight.hardware.simulated.panel import SimulatedPanel

FEW = range(4)
MANY = range(20)
BAD_CLOCK = Conditions(frames=150)  # 50 ppm, 1 % lost, 5 ms jitter: three passes of 2.5 s each


def measured(truth: Truth) -> tuple[ClockFit, Array, Array]:
    """The clock, and measured and true energies of the frames."""
    recording = truth.recording
    clock = fit_clock(recording)
    frames = frame_energies(recording.samples, recording.flips, recording.log.refresh_rate, line_of(clock))
    assert all(frame.flag not in LEFT_OUT for frame in frames)
    energy = np.array([frame.energy for frame in frames], dtype=float)
    begun, ended = times_of(frames)
    return clock, energy, truth.energy(ended) - truth.energy(begun)


@cache
def errors(conditions: Conditions, seeds: range = FEW) -> tuple[Array, Array, Array]:
    """Relative errors of all frames, of each run's frames together, and which frames are not at a cut."""
    single, whole, calm = [], [], []
    for seed in seeds:
        _, energy, true = measured(play(conditions, np.random.default_rng(seed)))
        single.append(np.abs(energy / true - 1))
        whole.append(abs(energy.sum() / true.sum() - 1))
        steps = np.abs(np.diff(np.log(true), prepend=np.log(true[0]), append=np.log(true[-1])))
        calm.append(np.maximum(steps[:-1], steps[1:]) < 0.02)
        calm[-1][np.arange(0, len(true), conditions.frames)] = False  # it was dark before
        calm[-1][np.arange(conditions.frames - 1, len(true), conditions.frames)] = False
    return np.concatenate(single), np.array(whole), np.concatenate(calm)


def test_the_truth_is_the_integral_of_the_simulated_panels_power() -> None:
    truth = play(dataclasses.replace(BAD_CLOCK, frames=20), np.random.default_rng(1))
    time = [0.0]
    panel = SimulatedPanel(Conditions().physics, lambda: time[0])
    flips = truth.recording.flips
    changes = sorted(
        [(mark.time, mark.factor) for mark in truth.recording.flashes]
        + list(zip(flips.flip.tolist(), flips.achieved_factor.tolist(), strict=True))
    )
    for when, factor in changes:
        time[0] = when
        panel.set_backlight(factor)
    begun, ended = flips.flip[5], flips.flip[9]
    moments = np.linspace(begun, ended, 20001)
    power = np.array([panel.power(moment) for moment in moments])
    by_quadrature = float(np.trapezoid(power, moments))
    assert float(truth.energy(ended) - truth.energy(begun)) == pytest.approx(by_quadrature, rel=1e-6)


@pytest.mark.parametrize("content", ["ramps", "cuts"])
def test_every_frame_is_within_one_percent_by_edges(content: str) -> None:
    """The target: 50 ppm of drift, 1 % of the samples lost, 5 ms of jitter; 1000 Hz, frames of 16.7 ms."""
    single, whole, _ = errors(dataclasses.replace(BAD_CLOCK, content=content), MANY)
    assert single.max() < 0.01
    assert whole.max() < 1e-4


@pytest.mark.parametrize("content", ["ramps", "cuts"])
def test_at_500_hz_all_but_a_few_frames_in_a_thousand_are(content: str) -> None:
    """Those that miss begin where power steps up from dark, or have lost the sample in which it did."""
    single, whole, calm = errors(dataclasses.replace(BAD_CLOCK, sample_rate=500.0, content=content))
    assert single[calm].max() < 0.01
    assert np.mean(single > 0.01) < 0.005
    assert single.max() < 0.03
    assert whole.max() < 1e-4


def test_with_a_meter_of_1_mw_noise_and_1000_hz_every_frame_is_still_within_one_percent() -> None:
    """1 mW / 0.32 W in the mean of 16.7 samples has a standard deviation of 0.08 %."""
    single, _, _ = errors(dataclasses.replace(BAD_CLOCK, noise=0.001))
    assert single.max() < 0.01


def test_with_a_meter_of_5_mw_noise_95_percent_of_the_frames_are() -> None:
    single, whole, _ = errors(dataclasses.replace(BAD_CLOCK, sample_rate=500.0, noise=0.005))
    assert np.quantile(single, 0.95) < 0.01
    assert whole.max() < 1e-3


def test_100_hz_tell_the_whole_clip_and_every_frame_that_is_not_at_a_cut() -> None:
    """Two samples to a frame cannot tell where in a sample the power stepped: single frames there miss."""
    single, whole, calm = errors(dataclasses.replace(BAD_CLOCK, sample_rate=100.0))
    assert single.max() > 0.05
    assert single[calm].max() < 0.01
    assert calm.mean() > 0.9
    assert whole.max() < 0.001


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_pings_alone_tell_the_whole_clip_and_every_frame_that_is_not_at_a_cut(rate: float) -> None:
    """With 5 ms of jitter they leave the clock open by some ms, which is a fifth of a frame."""
    single, whole, calm = errors(dataclasses.replace(BAD_CLOCK, sample_rate=rate, has_sync=False))
    assert single[calm].max() < 0.01
    assert whole.max() < 0.001


def test_without_synchronisation_frames_are_far_off() -> None:
    """The test above can fail: samples taken as evenly spaced from the first arrival, each as an instant."""
    worst, share = [], []
    for seed in range(5):
        truth = play(BAD_CLOCK, np.random.default_rng(seed))
        samples = truth.recording.samples
        begun, ended = times_of(frame_energies(samples, truth.recording.flips, 60.0, ClockLine(0.0, 0.0)))
        times = samples.received[0] + np.arange(len(samples.power)) / 1000.0
        steps = np.diff(times) * (samples.power[1:] + samples.power[:-1]) / 2
        energy = np.concatenate([[0.0], np.cumsum(steps)])
        guess = np.interp(ended, times, energy) - np.interp(begun, times, energy)
        true = truth.energy(ended) - truth.energy(begun)
        worst.append(np.abs(guess / true - 1).max())
        share.append(np.mean(np.abs(guess / true - 1) > 0.01))
    assert min(worst) > 0.3
    assert np.mean(share) > 0.03


CLOCKS = {
    ClockMethod.EDGES: {},
    ClockMethod.PINGS: {"has_sync": False},
    ClockMethod.FLASHES: {"has_sync": False, "has_pings": False},
}


@pytest.mark.parametrize("method", CLOCKS, ids=lambda method: method.value)
@pytest.mark.parametrize("drift_ppm", [50.0, -3000.0])
def test_a_clock_is_never_farther_off_than_it_says(method: ClockMethod, drift_ppm: float) -> None:
    """3000 ppm: a microcontroller without a crystal."""
    conditions = dataclasses.replace(
        BAD_CLOCK, sample_rate=200.0, drift_ppm=drift_ppm, content="cuts", **CLOCKS[method]
    )
    for seed in range(5):
        truth = play(conditions, np.random.default_rng(seed))
        clock = fit_clock(truth.recording)
        assert clock.method is method
        played = truth.recording.flips.flip[[0, -1]]
        device = line_of(clock).to_meter(played)
        assert clock.bound is not None
        assert np.abs(truth.to_computer(device) - played).max() < clock.bound


def test_the_drift_is_recovered_by_edges() -> None:
    """To a third of a sample over the 9 s played at most, where flips and samples keep step: 40 ppm."""
    for seed in range(5):
        truth = play(BAD_CLOCK, np.random.default_rng(seed))
        assert fit_clock(truth.recording).drift_ppm == pytest.approx(50.0, abs=40.0)


def test_a_step_inside_a_sample_costs_a_quarter_of_its_time_at_most() -> None:
    """Without lag: from 0.32 to 1.69 W at most, a step of 4.3 times the power of the darker frame."""
    instant = dataclasses.replace(Conditions().physics, lag=1e-5)
    for rate in (500.0, 2000.0):
        conditions = dataclasses.replace(BAD_CLOCK, sample_rate=rate, physics=instant, lost=0.0)
        clock = max(
            fit_clock(play(conditions, np.random.default_rng(seed)).recording).bound for seed in range(6)
        )
        single, _, _ = errors(conditions, range(4))
        assert single.max() < 4.3 * (0.25 / rate + clock) * 60


def test_samples_that_came_twice_change_nothing() -> None:
    truth = play(dataclasses.replace(BAD_CLOCK, duplicated=0.0), np.random.default_rng(3))
    doubled = np.repeat(np.arange(len(truth.arrived.power)), 2)
    once, duplicated = samples_once(chosen(truth.arrived, doubled), "power.csv")
    assert duplicated == len(truth.arrived.power)
    twice = dataclasses.replace(truth.recording, samples=once)
    assert np.array_equal(measured(dataclasses.replace(truth, recording=twice))[1], measured(truth)[1])
