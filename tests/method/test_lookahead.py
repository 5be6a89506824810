"""The controller that looks ahead: what it knows, what it keeps, and what that is good for."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.online.control_curves import (
    ControlledTrack,
    control_ahead,
    control_curves,
)
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.online.governor import GovernorSettings, frame_costs, governor_of, horizon_errors
from evenlight.method.online.lookahead import (
    DEBT_REACTION,
    ForeseenFrame,
    LookaheadController,
    LookaheadSettings,
)
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.power import power
from evenlight.method.preset_files import load_power_model, load_rate_limit
from evenlight.method.rate_limit import largest_rate_ratio, scalar_rate_limit

LIMIT, LCD = load_rate_limit("surace2025"), load_power_model("surace2025")
PAPER = scalar_rate_limit(LIMIT)
RATE = 10.0
MakeCurves = Callable[..., LossCurves]


def ahead(
    curves: LossCurves,
    seconds: float,
    budget: float | None = 0.5,
    horizon: float = 60.0,
    target: float | None = None,
) -> ControlledTrack:
    """The track with some lookahead."""
    settings = ControllerSettings(0.0 if target is None else target)
    asked = None if budget is None else GovernorSettings(budget, BudgetUnit.FACTOR, horizon)
    costs = None if asked is None else frame_costs(curves, asked, LCD)
    controller, look = Controller(settings, PAPER), LookaheadSettings(seconds, horizon)
    return control_ahead(curves, controller, look, budget, None, costs, target is not None)


def pid(curves: LossCurves, budget: float, horizon: float = 60.0) -> ControlledTrack:
    """The track of the PID controller."""
    asked = GovernorSettings(budget, BudgetUnit.FACTOR, horizon)
    first = float(loss_and_slope(curves, np.full(curves.n_frames, budget))[0][0])
    controller = Controller(ControllerSettings(first), PAPER)
    governed = (governor_of(controller, asked), frame_costs(curves, asked, LCD))
    return control_curves(curves, controller, budget, None, governed)


def scenes(make_curves: MakeCurves, seconds: float, seed: int = 1) -> LossCurves:
    """A film: cuts after 3 to 12 s, each time to other light and other detail."""
    rng, strength, light = np.random.default_rng(seed), [], []
    while len(strength) < seconds * RATE:
        frames = round(rng.uniform(3.0, 12.0) * RATE)
        strength += [rng.uniform(0.06, 0.2)] * frames
        light += [rng.uniform(8.0, 60.0)] * frames
    n = round(seconds * RATE)
    return make_curves(
        np.array(strength[:n]), exponent=1.5, luminance=np.array(light[:n]), frames_per_second=RATE
    )


def sd_ratio(curves: LossCurves, factors: np.ndarray) -> float:
    """The SD of the loss over that of constant dimming by the mean factor; frames of equal duration."""
    constant = np.full(curves.n_frames, min(float(np.mean(factors)), 1.0))
    ours, same = (loss_and_slope(curves, np.asarray(b))[0] for b in (factors, constant))
    return float(np.std(ours) / np.std(same))


@pytest.mark.parametrize("seconds", [0.0, 0.5, 2.0])
def test_no_frame_beyond_the_lookahead_changes_a_factor(make_curves: MakeCurves, seconds: float) -> None:
    """To the last bit. The frame that begins `seconds` later is the last that is known."""
    one, other = (scenes(make_curves, 13.5, seed) for seed in (1, 2))
    known = 100 + round(seconds * RATE)
    loss, light = one.loss.copy(), one.mean_luminance.copy()
    loss[known + 1 :], light[known + 1 :] = other.loss[known + 1 :], other.mean_luminance[known + 1 :]
    changed = replace(one, loss=loss, mean_luminance=light)
    tracks = [ahead(curves, seconds, horizon=10.0) for curves in (one, changed)]
    np.testing.assert_array_equal(tracks[0].factors[:101], tracks[1].factors[:101])
    assert (tracks[0].factors[101:] != tracks[1].factors[101:]).any()
    loss[known] = other.loss[known] * 1.5
    seen = ahead(replace(one, loss=loss, mean_luminance=light), seconds, horizon=10.0)
    assert seen.targets[100] != tracks[0].targets[100]  # the factor may be at its limit either way


def test_two_seconds_close_half_of_the_gap(make_curves: MakeCurves) -> None:
    """Between the PID controller with its governor and the optimizer, which knows the whole film.

    A dialogue, cut every 4 s: the best is to turn about in the middle of each shot; the buffer tells when.
    """
    dark = np.arange(300) // 20 % 2 == 1  # at 5 Hz
    curves = make_curves(np.where(dark, 0.16, 0.1), 1.5, np.where(dark, 15.0, 50.0), 5.0)
    request = Request(0.5, BudgetUnit.FACTOR, LCD, LIMIT)
    online, offline = pid(curves, 0.5), SplittingSolver().solve(pose(curves, request)).factors
    planned = ahead(curves, 2.0)
    gap = sd_ratio(curves, online.factors), sd_ratio(curves, offline)
    assert gap[0] - gap[1] > 0.1
    assert sd_ratio(curves, planned.factors) < (gap[0] + gap[1]) / 2
    used, every = planned.factors, np.ones(curves.n_frames)
    errors = horizon_errors(used, every, curves.durations, (0.5, 60.0))
    assert errors is not None
    assert errors.either_way < 0.01
    assert abs(planned.mean_factor - 0.5) < 0.01


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_no_content_makes_it_break_the_rate_limit_or_the_bounds(
    make_curves: MakeCurves, seconds: float
) -> None:
    """Black, white and dark frames in turn, with nothing or everything to lose."""
    rng = np.random.default_rng(3)
    for budget in (0.21, 0.5, 0.99):
        strength, light = rng.choice([0.0, 0.02, 0.3, 1.0], 150), rng.choice([0.0, 1e-4, 5.0, 100.0], 150)
        curves = make_curves(strength, luminance=light, frames_per_second=float(rng.choice([5.0, 90.0])))
        track = ahead(curves, seconds, budget, horizon=3.0)
        assert largest_rate_ratio(track.rate, track.rate_limit) <= 1
        assert track.factors.min() >= 0.2
        assert track.factors.max() <= 1.0


def test_the_first_frame_sets_the_level_for_a_tenth_of_the_horizon(make_curves: MakeCurves) -> None:
    """By hand: at the budget of 0.5 they lose 0.1 and 0.05; the first counts as 6 s, the second 0.1 s."""
    track = ahead(make_curves(np.array([0.2, 0.1]), frames_per_second=RATE), 0.0)
    assert track.targets.tolist() == pytest.approx([0.1, (6 * 0.1 + 0.1 * 0.05) / 6.1], rel=1e-9)


def test_what_stays_the_same_is_held_where_it_has_the_target_loss(make_curves: MakeCurves) -> None:
    """By hand: 0.2 (1 - b) = 0.08 at b = 0.6."""
    curves = make_curves(np.full(300, 0.2), frames_per_second=RATE)
    track = ahead(curves, 1.0, budget=None, target=0.08)
    assert track.factors == pytest.approx(0.6, abs=1e-6)
    assert ahead(curves, 1.0, budget=0.7).factors == pytest.approx(0.7, abs=1e-6)  # the level of the budget


def test_the_level_pays_a_debt_back_by_hand(make_curves: MakeCurves) -> None:
    """A frame at 0.9 for 1 s owes 0.4 s of factor; ŝ = 0.2, T = H/15: the level rises by 0.2 · 0.4 / T."""
    horizon = 30.0
    asked = GovernorSettings(0.5, BudgetUnit.FACTOR, horizon)
    curves = make_curves(np.full(2, 0.2), frames_per_second=1.0)
    cost = frame_costs(curves, asked, LCD)[0]
    controller = Controller(ControllerSettings(0.0), PAPER)
    planner = LookaheadController(
        controller, LookaheadSettings(0.0, horizon), curves.factors, 0.9, level_is_given=False
    )
    frame = ForeseenFrame(curves.loss[0], 40.0, 1.0, cost)
    first, second = planner.push(frame)[0], planner.push(frame)[0]
    assert first.target_loss == pytest.approx(0.1)
    assert second.target_loss == pytest.approx(0.1 + 0.2 * 0.4 * DEBT_REACTION / horizon)
    assert second.state.factor < 0.9


def test_it_sets_out_before_a_cut_and_not_before_it_knows(make_curves: MakeCurves) -> None:
    """From content that needs 0.5 to content that needs 0.75, after 20 s; the rate limit takes seconds."""
    strength = np.repeat([0.16, 0.32], 200)
    curves = make_curves(strength, luminance=np.full(400, 40.0), frames_per_second=RATE)
    knows, blind = (ahead(curves, s, budget=None, target=0.08).factors for s in (2.0, 0.0))
    assert knows[:180] == pytest.approx(0.5, abs=1e-6)
    assert knows[199] > 0.51
    assert blind[:200] == pytest.approx(0.5, abs=1e-6)
    assert 0.7 < knows[-1] < 0.75  # what was before is expected back until a horizon has passed


def test_frames_are_handed_out_when_enough_is_known(make_curves: MakeCurves) -> None:
    """Frames of 0.1 and 0.5 s: one is due once the frame after the last known one begins too late."""
    curves = make_curves(np.full(6, 0.2), frames_per_second=RATE)
    controller = Controller(ControllerSettings(0.08), PAPER)
    planner = LookaheadController(controller, LookaheadSettings(0.5), curves.factors, 0.6)
    counts = [
        len(planner.push(ForeseenFrame(curves.loss[0], 40.0, seconds)))
        for seconds in (0.1, 0.1, 0.5, 0.1, 0.5, 0.1)
    ]
    # Ends at 0.1, 0.2, 0.7 (those from 0 and 0.1 are due), 0.8 (from 0.2), 1.3 (from 0.7), 1.4 (from 0.8).
    assert counts == [0, 0, 2, 1, 1, 1]
    assert len(planner.finish()) == 1


@pytest.mark.parametrize("rate", [25.0, 90.0])
def test_a_frame_takes_less_than_a_millisecond(make_curves: MakeCurves, rate: float) -> None:
    """Of the processor, the median, with 2 s ahead; a factor of 3 is left to a slow machine."""
    wave = np.sin(np.arange(round(6 * rate)) / rate)
    curves = make_curves(0.3 + 0.2 * wave, luminance=40 - 20 * wave, frames_per_second=rate)
    controller = Controller(ControllerSettings(0.08), PAPER)
    planner = LookaheadController(controller, LookaheadSettings(2.0), curves.factors, 0.6)
    times = [process_time()]
    for losses, light in zip(curves.loss, curves.mean_luminance.tolist(), strict=True):
        planner.push(ForeseenFrame(losses, light, 1 / rate))
        times.append(process_time())
    steps = [after - before for before, after in itertools.pairwise(times)][round(3 * rate) :]
    assert np.median(steps) < 3e-3


@pytest.mark.parametrize(
    ("unit", "budget", "scale"),
    [(BudgetUnit.FACTOR, 0.5, 1.0), (BudgetUnit.POWER, 0.6, 1.0), (BudgetUnit.WATT, 1.0, 1.69)],
)
def test_any_budget_is_met_over_its_horizon(
    make_curves: MakeCurves, unit: BudgetUnit, budget: float, scale: float
) -> None:
    """Over every 20 s, to 3 % of what full brightness takes (1.69 W)."""
    curves = scenes(make_curves, 60.0)
    asked = GovernorSettings(budget, unit, 20.0)
    controller, costs = Controller(ControllerSettings(0.0), PAPER), frame_costs(curves, asked, LCD)
    track = control_ahead(curves, controller, LookaheadSettings(2.0, 20.0), 0.5, None, costs, False)
    watts = power(LCD, track.factors, curves.channel_means)
    full = power(LCD, np.ones(curves.n_frames), curves.channel_means)
    used = {BudgetUnit.FACTOR: track.factors, BudgetUnit.POWER: watts / full, BudgetUnit.WATT: watts}[unit]
    errors = horizon_errors(used, np.ones(curves.n_frames), curves.durations, (budget, 20.0))
    assert errors is not None
    assert errors.either_way < 0.03 * scale
    assert largest_rate_ratio(track.rate, track.rate_limit) <= 1
