"""The online controller as an object: what `evenlight control` does, a frame at a time."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

import evenlight
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.method.detectability import limit_at_share
from evenlight.method.online.control_curves import control_ahead, control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.lookahead import LookaheadSettings
from evenlight.method.rate_limit import allowed_rate, modulation_rate, scalar_rate_limit

RATE = 10.0  # [Hz]


def scene(seconds: float = 12.0) -> Iterator[NDArray[np.float32]]:
    """A texture that becomes darker, then brighter again."""
    texture = np.random.default_rng(1).random((48, 64, 1)).repeat(3, axis=2)
    for number in range(round(seconds * RATE)):
        yield (texture * (0.55 + 0.4 * np.cos(number / 40))).astype(np.float32)


@pytest.mark.slow
def test_it_chooses_the_factors_that_the_command_chooses() -> None:
    frames = [Frame(k / RATE, 1 / RATE, pixels) for k, pixels in enumerate(scene())]
    display, limit = evenlight.load_display("varjo-xr3"), evenlight.load_rate_limit("surace2025")
    curves = analyze_frames(iter(frames), "scene", display)
    known = control_curves(
        curves, Controller(ControllerSettings(0.05), scalar_rate_limit(limit, display.reflected_luminance))
    )
    online = evenlight.OnlineController(0.05, fps=RATE)
    factors = [online.step(frame) for frame in frames]
    # The curves interpolate the loss between knots; the object measures it at the factor itself.
    np.testing.assert_allclose(factors, known.factors, atol=3e-3)
    assert np.ptp(factors) > 0.05  # the scene makes it move


@pytest.mark.slow
def test_no_step_is_faster_than_the_rate_limit() -> None:
    display, limit = evenlight.load_display("varjo-xr3"), evenlight.load_rate_limit("surace2025")
    frames = [Frame(k / RATE, 1 / RATE, pixels) for k, pixels in enumerate(scene())]
    curves = analyze_frames(iter(frames), "scene", display)
    allowed = scalar_rate_limit(limit, display.reflected_luminance)
    half = scalar_rate_limit(limit_at_share(limit, 0.5), display.reflected_luminance)
    assert half(40.0) < 0.8 * allowed(40.0)
    for settings in (
        {"target_loss": 0.3},
        {"budget": 0.3, "horizon": 5.0},
        {"target_loss": 0.3, "noticed": 0.5},
    ):
        online = evenlight.OnlineController(**settings, fps=RATE, start_factor=0.9)
        factors = np.array([online.step(frame) for frame in frames])
        rate = modulation_rate(factors, curves.mean_luminance, curves.durations)
        bound = allowed_rate(
            factors,
            curves.mean_luminance,
            lambda L, own=half if "noticed" in settings else allowed: np.array([own(x) for x in L.tolist()]),
        )
        assert np.abs(rate[:-1] / bound[:-1]).max() <= 1 + 1e-6
        assert factors[-1] < 0.85


@pytest.mark.slow
@pytest.mark.parametrize("unit", [unit.value for unit in BudgetUnit])
def test_a_budget_is_met_over_the_horizon(unit: str) -> None:
    """Power is linear in brightness (Eq. 7), so each of the three budgets is a mean factor of 0.5."""
    model = evenlight.load_power_model("surace2025")
    full = model.base_power + model.power_per_luminance * model.peak_luminance
    wanted = {"factor": 0.5, "power": (model.base_power + 0.5 * (full - model.base_power)) / full}
    budget = wanted.get(unit, wanted["power"] * full)  # all three are a mean factor of 0.5
    online = evenlight.OnlineController(budget=budget, budget_unit=unit, horizon=4.0, fps=RATE)
    factors = np.array([online.step(pixels) for pixels in scene(40.0)])
    assert factors[100:].mean() == pytest.approx(0.5, abs=0.02)


def test_the_buffer_of_a_player_gives_the_factors_of_the_command() -> None:
    frames = [Frame(k / RATE, 1 / RATE, pixels) for k, pixels in enumerate(scene())]
    display, limit = evenlight.load_display("varjo-xr3"), evenlight.load_rate_limit("surace2025")
    curves = analyze_frames(iter(frames), "scene", display)
    known = control_ahead(
        curves,
        Controller(ControllerSettings(0.05), scalar_rate_limit(limit, display.reflected_luminance)),
        LookaheadSettings(1.0),
    )
    online = evenlight.OnlineController(0.05, fps=RATE, lookahead=1.0)
    factors: list[float] = []
    for k, frame in enumerate(frames):
        factors += online.push(frame)
        assert len(factors) == max(k - 9, 0)  # the frame that begins 1 s later is known
    factors += online.finish()
    np.testing.assert_allclose(factors, known.factors, atol=1e-9)
    assert online.factor == factors[-1]
    measured = loss_and_slope(curves, known.factors)[0][-1]  # of the knots, as controllers have them
    assert online.loss == pytest.approx(measured, abs=1e-9)
    assert online.warnings == ()  # 12 s are less than the horizon


def test_step_and_push_are_not_mixed() -> None:
    frame = np.full((16, 16, 3), 100, dtype=np.uint8)
    with pytest.raises(evenlight.InputError, match="with lookahead, push frames"):
        evenlight.OnlineController(0.05, lookahead=0.0).step(frame)
    with pytest.raises(evenlight.InputError, match="without it, use step"):
        evenlight.OnlineController(0.05).push(frame)


def test_a_walk_without_gain_is_warned_of() -> None:
    """The gains are 0: that is constant dimming."""
    online = evenlight.OnlineController(
        0.1, horizon=1.0, fps=RATE, proportional=0.0, integral=0.0, derivative=0.0
    )
    for pixels in scene(3.0):
        online.step(pixels)
    assert len(online.warnings) == 1
    assert online.warnings[0].startswith("nothing is gained")


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan")])
def test_a_frame_lasts_some_time_and_a_refused_one_leaves_the_controller_as_it_was(duration: float) -> None:
    frame = np.full((16, 16, 3), 100, dtype=np.uint8)
    online = evenlight.OnlineController(0.05)
    with pytest.raises(evenlight.InputError, match="duration must be"):
        online.step(frame, duration)
    with pytest.raises(evenlight.InputError, match="a frame needs"):
        online.step(np.zeros((16, 16, 3), dtype=np.int64))
    assert online.factor is None
    assert 0.2 <= online.step(frame) <= 1


def test_frames_of_another_size_are_refused() -> None:
    online = evenlight.OnlineController(0.05)
    online.step(np.full((16, 16, 3), 100, dtype=np.uint8))
    with pytest.raises(evenlight.InputError, match="expected a frame of the shape"):
        online.step(np.full((16, 24, 3), 100, dtype=np.uint8))


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "give `target_loss`"),
        ({"target_loss": 2.0}, "target_loss"),
        ({"budget": 0.5, "budget_unit": "percent"}, "percent"),
        ({"target_loss": 0.1, "display": "varjo"}, "did you mean 'varjo-xr3'"),
        ({"target_loss": 0.1, "min_factor": 0.0}, "min_factor"),
        ({"target_loss": 0.1, "start_factor": 0.1}, "start_factor"),
        ({"target_loss": 0.1, "fps": 0.0}, "fps"),
        ({"budget": 0.1}, "budget"),
        ({"target_loss": 0.1, "lookahead": -1.0}, "lookahead must lie in 0 to 60"),
        ({"budget": 50.0, "budget_unit": "watt"}, "budget"),
        ({"target_loss": 0.1, "gain_rate": -1.0}, "gain_rate must lie in 0 to"),
        ({"target_loss": 0.1, "lookahead": 1.0, "integral": 0.1}, "integral is for the PID controller"),
        ({"target_loss": 0.1, "lookahead": 1.0, "resolution": "half"}, "resolution is for `step`"),
        ({"target_loss": 0.1, "resolution": "third"}, "resolution"),
    ],
)
def test_what_cannot_be_used_is_named(given: dict[str, object], says: str) -> None:
    with pytest.raises(evenlight.InputError, match=says) as refused:
        evenlight.OnlineController(**given)  # type: ignore[arg-type] # wrong on purpose
    assert "--" not in str(refused.value)
