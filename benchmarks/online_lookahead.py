"""What 2 s of lookahead take, and what they gain: on a dialogue cut to and fro, and on the walk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.measured import Approach, RunSettings, claim, point
from benchmarks.online_content import content
from benchmarks.online_walk import BUDGET, HORIZON, OFFLINE, RATIO, WalkFrames, sd_ratio
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.online.control_curves import (
    control_ahead,
    control_curves,
)
from evenlight.method.online.governor import GovernorSettings, frame_costs, governor_of, horizon_errors
from evenlight.method.online.lookahead import LookaheadSettings
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver

SECONDS = 2.0  # of lookahead
PID, BLIND, AHEAD = "PID and governor", "statistics of what came", f"{SECONDS:g} s of lookahead"
MOST_PER_FRAME = 1e-3  # [s]
ASKED = GovernorSettings(BUDGET, BudgetUnit.FACTOR, HORIZON)


def lookahead_points(
    walk: WalkFrames, display: Display, settings: RunSettings
) -> tuple[list[BenchmarkPoint], list[BenchmarkClaim]]:
    """Return the points of a film, the walk, and single frames; and the claims about them."""
    settings.say("looking ahead")
    points, claims = _frame_points(walk, display, settings)
    dialogue = _dialogue(display, 10.0 if settings.quick else 25.0)
    films = {"brightness over 60 s of a dialogue, cut every 4 s": dialogue}
    if not settings.quick:
        films[f"{walk.task}, on a budget"] = walk.curves
    for task, curves in films.items():
        found = _film_points(task, replace(walk, curves=curves), settings)
        points += found
        if curves is dialogue:
            ratio = {p.approach: p.error or 0.0 for p in found}
            closed = (ratio[PID] - ratio[AHEAD]) / (ratio[PID] - ratio[OFFLINE])
            words = (
                f"of the gap between PID and offline optimum, {SECONDS:g} s of lookahead leave at most half"
            )
            claims.append(claim(words, 0.5, 1 - closed, "1", "the dialogue; SD over constant dimming's"))
    return points, claims


def _dialogue(display: Display, rate: float) -> LossCurves:
    """Return content that cuts every 4 s between bright with little to lose and dark with more."""
    dark = np.arange(round(60 * rate)) // round(4 * rate) % 2 == 1
    return content(np.where(dark, 0.16, 0.1), np.where(dark, 15.0, 50.0), display, rate)


def _film_points(task: str, film: WalkFrames, settings: RunSettings) -> list[BenchmarkPoint]:
    """Return how steady the loss of a film is on a budget, and what that takes."""
    request = Request(BUDGET, BudgetUnit.FACTOR, film.power_model, film.rate_limit)
    ways: dict[str, Callable[[], Array]] = {
        PID: lambda: _pid(film),
        BLIND: lambda: _ahead(film, 0.0),
        AHEAD: lambda: _ahead(film, SECONDS),
        OFFLINE: lambda: SplittingSolver().solve(pose(film.curves, request)).factors,
    }
    times, n = timed_in_turn(ways, settings.repeats(5)), film.curves.n_frames
    points = []
    for name, way in ways.items():
        factors = way()
        errors = horizon_errors(factors, np.ones(n), film.curves.durations, (BUDGET, HORIZON))
        note = "" if errors is None else f"mean over any {HORIZON:g} s off by {errors.either_way:.3f} at most"
        role = Role.DEFAULT if name == PID else Role.VARIANT
        ratio = sd_ratio(film.curves, factors)
        points.append(point(Approach(task, name, role, n, "frames"), times[name], ratio, RATIO, note))
    return points


def _pid(film: WalkFrames) -> Array:
    """Return the factors of the PID controller with its governor."""
    costs = frame_costs(film.curves, ASKED, film.power_model)
    first = float(loss_and_slope(film.curves, np.full(film.curves.n_frames, BUDGET))[0][0])
    controller = replace(film.controller, settings=replace(film.controller.settings, target_loss=first))
    governed = (governor_of(controller, ASKED), costs)
    return control_curves(film.curves, controller, BUDGET, None, governed).factors


def _ahead(film: WalkFrames, seconds: float) -> Array:
    """Return the factors with some lookahead."""
    costs = frame_costs(film.curves, ASKED, film.power_model)
    look = LookaheadSettings(seconds, HORIZON)
    return control_ahead(film.curves, film.controller, look, BUDGET, None, costs, False).factors


def _frame_points(
    walk: WalkFrames, display: Display, settings: RunSettings
) -> tuple[list[BenchmarkPoint], list[BenchmarkClaim]]:
    """Return what one frame takes the lookahead, at two frame rates, beside the PID controller."""
    points, claims = [], []
    for rate in (25.0, 90.0):
        wave = np.sin(np.arange(round(12 * rate)) / rate)
        film = replace(walk, curves=content(0.3 + 0.2 * wave, 40 - 20 * wave, display, rate))
        ways = {PID: lambda film=film: _pid(film), AHEAD: lambda film=film: _ahead(film, SECONDS)}
        times, n = timed_in_turn(ways, settings.repeats(5)), film.curves.n_frames
        for name, taken in times.items():
            per_frame = replace(taken, wall=taken.wall / n, processor=taken.processor / n)
            role = Role.DEFAULT if name == PID else Role.VARIANT
            approach = Approach(f"control of one frame at {rate:g} Hz", name, role, 1, "frames")
            points.append(point(approach, per_frame, note=f"of {n} in a row; the curves are known"))
            if name == AHEAD:
                took = float(np.median(per_frame.wall))
                words = f"{SECONDS:g} s of lookahead at {rate:g} Hz take at most 1 ms a frame"
                claims.append(claim(words, MOST_PER_FRAME, took, "s", "the control alone, curves known"))
    return points, claims
