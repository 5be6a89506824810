"""How fast loss curves are, and how far every saving errs: of a frame, of a video, over pixels; memory."""

from __future__ import annotations

import math
from collections.abc import Sequence

from analysis.benchmarks.chart import duration
from analysis.benchmarks.curves_memory import curves_size
from analysis.benchmarks.frame_points import (
    GROWTH,
    frame_points,
    frame_task,
    growth_points,
    knot_points,
)
from analysis.benchmarks.gpu_points import curve_points
from analysis.benchmarks.measured import Chart, Measured, Pains, claim, growth, not_measured
from analysis.benchmarks.peak_memory import peak_memory
from analysis.benchmarks.video_points import EVERY_FRAME, TOLERANCE, USUAL, video_points
from data_schema.benchmark import BenchmarkClaim, BenchmarkPoint, Role
from data_schema.errors import InputError
from method.preset_files import load_display

TARGET_SECONDS, TARGET_ERROR = 0.1, 1e-3
LARGE = frame_task(1920, 1080)
MEMORY = "analysis.benchmarks.curves_memory:analyze_minutes"
SAME_MEMORY = 1.05  # two runs of the same differ by as much
COPIES = 2  # of the curves, while they are checked

Points = Sequence[BenchmarkPoint]


def measure(pains: Pains) -> Measured:
    """Return the speed and the errors of loss curves."""
    display = load_display("varjo-xr3")
    frames = [*frame_points(pains, display), *curve_points(pains, frame_task, display)]
    knots, sizes = knot_points(pains, display), growth_points(pains, display)
    refused = {}
    try:
        videos = video_points(pains, display)
    except InputError as error:
        videos, refused = [], {"curves of a rendered sequence": str(error)}
    pains.say("memory of long videos")
    tasks = tuple(dict.fromkeys(p.task for p in frames))
    return Measured(
        name="curves",
        title="Loss curves",
        lead=_lead(frames, videos),
        points=(*frames, *knots, *sizes, *videos),
        charts=_charts(tasks, knots, videos),
        claims=(*_frame_claims(frames), *_video_claims(videos), _memory_claim(pains)),
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
        "loss of a frame, against the definition in float64", TARGET_ERROR, error, "", "worst of the sizes"
    )
    words = "curve of a frame of 1920 x 1080, every b, processor time"
    large = next((p for p in ours if p.task == LARGE), None)
    if large is None or large.processor_time is None:
        return [not_measured(words, TARGET_SECONDS, "s", "a quick run leaves this size out"), of_error]
    return [claim(words, TARGET_SECONDS, large.processor_time, "s", "one core, without decoding"), of_error]


def _video_claims(videos: Points) -> list[BenchmarkClaim]:
    """Return the target of a video: the tolerance holds."""
    words = f"loss of all frames of a video, at a tolerance of {TOLERANCE:g}"
    errors = [p.error for p in videos if p.approach == USUAL and p.error is not None]
    if not errors:
        return [not_measured(words, TOLERANCE, "", "no video could be made")]
    note = "against every frame counted whole; checked where it is looked at, not proven"
    return [claim(words, TOLERANCE, max(errors), "", note)]


def _memory_claim(pains: Pains) -> BenchmarkClaim:
    """Return the target of memory: a video ten times as long takes no more."""
    short = 0.1 if pains.quick else 1.0
    long = 10 * short
    words = f"memory of a video of {long:g} min over that of {short:g} min, apart from the curves"
    used = peak_memory(MEMORY, str(short), str(TOLERANCE)), peak_memory(MEMORY, str(long), str(TOLERANCE))
    if used[0] is None or used[1] is None:
        return not_measured(words, SAME_MEMORY, "", "the system does not tell how much memory a process used")
    least, most = used[0] - COPIES * curves_size(short), used[1] - COPIES * curves_size(long)
    note = (
        f"{used[0]:.1f} and {used[1]:.1f} MiB, of which the curves take {curves_size(short):.1f} and "
        f"{curves_size(long):.1f}, twice while they are checked; frames of 384 x 270, made one by one"
    )
    return claim(words, SAME_MEMORY, most / least, "", note)


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
    usual = [p for p in videos if p.approach == USUAL]
    for p in usual:
        whole = next(q for q in videos if q.task == p.task and q.approach == EVERY_FRAME)
        tenth = next(q for q in videos if q.task == p.task and "as the paper" in q.approach)
        words += (
            f" Of the {p.task}, counting fine detail only where it changes takes "
            f"{1 / (whole.ratio or math.nan):.2g} of the time and errs by {p.error:.1g}; one frame in ten "
            f"errs by {tenth.error:.1g}."
        )
    return words


def _notes() -> tuple[str, ...]:
    """Return what a reader should know."""
    return (
        "Frames are in memory: decoding, which runs beside the analysis, is not part of these times.",
        "The definition dims the frame, rebuilds the pyramids and compares, in float64, for each factor.",
        "Half resolution and the sensitivity of the level's mean are other models of the same picture: what "
        "they err by is no error of computing.",
        "Between knots a curve is a staircase of single pixels of the coarse bands, which no number of knots "
        "follows.",
        "Results do not depend on the number of cores, byte for byte.",
    )
