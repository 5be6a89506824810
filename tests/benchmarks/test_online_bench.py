"""What the benchmark of the online controller measures: each of its claims can fail."""

from dataclasses import replace

import numpy as np
import pytest

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
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import factor_at_loss
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.method.rate_limit import (
    allowed_rate,
    largest_rate_ratio,
    modulation_rate,
    rate_limit_at,
    scalar_rate_limit,
)

DISPLAY, PAPER = load_display("varjo-xr3"), load_rate_limit("surace2025")
CONTROLLER = Controller(ControllerSettings(TARGET), scalar_rate_limit(PAPER))


def free(_: float) -> float:
    """No limit that matters."""
    return 1e9


def with_gains(p: float, i: float, d: float) -> Controller:
    return Controller(replace(CONTROLLER.settings, proportional=p, integral=i, derivative=d), free)


def test_gains_beyond_the_margin_ring_and_pass_their_rest() -> None:
    curves = step_content(DISPLAY, 0.4, 5.0)
    passed, back = _step_overshoot(curves, CONTROLLER)
    assert passed <= 0.01
    assert back <= 0.001
    passed, back = _step_overshoot(curves, with_gains(2.6, 0.01, 0.0))
    assert back > 0.01
    passed, _ = _step_overshoot(curves, with_gains(0.0, 0.25, 0.0))
    assert passed > 0.01


def test_an_eager_integral_passes_the_target_after_a_bound() -> None:
    curves = bound_content(DISPLAY, 0.6, 5.0)
    assert _bound_overshoot(curves, CONTROLLER) <= 0.02
    assert _bound_overshoot(curves, with_gains(0.0, 0.16, 0.0)) > 0.02


def test_the_ratio_of_rates_is_to_the_limit_that_is_meant() -> None:
    """A controller that takes twice the limit for its limit comes out at 2."""
    double = Controller(CONTROLLER.settings, lambda light: 2 * CONTROLLER.rate_limit(light))
    curves = extreme_content(DISPLAY, np.random.default_rng(2))
    assert _extreme_ratio(curves, CONTROLLER, np.random.default_rng(3)) <= 1
    factors = _direct(WalkFrames(curves, double, PAPER, load_power_model("surace2025")))
    rate = modulation_rate(factors, curves.mean_luminance, curves.durations)
    limit = allowed_rate(factors, curves.mean_luminance, lambda light: rate_limit_at(PAPER, light))
    assert largest_rate_ratio(rate, limit) == pytest.approx(2, rel=1e-6)


def test_going_straight_is_at_the_target_or_at_the_limit(make_curves) -> None:
    times = np.arange(150) / 5
    curves: LossCurves = make_curves(
        0.2 + 0.1 * np.sin(times / 3), luminance=30 + 10 * np.cos(times), frames_per_second=5.0
    )
    walk = WalkFrames(curves, CONTROLLER, PAPER, load_power_model("surace2025"))
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
