"""The online controller, measured: a frame's loss, the step, how steady it is (Section 6 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.chart import duration
from benchmarks.gpu_points import online_points
from benchmarks.measured import Chart, RunSettings, SubjectResults, claim, growth
from benchmarks.online_content import house_curves
from benchmarks.online_frames import (
    LAYERED,
    STRIPS,
    WHOLE,
    cited_point,
    frame_points,
    latency_points,
    layered_points,
    step_point,
)
from benchmarks.online_lookahead import lookahead_points
from benchmarks.online_walk import (
    BUDGET,
    DIRECT,
    GAINS,
    HORIZON,
    OFFLINE,
    PAPER_RATIO,
    TARGET,
    TUNED,
    WalkFrames,
    hard_claims,
    walk_points,
)
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit

ONE_FRAME = "loss of one frame at one factor, by size"


def measure(settings: RunSettings) -> SubjectResults:
    """Return what the online controller takes per frame, and how steady it keeps the loss."""
    rng = np.random.default_rng(settings.seed)
    display, limit = load_display("varjo-xr3"), load_rate_limit("surace2025")
    controller = Controller(ControllerSettings(TARGET), scalar_rate_limit(limit))
    frames = frame_points(display, settings, rng)
    layered = layered_points(display, settings, rng)
    latency = latency_points(display, controller, settings, rng)
    step = step_point(display, controller, settings)
    settings.say("rendering the walk")
    walk = WalkFrames(
        house_curves(display, settings.quick), controller, limit, load_power_model("surace2025")
    )
    walked, tuned, off = walk_points(walk, settings)
    looked, ahead_claims = lookahead_points(walk, display, settings)
    on_gpu, gpu_claims = online_points(settings)
    claims = [*gpu_claims, *ahead_claims, *hard_claims(controller, display, settings, rng)]
    if not settings.quick:
        claims += _walk_claims(walked, off)
    points = (*frames, *layered, *on_gpu, *latency, step, cited_point(), *walked, *looked)
    whole = tuple(p for p in frames if p.approach == WHOLE)
    return SubjectResults(
        name="online",
        title="Online controller",
        lead=_lead([*frames, *layered], walked, step),
        points=points,
        charts=_charts([*frames, *on_gpu], walked),
        claims=tuple(claims),
        growth=(growth(whole, ONE_FRAME),) if len(whole) > 1 else (),
        notes=(
            f"The walk is held at a contrast loss of {TARGET:g}. Tuned gains: "
            f"K_p {tuned.settings.proportional:.3g}, K_i {tuned.settings.integral:.3g}, "
            f"K_d {tuned.settings.derivative:.3g} for frames of 1/90 s, with a gain margin of "
            f"{tuned.margins.gain_margin_db:.1f} dB at the slope {tuned.slope:.2g} "
            f"(the paper's gains: {tuned.margins_before.gain_margin_db:.1f} dB).",
            "The offline optimum has the mean factor of the controller with the paper's gains; it minimizes "
            "the mean difference between frames, not the SD. Its time is that of the whole optimization.",
            "Memory is the largest of a process that reads one picture from a file and finds its factor "
            "twice, beyond one that does nothing: the picture and the compiled code are part of it.",
            "At one factor the loss needs no reference factor for its neighbours: what the one pass for all "
            "factors approximates, it computes.",
            "Half and quarter resolution leave out the finest bands; strips leave out rows of the fine "
            "bands, and keep all bands; at each turn others, and none of bands of at most 300 000 pixels. "
            "Resolutions other than full count one strip in eight.",
        ),
    )


def _charts(frames: Sequence[BenchmarkPoint], walked: Sequence[BenchmarkPoint]) -> tuple[Chart, ...]:
    """Return the figures: one frame of the middle size, all sizes, and the walk."""
    tasks = list(dict.fromkeys(p.task for p in frames))
    middle = tasks[len(tasks) // 2]
    charts = [
        Chart("online_frame", middle.capitalize(), (middle,)),
        Chart("online_walk", walked[0].task.capitalize(), (walked[0].task,)),
    ]
    if len(tasks) > 1:
        charts.append(Chart("online_size", ONE_FRAME.capitalize(), tuple(tasks), over_size=True))
    return tuple(charts)


def _walk_claims(walked: Sequence[BenchmarkPoint], off: float) -> list[BenchmarkClaim]:
    """Return the claims about the walk."""
    ratio = {p.approach: p.error for p in walked}
    gains, tuned = ratio[GAINS], ratio[TUNED]
    assert gains is not None
    assert tuned is not None
    words = "SD of the loss on the walk over that of constant dimming is that of the paper or less"
    why = "the paper: 0.12 / 0.19, on a walk and at losses of its own, ten times as large as here"
    return [
        claim(f"{words}, with its gains", PAPER_RATIO, gains, "1", why),
        claim(f"{words}, with tuned gains", PAPER_RATIO, tuned, "1", why),
        claim(f"the governor keeps the mean factor over any {HORIZON:g} s of the walk to 0.03", 0.03, off,
              "1", f"of a budget of {BUDGET:g}, from the first frame on"),
    ]  # fmt: skip


def _lead(frames: Sequence[BenchmarkPoint], walked: Sequence[BenchmarkPoint], step: BenchmarkPoint) -> str:
    """Return what came out, from the numbers."""
    tasks = list(dict.fromkeys(p.task for p in frames if p.task != LAYERED))
    middle = [p for p in frames if p.task == tasks[len(tasks) // 2]]
    layered = next(p for p in frames if p.task == LAYERED and p.approach == STRIPS)
    whole = next(p for p in middle if p.role is Role.DEFAULT)
    strips = next(p for p in middle if p.approach == STRIPS)
    ratio = {p.approach: p.error or 0.0 for p in walked}
    return (
        f"The {whole.task} takes {duration(whole.time)} on one core with every pixel (error "
        f"{whole.error or 0:.1g}), {duration(strips.time)} with one strip of rows in four (error "
        f"{strips.error or 0:.1g}; at most {layered.error or 0:.1g} where rows differ most); the "
        f"controller's step {duration(step.time)}. Over the walk the loss "
        f"varies {ratio[GAINS]:.2f} times as much as with constant dimming of equal mean factor with the "
        f"paper's gains, {ratio[TUNED]:.2f} times with tuned ones, {ratio[DIRECT]:.2f} times by going "
        f"straight to the target as fast as the rate limit lets it, and {ratio[OFFLINE]:.2f} times when the "
        "whole walk is known."
    )
