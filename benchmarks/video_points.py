"""Loss curves of a video: every frame, and one frame in ten."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.measured import Approach, RunSettings, point
from benchmarks.online_content import picture
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from benchmarks.video_definition import DefaultErrors, default_errors
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.stimuli.sequences import built_in_sequence

RATE = 25.0  # [Hz]
SMALL, FEW = (640, 360), 33  # pixels and frames of a video that takes seconds
ONE_IN = 10  # frames, as the paper samples a video
ERROR = "largest difference of contrast loss from that of every frame, over all frames and knots"
EVERY_FRAME = "every frame"

Frames = list[Frame]


@dataclass(frozen=True, slots=True)
class _Clip:
    """A video in memory, so that what is timed is its analysis."""

    name: str
    frames: Frames

    @property
    def task(self) -> str:
        """What is done with it."""
        height, width = self.frames[0].shape
        return f"{self.name}: {len(self.frames)} frames of {width} x {height}"


def video_points(settings: RunSettings, display: Display) -> tuple[list[BenchmarkPoint], list[DefaultErrors]]:
    """Return the points of two videos, and what the default misses the definition by in some of their frames.

    They are a rendered sequence, and a film of what is hard.
    """
    points, errors = [], []
    for clip in _clips(settings):
        settings.say(f"a video, {clip.name}")
        points += _points(clip, display, settings)
        settings.say(f"a video, {clip.name}, by the definition")
        errors.append(_errors(clip, display, 1 if settings.quick else 2))
    if not settings.quick:  # whose frames have this size anyhow
        errors.append(_errors(_sunrise(SMALL, FEW), display, 3))
    return points, errors


def _errors(clip: _Clip, display: Display, many: int) -> DefaultErrors:
    """Return what the curves miss the definition by in some frames."""
    return default_errors(clip.frames, analyze_frames(clip.frames, clip.name, display), many)


def _clips(settings: RunSettings) -> Iterator[_Clip]:
    """Yield the videos."""
    size, n = (SMALL, FEW) if settings.quick else ((1280, 720), 100)
    yield _sunrise(size, n)
    yield _Clip("film", list(film(*size, n, settings.seed)))


def _sunrise(size: tuple[int, int], n: int) -> _Clip:
    """Return the first frames of a rendered sequence."""
    frames = itertools.islice(built_in_sequence("sunrise", size).frames(), n)
    return _Clip("sunrise", [Frame(f.time, f.duration, f.pixel_values.copy()) for f in frames])


def film(width: int, height: int, n: int, seed: int) -> Iterator[Frame]:
    """Yield a film of four shots: still with grain, panned, faded out, and panned fast with a flash in it."""
    rng = np.random.default_rng(seed)
    shots = [picture(height, width, rng) for _ in range(4)]
    for k in range(n):
        shot, way = 4 * k // n, (4 * k % n) / n
        pixels = np.roll(shots[shot], (0, 2, 0, 15)[shot] * k, axis=1).astype(np.float64)
        if shot == 0:
            pixels += 4 * rng.standard_normal((height, width, 1))
        pixels *= 1 - way if shot == 2 else 1
        pixels += 60 if k == n - 5 else 0
        yield Frame(k / RATE, 1 / RATE, np.clip(pixels.round(), 0, 255).astype(np.uint8))


def _points(clip: _Clip, display: Display, settings: RunSettings) -> list[BenchmarkPoint]:
    """Return the points of one video."""

    def counted(jobs: int) -> Array:
        return analyze_frames(clip.frames, clip.name, display, effort=AnalysisEffort(jobs)).loss

    runs: dict[str, Callable[[], Array]] = {
        EVERY_FRAME: lambda: counted(1),
        f"{EVERY_FRAME}, 2 cores": lambda: counted(2),
        f"one frame in {ONE_IN}, linear (as the paper)": lambda: _one_in_ten(clip.frames, display, np.interp),
        f"one frame in {ONE_IN}, splines": lambda: _one_in_ten(clip.frames, display, _spline),
    }
    times = timed_in_turn(runs, settings.repeats(3))
    exact = counted(1)
    points = []
    for name, run in runs.items():
        role = Role.DEFAULT if name == EVERY_FRAME else Role.PEER if "paper" in name else Role.VARIANT
        approach = Approach(clip.task, name, role, len(clip.frames), "frames")
        points.append(point(approach, times[name], float(np.abs(run() - exact).max()), ERROR))
    return points


def _one_in_ten(frames: Frames, display: Display, between: Callable[[Array, Array, Array], Array]) -> Array:
    """Return the loss of every frame from that of one in ten and of the last, interpolated over time."""
    sampled = sorted({*range(0, len(frames), ONE_IN), len(frames) - 1})
    known = analyze_frames([frames[k] for k in sampled], "sampled", display).loss
    every, at = np.arange(len(frames), dtype=np.float64), np.array(sampled, dtype=np.float64)
    return np.array([between(every, at, knot) for knot in known.T]).T


def _spline(every: Array, at: Array, values: Array) -> Array:
    """Return a cubic spline through values."""
    return np.asarray(CubicSpline(at, values)(every))
