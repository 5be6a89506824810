"""How long the optimizer and the controller take on this machine, for the two times that the paper states.

The paper's are of other machines and other pictures (Sections 3.5 and 6), so they tell orders of magnitude.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from evenlight.analysis.reproduction.reproduction import Panel, SequenceTracks
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import SolverName
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.optimizer.optimize import joined_curves, joints, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.solvers import make_solver
from evenlight.method.rate_limit import scalar_rate_limit

TABLE = "times"
TIMED_FRAMES = 3000  # as many as the paper's (Section 3.5)
OPTIMIZATION = f"optimization of {TIMED_FRAMES} frames [s]"
FRAME = "online, per frame [ms]"
FACTOR, TARGET = 0.5, 0.02  # mean factor that is asked for; contrast loss that is held
REPEATS = 5  # of a frame's loss, of which the median is taken
Clock = Callable[[], float]


def measured_times(
    sequences: Sequence[SequenceTracks], panel: Panel, walk: LossCurves, clock: Clock = time.perf_counter
) -> tuple[Statistic, ...]:
    """Return how long an optimization takes, and a frame of the online controller, on the processor.

    Parameters
    ----------
    sequences : sequence of SequenceTracks
        Their frames are optimized, one sequence after the other, as often as fits into the paper's frames.
    panel, walk : Panel, LossCurves
        What they are optimized for; and what the controller walks through.
    clock : callable
        Gives the time [s].
    """
    once = sum(sequence.curves.n_frames for sequence in sequences)
    repeats = max(TIMED_FRAMES // once, 1)
    frames = once * repeats
    solved = _solving_time(sequences, repeats, panel, clock)
    curves = sum(sequence.summary.curves_s for sequence in sequences) / once
    step, loss = _step_time(panel, walk, clock), _loss_time(sequences[0], clock)
    height, width = sequences[0].samples[0][1].shape[:2]
    scaled = "" if frames == TIMED_FRAMES else f", scaled to {TIMED_FRAMES}"
    what = f"{once} frames" + (f", taken {repeats} times," if repeats > 1 else "")
    where = f"on {processor_name()}, {os.cpu_count()} cores"
    return (
        Statistic(
            TABLE, "four sequences", OPTIMIZATION, solved * TIMED_FRAMES / frames, "s", Origin.MEASURED,
            n=once, method=f"the optimizer alone, loss curves known: {what} optimized in {solved:.2g} s"
            f"{scaled}, {where} (computing the curves took another {curves:.2g} s per frame, "
            "rendering included)",
        ),
        Statistic(
            TABLE, "house", FRAME, 1000 * (step + loss), "ms", Origin.MEASURED, n=walk.n_frames,
            method=f"controller {1000 * step:.2g} ms, loss of {width} x {height} pixels at one factor "
            f"{1000 * loss:.2g} ms, {where}",
        ),
    )  # fmt: skip


def _solving_time(sequences: Sequence[SequenceTracks], repeats: int, panel: Panel, clock: Clock) -> float:
    """Return how long the sequences take to optimize, one after the other and again [s]."""
    clips = [sequence.curves for sequence in sequences] * repeats
    request = Request(FACTOR, BudgetUnit.FACTOR, panel.power_model, panel.rate_limit)
    whole = joined_curves(clips)
    problem = pose(whole, request, joints(clips))
    solver = make_solver(SolverName.SPLITTING, np.random.default_rng(0))  # which draws nothing
    begun = clock()
    optimize(problem, solver)
    return clock() - begun


def _step_time(panel: Panel, walk: LossCurves, clock: Clock) -> float:
    """Return how long a step of the controller takes, its frame's loss known [s]."""
    limit = scalar_rate_limit(panel.rate_limit, panel.display.reflected_luminance)
    controller = Controller(ControllerSettings(TARGET), limit)
    begun = clock()
    control_curves(walk, controller)
    return (clock() - begun) / walk.n_frames


def _loss_time(sequence: SequenceTracks, clock: Clock) -> float:
    """Return how long the loss of a frame at one factor takes [s]."""
    pixels = sequence.samples[0][1]
    meter, times = OneFactorLoss(pixels.shape[:2], sequence.curves.display), []
    for _ in range(1 + REPEATS):  # the first one warms up
        begun = clock()
        meter.of(pixels, FACTOR)
        times.append(clock() - begun)
    return float(np.median(times[1:]))


def processor_name() -> str:
    """Return the processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
