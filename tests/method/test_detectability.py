"""d' of a track: accumulated over windows, each a ramp of the calibration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.method.detectability import detectability, function_of, window_ratios
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import PsychometricFunction, d_prime, yes_probability

GUESS = float(stats.norm.cdf(-1.0))  # z = -1
KNOWN = RateLimit(
    "lab", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0), procedure=Procedure.YES_NO,
    ramp_duration=5.0, width=1.6, guess_rate=GUESS, lapse_rate=0.0,
)  # fmt: skip


def test_a_steady_ramp_at_the_limit_has_the_d_prime_of_the_threshold() -> None:
    # z(0.75) - z(false alarms) in yes/no; sqrt(2) z(0.75) of two intervals.
    yes_no = PsychometricFunction(1.0, 1.6, GUESS)
    assert float(d_prime(1.0, yes_no)) == pytest.approx(0.6744898 + 1.0, abs=1e-6)
    assert float(d_prime(0.0, yes_no)) == pytest.approx(0.0, abs=1e-12)
    two = PsychometricFunction(1.0, 1.6, 0.5)
    assert float(d_prime(1.0, two, two_intervals=True)) == pytest.approx(0.954, abs=1e-3)
    assert np.isfinite(d_prime(1e12, replace(two, width=0.01), two_intervals=True))


def test_who_lapses_has_the_d_prime_of_who_looks() -> None:
    # F is (0.75 - g) / (1 - g - l) at the threshold; without lapses psi is g + (1 - g) F there.
    rise = (0.75 - 0.1) / (1 - 0.1 - 0.05)
    expected = stats.norm.ppf(0.1 + 0.9 * rise) - stats.norm.ppf(0.1)
    assert float(d_prime(1.0, PsychometricFunction(1.0, 1.6, 0.1, 0.05))) == pytest.approx(expected)


def test_windows_are_ramps_by_where_they_get_to() -> None:
    rising = np.full(100, 0.5)  # 0.1 s each: two windows of 5 s
    np.testing.assert_allclose(window_ratios(rising, np.full(100, 0.1), 5.0), [0.5, 0.5])
    there_and_back = np.tile([0.8, -0.8], 50)
    np.testing.assert_allclose(window_ratios(there_and_back, np.full(100, 0.1), 5.0), 0.0, atol=1e-12)
    # 7.4 s are one window, 7.6 s two of 3.8 s; a frame may last longer than a window.
    assert len(window_ratios(np.ones(74), np.full(74, 0.1), 5.0)) == 1
    assert len(window_ratios(np.ones(76), np.full(76, 0.1), 5.0)) == 2
    np.testing.assert_allclose(window_ratios(np.array([0.3]), np.array([20.0]), 5.0), 0.3)


def test_four_ramps_at_the_limit_are_twice_as_detectable_as_one() -> None:
    one = detectability(KNOWN, np.ones(50), np.full(50, 0.1))
    four = detectability(KNOWN, np.ones(200), np.full(200, 0.1))
    assert one is not None
    assert four is not None
    assert (one[1], four[1]) == (1, 4)  # windows
    assert one[0] == pytest.approx(0.6744898 + 1.0, abs=1e-6)  # d'
    assert four[0] == pytest.approx(2 * one[0])
    assert four[2] == pytest.approx(4 * 0.75)  # windows noticed
    nothing = detectability(KNOWN, np.zeros(200), np.full(200, 0.1))
    assert nothing is not None
    assert nothing[0] == pytest.approx(0.0, abs=1e-12)
    assert nothing[2] == pytest.approx(4 * GUESS)  # false alarms


def test_an_ideal_watcher_of_simulated_evidence_does_as_d_prime_says() -> None:
    # Each window leaves evidence of mean d' and standard deviation 1; "yes" is evidence above the criterion.
    observer = SimulatedObserver(load_rate_limit("surace2025"), 1.0, {}, 1.6, GUESS, 0.0)
    function = replace(observer.function_at(40.0), threshold=1.0)
    assert function == function_of(KNOWN)
    ratios = np.array([0.0, 0.3, 0.6, 0.9, 0.4])
    found = detectability(KNOWN, np.repeat(ratios, 50), np.full(250, 0.1))
    assert found is not None
    of_track, _, noticed = found
    rng, n = np.random.default_rng(5), 40_000
    mean = d_prime(ratios, function)
    track, still = mean + rng.standard_normal((n, 5)), rng.standard_normal((n, 5))
    reported = (track > 1.0).sum(axis=1)  # the criterion is -z(guess rate) = 1
    assert reported.mean() == pytest.approx(noticed, abs=4 * reported.std() / n**0.5)
    np.testing.assert_allclose((track > 1.0).mean(axis=0), yes_probability(ratios, function), atol=0.01)
    right = (track @ mean > still @ mean).mean()  # which of two films changed?
    assert right == pytest.approx(stats.norm.cdf(of_track / 2**0.5), abs=0.01)


def test_of_two_intervals_no_criterion_is_known() -> None:
    two = replace(KNOWN, procedure=Procedure.TWO_INTERVAL, guess_rate=0.5)
    found = detectability(two, np.ones(50), np.full(50, 0.1))
    assert found is not None
    assert found[0] == pytest.approx(0.954, abs=1e-3)
    assert found[2] is None


def test_the_published_limit_does_not_tell() -> None:
    # The paper prints thresholds, but no slope and no false alarms.
    assert detectability(load_rate_limit("surace2025"), np.ones(9), np.ones(9)) is None
    assert detectability(replace(KNOWN, ramp_duration=None), np.ones(9), np.ones(9)) is None
