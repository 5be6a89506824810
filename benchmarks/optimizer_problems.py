"""Problems for measuring the optimizer: made curves of any length, a rendered sequence, odd short ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, VideoSection
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import Problem, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.stimuli.sequences import built_in_sequence

FRAMES_PER_SECOND = 25.0
SCENE = 150.0  # frames between cuts, on average
# Its power is what its pixels emit, so that a share of the power at full brightness is a mean factor in which
# bright frames count more.
OLED = PowerModel("OLED", PanelKind.OLED, 0.0, red_power=1.0, green_power=0.6, blue_power=1.4)


def mean_factor_problem(curves: LossCurves, budget: float, scale: float = 1.0) -> Problem:
    """Return the problem of a mean factor under the published rate limit, or some multiple of it."""
    limit: RateLimit = load_rate_limit("surace2025")
    request = Request(budget, BudgetUnit.FACTOR, load_power_model("surace2025"), limit)
    return _scaled(pose(curves, request), scale)


def _scaled(problem: Problem, scale: float) -> Problem:
    """Return a problem under a multiple of its rate limit."""
    if scale == 1.0:
        return problem
    steps = np.ones(problem.curves.n_frames - 1) if problem.allowances is None else problem.allowances
    return replace(problem, allowances=scale * steps)


def made_curves(
    frames: int, rng: np.random.Generator, frames_per_second: float = FRAMES_PER_SECOND
) -> LossCurves:
    """Return curves of scenes with cuts, slow changes within them and a flicker from frame to frame.

    Loss is strength · (1 - b)^exponent, strength and luminance wander; single pixels add stairs.
    """
    scene = np.cumsum(rng.random(frames) < 1 / SCENE)
    drift = np.cumsum(rng.standard_normal(frames)) * 0.004
    level = rng.uniform(0.1, 0.6, scene[-1] + 1)[scene] + 0.05 * np.sin(drift * 5)
    strength = np.clip(level + 0.01 * rng.standard_normal(frames), 0.02, 0.95)
    exponent = rng.uniform(0.8, 1.8, scene[-1] + 1)[scene]
    luminance = np.exp(rng.normal(3.0, 0.6, scene[-1] + 1))[scene] * np.exp(0.1 * np.sin(drift * 3))
    knots = brightness_factors()
    loss = strength[:, None] * ((1 - knots) / 0.8) ** exponent[:, None]
    loss += np.cumsum(rng.exponential(2e-4, (frames, len(knots))), axis=1)[:, ::-1]
    return curves_of(np.clip(loss - loss[:, -1:], 0.0, 1.0), luminance, knots, frames_per_second)


def curves_of(loss: Array, luminance: Array, knots: Array, frames_per_second: float) -> LossCurves:
    """Return the record of loss curves that were made, not measured."""
    frames = len(loss)
    display = load_display("varjo-xr3")
    share = np.clip(luminance / display.peak_luminance, 0.0, 1.0)
    return LossCurves(
        video="made",
        display=display,
        times=np.arange(frames) / frames_per_second,
        durations=np.full(frames, 1 / frames_per_second),
        factors=knots,
        loss=loss,
        visible_contrast=np.full(frames, 0.5),
        mean_luminance=share * display.peak_luminance,
        channel_means=np.repeat(share[:, None], 3, axis=1),
        provenance=Provenance(),
    )


def rendered_curves(name: str, seconds: float, knots: int) -> LossCurves:
    """Return the measured curves of a built-in sequence, small."""
    sequence = built_in_sequence(name, size=(160, 90), duration=seconds, frames_per_second=10.0)
    display = load_display("varjo-xr3")
    return analyze_frames(sequence.frames(), name, display, factors=brightness_factors(knots=knots))


def some_frames(curves: LossCurves, frames: NDArray[np.int64]) -> LossCurves:
    """Return some frames of a video, each shown until the next one of them."""
    arrays = {n: getattr(curves, n)[frames] for n, shape in ARRAY_SHAPES.items() if shape[0] == "N"}
    arrays["durations"] = np.diff(arrays["times"], append=curves.times[-1] + curves.durations[-1])
    return replace(curves, **arrays, bends=None)


def some_knots(curves: LossCurves, every: int) -> LossCurves:
    """Return the curves with every so many of their knots."""
    return replace(curves, factors=curves.factors[::every], loss=curves.loss[:, ::every])


def odd_problems(rng: np.random.Generator, frames: tuple[int, int], instances: int) -> list[Problem]:
    """Return problems of few frames: smooth, flickering, jumping, rising curves; any limit and budget.

    Of four in turn one is plain, one has frames that count more or not at all, one has sections that hold
    still or may change faster, and one has the power budget of an OLED panel; each kind of curves in turn.

    Parameters
    ----------
    rng : np.random.Generator
        Draws all of it.
    frames : tuple of int
        The least and the most.
    instances : int
        How many; the last one has curves that rise, and asks for nothing more.
    """
    least, most = frames
    problems = []
    for number in range(-instances, 0):
        kind, asked = number % 4, (number + number // 4 + 2) % 4
        n = int(np.exp(rng.uniform(np.log(least), np.log(most + 1))))
        speed = float(10 ** rng.uniform(-1.5, 1.0))  # steps long enough for the limit to be loose or tight
        if kind < 2:
            curves = made_curves(n, rng, frames_per_second=25 * speed / max(n / 20, 1))
        else:
            curves = _stairs(n, rng, rises=bool(kind == 3), frames_per_second=speed)
        budget = float(rng.choice([0.2 + 1e-6, 0.25, 0.5, 0.8, 1 - 1e-6, rng.uniform(0.2, 1.0)]))
        problems.append(_asked(curves, budget, float(10 ** rng.uniform(-0.5, 1.0)), asked))
    return problems


def _asked(curves: LossCurves, budget: float, scale: float, asked: int) -> Problem:
    """Return a problem that asks for nothing more (0), for weights (1) or allowances (2), or on OLED (3)."""
    n, end = curves.n_frames, float(curves.times[-1] + curves.durations[-1])
    first, last = (float(curves.times[k]) for k in (max(n // 3, 1), max(2 * n // 3, 1)))
    plain = Request(budget, BudgetUnit.FACTOR, load_power_model("surace2025"), load_rate_limit("surace2025"))
    request = (
        plain,
        replace(plain, weights=(VideoSection(0.0, first, 5.0), VideoSection(last, end, 0.0))),
        replace(
            plain,
            allowances=(VideoSection(0.0, first, allowance=0.0), VideoSection(last, end, allowance=3.0)),
        ),
        replace(plain, budget_unit=BudgetUnit.POWER, power_model=OLED),
    )[asked]
    return _scaled(pose(curves, request), scale)


def _stairs(n: int, rng: np.random.Generator, rises: bool, frames_per_second: float) -> LossCurves:
    """Return curves of a few large steps; some of them may rise with the factor."""
    knots = brightness_factors(knots=17)
    loss = rng.uniform(0.0, 0.7, (n, len(knots)))
    if not rises:
        loss = np.sort(loss, axis=1)[:, ::-1].copy()
    loss[:, -1] = 0.0
    return curves_of(loss, rng.uniform(1.0, 90.0, n), knots, frames_per_second)


def keep_made(curves: LossCurves, file: Path) -> None:
    """Keep made curves in a file, so that another process need not make them."""
    np.savez(file, loss=curves.loss, luminance=curves.mean_luminance, knots=curves.factors)


def solve_kept(file: str) -> None:
    """Solve and certify the problem of curves in a file, for the memory that it takes."""
    with np.load(file) as kept:
        curves = curves_of(kept["loss"], kept["luminance"], kept["knots"], FRAMES_PER_SECOND)
    problem = mean_factor_problem(curves, 0.5)
    lower_bound(problem, optimize(problem, SplittingSolver()))
