"""Loss curves of one frame: how fast the one pass is and its variants are, and how far they err."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.curve_definition import loss_curves_by_definition
from benchmarks.measured import Approach, RunSettings, point
from benchmarks.online_content import picture
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from benchmarks.unfused_pass import TABLE_STEPS, UnfusedPass
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import emitted_luminance

SIZES = ((640, 360), (1280, 720), (1920, 1080))
QUICK_SIZES = ((320, 180),)
GROWTH_SIZES = ((320, 180), (640, 360), (960, 540), (1280, 720), (1920, 1080), (2560, 1440))
EVERY = 8  # knot at which a curve is compared: the definition takes up to a second for each
ERROR = f"largest difference of contrast loss from the definition, at every {EVERY}th knot"
BETWEEN = "largest difference of contrast loss from the definition, at 129 factors, most between the knots"
OURS = "one pass, every b"
DOUBLE, SINGLE = "one pass in double precision, NumPy", "one pass in single precision, NumPy"
OF_PIXELS = "pixels"
GROWTH = "one frame, by size"

Pixels = NDArray[np.uint8]
Curve = Callable[[], Array]


@dataclass(frozen=True, slots=True)
class _Variant:
    """One way to a curve: how it is run, what should be known of it, and whether it takes long."""

    curve: Curve
    note: str = ""
    long: bool = False


def frame_task(width: int, height: int) -> str:
    """Return what the task of a frame is called."""
    return f"one frame of {width} x {height}"


def frame_points(settings: RunSettings, display: Display) -> list[BenchmarkPoint]:
    """Return the points of frames of several sizes, by default and with one thing changed."""
    points = []
    for width, height in QUICK_SIZES if settings.quick else SIZES:
        settings.say(f"loss curve of a frame of {width} x {height}")
        frame = picture(height, width, np.random.default_rng(settings.seed))
        approach = Approach(frame_task(width, height), "", Role.VARIANT, width * height, OF_PIXELS)
        points += _points(approach, frame, display, settings)
    return points


def _points(
    approach: Approach, frame: Pixels, display: Display, settings: RunSettings
) -> list[BenchmarkPoint]:
    """Return the points of one frame."""
    knots = brightness_factors()
    asked = np.arange(len(knots) - 1, -1, -EVERY)[::-1]
    emitted = emitted_luminance(frame, display)
    expected, once = _timed_once(lambda: loss_curves_by_definition(emitted, knots[asked], display))
    variants = _variants(frame, display, knots) | _unfused(frame, display, knots)
    times = _times(variants, settings)
    curves = {name: variant.curve() for name, variant in variants.items()}
    reference = replace(approach, approach=f"the definition, {len(asked)} factors", role=Role.REFERENCE)
    usual = float(np.median(times[OURS].wall))
    definition = replace(point(reference, once), ratio=once.wall[0] / usual, error=0.0, error_of=ERROR)
    points = [replace(definition, note="float64; one run")]
    for name, variant in variants.items():
        error = float(np.abs(curves[name][asked] - expected).max())
        made = replace(approach, approach=name, role=Role.DEFAULT if name == OURS else Role.VARIANT)
        points.append(point(made, times[name], error, ERROR, variant.note + _from_double(name, curves)))
    return points


def _times(variants: Mapping[str, _Variant], settings: RunSettings) -> dict[str, Times]:
    """Return the times of ways to a curve, the usual one first; long ones have few turns of their own."""
    fast = {name: variant.curve for name, variant in variants.items() if not variant.long}
    slow = {name: variant.curve for name, variant in variants.items() if variant.long or name == OURS}
    return timed_in_turn(slow, settings.repeats(3)) | timed_in_turn(fast, settings.repeats(9))


def _from_double(name: str, curves: Mapping[str, Array]) -> str:
    """Return what to add to a note: how far single precision is from the same pass in double precision."""
    if name not in (OURS, SINGLE):
        return ""
    return f"; at most {np.abs(curves[name] - curves[DOUBLE]).max():.1g} from double precision at any of them"


def _variants(frame: Pixels, display: Display, knots: Array) -> dict[str, _Variant]:
    """Return the ways to the curve of a frame, the usual one first."""
    shape = frame.shape[:2]
    authors = ContrastModel(sensitivity=SensitivityModel.AUTHORS)
    halved = replace(display, pixels_per_degree=display.pixels_per_degree / 2)
    small = FrameAnalysis((shape[0] // 2, shape[1] // 2), halved, DEFAULT_MODEL, knots)

    def one_pass(model: ContrastModel = DEFAULT_MODEL, **choices: Any) -> Curve:
        analysis = FrameAnalysis(shape, display, model, knots, **choices)
        return lambda: analysis.of(frame).loss

    return {
        OURS: _Variant(one_pass(), "single precision, 65 knots"),
        "half resolution": _Variant(lambda: small.of(_half(frame)).loss, "pixel values averaged by four"),
        **{f"tables of {n} steps": _Variant(one_pass(table_steps=n)) for n in (512, 64, 16, 8)},
        "sensitivity of the level's mean": _Variant(one_pass(authors), "as the authors' script, pupil fixed"),
    }


def _unfused(frame: Pixels, display: Display, knots: Array) -> dict[str, _Variant]:
    """Return the same pass as expressions over whole images, in either precision."""
    shape = (frame.shape[0], frame.shape[1])

    def curve(precision: type[np.floating[Any]]) -> Curve:
        return partial(UnfusedPass(shape, display, knots, precision).loss, frame)

    of_double = f"the same steps as expressions over whole images, tables of {TABLE_STEPS} steps"
    of_single = f"as in double precision, each step's images rounded; {len(knots)} knots"
    return {
        DOUBLE: _Variant(curve(np.float64), of_double, long=True),
        SINGLE: _Variant(curve(np.float32), of_single, long=True),
    }


def _half(frame: Pixels) -> Pixels:
    """Return a frame of half the size, each pixel the mean of four."""
    height, width = (2 * (side // 2) for side in frame.shape[:2])
    rows = frame[0:height:2].astype(np.uint16) + frame[1:height:2]
    return np.asarray((rows[:, 0:width:2] + rows[:, 1:width:2] + 2) // 4, dtype=np.uint8)


def knot_points(settings: RunSettings, display: Display) -> list[BenchmarkPoint]:
    """Return the points of curves of few and many knots, with what they err by between them."""
    width, height = QUICK_SIZES[0] if settings.quick else SIZES[0]
    settings.say("knots of a curve")
    frame = picture(height, width, np.random.default_rng(settings.seed))
    task = f"{frame_task(width, height)}, between the knots"
    approach = Approach(task, "", Role.VARIANT, width * height, OF_PIXELS)
    dense, emitted = brightness_factors(knots=129), emitted_luminance(frame, display)
    expected, once = _timed_once(lambda: loss_curves_by_definition(emitted, dense, display))
    paper = np.linspace(0.2, 1.0, 5)

    def curve(knots: Array) -> Curve:
        analysis = FrameAnalysis(frame.shape[:2], display, DEFAULT_MODEL, knots)
        return lambda: np.interp(dense, knots, analysis.of(frame).loss)

    def by_definition() -> Array:
        return np.interp(dense, paper, loss_curves_by_definition(emitted, paper, display))

    ways = {f"{n} knots": curve(brightness_factors(knots=n)) for n in (65, 5, 9, 17, 33, 129)}
    ways |= {"the paper's 5 knots": curve(paper), "the paper's 5 knots by definition": by_definition}
    times = timed_in_turn(ways, settings.repeats(5))
    role = {"65 knots": Role.DEFAULT, "the paper's 5 knots by definition": Role.PEER}
    reference = replace(approach, approach="the definition, 129 factors", role=Role.REFERENCE)
    usual = float(np.median(times["65 knots"].wall))
    points = [replace(point(reference, once), ratio=once.wall[0] / usual, error=0.0, error_of=BETWEEN)]
    for name, run in ways.items():
        made = replace(approach, approach=name, role=role.get(name, Role.VARIANT))
        points.append(point(made, times[name], float(np.abs(run() - expected).max()), BETWEEN))
    return points


def growth_points(settings: RunSettings, display: Display) -> list[BenchmarkPoint]:
    """Return the times of frames of many sizes."""
    sizes = GROWTH_SIZES[:3] if settings.quick else GROWTH_SIZES
    points = []
    for width, height in sizes:
        settings.say(f"growth: {width} x {height}")
        frame = picture(height, width, np.random.default_rng(settings.seed))
        analysis = FrameAnalysis((height, width), display, DEFAULT_MODEL, brightness_factors())
        times = timed_in_turn({OURS: partial(analysis.of, frame)}, settings.repeats(9))[OURS]
        points.append(point(Approach(GROWTH, OURS, Role.DEFAULT, width * height, OF_PIXELS), times))
    return points


def _timed_once(run: Curve) -> tuple[Array, Times]:
    """Return what a long run gives, and its times."""
    began, used = time.perf_counter(), time.process_time()
    result = run()
    wall, processor = time.perf_counter() - began, time.process_time() - used
    return result, Times(np.array([wall]), np.array([processor]), np.ones(1))
