"""How fast loss curves are, and how far every saving errs: of frames, files, videos, over pixels; memory."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.chart import duration
from benchmarks.decoding_points import decoding_claims, decoding_points
from benchmarks.frame_points import (
    EVERY,
    GROWTH,
    frame_points,
    frame_task,
    growth_points,
    knot_points,
)
from benchmarks.gpu_points import curve_points
from benchmarks.measured import Chart, RunSettings, SubjectResults, claim, growth, not_measured
from benchmarks.memory_claims import memory_claims
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.video_definition import TARGET_ERROR, default_claims
from benchmarks.video_points import EVERY_FRAME, video_points
from evenlight.data_schema.errors import InputError
from evenlight.method.preset_files import load_display

TARGET_SECONDS = 0.1
LARGE = frame_task(1920, 1080)

Points = Sequence[BenchmarkPoint]


def measure(settings: RunSettings) -> SubjectResults:
    """Return the speed and the errors of loss curves."""
    display = load_display("varjo-xr3")
    frames = [*frame_points(settings, display), *curve_points(settings, frame_task, display)]
    knots, sizes = knot_points(settings, display), growth_points(settings, display)
    files, refused = decoding_points(settings, display), {}
    try:
        videos, errors = video_points(settings, display)
    except InputError as error:
        videos, errors, refused = [], [], {"curves of a rendered sequence": str(error)}
    tasks = tuple(dict.fromkeys(p.task for p in frames))
    return SubjectResults(
        name="curves",
        title="Loss curves",
        lead=_lead(frames, videos),
        points=(*frames, *knots, *sizes, *files, *videos),
        charts=_charts(tasks, knots, videos),
        claims=(
            *_frame_claims(frames),
            *decoding_claims(files),
            *default_claims(errors),
            *memory_claims(settings),
        ),
        growth=(growth(tuple(sizes)),),
        notes=_notes(),
        refused=refused,
    )


def _charts(tasks: tuple[str, ...], knots: Points, videos: Points) -> tuple[Chart, ...]:
    """Return the figures: each frame, the knots, each video, growth."""
    of_frames = [Chart(f"curves-{k}", f"Loss curve: {task}", (task,)) for k, task in enumerate(tasks)]
    of_videos = [
        Chart(f"curves-video-{k}", f"Loss curves of a video, {task}", (task,))
        for k, task in enumerate(dict.fromkeys(p.task for p in videos))
    ]
    return (
        *of_frames,
        Chart("curves-knots", f"Knots of a loss curve: {knots[0].task}", (knots[0].task,)),
        *of_videos,
        Chart("curves-size", "Loss curve of a frame, by its pixels", (GROWTH,), over_size=True),
    )


def _frame_claims(frames: Points) -> list[BenchmarkClaim]:
    """Return the targets of one frame."""
    ours = [p for p in frames if p.role is Role.DEFAULT]
    error = max(p.error or 0.0 for p in ours)
    of_error = claim(
        "loss of a frame at knots, against the definition in float64",
        TARGET_ERROR,
        error,
        "",
        f"worst of the sizes; every {EVERY}th knot",
    )
    words = "curve of a frame of 1920 x 1080, every b, processor time"
    large = next((p for p in ours if p.task == LARGE), None)
    if large is None or large.processor_time is None:
        return [not_measured(words, TARGET_SECONDS, "s", "a quick run leaves this size out"), of_error]
    return [claim(words, TARGET_SECONDS, large.processor_time, "s", "one core, without decoding"), of_error]


def _lead(frames: Points, videos: Points) -> str:
    """Return what came out."""
    ours = [p for p in frames if p.role is Role.DEFAULT]
    large = ours[-1]
    definition = next(p for p in frames if p.task == large.task and p.role is Role.REFERENCE)
    words = (
        f"The loss at every brightness factor of {large.task} takes {duration(large.time)} on one core, "
        f"{definition.time / large.time:.3g} times less than {definition.approach}, and errs by "
        f"{large.error:.1g} at most."
    )
    for p in (p for p in videos if p.approach == EVERY_FRAME):
        tenth = next(q for q in videos if q.task == p.task and "as the paper" in q.approach)
        words += f" The {p.task} take {duration(p.time)}; one frame in ten errs by {tenth.error:.1g}."
    return words


def _notes() -> tuple[str, ...]:
    """Return what a reader should know."""
    return (
        "From file to page, stages are timed apart, of all frames of a film in H.264; ratios are to FFmpeg's "
        "decoding. Curves of the file are all stages to there at once. Elsewhere frames are in memory.",
        "The definition dims the frame, rebuilds the pyramids and compares, in float64, for each factor.",
        "The one pass in NumPy takes the same steps, one expression over the image after the other: its time "
        "shows what the compiled loops save, its error in double precision what the one approximation costs.",
        "Half resolution and the sensitivity of the level's mean are other models of the same picture: what "
        "they err by is no error of computing.",
        "Between knots a curve is a staircase of single pixels of the coarse bands, which no number of knots "
        "follows.",
        "Results do not depend on the number of cores, byte for byte.",
    )
