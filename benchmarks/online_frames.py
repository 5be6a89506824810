"""How long one frame takes the online controller: its loss, at several savings, and the step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.measured import Approach, RunSettings, point
from benchmarks.online_content import content, layered_pictures, picture
from benchmarks.peak_memory import peak_memory
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from evenlight.analysis.tracks.control_request import LoopRequest
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.method.choices import Resolution
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.one_factor import MANY_PIXELS, OneFactorLoss
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings, FrameMeasurement
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit

SIZES = ((1280, 720), (1920, 1080), (2880, 2720))
QUICK_SIZES = ((640, 360),)
FACTORS = (0.3, 0.5, 0.8)  # at which the errors are taken; times are at the one in the middle
ERROR = "difference of contrast loss from the definition, largest at factors 0.3, 0.5 and 0.8"
PIXELS = "pixels"
WHOLE, STRIPS = "one factor, every pixel", "one factor, one strip of rows in four"
LAYERED = "strips of rows, where the rows of pictures of 1280 x 720 differ most"
LAYERED_ERROR = (
    "difference from the loss of all rows, largest of six pictures, factors 0.3, 0.5, 0.8, all turns"
)
TURNS_OF_STRIPS = 4
PAPER = 25e-3  # [s] per frame that the paper's implementation adds on its graphics processor (Section 6)

LossAt = Callable[[float], float]


def frame_points(display: Display, settings: RunSettings, rng: np.random.Generator) -> list[BenchmarkPoint]:
    """Return the points of one frame's loss, for each size."""
    points = []
    for width, height in QUICK_SIZES if settings.quick else SIZES:
        settings.say(f"the loss of a frame of {width} x {height}")
        points += _points_of(picture(height, width, rng), display, settings)
    return points


def layered_points(display: Display, settings: RunSettings, rng: np.random.Generator) -> list[BenchmarkPoint]:
    """Return what strips err by at worst: at one turn, and in the mean of the four in which all rows are."""
    settings.say("strips of rows where rows differ")
    shape = (720, 1280)
    whole, strips = (OneFactorLoss(shape, display, one_strip_in=n) for n in (1, TURNS_OF_STRIPS))
    errors = {}
    for name, pixels in layered_pictures(*shape, rng).items():
        for b in FACTORS:
            turns = np.array([strips.of(pixels, b, turn).loss for turn in range(TURNS_OF_STRIPS)])
            off = turns - whole.of(pixels, b).loss
            errors[name, b] = float(np.abs(off).max()), abs(float(off.mean()))
    worst = max(errors, key=lambda one: errors[one][0])
    times = timed_in_turn({"strips": lambda: strips.of(pixels, FACTORS[1])}, settings.repeats(9))["strips"]
    four = replace(times, wall=times.wall * TURNS_OF_STRIPS, processor=times.processor * TURNS_OF_STRIPS)

    def of(name: str, seconds: Times, error: float, note: str) -> BenchmarkPoint:
        approach = Approach(LAYERED, name, Role.VARIANT, shape[0] * shape[1], PIXELS)
        return point(approach, seconds, error, LAYERED_ERROR, note)

    mean = max(error for _, error in errors.values())
    return [
        of(STRIPS, times, errors[worst][0], f"most with {worst[0]}, at factor {worst[1]:g}"),
        of("the mean of four such turns", four, mean, "while the picture stands"),
    ]


def frame_task(width: int, height: int) -> str:
    """Return what the task is called."""
    return f"loss of one frame of {width} x {height} at one factor"


def _points_of(pixels: NDArray[np.uint8], display: Display, settings: RunSettings) -> list[BenchmarkPoint]:
    """Return the points of one picture."""
    height, width = pixels.shape[:2]
    task, size = frame_task(width, height), height * width
    emitted = emitted_luminance(pixels, display)
    truth = [contrast_loss(emitted, factor, display) for factor in FACTORS]
    approaches = _approaches(pixels, display)
    times = timed_in_turn(
        {name: partial(at, FACTORS[1]) for name, at in approaches.items()}, settings.repeats(9)
    )
    points = []
    for name, at in approaches.items():
        error = max(abs(at(factor) - exact) for factor, exact in zip(FACTORS, truth, strict=True))
        role = Role.DEFAULT if name == WHOLE else Role.VARIANT
        note = "so few pixels are all counted" if name == STRIPS and size <= MANY_PIXELS else ""
        points.append(point(Approach(task, name, role, size, PIXELS), times[name], error, ERROR, note))
    if settings.quick or size < 3_000_000:  # the definition of the largest takes minutes to time in turn
        slow = timed_in_turn(
            {"ours": lambda: approaches[WHOLE](FACTORS[1]),
             "definition": lambda: contrast_loss(emitted, FACTORS[1], display)}, settings.repeats(3),
        )  # fmt: skip
        reference = Approach(task, "definition, float64", Role.REFERENCE, size, PIXELS)
        points.append(point(reference, slow["definition"], 0.0, ERROR))
    return points


def _approaches(pixels: NDArray[np.uint8], display: Display) -> dict[str, LossAt]:
    """Return the ways to the loss of a picture, the default first."""
    shape = pixels.shape[:2]
    knots = brightness_factors()
    curve = FrameAnalysis(shape, display, DEFAULT_MODEL, knots)
    strips = OneFactorLoss(shape, display, one_strip_in=TURNS_OF_STRIPS)
    meters = _meters(shape, display) | {STRIPS: strips}
    approaches: dict[str, LossAt] = {name: partial(_loss, one, pixels) for name, one in meters.items()}
    approaches["all factors at once, read at one"] = lambda b: float(
        np.interp(b, knots, curve.of(pixels).loss)
    )
    return approaches


def _meters(shape: tuple[int, int], display: Display) -> dict[str, OneFactorLoss]:
    """Return what measures loss at each resolution, by name."""
    counted = {one: LoopRequest(target_loss=0.05, resolution=one).strips_and_halvings for one in Resolution}
    meters = {one: OneFactorLoss(shape, display, DEFAULT_MODEL, 0.2, *ways) for one, ways in counted.items()}
    return {
        WHOLE if one is Resolution.FULL else f"resolution {one.value}": meter for one, meter in meters.items()
    }


def _loss(meter: OneFactorLoss, pixels: NDArray[np.uint8], factor: float) -> float:
    return meter.of(pixels, factor).loss


@dataclass(frozen=True, slots=True)
class _Live:
    """Goes from the pixels of a frame to its factor, as a live controller does."""

    controller: Controller
    meter: OneFactorLoss

    def factor(self, pixels: NDArray[Any]) -> float:
        """Return the factor of a second frame like the first."""
        shown = self.controller.start(0.5, FrameMeasurement(0.03, 40.0, 1 / 90))
        seen = self.meter.of(pixels, shown.factor)
        return self.controller.step(shown, FrameMeasurement(seen.loss, seen.mean_luminance, 1 / 90)).factor


def latency_points(
    display: Display, controller: Controller, settings: RunSettings, rng: np.random.Generator
) -> list[BenchmarkPoint]:
    """Return the points of a whole turn of the loop: from the pixels of a frame to its factor."""
    settings.say("from a frame to its factor")
    width, height = (640, 360) if settings.quick else (1920, 1080)
    pixels = picture(height, width, rng)
    loops = {name: _Live(controller, meter) for name, meter in _meters((height, width), display).items()}
    exact = _loss(loops[WHOLE].meter, pixels, FACTORS[1])
    times = timed_in_turn(
        {name: partial(one.factor, pixels) for name, one in loops.items()}, settings.repeats(15)
    )
    points = [
        point(
            Approach(
                f"from the pixels of {width} x {height} to the factor", name,
                Role.DEFAULT if name == WHOLE else Role.VARIANT, width * height, PIXELS,
            ),
            times[name], abs(_loss(one.meter, pixels, FACTORS[1]) - exact),
            "difference of the loss from that of all pixels",
        )
        for name, one in loops.items()
    ]  # fmt: skip
    return [replace(p, peak_memory=_memory(pixels)) if p.approach == WHOLE else p for p in points]


def _memory(pixels: NDArray[np.uint8]) -> float | None:
    """Return the largest memory of a process that reads a picture and finds its factor [MiB]."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "picture.npy"
        np.save(file, pixels)
        return peak_memory(f"{__name__}:control_kept", str(file))


def control_kept(file: str) -> None:
    """Find the factor of the picture in a file, twice in a row, for the memory that it takes."""
    pixels, display = np.load(file), load_display("varjo-xr3")
    limit = scalar_rate_limit(load_rate_limit("surace2025"))
    live = _Live(Controller(ControllerSettings(0.05), limit), OneFactorLoss(pixels.shape[:2], display))
    for _ in range(2):
        live.factor(pixels)


def step_point(display: Display, controller: Controller, settings: RunSettings) -> BenchmarkPoint:
    """Return the point of the controller alone: of 3000 frames whose loss is known, the time of one."""
    wave = np.sin(np.arange(3000) / 40)
    curves = content(0.3 + 0.2 * wave, 40 - 20 * wave, display, 90.0)
    times = timed_in_turn({"step": lambda: control_curves(curves, controller)}, settings.repeats(9))["step"]
    per_frame = replace(times, wall=times.wall / 3000, processor=times.processor / 3000)
    approach = Approach("a step of the controller", "PID within the rate limit", Role.DEFAULT, 1, "frames")
    return point(approach, per_frame, note="of 3000 in a row; the loss is read from a curve")


def cited_point() -> BenchmarkPoint:
    """Return the paper's own figure."""
    return BenchmarkPoint(
        task="loss and controller, in the paper", approach="graphics processor (Section 6)", role=Role.CITED,
        size=1, size_of="frames", repeats=0, time=PAPER, time_low=PAPER, time_high=PAPER,
        note="added to each frame; size of the frames and machine are the paper's",
    )  # fmt: skip
