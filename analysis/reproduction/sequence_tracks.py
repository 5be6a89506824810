"""The tracks of the paper's sequences, with the rate limit and without, from one pass over the frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.reproduction.adaptation_lag import AdaptationInput, LuminanceMaps, adaptation_input
from evenlight.analysis.tracks.frame_samples import FrameSamples, Image, thumbnails_of
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.track_results import run_optimization
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
    OptimizationSummary,
    read_track,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.method.choices import SolverName
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.solvers import make_solver
from evenlight.stimuli.video.video_source import VideoSource


@dataclass(frozen=True, slots=True)
class Panel:
    """What every sequence is optimized for.

    Attributes
    ----------
    display : Display
        What it is shown on.
    power_model : PowerModel
        What the budget is counted with.
    rate_limit : RateLimit
        How fast brightness may change.
    """

    display: Display
    power_model: PowerModel
    rate_limit: RateLimit


@dataclass(frozen=True, slots=True)
class SequenceTracks:
    """A sequence, and how its brightness may move.

    Attributes
    ----------
    name : str
        Of the sequence.
    budget : float
        Mean brightness factor.
    track : BrightnessTrack
        Within the rate limit.
    summary : OptimizationSummary
        What it achieves.
    curves : LossCurves
        Contrast loss of each frame.
    tracks : AdaptationInput
        Its factors, those without a rate limit, those of constant dimming, and luminance at low resolution.
    unconstrained_objective : float
        Mean absolute difference of contrast loss between two frames, without a rate limit.
    baseline_loss : array, (N,)
        Contrast loss of each frame under constant dimming at equal power.
    samples : tuple of (int, array (height, width, 3))
        Some frames, with their index.
    """

    name: str
    budget: float
    track: BrightnessTrack
    summary: OptimizationSummary
    curves: LossCurves
    tracks: AdaptationInput
    unconstrained_objective: float
    baseline_loss: Array
    samples: tuple[tuple[int, NDArray[np.uint8]], ...]

    @property
    def unconstrained(self) -> Array:
        """Factors of the track without a rate limit, (N,)."""
        return self.tracks.unconstrained

    @property
    def baseline_factor(self) -> float:
        """Factor of constant dimming at equal power."""
        return float(self.tracks.constant[0])

    @property
    def thumbnails(self) -> tuple[tuple[int, Image], ...]:
        """Six small pictures, evenly spread."""
        return thumbnails_of(self.samples)


def track_sequence(source: VideoSource, budget: float, panel: Panel, folder: Path) -> SequenceTracks:
    """Optimize a sequence, with the rate limit and without, and write its track into a folder.

    Parameters
    ----------
    source : VideoSource
        The sequence.
    budget : float
        Mean brightness factor.
    panel : Panel
        Display, power and rate limit.
    folder : Path
        Where `track.csv`, `summary.json`, `loss_curves.npz` and the figures go.
    """
    maps, samples = LuminanceMaps(panel.display), FrameSamples()

    def watch(frames: Iterable[Frame]) -> Iterator[Frame]:
        return samples.watch(maps.watch(frames))

    request = Request(budget, BudgetUnit.FACTOR, panel.power_model, panel.rate_limit)
    summary = run_optimization(
        OptimizationJob(source, panel.display, request, quiet=True, watch=watch), folder
    )
    curves = read_loss_curves(folder / "loss_curves.npz")
    problem = pose(curves, request)
    track = read_track(folder / "track.csv")
    solver = make_solver(SolverName.SPLITTING, np.random.default_rng(0))  # which draws nothing
    tracks = adaptation_input(problem, track.factors, maps, solver)
    return SequenceTracks(
        name=source.name,
        budget=budget,
        track=track,
        summary=summary,
        curves=curves,
        tracks=tracks,
        unconstrained_objective=problem.objective(tracks.unconstrained),
        baseline_loss=problem.loss(problem.baseline()),
        samples=tuple(samples.held),
    )
