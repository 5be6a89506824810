"""The margins of the controller's loop: against its characteristic roots, closed forms, and simulation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.controller_tuning import FrameGains, frame_gains, margins, open_loop, stable_slope
from evenlight.method.online.controller import Controller, ControllerSettings, FrameMeasurement

GAIN = st.floats(0.0, 2.0).map(lambda gain: round(gain, 3))
GAINS = st.builds(FrameGains, GAIN, GAIN.map(lambda gain: max(gain, 0.01)), GAIN)


def largest_root(gains: FrameGains, slope: float) -> float:
    """Size of the largest root of z²(z - 1) + s (K_p z (z - 1) + K_i z² + K_d (z - 1)²): 1 + L = 0."""
    polynomial = np.array([1.0, -1.0, 0.0, 0.0])
    for gain, part in (
        (gains.proportional, [1.0, -1.0, 0.0]), (gains.integral, [1.0, 0.0, 0.0]),
        (gains.derivative, [1.0, -2.0, 1.0]),
    ):  # fmt: skip
        polynomial[1:] += slope * gain * np.array(part)
    return float(np.abs(np.roots(polynomial)).max())


@pytest.mark.slow
@given(GAINS)
def test_the_loop_is_stable_just_below_the_stable_slope_and_not_just_above(gains: FrameGains) -> None:
    edge = stable_slope(gains)
    assert largest_root(gains, 0.999 * edge) < 1
    assert largest_root(gains, 1.001 * edge) > 1


@given(GAINS, st.floats(0.05, 0.9))
def test_the_open_loop_is_the_controllers_own(gains: FrameGains, slope: float) -> None:
    """The roots of the characteristic polynomial are where 1 + L(z) = 0."""
    frequency = np.array([0.3, 1.7, math.pi])
    z = np.exp(1j * frequency)
    parts = gains.proportional * z * (z - 1) + gains.integral * z**2 + gains.derivative * (z - 1) ** 2
    np.testing.assert_allclose(open_loop(gains, slope, frequency), slope * parts / (z**2 * (z - 1)))


@pytest.mark.parametrize("kappa", [0.1, 0.5, 1.0, 1.5])
def test_margins_of_an_integral_loop_in_closed_form(kappa: float) -> None:
    # L = κ / (z - 1): a gain of 1 at ω = 2 asin(κ / 2), where its phase is -(90° + ω / 2); 1 / (1 + L) is
    # (z - 1) / (z - 1 + κ), largest at z = -1; L(-1) = -κ / 2.
    found = margins(FrameGains(0.0, 2 * kappa, 0.0), 0.5)
    assert found.gain_margin == pytest.approx(2 / kappa, rel=1e-12)
    assert found.phase_margin == pytest.approx(90 - math.degrees(math.asin(kappa / 2)), abs=1e-6)
    assert found.sensitivity_peak == pytest.approx(2 / (2 - kappa), rel=1e-6)


def test_a_loop_without_a_gain_of_one_has_no_phase_to_lose() -> None:
    found = margins(FrameGains(0.5, 0.0, 0.0), 1.0)
    assert found.phase_margin is None
    assert found.gain_margin == pytest.approx(2.0)
    assert margins(FrameGains(0.0, 0.0, 0.0), 1.0).gain_margin == math.inf
    assert margins(FrameGains(1.5, 0.1, 0.0), 1.0).sensitivity_peak == math.inf  # not stable


@given(GAINS, st.floats(0.05, 0.95))
def test_no_wave_is_amplified_more_than_the_peak_says(gains: FrameGains, share: float) -> None:
    slope = share * stable_slope(gains)
    found = margins(gains, slope)
    waves = np.linspace(1e-3, math.pi, 777)
    amplified = np.abs(1 / (1 + open_loop(gains, slope, waves)))
    assert amplified.max() <= found.sensitivity_peak * (1 + 1e-6)
    assert found.sensitivity_peak >= 1 / (1 - share) - 1e-6  # a loop that near to -1 at half the frame rate


def run(gains: tuple[float, float, float], slopes: list[float], start: float) -> np.ndarray:
    """The controller's own steps on frames whose loss is 0.1 + slope · (0.6 - b): how far b is from 0.6."""
    controller = Controller(ControllerSettings(0.1, *gains, gain_rate=None), lambda _: 1e9)
    state = controller.start(start, FrameMeasurement(0.1 + slopes[0] * (0.6 - start), 50.0, 0.04))
    away = [state.factor - 0.6]
    for slope in slopes[1:]:
        state = controller.step(state, FrameMeasurement(0.1 + slope * (0.6 - state.factor), 50.0, 0.04))
        away.append(state.factor - 0.6)
    return np.abs(away)


@pytest.mark.parametrize("gains", [(0.2, 0.01, 0.05), (0.0, 0.4, 0.0), (0.8, 0.5, 0.0), (0.1, 0.2, 0.6)])
def test_the_controller_rings_above_the_gain_margin_and_settles_below(
    gains: tuple[float, float, float],
) -> None:
    edge = stable_slope(frame_gains(ControllerSettings(0.1, *gains, gain_rate=None), 0.04))
    settling = run(gains, [0.96 * edge] * 400, 0.601)
    ringing = run(gains, [1.04 * edge] * 400, 0.601)
    assert settling[-50:].max() < 0.1 * settling[:50].max()
    assert ringing[-50:].max() > 5 * ringing[5:50].max()


@settings(max_examples=40)
@given(st.lists(st.floats(0.1, 0.95), min_size=30, max_size=60), GAINS)
def test_it_settles_however_the_slope_of_content_changes_below_the_stable_slope(
    shares: list[float], gains: FrameGains
) -> None:
    slopes = [share * stable_slope(gains) for share in shares]
    chosen = (gains.proportional, gains.integral, gains.derivative)
    away = run(chosen, slopes * 40, 0.6001)  # within the bounds whatever it does at first
    slow = gains.integral * 0.1 * stable_slope(gains)  # what the integral part takes back per frame, at least
    if slow * len(slopes) * 40 > 20:
        assert away[-20:].max() < 0.5 * away[:60].max()
    assert away.max() < 0.05


def test_gains_of_a_controller_per_frame() -> None:
    per_frame = frame_gains(ControllerSettings(0.1, 0.2, 0.01, 0.05), 0.2)  # 18 frames of 1/90 s
    assert per_frame == FrameGains(0.2, pytest.approx(0.18), pytest.approx(0.05 / 18))
    assert frame_gains(ControllerSettings(0.1, gain_rate=None), 0.2) == FrameGains(0.2, 0.01, 0.05)
