"""From a video and a budget to a brightness track, as an object that answers questions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import fspath
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from evenlight.analysis.earlier_results import files_in, remove_earlier_track
from evenlight.analysis.figure_style import write_png
from evenlight.analysis.tracks.gain_words import gain_in_words, uses_same_power
from evenlight.analysis.tracks.objective_words import (
    less_or_more,
    little_of,
    minimized_in_words,
    spread_in_words,
)
from evenlight.analysis.tracks.optimization import optimize_video
from evenlight.analysis.tracks.optimization_job import AnalysedVideo, OptimizationJob
from evenlight.analysis.tracks.track_figure import track_figure
from evenlight.analysis.tracks.track_figure_data import TrackFigureData
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.data_schema.storage.whole_files import results_folder
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
    read_track,
    track_columns,
    write_track,
)
from evenlight.data_schema.tracks.loss_curves import (
    LossCurves,
    read_loss_curves,
    write_loss_curves,
)
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.inputs import (
    LOWEST_FACTORS,
    Frames,
    Named,
    choice,
    contrast_model_of,
    display_of,
    field_of_view_in,
    number,
    power_model_of,
    rate_limit_of,
    require_own,
    video_of,
    whole,
)
from evenlight.method.choices import (
    DEFAULT_CALM,
    AnalysisEffort,
    LimitCurve,
    ModulatedLuminance,
    ObjectiveName,
    SolverName,
)
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.contrast.measures import measure_named, measures_named
from evenlight.method.optimizer.objective import objective_named
from evenlight.method.optimizer.request import Request, require_possible
from evenlight.method.preset_files import usable_limit
from evenlight.stimuli.video.video_source import VideoSource

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TRACK, SUMMARY, CURVES, FIGURE = "track.csv", "summary.json", "loss_curves.npz", "track.png"


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Track:
    """A brightness track: what `optimize` returns and `load` reads.

    Attributes
    ----------
    track : BrightnessTrack
        The columns of `track.csv`, as arrays.
    summary : OptimizationSummary
        The keys of `summary.json`: budget, objective, bound, rates, power, how it was made.
    curves : LossCurves
        Contrast loss of every frame at every brightness factor.
    """

    track: BrightnessTrack
    summary: OptimizationSummary
    curves: LossCurves

    def __repr__(self) -> str:
        s = self.summary
        gain = 1 - self.objective / self.objective_baseline if self.objective_baseline > 0 else 0.0
        gained = "little to gain here" if little_of(s) else f"{less_or_more(gain)} than constant dimming"
        return (
            f"<Track of {s.video!r}: {s.frames} frames, {s.duration:.4g} s, mean factor {s.mean_factor:.3f}, "
            f"{s.mean_power:.3g} W; loss differs by {self.objective:.4f} between two frames, {gained}>"
        )

    def __str__(self) -> str:
        return "\n".join((*gain_in_words(self.summary), spread_in_words(self.summary)))

    def __len__(self) -> int:
        return len(self.track.factors)

    @property
    def factors(self) -> Array:
        """b, the brightness factor of each frame, (N,)."""
        return self.track.factors

    @property
    def times(self) -> Array:
        """When each frame appears [s], (N,)."""
        return self.track.times

    @property
    def baseline(self) -> float:
        """The factor of constant dimming at equal power."""
        return self.summary.baseline_factor

    @property
    def objective(self) -> float:
        """Mean absolute difference of contrast loss between two frames (Eq. 6)."""
        return self.summary.objective

    @property
    def objective_baseline(self) -> float:
        """The same, of constant dimming at equal power."""
        return self.summary.objective_baseline

    @property
    def gap(self) -> float:
        """Share of what was minimized that a better track could gain at most, in [0, 1]; 1: not certified."""
        value, bound = self.objective, self.summary.lower_bound
        if (minimized := self.summary.minimized) is not None:
            value, bound = minimized.value, minimized.bound
        return float(1 - bound / value) if value > 0 else 0.0

    def loss(self, factors: ArrayLike | None = None) -> Array:
        """Return the contrast loss 𝓛_c of each frame, (N,).

        Parameters
        ----------
        factors : float or array_like, (N,), optional
            Brightness factors to compute it at, in [lowest factor, 1]; else those of the track.

        Examples
        --------
        `track.loss(track.baseline)` is the loss under constant dimming at equal power.
        """
        if factors is None:
            return self.track.contrast_loss
        return loss_and_slope(self.curves, _checked_factors(factors, self.curves))[0]

    def power(self) -> Array:
        """Return the power of the display in each frame [W], (N,)."""
        return self.track.power

    def to_frame(self) -> pd.DataFrame:
        """Return the columns of `track.csv`, one row for each frame, as a pandas table."""
        import pandas as pd

        return pd.DataFrame(track_columns(self.track))

    def plot(self) -> Figure:
        """Return the figure `track.png` without the pictures of frames: factor, loss, rate over time."""
        data = TrackFigureData(
            track=self.track,
            baseline_factor=self.baseline,
            baseline_loss=self.loss(self.baseline),
            objective=self.objective,
            objective_baseline=self.objective_baseline,
            lowest_factor=self.summary.lowest_factor,
            achieved=self.summary.achieved,
            clips=self.summary.clips,
            same_power=uses_same_power(self.summary),
            minimized=minimized_in_words(self.summary),
        )
        return track_figure(data)

    def save(self, folder: Named) -> None:
        """Write `track.csv`, `track.json`, `summary.json`, `loss_curves.npz` and `track.png` into a folder.

        The folder is made if need be; files of an earlier track in it are replaced.
        """
        with results_folder(Path(folder)) as made:
            write_track(made / TRACK, self.track)
            write_json_record(made / SUMMARY, self.summary)
            write_loss_curves(made / CURVES, self.curves)
            write_png(made / FIGURE, self.plot())
            written = files_in(made)
        remove_earlier_track(Path(folder), written)


def load(folder: Named) -> Track:
    """Return the track in a folder that `Track.save` or `evenlight optimize` has written.

    Raises
    ------
    InputError
        If a file is missing or damaged.
    """
    path = Path(folder)
    if not path.is_dir():
        raise InputError(
            f"{path}: no such folder; give one that `Track.save` or `evenlight optimize` has written"
        )
    return Track(
        read_track(path / TRACK),
        read_json_record(OptimizationSummary, path / SUMMARY),
        read_loss_curves(path / CURVES),
    )


def optimize(
    video: Named | VideoSource | Frames | LossCurves,
    budget: float,
    *,
    budget_unit: str = "factor",
    display: Named | Display | None = None,
    power_model: Named | PowerModel = "surace2025",
    rate_limit: Named | RateLimit = "surace2025",
    contrast_model: Named | ContrastModel = "default",
    frames_per_second: float | None = None,
    field_of_view: float | None = None,
    actuator: str = "backlight",
    lowest_factor: float = 0.2,
    limit_curve: str = "fitted",
    modulated: str = "frame_mean",
    solver: str = "splitting",
    calm: float = DEFAULT_CALM,
    robust: Sequence[str] = (),
    objective: str = "spread",
    level_weight: float | None = None,
    tolerance: float = 0.001,
    jobs: int = 1,
    other_display_ok: bool = False,
    accept_wide_band: bool = False,
    seed: int = 1,
) -> Track:
    """Return the brightness track of a video under a power budget (Eq. 6).

    Parameters
    ----------
    video : str, path, video of `open_video`, iterable of frames, or LossCurves
        A file, a folder of images, the name of a built-in sequence; arrays (height, width, 3) of gamma-
        encoded R, G, B (uint8 or uint16 over their full range, floats in [0, 1]) or `Frame` objects; or the
        curves of an earlier analysis, which serve for other budgets, power models and rate limits too.
    budget : float
        In `budget_unit`.
    budget_unit : {"factor", "power", "watt"}
        Mean factor, share of the power at full brightness, or watt.
    display : str, path or Display, optional
        A preset, a file or the record; else the one that the rate limit was fitted on.
    power_model, rate_limit, contrast_model : str, path or record
        Presets by name, files by path, or the records themselves.
    frames_per_second : float, optional
        Of arrays, of a folder of images, or of a built-in sequence; 25 if not given [Hz].
    field_of_view : float, optional
        What the video's width spans [deg]; else what it was rendered for, or it is shown pixel for pixel.
    actuator : {"backlight", "pixels"}
        What dims the video; pixels show nothing darker than the display's black, and lose more for it.
    lowest_factor : float
        Lowest brightness factor.
    limit_curve : {"fitted", "safe"}
        The fitted rate limit, or the lower edge of its band.
    modulated : {"frame_mean", "white_field"}
        Whose luminance the rate limit is about.
    solver : {"splitting", "slsqp", "highs", "clarabel"}
        The fast one, the paper's, or a general one (short clips).
    calm : float
        Share of the gain to give up for a calmer track, in [0, 1]; 0 is the paper's exact problem.
    robust : sequence of str
        Measures of loss whose worst is minimized, e.g. "relative", "castle" and "suprathreshold", in place of
        the `contrast_model`; not with loss curves, which are of one measure, or another `objective`.
    objective : {"spread", "spread+mean", "minimax"}
        What to minimize: the mean difference of contrast loss between two frames, that and the mean loss, or
        the largest loss of any frame.
    level_weight : float, optional
        Weight of the mean loss; `"spread+mean"` needs it.
    tolerance : float
        Error of contrast loss to accept for counting fine detail only where it changes.
    jobs : int
        Frames to analyse at a time, each on a core; 0 for all cores.
    other_display_ok : bool
        Whether a rate limit that was fitted on another display will do.
    accept_wide_band : bool
        Whether a rate limit will do whose band is too wide for use: upper over lower edge above 4.
    seed : int
        Of the start of `slsqp`.

    Returns
    -------
    Track
        Budget met to 1e-6, no step faster than the rate limit, no worse than constant dimming.

    Raises
    ------
    InputError
        If something cannot be used: the message names it and says what would be right.
    """
    known = video if isinstance(video, LossCurves) else None
    measures = measures_named(tuple(robust)) if robust else ()
    if measures and (known is not None or contrast_model != "default" or objective != "spread"):
        raise InputError("robust is the worst spread: leave out loss curves, contrast_model and objective")
    if known is not None:
        require_own(known, display, contrast_model, frames_per_second, field_of_view, lowest_factor)
        if actuator not in ("backlight", known.actuator.value):
            raise InputError(f"actuator: the loss curves were made for {known.actuator.value}; leave it out")
        lowest_factor = float(known.factors[0])
    limit = rate_limit_of(rate_limit)
    shown = known.display if known is not None else display_of(display, limit)
    request = Request(
        number("budget", budget), choice("budget_unit", budget_unit, BudgetUnit), power_model_of(power_model),
        usable_limit(limit, shown, other_display_ok, accept_wide_band),
        choice("limit_curve", limit_curve, LimitCurve),
        choice("modulated", modulated, ModulatedLuminance),
        minimized=objective_named(
            choice("objective", objective, ObjectiveName),
            None if level_weight is None else number("level_weight", level_weight),
        ),
    )  # fmt: skip
    require_possible(request, number("lowest_factor", lowest_factor, *LOWEST_FACTORS))
    job = OptimizationJob(
        source=video_of(video, frames_per_second) if known is None else AnalysedVideo(known),  # type: ignore[arg-type] # not curves
        display=shown,
        request=request,
        model=measure_named(measures[0]) if measures else contrast_model_of(contrast_model),
        model_name=measures[0] if measures else _name_of(contrast_model),
        solver=choice("solver", solver, SolverName),
        seed=whole("seed", seed),
        min_factor=lowest_factor,
        calm=number("calm", calm, 0.0, 1.0),
        field_of_view=field_of_view_in(field_of_view),
        actuator=choice("actuator", actuator, Actuator) if known is None else known.actuator,
        effort=AnalysisEffort(number("tolerance", tolerance, 0.0, 1.0), whole("jobs", jobs)),
        robust=measures,
        quiet=True,
    )
    made = optimize_video(job)
    return Track(made.clips[0].track, made.summary, made.clips[0].problem.curves)


def _name_of(contrast_model: Named | ContrastModel) -> str:
    """Return what a contrast model is called."""
    return "given" if isinstance(contrast_model, ContrastModel) else fspath(contrast_model)


def _checked_factors(factors: ArrayLike, curves: LossCurves) -> Array:
    """Return the factor of each frame, (N,), if the curves reach them."""
    try:
        given = np.broadcast_to(np.asarray(factors, dtype=np.float64), (curves.n_frames,))
    except ValueError:
        raise InputError(
            f"factors must be one number or one for each of the {curves.n_frames} frames"
        ) from None
    lowest = float(curves.factors[0])
    if not (given.min() >= lowest * (1 - 1e-9) and given.max() <= 1):
        raise InputError(f"factors must lie in {lowest:g} to 1, got {given.min():g} to {given.max():g}")
    return given
