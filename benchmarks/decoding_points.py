"""From a file of H.264 to loss curves: what decoding, luminance and the count take of it, and two jobs."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.frame import VideoFrame

from benchmarks.frame_points import OF_PIXELS, QUICK_SIZES, SIZES
from benchmarks.measured import Approach, RunSettings, claim, point
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from benchmarks.video_points import RATE, film
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.stimuli.video.video_file import VideoFile, open_video_file

DECODING, CONVERTED = "decoded", "decoded and made R, G, B"
OF_PLANES, OF_RGB = "luminance of Y, Cb, Cr", "luminance of R, G, B"
COUNTED = "luminance and every band"
ONE_JOB, TWO_JOBS = "curves of the file, one job", "curves of the file, two jobs"
ERROR = "largest difference of luminance from that of R, G, B [cd/m^2]"
TARGET_JOBS = 1 / 1.7  # time of two jobs to that of one


def decoding_points(settings: RunSettings, display: Display) -> list[BenchmarkPoint]:
    """Return the points of files of several sizes: of each step by itself, and of all of them."""
    points = []
    for width, height in QUICK_SIZES if settings.quick else SIZES:
        settings.say(f"a file of {width} x {height}")
        with tempfile.TemporaryDirectory() as folder:
            film_of = film(width, height, 6 if settings.quick else 24, settings.seed)
            video = open_video_file(encoded(Path(folder) / "film.mp4", film_of))
            points += _points(video, width, height, display, settings)
    return points


def _points(
    video: VideoFile, width: int, height: int, display: Display, settings: RunSettings
) -> list[BenchmarkPoint]:
    """Return the points of one file; times are of one frame."""
    frames = list(video.frames())
    light = FrameLight(display, DEFAULT_MODEL.pixel_to_luminance)
    analysis = FrameAnalysis((height, width), display, DEFAULT_MODEL, brightness_factors())

    def curves(jobs: int) -> Callable[[], object]:
        return lambda: analyze_frames(video.frames(), video.name, display, effort=AnalysisEffort(jobs=jobs))

    runs: dict[str, Callable[[], object]] = {
        ONE_JOB: curves(1),
        TWO_JOBS: curves(2),
        DECODING: lambda: [None for _ in video.frames()],
        CONVERTED: lambda: [None for frame in video.frames() if frame.pixel_values.size],
        OF_PLANES: lambda: [None for frame in frames if light.luminance(frame.pixels).size],
        OF_RGB: lambda: [None for frame in frames if light.luminance(frame.pixel_values).size],
        COUNTED: lambda: [analysis.of(frame.pixels) for frame in frames],
    }
    errors = [np.abs(light.luminance(f.pixels) - light.luminance(f.pixel_values)).max() for f in frames]
    points = []
    for name, times in timed_in_turn(runs, settings.repeats(7)).items():
        of_one = replace(times, wall=times.wall / len(frames), processor=times.processor / len(frames))
        role = Role.DEFAULT if name == ONE_JOB else Role.VARIANT
        approach = Approach(
            f"a frame of an H.264 file of {width} x {height}", name, role, width * height, OF_PIXELS
        )
        error = (float(max(errors)), ERROR) if name == OF_PLANES else (None, "")
        points.append(point(approach, of_one, *error))
    return points


def encoded(path: Path, frames: Iterable[Frame]) -> Path:
    """Write a film as encoders do: H.264, 4:2:0, each picture in one slice."""
    whole = {"x264-params": "sliced-threads=0:slices=1"}
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=round(RATE), options=whole)
        first, *others = frames
        stream.height, stream.width = first.shape
        stream.pix_fmt = "yuv420p"
        for k, frame in enumerate([first, *others]):
            picture = VideoFrame.from_ndarray(frame.pixel_values, "rgb24").reformat(format="yuv420p")
            picture.pts, picture.time_base = k, 1 / Fraction(RATE)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def decoding_claims(points: Sequence[BenchmarkPoint]) -> list[BenchmarkClaim]:
    """Return the targets: planes change nothing, and two jobs save time, here at the second largest size."""
    errors = [p.error for p in points if p.error is not None]
    pairs = [p.ratio for p in points if p.approach == TWO_JOBS and p.ratio is not None]
    note = "one job decodes beside the analysis already; on two cores the sum of both is the limit"
    return [
        claim("luminance of Y, Cb, Cr, against that of R, G, B", 0.0, max(errors), "cd/m^2", "bit by bit"),
        claim("time of two jobs, to that of one", TARGET_JOBS, pairs[len(pairs) // 2], "", note),
    ]
