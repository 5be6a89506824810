"""What other measures of loss say of a track, in a few of its frames: whether they find it less even."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import MeasuredTrack, OptimizationSummary
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.method.contrast.measures import MEASURES, ROBUST
from evenlight.method.optimizer.objective import pairwise_spread

FEWEST = 8  # frames; fewer say little of a difference between two of them


def measured_track(measure: str, track: Array, constant: Array) -> MeasuredTrack:
    """Return what sums up the losses of N frames by a measure, dimmed by a track and evenly, (N,)."""
    pairs = [(how(track), how(constant)) for how in (pairwise_spread, np.mean, np.max)]
    return MeasuredTrack(measure, *(float(number) for pair in pairs for number in pair))


def with_other_measures(
    summary: OptimizationSummary,
    track: BrightnessTrack,
    samples: Sequence[tuple[int, NDArray[Any]]],
    curves: LossCurves,
    job: OptimizationJob,
) -> OptimizationSummary:
    """Return a summary with what the measures of a robust track, but for its own, say of sampled frames.

    On two films of 10 and 15 s, the ratio of the differences in 16 to 32 frames is that in all to 0.1; light
    is scaled as a backlight scales it.
    """
    if len(samples) < FEWEST or summary.by_measure:
        return summary
    at = [index for index, _ in samples]
    frames = [Frame(float(curves.times[index]), 1.0, pixels) for index, pixels in samples]
    found, cores = [], AnalysisEffort(job.effort.jobs)
    for name in ROBUST:
        if (other := MEASURES[name]) != job.model:
            known = analyze_frames(frames, curves.video, curves.display, other, curves.factors, effort=cores)
            dimmed = track.factors[at], np.full(len(at), summary.baseline_factor)
            found.append(measured_track(name, *(loss_at(known, factors) for factors in dimmed)))
    return replace(summary, measured=tuple(found), frames_measured=len(at))
