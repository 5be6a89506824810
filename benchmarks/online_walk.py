"""How steady the online controller keeps the loss: on the walk through the house, and on hard content."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.controller_tuning import TuningResult, tune
from benchmarks.measured import Approach, RunSettings, claim, point
from benchmarks.online_content import bound_content, extreme_content, step_content
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings, FrameMeasurement
from evenlight.method.online.governor import GovernorSettings, frame_costs, governor_of
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.rate_limit import largest_rate_ratio

TARGET = 0.03  # contrast loss held on the walk
PAPER_RATIO = 0.12 / 0.19  # SD ours / SD constant on the paper's walk (caption of its figure)
BUDGET, HORIZON = 0.5, 60.0  # of the governor: mean factor, over [s]
RATIO = "SD of the loss over time / that of constant dimming of equal mean factor"
GAINS, PER_SECOND = "online, the paper's gains per frame of 1/90 s", "online, the paper's gains per second"
TUNED, GOVERNED = "online, gains tuned on the walk", f"online, governor of a mean factor of {BUDGET:g}"
DIRECT = "straight to the target at the rate limit, from the whole curve of each frame"
OFFLINE = "offline optimum, which knows the whole walk"


@dataclass(frozen=True, slots=True)
class WalkFrames:
    """The walk, and what it is shown with.

    Attributes
    ----------
    curves : LossCurves
        Of the walk.
    controller : Controller
        With the paper's gains.
    rate_limit, power_model : RateLimit, PowerModel
        For the offline optimum.
    """

    curves: LossCurves
    controller: Controller
    rate_limit: RateLimit
    power_model: PowerModel

    @property
    def task(self) -> str:
        """What the task is called."""
        seconds = float(self.curves.durations.sum())
        return f"brightness over {seconds:.0f} s of the walk through the house"


def walk_points(walk: WalkFrames, settings: RunSettings) -> tuple[list[BenchmarkPoint], TuningResult, float]:
    """Return the points of the walk, the tuned gains, and the governor's largest error over a horizon."""
    settings.say("the walk through the house")
    tuned = tune(walk.curves, walk.controller)
    budget = GovernorSettings(BUDGET, BudgetUnit.FACTOR, HORIZON)
    governed = (governor_of(walk.controller, budget), frame_costs(walk.curves, budget, walk.power_model))
    ways: dict[str, Callable[[], Array]] = {
        GAINS: lambda: _factors(walk, walk.controller.settings),
        PER_SECOND: lambda: _factors(walk, replace(walk.controller.settings, gain_rate=1.0)),
        TUNED: lambda: _factors(walk, tuned.settings),
        GOVERNED: lambda: control_curves(walk.curves, walk.controller, BUDGET, None, governed).factors,
        DIRECT: lambda: _direct(walk),
        OFFLINE: lambda: _offline(walk),
    }
    times = timed_in_turn(ways, settings.repeats(5))
    n, points = walk.curves.n_frames, []
    for name, way in ways.items():
        role = Role.DEFAULT if name == GAINS else Role.VARIANT
        note = f"tuning took {tuned.tries} runs over the walk" if name == TUNED else ""
        approach = Approach(walk.task, name, role, n, "frames")
        points.append(point(approach, times[name], sd_ratio(walk.curves, way()), RATIO, note))
    return points, tuned, _horizon_error(walk.curves, ways[GOVERNED]())


def _factors(walk: WalkFrames, settings: ControllerSettings) -> Array:
    """Return the controller's factors with some gains."""
    return control_curves(walk.curves, replace(walk.controller, settings=settings)).factors


def _direct(walk: WalkFrames) -> Array:
    """Return the factors of who knows each frame's loss at every factor, and nothing of the next frame."""
    curves, controller = walk.curves, walk.controller
    goals = factor_at_loss(curves, np.full(curves.n_frames, controller.settings.target_loss)).tolist()
    lights, durations = curves.mean_luminance.tolist(), curves.durations.tolist()
    frames = [FrameMeasurement(0.0, light, seconds) for light, seconds in zip(lights, durations, strict=True)]
    state, factors = controller.start(goals[0], frames[0]), [goals[0]]
    for frame, goal in zip(frames[1:], goals[1:], strict=True):
        factors.append(controller.towards(state, frame, goal))
        state = controller.start(factors[-1], frame)
    return np.array(factors)


def _offline(walk: WalkFrames) -> Array:
    """Return the factors of the optimizer at the mean factor that the default gains came to."""
    mean = control_curves(walk.curves, walk.controller).mean_factor
    request = Request(mean, BudgetUnit.FACTOR, walk.power_model, walk.rate_limit)
    return SplittingSolver().solve(pose(walk.curves, request)).factors


def sd_ratio(curves: LossCurves, factors: Array) -> float:
    """Return the SD over time of the loss, over that of constant dimming by the mean factor."""
    share = curves.durations / curves.durations.sum()
    constant = np.full(curves.n_frames, min(float(share @ factors), 1.0))
    ours, same = (loss_and_slope(curves, b)[0] for b in (factors, constant))
    return float(np.sqrt(share @ (ours - share @ ours) ** 2 / (share @ (same - share @ same) ** 2)))


def _horizon_error(curves: LossCurves, factors: Array) -> float:
    """Return the largest difference of a mean over the horizon, or over all of a shorter walk."""
    frames = min(round(HORIZON / float(curves.durations[0])), curves.n_frames)
    sums = np.append(0.0, np.cumsum(factors - BUDGET))
    return float(np.abs(sums[frames:] - sums[:-frames]).max() / frames)


def hard_claims(
    controller: Controller, display: Display, settings: RunSettings, rng: np.random.Generator
) -> list[BenchmarkClaim]:
    """Return what the controller promises on hard content, and what it kept."""
    settings.say("steps, bounds and extremes")
    many = 20 if settings.quick else 200
    ratios = [_extreme_ratio(extreme_content(display, rng), controller, rng) for _ in range(many)]
    steps = [
        _step_overshoot(step_content(display, strong, rate), controller)
        for strong in (0.15, 0.4, 1.0) for rate in (5.0, 12.5, 90.0)
    ]  # fmt: skip
    bounds = [
        _bound_overshoot(bound_content(display, strong, rate), controller)
        for strong in (0.3, 0.6, 1.0) for rate in (5.0, 12.5, 90.0)
    ]  # fmt: skip
    backward = max(back for _, back in steps)
    return [
        claim("the controller never exceeds the rate limit: largest rate over its limit", 1.0, max(ratios),
              "1", f"{many} sequences of 200 frames that cut at random from black to white, random gains"),
        claim("after a step between bright and dark the factor passes its new rest by at most 0.01", 0.01,
              max(over for over, _ in steps), "1", "nine steps each way, contrast loss up to 1, 5 to 90 Hz"),
        claim("and does not ring: it moves back by at most 0.001", 0.001, backward, "1",
              "largest way back after the first three frames, in which K_d acts"),
        claim("after 10 s at a bound the loss passes the target by at most 0.02", 0.02, max(bounds), "1",
              "nine sequences, from the lowest factor"),
    ]  # fmt: skip


def _extreme_ratio(curves: LossCurves, controller: Controller, rng: np.random.Generator) -> float:
    """Return the largest ratio of a rate to its limit, with gains of any size."""
    p, i, d = (float(gain) for gain in rng.choice([0.0, 0.05, 1.0, 20.0], 3))
    gains = replace(controller.settings, proportional=p, integral=i, derivative=d)
    track = control_curves(curves, replace(controller, settings=gains))
    return largest_rate_ratio(track.rate, track.rate_limit)


def _step_overshoot(curves: LossCurves, controller: Controller) -> tuple[float, float]:
    """Return how far the factor passes its rest after a step, and how far it moves back on its way."""
    target = 0.08
    track = control_curves(
        curves, replace(controller, settings=replace(controller.settings, target_loss=target))
    )
    goals = factor_at_loss(curves, np.full(curves.n_frames, target))
    ends = np.flatnonzero(np.diff(goals)) + 1
    passed, back = 0.0, 0.0
    for begin, end in zip(ends, [*ends[1:], curves.n_frames], strict=True):
        way = np.sign(goals[begin] - track.factors[begin - 1])
        passed = max(passed, float(((track.factors[begin:end] - goals[begin]) * way).max()))
        piece = track.factors[begin + 3 : end] * way
        back = max(back, float((np.maximum.accumulate(piece) - piece).max()))
    return passed, back


def _bound_overshoot(curves: LossCurves, controller: Controller) -> float:
    """Return how far the loss passes the target on the way back from the lowest factor."""
    target = 0.1
    settings = replace(controller.settings, target_loss=target)
    track = control_curves(curves, replace(controller, settings=settings), 0.2)
    after = track.contrast_loss[round(10 / float(curves.durations[0])) :]
    return max(float((target - after).max()), 0.0)
