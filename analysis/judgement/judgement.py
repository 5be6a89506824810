"""A brightness track, and constant dimming at equal power, by several measures of loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import stats

from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization_job import OptimizationJob, loss_curves_of
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.tracks.brightness_track import require_display_of
from evenlight.data_schema.tracks.judgement import MeasureAgreement, MeasuredTrack
from evenlight.data_schema.tracks.loaded_track import LoadedTrack
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.contrast.measures import measure_named
from evenlight.method.optimizer.objective import pairwise_spread
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_power_model, load_rate_limit
from evenlight.stimuli.video.track_fit import require_fit, require_times
from evenlight.stimuli.video.video_source import VideoSource

LOWEST_FACTOR = 0.2  # of the curves, unless the track goes lower: those that `evenlight optimize` has


@dataclass(frozen=True, slots=True)
class JudgedVideo:
    """What is judged: a track, its video and display.

    Attributes
    ----------
    source, display, loaded : VideoSource, Display, LoadedTrack
        The video, what it is shown on, and the track with its baseline.
    effort, cached, quiet : AnalysisEffort, bool, bool
        How much is counted; whether loss curves are kept in the user's cache; whether to show no progress.
    """

    source: VideoSource
    display: Display
    loaded: LoadedTrack
    effort: AnalysisEffort
    cached: bool = False
    quiet: bool = False

    def job(self, measure: str) -> OptimizationJob:
        """Return how the video's curves by a measure are made: seen and dimmed as the track was made for."""
        track = self.loaded.track
        made = track.header
        # Of a request, loss curves take nothing.
        request = Request(
            made.budget, made.budget_unit, load_power_model("surace2025"), load_rate_limit("surace2025")
        )
        return OptimizationJob(
            self.source,
            self.display,
            request,
            model=measure_named(measure),
            model_name=measure,
            min_factor=min(LOWEST_FACTOR, self.loaded.baseline, float(track.factors.min())),
            field_of_view=made.field_of_view,
            actuator=made.actuator,
            effort=self.effort,
            cached=self.cached,
            quiet=self.quiet,
        )


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredLosses:
    """The losses of N frames by one measure: dimmed by the track, and evenly by its baseline's factor."""

    measure: str
    track: Array  # (N,)
    constant: Array  # (N,)

    def summary(self) -> MeasuredTrack:
        """Return the numbers that sum them up."""
        ours, constant = pairwise_spread(self.track), pairwise_spread(self.constant)
        return MeasuredTrack(
            measure=self.measure,
            spread=ours,
            spread_constant=constant,
            mean_loss=float(self.track.mean()),
            mean_loss_constant=float(self.constant.mean()),
            largest_loss=float(self.track.max()),
            largest_loss_constant=float(self.constant.max()),
        )


def require_judgeable(judged: JudgedVideo) -> None:
    """Refuse a track that was made for another display, or is none of the video's."""
    require_display_of(judged.loaded.track.header, judged.display, judged.display.name)
    require_fit(judged.source, judged.loaded.track)


def losses_by(judged: JudgedVideo, measure: str) -> MeasuredLosses:
    """Return the losses of a track and of constant dimming by a measure, one of `MEASURES`.

    Raises
    ------
    InputError
        If the track is none of the video's.
    """
    track = judged.loaded.track
    curves = loss_curves_of(judged.job(measure), FrameSamples(most=1, least=1))
    require_times(judged.source.name, curves.times, track)
    ours, _ = loss_and_slope(curves, track.factors)
    evenly, _ = loss_and_slope(curves, np.full(curves.n_frames, judged.loaded.baseline))
    return MeasuredLosses(measure, ours, evenly)


def agreements_of(losses: Sequence[MeasuredLosses]) -> tuple[MeasureAgreement, ...]:
    """Return the rank correlation of each pair of measures over the frames at constant dimming."""
    return tuple(
        MeasureAgreement(a.measure, b.measure, rank_correlation(a.constant, b.constant))
        for a, b in combinations(losses, 2)
    )


def rank_correlation(first: Array, second: Array) -> float | None:
    """Return Spearman's rank correlation; None where one is the same in all frames.

    >>> round(rank_correlation(np.array([0.1, 0.2, 0.3, 0.4]), np.array([1.0, 3.0, 2.0, 4.0])), 3)
    0.8
    """
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return None
    return float(np.clip(stats.spearmanr(first, second).statistic, -1.0, 1.0))


def provenance_of(judged: JudgedVideo, measures: Sequence[str]) -> Provenance:
    """Return what a judgement was made from."""
    models = {f"measure_{name}": sha256_of_record(measure_named(name)) for name in measures}
    display = sha256_of_record(judged.display)
    inputs = {"video": judged.source.sha256(), "track": judged.loaded.sha256, "display": display}
    return provenance_now(inputs=inputs | models)
