"""Tuned gains: within their margins, and nearer to the target than what can be found without a plan."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.controller_tuning import (
    AS_GOOD,
    MarginRequirements,
    TuningResult,
    content_slopes,
    frame_gains,
    margins,
    rms_error,
    tune,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit

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


@pytest.mark.slow
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


@pytest.mark.slow
def test_gains_that_count_frames_stay_such(rooms: LossCurves, tuned: TuningResult) -> None:
    """They are found per frame: those of a rate do the same."""
    counted = tune(rooms, replace(CONTROLLER, settings=replace(CONTROLLER.settings, gain_rate=None)))
    assert counted.settings.gain_rate is None
    assert error_of(rooms, counted.settings) == pytest.approx(error_of(rooms, tuned.settings), rel=1e-9)
