"""Tuned gains: margins of the loop, and what the benchmark of the online controller measures."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.controller_tuning import (
    AS_GOOD,
    FrameGains,
    MarginRequirements,
    TuningResult,
    content_slopes,
    frame_gains,
    margins,
    open_loop,
    rms_error,
    stable_slope,
    tune,
)
from benchmarks.online_content import bound_content, extreme_content, step_content
from benchmarks.online_walk import (
    TARGET,
    WalkFrames,
    _bound_overshoot,
    _direct,
    _extreme_ratio,
    _step_overshoot,
    sd_ratio,
)
from benchmarks.tune_gains import TuningReport, main
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings, FrameMeasurement
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.method.rate_limit import (
    allowed_rate,
    largest_rate_ratio,
    modulation_rate,
    rate_limit_at,
    scalar_rate_limit,
)

LIMIT = scalar_rate_limit(load_rate_limit("surace2025"))

CONTROLLER = Controller(ControllerSettings(0.08), LIMIT)


@pytest.fixture(scope="module")
def rooms(make_curves: Callable[..., LossCurves]) -> LossCurves:
    """A walk of 24 s through rooms of much and little contrast to lose, at 5 Hz, with a bend in the loss."""
    times = np.arange(120) / 5
    strength = 0.2 + 0.05 * np.sin(times / 4) + 0.02 * np.sign(np.sin(times / 2.5))
    return make_curves(strength, exponent=1.5, luminance=40 - 15 * np.sin(times / 4), frames_per_second=5.0)


def error_of(curves: LossCurves, settings: ControllerSettings) -> float:
    return rms_error(control_curves(curves, replace(CONTROLLER, settings=settings)))


@pytest.fixture(scope="module")
def tuned(rooms: LossCurves) -> TuningResult:
    return tune(rooms, CONTROLLER)


def test_they_keep_their_margins_and_come_nearer_to_the_target(
    rooms: LossCurves, tuned: TuningResult
) -> None:
    kept = margins(frame_gains(tuned.settings, 0.2), tuned.slope)
    assert kept.gain_margin >= 2 - 1e-9
    assert kept.phase_margin is None or kept.phase_margin >= 45
    assert kept.gain_margin == pytest.approx(tuned.margins.gain_margin, rel=1e-9)
    assert error_of(rooms, tuned.settings) < 0.95 * error_of(rooms, CONTROLLER.settings)
    assert tuned.slope == pytest.approx(np.quantile(content_slopes(rooms, 0.08, 0.2), 0.99))


def test_nobody_who_guesses_gains_within_the_margins_does_better(
    rooms: LossCurves, tuned: TuningResult
) -> None:
    rng, tried, reached = np.random.default_rng(5), 0, error_of(rooms, tuned.settings)
    frames = 90.0 / 5
    for _ in range(60):
        shares = rng.dirichlet([1, 1, 1]) * rng.uniform(0, 0.5) / tuned.slope
        guess = replace(
            CONTROLLER.settings, proportional=shares[0], integral=2 * shares[1] / frames,
            derivative=shares[2] / 2 * frames,
        )  # fmt: skip
        left = margins(frame_gains(guess, 0.2), tuned.slope).phase_margin
        if left is None or left >= 45:
            tried += 1
            assert reached <= AS_GOOD * error_of(rooms, guess) * 1.01
    assert tried > 30


def test_margins_are_kept_where_the_content_asks_for_less(rooms: LossCurves) -> None:
    """Without a rate limit, the boldest gains follow best: each margin is what holds them."""
    unlimited = replace(CONTROLLER, rate_limit=lambda _: 1e9)
    gain, phase = (
        tune(rooms, unlimited, demands).margins
        for demands in (
            MarginRequirements(gain_margin=2.0, phase_margin=0.0),
            MarginRequirements(1.2, phase_margin=80.0),
        )
    )
    assert gain.phase_margin is not None
    assert gain.phase_margin < 80
    assert gain.gain_margin == pytest.approx(2, rel=0.1)
    assert phase.phase_margin is None or phase.phase_margin >= 80


def test_slopes_are_the_steepest_secants_from_the_factor_of_the_target(rooms: LossCurves) -> None:
    found = content_slopes(rooms, 0.08, 0.2)
    rest = factor_at_loss(rooms, np.full(120, 0.08))
    loss = loss_and_slope(rooms, rest)[0]
    for i in range(0, 120, 23):
        secants = [
            (rooms.loss[i, k] - loss[i]) / (rest[i] - b)
            for k, b in enumerate(rooms.factors)
            if abs(rest[i] - b) > 1e-6
        ]
        assert found[i] == pytest.approx(max(secants), rel=1e-9)


def test_content_that_loses_nothing_is_no_trouble(make_curves: Callable[..., LossCurves]) -> None:
    dull = make_curves(np.zeros(20))
    tuned = tune(dull, CONTROLLER)
    assert tuned.margins.gain_margin >= 2 - 1e-9
    assert np.isfinite(error_of(dull, tuned.settings))


def test_gains_that_count_frames_stay_such(rooms: LossCurves, tuned: TuningResult) -> None:
    """They are found per frame: those of a rate do the same."""
    counted = tune(rooms, replace(CONTROLLER, settings=replace(CONTROLLER.settings, gain_rate=None)))
    assert counted.settings.gain_rate is None
    assert error_of(rooms, counted.settings) == pytest.approx(error_of(rooms, tuned.settings), rel=1e-9)


# --- stability margins

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


# --- tune gains


def test_gains_are_tuned_and_targets_tried(make_curves, tmp_path, capsys) -> None:
    times = np.arange(60) / 5
    curves = make_curves(0.2 + 0.05 * np.sin(times), luminance=40 - 15 * np.sin(times), frames_per_second=5.0)
    write_loss_curves(tmp_path / "loss_curves.npz", curves)
    out = tmp_path / "tuning.json"
    main([str(tmp_path / "loss_curves.npz"), "--target-loss", "0.08", "--out", str(out), "--targets", "0.05"])
    found = read_json_record(TuningReport, out)
    after = found.after
    assert (after.gain_margin_db or 0) >= found.least_gain_margin_db - 1e-9
    assert after.rms_error <= found.before.rms_error * 1.02
    limit = scalar_rate_limit(load_rate_limit("surace2025"), curves.display.reflected_luminance)
    gains = (after.proportional, after.integral, after.derivative)

    def run(target: float):
        settings = ControllerSettings(target, *gains, lowest_factor=float(curves.factors[0]))
        return control_curves(curves, Controller(settings, limit))

    error = run(0.08).contrast_loss - 0.08
    assert after.rms_error == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
    alone = run(0.05)
    said = capsys.readouterr().out
    assert f"target 5 %: mean factor {alone.factors.mean():.4g}, " in said
    assert f"SD {100 * alone.contrast_loss.std():.2g} points" in said


# --- online bench

DISPLAY, PAPER = load_display("varjo-xr3"), load_rate_limit("surace2025")

CONTROLLER_OF_ONLINE_BENCH = Controller(ControllerSettings(TARGET), scalar_rate_limit(PAPER))


def free(_: float) -> float:
    """No limit that matters."""
    return 1e9


def with_gains(p: float, i: float, d: float) -> Controller:
    return Controller(
        replace(CONTROLLER_OF_ONLINE_BENCH.settings, proportional=p, integral=i, derivative=d), free
    )


def test_gains_beyond_the_margin_ring_and_pass_their_rest() -> None:
    curves = step_content(DISPLAY, 0.4, 5.0)
    passed, back = _step_overshoot(curves, CONTROLLER_OF_ONLINE_BENCH)
    assert passed <= 0.01
    assert back <= 0.001
    passed, back = _step_overshoot(curves, with_gains(2.6, 0.01, 0.0))
    assert back > 0.01
    passed, _ = _step_overshoot(curves, with_gains(0.0, 0.25, 0.0))
    assert passed > 0.01


def test_an_eager_integral_passes_the_target_after_a_bound() -> None:
    curves = bound_content(DISPLAY, 0.6, 5.0)
    assert _bound_overshoot(curves, CONTROLLER_OF_ONLINE_BENCH) <= 0.02
    assert _bound_overshoot(curves, with_gains(0.0, 0.16, 0.0)) > 0.02


def test_the_ratio_of_rates_is_to_the_limit_that_is_meant() -> None:
    """A controller that takes twice the limit for its limit comes out at 2."""
    double = Controller(
        CONTROLLER_OF_ONLINE_BENCH.settings, lambda light: 2 * CONTROLLER_OF_ONLINE_BENCH.rate_limit(light)
    )
    curves = extreme_content(DISPLAY, np.random.default_rng(2))
    assert _extreme_ratio(curves, CONTROLLER_OF_ONLINE_BENCH, np.random.default_rng(3)) <= 1
    factors = _direct(WalkFrames(curves, double, PAPER, load_power_model("surace2025")))
    rate = modulation_rate(factors, curves.mean_luminance, curves.durations)
    limit = allowed_rate(factors, curves.mean_luminance, lambda light: rate_limit_at(PAPER, light))
    assert largest_rate_ratio(rate, limit) == pytest.approx(2, rel=1e-6)


def test_going_straight_is_at_the_target_or_at_the_limit(make_curves) -> None:
    times = np.arange(150) / 5
    curves: LossCurves = make_curves(
        0.2 + 0.1 * np.sin(times / 3), luminance=30 + 10 * np.cos(times), frames_per_second=5.0
    )
    walk = WalkFrames(curves, CONTROLLER_OF_ONLINE_BENCH, PAPER, load_power_model("surace2025"))
    factors = _direct(walk)
    rate = np.abs(modulation_rate(factors, curves.mean_luminance, curves.durations))[:-1]
    limit = allowed_rate(factors, curves.mean_luminance, lambda light: rate_limit_at(PAPER, light))[:-1]
    there = np.abs(factors - factor_at_loss(curves, np.full(150, TARGET)))[1:] < 1e-9
    # A step that keeps the lower limit of its ends may be a hair shorter than the limit of the end it has.
    assert (there | (rate >= 0.99 * limit)).all()
    assert there.any()
    assert not there.all()


def test_constant_dimming_has_a_ratio_of_one(make_curves) -> None:
    curves = make_curves(0.2 + 0.1 * np.sin(np.arange(50)))
    assert sd_ratio(curves, np.full(50, 0.6)) == pytest.approx(1, rel=1e-9)
