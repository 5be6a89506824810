"""Simulate, fit, recover: a small case of each study; `make studies` has the others, and more data sets.

Bounds on shares are those that a true level of 5 %, or coverage of 95 %, passes in 9999 of 10 000 studies.
"""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from inference_levels import populations, rates
from interval_gaps import GAPS, THRESHOLD_D, sensitivities
from joint_recovery import Study, recovered
from made_searches import SearchTruth
from made_sweeps import WARM, Meter, luminance_readings, power_readings
from played_power_truth import Conditions, chosen, play, times_of
from recovered_thresholds import MODES, recover
from saving_coverage import CASES, coverage
from scipy import stats
from search_level import PAIRS, study

from evenlight.analysis.played_power.clock_fit import fit_clock
from evenlight.analysis.played_power.clock_line import line_of
from evenlight.analysis.played_power.pass_power import frame_energies
from evenlight.analysis.played_power.power_recording import samples_once
from evenlight.analysis.sweeps.display_fit import fit_gamma
from evenlight.analysis.sweeps.luminance_sweep import middle_of, pixel_levels
from evenlight.analysis.sweeps.power_fit import fit_line, points_of
from evenlight.data_schema.recordings.ramp import IntervalGap, RampDesign
from evenlight.data_schema.recordings.sweep import LuminanceSweepDesign, PowerSweepDesign
from evenlight.experiments.ramp.ramp_observer import ObserverPopulation
from evenlight.hardware.simulated.panel import PanelPhysics

SETS = 20
ROOT = Path(__file__).parents[2]


def most(sets: int) -> float:
    """Largest share of errors that a true one of 5 % gives."""
    return float(stats.binom.ppf(1 - 1e-4, sets, 0.05)) / sets


def energies(recording):
    """Measured energies of frames, and when these began and ended."""
    line = line_of(fit_clock(recording))
    frames = frame_energies(recording.samples, recording.flips, recording.log.refresh_rate, line)
    return np.array([frame.energy for frame in frames], dtype=float), *times_of(frames)


@pytest.mark.parametrize("content", ["ramps", "cuts"])
def test_energies_of_frames_are_within_one_percent_and_samples_that_came_twice_change_nothing(
    content: str,
) -> None:
    """50 ppm of drift, 1 % of the samples lost, 5 ms of jitter; 1000 Hz, frames of 16.7 ms."""
    truth = play(Conditions(frames=150, content=content, duplicated=0.0), np.random.default_rng(0))
    energy, begun, ended = energies(truth.recording)
    true = truth.energy(ended) - truth.energy(begun)
    assert np.abs(energy / true - 1).max() < 0.01
    assert energy.sum() == pytest.approx(true.sum(), rel=1e-4)
    doubled = np.repeat(np.arange(len(truth.arrived.power)), 2)
    once, duplicated = samples_once(chosen(truth.arrived, doubled), "power.csv")
    assert duplicated == len(truth.arrived.power)
    assert np.array_equal(energies(dataclasses.replace(truth.recording, samples=once))[0], energy)


def test_a_steady_gap_leaves_a_change_at_threshold_there_and_its_steps_tell_nothing() -> None:
    (steady,) = (gap for gap in GAPS if gap.kind is IntervalGap.STEADY)
    trials = 400
    found, by_steps = sensitivities(steady, trials)
    # Of d' = sqrt(2) z(p): sqrt(2 p (1 - p) / n) / φ(z), at 0.75 and at chance
    error, error_at_chance = (
        np.sqrt(2 * p * (1 - p) / trials) / stats.norm.pdf(stats.norm.ppf(p)) for p in (0.75, 0.5)
    )
    assert found == pytest.approx(THRESHOLD_D, abs=3 * error)
    assert by_steps < 3 * error_at_chance


@pytest.mark.parametrize("task", ["comparison", "rating"])
def test_primary_tests_err_in_5_percent_and_their_intervals_hold_the_truth(task: str) -> None:
    """`rates` also fails where the report prints other numbers than were counted."""
    without, some, *_ = populations([task], 1 / 9)
    assert without.effect == 0 != some.effect
    for population in (without, some):
        for question, found in rates(population, 8, SETS).items():
            assert found.held >= 1 - most(SETS), question
            assert found.contradictions == 0
            assert population is some or not found.rejected > most(SETS), question


def test_an_effect_is_found() -> None:
    """Else a test that never rejects would pass."""
    (_, some, _) = populations(["comparison"])
    assert rates(some, 17, SETS)["all"].rejected > 0.25  # 0.65 ± 0.08 of 1000 sets


def test_a_joint_curve_is_that_of_the_people_drawn() -> None:
    """Of 48 ramps with constant rates a threshold is known to 19 %, six people have one at five levels."""
    design = RampDesign(screens=("white",))
    found = recovered(Study(design, "broken line", 6, ObserverPopulation(width_median=1.6)), 500)
    assert abs(found.own_errors.mean()) < 3 * 0.19 / np.sqrt(6 * 5)
    assert np.mean(found.pointwise) > 0.5


@pytest.mark.parametrize(("mode", "ramps"), [("two intervals, targeted", 64), ("yes/no, targeted", 40)])
def test_thresholds_are_recovered_and_their_errors_are_those_that_are_stated(mode: str, ramps: int) -> None:
    found = recover(MODES[mode], ramps, 25, 2024)
    assert abs(found.bias) < 0.02 + 3 * found.bias_error
    assert found.coverage >= 1 - most(found.covered.size)
    # 50 errors tell their scatter to a tenth; the prior makes the stated one larger, by up to a third
    assert 0.7 < np.sqrt(np.mean(found.stated**2)) / found.scatter < 1.7


def test_the_interval_of_a_saving_holds_the_truth_and_a_lag_that_counts_biases_it() -> None:
    held, width, bias = coverage(CASES["saving 20 %"], 100, 3)
    assert held >= 1 - most(100)
    assert width / 2 < 0.02
    assert abs(bias) < 0.003
    assert coverage(CASES["lag 5 s, not settled"], 100, 5)[2] < -0.004


def test_the_hazard_ratio_keeps_its_level_if_people_differ() -> None:
    rejected, held = study(SearchTruth(version_sd=0.8, locations=12, middle=8.0), PAIRS[:1], SETS)[PAIRS[0]]
    assert rejected <= most(SETS)
    assert held >= 1 - most(SETS)


@pytest.mark.parametrize(
    ("black", "reflected", "lowest"),
    [(0.2, 0.0, 0.0), (0.0, 1.0, 0.0), (0.1, 0.0, 0.3)],
    ids=["as usual", "no light but the reflected one", "too dark for the meter"],
)
def test_a_sweep_recovers_gamma_peak_and_black(black: float, reflected: float, lowest: float) -> None:
    rng = np.random.default_rng(20_263)
    physics = dataclasses.replace(WARM, gamma=2.4, black_level=black, reflected_luminance=reflected)
    for _ in range(5):
        readings = luminance_readings(physics, rng, LuminanceSweepDesign(factors=()), Meter(lowest=lowest))
        fit = fit_gamma(pixel_levels(readings, reflected), reflected, middle_of(readings))
        assert fit.gamma == pytest.approx(2.4, abs=0.01)
        assert fit.peak_luminance == pytest.approx(physics.peak_luminance, rel=0.005)
        assert fit.black_level == pytest.approx(black, abs=0.02)
        assert fit.is_gamma


def power_line(physics: PanelPhysics, seed: int):
    readings = power_readings(physics, np.random.default_rng(seed), PowerSweepDesign(warm_up=0.0), Meter())
    luminance = [r.luminance or 0.0 for r in readings]
    return fit_line(points_of(luminance, [r.power for r in readings], [r.factor for r in readings]))


def test_a_power_line_holds_the_truth_in_its_intervals() -> None:
    fits = [power_line(WARM, seed) for seed in range(40)]
    for truth, ends in ((WARM.base_power, "base_power_interval"),
                        (WARM.power_per_luminance, "power_per_luminance_interval")):  # fmt: skip
        low, high = np.transpose([getattr(fit, ends) for fit in fits])
        assert np.mean((low <= truth) & (truth <= high)) >= 1 - most(40)
    assert all(fit.is_linear for fit in fits)


def test_the_bend_of_a_panel_that_droops_is_a_quarter_of_its_droop() -> None:
    # Light l takes l + droop (l² - l): a quadratic whose chord from 0.1 to 1 is droop · 0.9²/4 above its
    # middle, over an added power of 0.9 + droop (1 - 0.01 - 0.9) = 0.9 + 0.09 droop.
    droop = 0.2
    fit = power_line(dataclasses.replace(WARM, peak_luminance=500.0, droop=droop), 5)
    assert fit.bend == pytest.approx(-droop * 0.9**2 / 4 / (0.9 + 0.09 * droop), abs=0.003)
    assert fit.bend_p is not None
    assert fit.bend_p < 1e-6
    assert not fit.is_linear


def test_studies_are_scripts_that_need_nothing_of_the_tests() -> None:
    companions = {path.stem for path in (ROOT / "tests" / "companions").iterdir()}
    for path in (ROOT / "benchmarks" / "studies").glob("*.py"):
        imports = [line for line in path.read_text().splitlines() if line.startswith(("from ", "import "))]
        assert not companions & {line.split()[1] for line in imports}, path.name
