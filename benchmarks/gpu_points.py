"""What the graphics processor adds to the benchmarks of curves and of the online controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.curve_definition import loss_curves_by_definition
from benchmarks.gpu_clock import copy_bandwidth, gpu_seconds
from benchmarks.measured import Approach, RunSettings, claim, not_measured, point
from benchmarks.online_content import picture
from benchmarks.online_frames import QUICK_SIZES
from benchmarks.online_frames import frame_task as loss_task
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.one_factor import MeasuredLoss, OneFactorLoss
from evenlight.method.gpu.context import OwnContext, is_software, renderer_name
from evenlight.method.gpu.frame_loss import GpuCurve, GpuLoss
from evenlight.method.gpu.one_pass import GpuOnePass
from evenlight.method.gpu.pyramid import FrameTexture, packed
from evenlight.method.online.controller import Controller, ControllerSettings, FrameMeasurement
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit

if TYPE_CHECKING:
    import moderngl

CURVE_SIZES = ((640, 360), (1280, 720), (1920, 1080))
TARGETS = {(1920, 1080): 2e-3, (2880, 2720): 5e-3}  # [s] for a frame's loss and the controller's answer
QUICK_SIZE = (320, 180)
FACTOR = 0.5  # at which the loss is asked for
EVERY = 8  # knot of a curve at which it is compared: the definition takes a second for each
CURVE_ERROR = f"largest difference of contrast loss from the definition, at every {EVERY}th knot"
LOSS_ERROR = f"difference of contrast loss from the definition at factor {FACTOR:g}"
BYTES = 4  # of a pixel of the textures here: four channels of 8 bits

Frame = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class _Bench:
    """One size, and where it is measured.

    Attributes
    ----------
    context : moderngl.Context
        Current.
    display : Display
        What the frame is shown on.
    frame : array of uint8, (height, width, 3)
        The frame.
    approach : Approach
        Task and size of its points.
    settings : RunSettings
        How to run them.
    """

    context: moderngl.Context
    display: Display
    frame: Frame
    approach: Approach
    settings: RunSettings

    @property
    def software(self) -> bool:
        """Whether OpenGL runs on the processor."""
        return is_software(renderer_name(self.context))

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width."""
        return self.frame.shape[0], self.frame.shape[1]

    def named(self, words: str) -> Approach:
        """Return what a point says of itself."""
        return replace(self.approach, approach=f"GPU, {words}")

    def texture(self) -> FrameTexture:
        """Return the frame as a texture of levels, four channels of 8 bits."""
        height, width = self.shape
        four = np.concatenate([self.frame, np.full((height, width, 1), 255, np.uint8)], axis=2)
        texture = self.context.texture((width, height), 4, four.tobytes(), dtype="u1")
        return FrameTexture(texture)


@dataclass(frozen=True, slots=True)
class _Work:
    """What the graphics processor is given to do.

    Attributes
    ----------
    start, result : function
        Begin without waiting; fetch what came out.
    moved : int
        Bytes that pass between shaders and memory at least.
    """

    start: Callable[[], object]
    result: Callable[[], object]
    moved: int


def frame_task(width: int, height: int) -> str:
    """Return what the task of a frame's curve is called."""
    return f"one frame of {width} x {height}"


def curve_points(
    settings: RunSettings, task_of: Callable[[int, int], str] = frame_task, display: Display | None = None
) -> list[BenchmarkPoint]:
    """Return the points of loss curves on the graphics processor; none where there is none.

    Parameters
    ----------
    settings : RunSettings
        How to run them.
    task_of : function
        What the task of a width and height is called.
    display : Display, optional
        What frames are shown on; without it, the paper's.
    """
    shown = display or load_display("varjo-xr3")
    try:
        own = OwnContext()
    except InputError:
        return []
    points: list[BenchmarkPoint] = []
    for size in (QUICK_SIZE,) if settings.quick else CURVE_SIZES:
        settings.say(f"loss curve on the graphics processor, {size[0]} x {size[1]}")
        points += own.run(_curve_points_of, _bench(own, size, (task_of(*size), shown, settings)))
    return points


def _bench(own: OwnContext, size: tuple[int, int], rest: tuple[str, Display, RunSettings]) -> _Bench:
    """Return one size, and where it is measured; `rest` is the task, the display and the settings."""
    (width, height), (task, display, settings) = size, rest
    frame = picture(height, width, np.random.default_rng(settings.seed))
    approach = Approach(task, "", Role.VARIANT, width * height, "pixels")
    return _Bench(own.context, display, frame, approach, settings)


def _curve_points_of(bench: _Bench) -> list[BenchmarkPoint]:
    """Return the points of one size: with upload and reading back, and the shaders alone."""
    knots, frame = brightness_factors(), bench.frame
    processor = FrameAnalysis(bench.shape, bench.display, DEFAULT_MODEL, knots)
    curve = GpuCurve(bench.context, bench.shape, bench.display, DEFAULT_MODEL, knots)
    runs = {"processor": lambda: processor.of(frame), "gpu": lambda: curve.of(packed(frame))}
    times = timed_in_turn(runs, bench.settings.repeats(5))
    asked = slice(None, None, -EVERY)
    emitted = emitted_luminance(frame, bench.display)
    expected = loss_curves_by_definition(emitted, knots[asked], bench.display)
    error = float(np.abs(curve.of(packed(frame)).loss[asked] - expected).max())
    whole = point(
        bench.named("upload to read-back"), times["gpu"], error, CURVE_ERROR, renderer_name(bench.context)
    )
    texture = bench.texture()
    work = _Work(lambda: curve.start(texture), curve.result, _bytes_moved(curve.one_pass))
    return [whole, _alone(bench, work, times["processor"], whole)]


def _bytes_moved(one_pass: GpuOnePass) -> int:
    """Return the bytes that have to pass between shaders and memory, each level once in each pass."""
    sizes = [height * width for height, width in one_pass._pyramid.shapes]
    levels = BYTES * sizes[0] + 4 * sum(sizes) + 4 * sum(sizes[1:-1])
    counts = sum(references * sum(sizes[level : level + 3]) for level, references, _ in one_pass._places)
    return levels + 4 * counts + 4 * one_pass._nothing.size


def online_points(settings: RunSettings) -> tuple[list[BenchmarkPoint], list[BenchmarkClaim]]:
    """Return the points of the loss at one factor from a texture, and the targets held to it.

    Parameters
    ----------
    settings : RunSettings
        How to run them.
    """
    sizes = QUICK_SIZES if settings.quick else tuple(TARGETS)
    display = load_display("varjo-xr3")
    try:
        own = OwnContext()
    except InputError as error:
        return [], [not_measured(_words(size), limit, "s", str(error)) for size, limit in TARGETS.items()]
    points: list[BenchmarkPoint] = []
    for size in sizes:
        settings.say(f"loss on the graphics processor, {size[0]} x {size[1]}")
        points += own.run(_online_points_of, _bench(own, size, (loss_task(*size), display, settings)))
    return points, _claims(points, own.renderer)


def _online_points_of(bench: _Bench) -> list[BenchmarkPoint]:
    """Return the points of one size: until the factor is known, one frame late, and the shaders alone."""
    loss, texture = GpuLoss(bench.context, bench.shape, bench.display), bench.texture()
    processor, answer = OneFactorLoss(bench.shape, bench.display), _controller()
    runs: dict[str, Callable[[], Any]] = {
        "processor": lambda: answer(processor.of(bench.frame, FACTOR)),
        "from texture to factor": lambda: answer(loss.of(texture, FACTOR)),
    }
    if not bench.software:  # which works at once, and is never late
        behind = _behind(bench, texture)
        runs["from texture to factor, one frame late"] = lambda: answer(behind())
    times = timed_in_turn(runs, bench.settings.repeats(3 if bench.software else 25))
    exact = contrast_loss(emitted_luminance(bench.frame, bench.display), FACTOR, bench.display)
    error, name = abs(loss.of(texture, FACTOR).loss - exact), renderer_name(bench.context)
    default = times.pop("processor")
    points = [point(bench.named(words), t, float(error), LOSS_ERROR, name) for words, t in times.items()]
    work = _Work(lambda: loss.start(texture, FACTOR), loss.result, _bytes_moved(loss.one_pass))
    return [*points, _alone(bench, work, default, points[0])]


def _behind(bench: _Bench, texture: FrameTexture) -> Callable[[], MeasuredLoss]:
    """Return a function that begins with a frame, and returns what the one before gave."""
    loss = GpuLoss(bench.context, bench.shape, bench.display)
    loss.start(texture, FACTOR)

    def seen() -> MeasuredLoss:
        loss.start(texture, FACTOR)
        return loss.result()

    return seen


def _controller() -> Callable[[MeasuredLoss], float]:
    """Return the controller's answer to what was seen of a frame."""
    limit = scalar_rate_limit(load_rate_limit("surace2025"))
    controller = Controller(ControllerSettings(target_loss=0.03), limit)
    shown = controller.start(FACTOR, FrameMeasurement(0.03, 40.0, 1 / 90))
    return lambda seen: (
        controller.step(shown, FrameMeasurement(seen.loss, seen.mean_luminance, 1 / 90)).factor
    )


def _alone(bench: _Bench, work: _Work, default: Times, like: BenchmarkPoint) -> BenchmarkPoint:
    """Return the point of the shaders alone, and how near they are to what memory allows."""
    repeats = bench.settings.repeats(3 if bench.software else 25)
    seconds = gpu_seconds(bench.context, work.start, work.result, repeats)
    # Taken apart from the default's: ratios are to its median, and processor time is not known.
    times = Times(seconds, np.zeros_like(seconds), seconds / np.median(default.wall))
    way = "until done: software has no timer queries that count them" if bench.software else "timer queries"
    bandwidth = copy_bandwidth(bench.context)
    share = work.moved / bandwidth / float(np.median(seconds))
    note = (
        f"{renderer_name(bench.context)}; {way}; moves at least {work.moved / 1e6:.0f} MB, which takes "
        f"{100 * share:.2g} % of this time at the {bandwidth / 1e9:.0f} GB/s of a copy from buffer to buffer"
    )
    made = point(bench.named("shaders alone"), times, like.error, like.error_of, note)
    return replace(made, processor_time=None)


def _words(size: tuple[int, int]) -> str:
    """Return a target in words."""
    return f"loss and control of a frame of {size[0]} x {size[1]}"


def _claims(points: list[BenchmarkPoint], renderer: str) -> list[BenchmarkClaim]:
    """Return the targets, and whether they are met: from texture to factor, waited for."""
    claims = []
    for size, limit in TARGETS.items():
        found = [p for p in points if p.size == size[0] * size[1] and p.approach.endswith("to factor")]
        if is_software(renderer):
            took = f", where it takes {found[0].time:.2g} s" if found else ""
            why = f"OpenGL runs on the processor here ({renderer}){took}"
            claims.append(not_measured(_words(size), limit, "s", why))
        elif found:
            claims.append(
                claim(_words(size), limit, found[0].time, "s", f"{renderer}; the answer waited for")
            )
        else:
            claims.append(not_measured(_words(size), limit, "s", "not in a quick run"))
    return claims
