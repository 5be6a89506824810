"""From a file of H.264 to a player page: what each stage takes, beside FFmpeg's own decoding; two jobs."""

from __future__ import annotations

import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.video.frame import VideoFrame

from benchmarks.frame_points import OF_PIXELS, QUICK_SIZES, SIZES
from benchmarks.measured import Approach, RunSettings, claim, point
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from benchmarks.video_points import RATE, film
from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.player.picture_recorder import PictureRecorder
from evenlight.analysis.player.player_page import player_content, player_html
from evenlight.analysis.tracks.optimization import optimize_video
from evenlight.analysis.tracks.price_figure import price_figure
from evenlight.analysis.tracks.track_figure import track_figure
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame, LumaChroma
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.band_shares import BandShares
from evenlight.method.contrast.critical_factor import band_tables
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.method.contrast.one_pass import reduced
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import optimize, pose
from evenlight.method.optimizer.splitting import make_solver
from evenlight.stimuli.video.video_file import VideoFile, open_video_file

FFMPEG, COPIED = "FFmpeg decodes it", "a copy of its planes in memory"
DECODING = "decoding, with every check"
OF_PLANES, PYRAMID, BANDS = "luminance of Y, Cb, Cr", "pyramid of luminance", "bands, from histogram to curve"
ONE_JOB, TWO_JOBS = "curves of the file, one job", "curves of the file, two jobs"
SOLVER, FIGURES = "solver and lower bound", "figures of the track and of its price"
PLAYER = "player page, decoding included"
AUTHORS, PUBLISHED = "the authors' script, 25 of 250 frames of 1920 x 1080", 10.8  # [s], measured apart
ERROR = "largest difference of luminance from that of R, G, B [cd/m^2]"
TARGET_JOBS = 1 / 1.7  # time of two jobs to that of one
HELD = 5  # frames whose levels are in memory at a time
ASKED = TrackRequest(budget=0.5, no_cache=True)


def decoding_points(settings: RunSettings, display: Display) -> list[BenchmarkPoint]:
    """Return the points of a file: of FFmpeg alone, and of each stage from the file to the player page."""
    (width, height), n = ((QUICK_SIZES if settings.quick else SIZES)[-1], 6 if settings.quick else 100)
    words = f"file to page, {n} frames of {width} x {height}"
    settings.say(words)
    with tempfile.TemporaryDirectory() as folder:
        video = open_video_file(encoded(Path(folder) / "film.mp4", film(width, height, n, settings.seed)))
        frames = list(video.frames())
        runs = _of_frames(video, frames, display) | _of_file(video, display) | _of_track(video)
        times = timed_in_turn(runs, settings.repeats(5))
    light = FrameLight(display, DEFAULT_MODEL.pixel_to_luminance)
    task = Approach(words, "", Role.VARIANT, width * height, OF_PIXELS)
    pairs = [(light.luminance(f.pixels), light.luminance(f.pixel_values)) for f in frames[::HELD]]
    error = max(float(np.abs(of_planes - of_rgb).max()) for of_planes, of_rgb in pairs)
    points = []
    for name in runs:
        approach = replace(task, approach=name, role=Role.REFERENCE if name == FFMPEG else Role.VARIANT)
        points.append(point(approach, times[name], *((error, ERROR) if name == OF_PLANES else ())))
    cited = point(replace(task, approach=AUTHORS, role=Role.CITED), Times(*np.full((3, 1), PUBLISHED)))
    return [*points, replace(cited, repeats=0, processor_time=None, ratio=None)]


def _of_frames(video: VideoFile, frames: list[Frame], display: Display) -> dict[str, Callable[[], object]]:
    """Return what is done with each frame: by FFmpeg, and by the stages of its analysis."""
    knots = brightness_factors()
    light = FrameLight(display, DEFAULT_MODEL.pixel_to_luminance)
    bands = band_tables(frames[0].shape, float(knots[0]), display, DEFAULT_MODEL)
    shares = BandShares(DEFAULT_MODEL, knots, bands)
    of_planes = [f.pixels.planes if isinstance(f.pixels, LumaChroma) else (f.pixels,) for f in frames]
    copies = [np.empty_like(plane) for plane in of_planes[0]]
    held = [_levels(light.luminance(frame.pixels), len(bands) + 2) for frame in frames[:HELD]]

    def counted(k: int) -> None:
        levels = held[k % len(held)]
        for number, three in enumerate(zip(levels, levels[1:], levels[2:], strict=False)):
            shares.of(*three, number)

    def copied(k: int) -> None:
        for copy, plane in zip(copies, of_planes[k], strict=True):
            np.copyto(copy, plane)

    def each(work: Callable[[int], object]) -> Callable[[], object]:
        return lambda: deque(map(work, range(len(frames))), maxlen=0)  # nothing is kept

    return {
        FFMPEG: lambda: _decoded(str(video.path)),
        COPIED: each(copied),
        OF_PLANES: each(lambda k: light.luminance_and_means(frames[k].pixels)),
        PYRAMID: each(lambda k: _levels(held[k % len(held)][0], len(bands) + 2)),
        BANDS: each(counted),
    }


def _levels(luminance: Any, count: int) -> list[Any]:
    levels = [luminance]
    while len(levels) < count:
        levels.append(reduced(levels[-1]))
    return levels


def _decoded(path: str) -> None:
    with av.open(path) as container:
        container.streams.video[0].thread_type = "AUTO"
        deque(container.decode(video=0), maxlen=0)


def _of_file(video: VideoFile, display: Display) -> dict[str, Callable[[], object]]:
    def curves(jobs: int) -> Callable[[], object]:
        return lambda: analyze_frames(video.frames(), video.name, display, effort=AnalysisEffort(jobs=jobs))

    return {DECODING: lambda: [None for _ in video.frames()], ONE_JOB: curves(1), TWO_JOBS: curves(2)}


def _of_track(video: VideoFile) -> dict[str, Callable[[], object]]:
    job = replace(ASKED.job(video, *ASKED.posed()), quiet=True)
    summary, ((curves, data),) = optimize_video(job)

    def solved() -> float:
        problem = pose(curves, job.request)
        return lower_bound(problem, optimize(problem, make_solver(job.solver, np.random.default_rng(1))))

    def page() -> str:
        recorder = PictureRecorder(video, cached=False, quiet=True)
        return player_html(player_content(job, data, curves, recorder))

    def drawn() -> list[bytes]:
        return [png_bytes(track_figure(data)), png_bytes(price_figure(job, [curves], summary).figure)]

    return {SOLVER: solved, FIGURES: drawn, PLAYER: page}


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
    """Return the targets: planes change nothing, and two jobs save time."""
    by_name = {p.approach: p for p in points}
    error, one, two = by_name[OF_PLANES].error or 0.0, by_name[ONE_JOB], by_name[TWO_JOBS]
    least, jobs = (one.processor_time or np.nan) / 2 / one.time, two.time / one.time
    note = f"one job decodes beside the analysis already: two cores could reach {least:.2f}"
    equal = claim("luminance of Y, Cb, Cr, against that of R, G, B", 0.0, error, "cd/m^2", "bit by bit")
    return [equal, claim("time of two jobs, to that of one", TARGET_JOBS, jobs, "", note)]
