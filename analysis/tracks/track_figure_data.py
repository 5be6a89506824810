"""The content of a brightness track's figure, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.figure_style import short
from evenlight.analysis.tracks.frame_samples import Image
from evenlight.analysis.tracks.gain_words import SAME_POWER
from evenlight.analysis.tracks.objective_words import less_or_more, little_to_gain
from evenlight.analysis.tracks.optimization import FrameWeighting
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.quantities import read_only
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit


@dataclass(frozen=True, slots=True)
class TrackFigureData:
    """The content of the figure of a brightness track.

    Attributes
    ----------
    track, baseline_factor : BrightnessTrack, float
        The track, and b of constant dimming.
    baseline_loss : array, (N,)
        𝓛_c of each frame under constant dimming.
    objective, objective_baseline : float
        Mean absolute difference of contrast loss between two frames: of the track, of constant dimming.
    thumbnails : tuple of (int, array (height, width, 3), uint8)
        Some frames at full brightness, small, with their index (see `thumbnails_of`).
    lowest_factor : float
        The lowest factor that was allowed.
    achieved : float or None
        What the track has, in the budget's unit; None where that is the budget.
    clips, weighing : int, FrameWeighting
        How many clips share the budget, and how the frames count in the objective.
    same_power : bool
        Whether constant dimming uses the same power; if not, it has the same mean factor.
    fitted_limit : array, (N,), or None
        The rate limit without allowances [cd/m^2/s]; None where the track has that one.
    minimized : str
        What was minimized, and how far; empty where it is the objective.
    gained : tuple of str
        What is saved and what that costs, a sentence each.
    """

    track: BrightnessTrack
    baseline_factor: float
    baseline_loss: Array
    objective: float
    objective_baseline: float
    thumbnails: tuple[tuple[int, Image], ...] = field(default=())
    lowest_factor: float = 0.2
    achieved: float | None = None
    clips: int = 1
    same_power: bool = True
    weighing: FrameWeighting = FrameWeighting.ALIKE
    fitted_limit: Array | None = None
    minimized: str = ""
    gained: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "baseline_loss", read_only(self.baseline_loss))
        if len(self.baseline_loss) != len(self.track.times):
            raise ValueError(
                f"baseline_loss must have one value for each of the {len(self.track.times)} frames, "
                f"got {len(self.baseline_loss)}"
            )
        if self.fitted_limit is not None:
            object.__setattr__(self, "fitted_limit", read_only(self.fitted_limit))
        object.__setattr__(self, "thumbnails", tuple(sorted(self.thumbnails, key=lambda t: t[0])))

    def limit_alone(self) -> Array:
        """Return the rate limit of each step without allowances [cd/m^2/s], (N,)."""
        return self.track.rate_limit if self.fitted_limit is None else self.fitted_limit

    def with_allowance(self) -> NDArray[np.bool_]:
        """Return which steps have another rate limit than the fitted one, (N,)."""
        limit = self.limit_alone()
        return np.asarray(np.abs(self.track.rate_limit - limit) > 1e-9 * np.abs(limit))


def compared_at(data: TrackFigureData, frame: int) -> tuple[tuple[float, float], ...]:
    """Return factor and contrast loss of a frame: ours, and under constant dimming."""
    track = data.track
    return (
        (float(track.factors[frame]), float(track.contrast_loss[frame])),
        (data.baseline_factor, float(data.baseline_loss[frame])),
    )


def frame_edges(times: Array) -> Array:
    """Return when frames begin, and when the last one ends: it lasts as long as the median of the others."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    return np.append(times, times[-1] + (step if step > 0 else 1.0))


def budget_in_words(data: TrackFigureData) -> str:
    """Return what the track uses, and the budget where that is another, or not the track's alone."""
    budget = data.track.header.budget
    achieved = budget if data.achieved is None else data.achieved
    words = _amount(data, achieved)
    if data.clips > 1:
        return f"{words} ({_bare(data, budget)} shared by {data.clips} clips)"
    if abs(achieved - budget) > SAME_POWER * budget:
        return f"{words} (budget {_bare(data, budget)})"
    return words


def _amount(data: TrackFigureData, value: float) -> str:
    """Return an amount in the budget's unit with what it counts."""
    what = {BudgetUnit.FACTOR: "mean brightness factor {}", BudgetUnit.POWER: "{} of full power"}
    unit = data.track.header.budget_unit
    return what.get(unit, "mean power {}").format(_bare(data, value))


def _bare(data: TrackFigureData, value: float) -> str:
    """Return an amount in the budget's unit."""
    unit = data.track.header.budget_unit
    if unit is BudgetUnit.POWER:
        return f"{100 * value:.3g} %"
    return f"{value:.3g}" if unit is BudgetUnit.FACTOR else f"{value:.3g} W"


def outcome_in_words(data: TrackFigureData) -> str:
    """Return in a sentence or two how evenly contrast is lost, and what counts."""
    ours, constant = data.objective, data.objective_baseline
    if not (data.track.contrast_loss.any() or data.baseline_loss.any()):
        return "No visible contrast is lost in any frame, nor is it under constant dimming."
    weighted = data.weighing is FrameWeighting.WEIGHTED
    lead = "Does not count (weight 0). " if data.weighing is FrameWeighting.LEFT_OUT else ""
    if not (ours > 0 or constant > 0):
        which = "every frame that counts" if weighted else "every frame"
        return f"{lead}Constant dimming already loses the same share of contrast in {which}."
    at_worst = float(data.baseline_loss.max() - data.track.contrast_loss.max())
    level = float(data.baseline_loss.max()), float(data.baseline_loss.mean())
    little = "" if data.minimized else little_to_gain(ours, constant, at_worst, *level)
    if little:
        said = f"{lead}{little[0].upper()}{little[1:]}: contrast loss differs between two frames by "
        return f"{said}{short(constant)}, with the track by {short(ours)}."
    how = "on weighted average" if weighted else "on average"
    return (
        f"{lead}Contrast loss differs between two frames by {short(ours)} {how}, "
        f"{compared_in_words(ours, constant)} constant dimming ({short(constant)})."
        f"{data.minimized and f' {data.minimized[0].upper()}{data.minimized[1:]}.'}"
    )


def compared_in_words(ours: float, constant: float) -> str:
    """Return how one difference of contrast loss compares to that of constant dimming.

    >>> [compared_in_words(ours, 0.1) for ours in (0.05, 0.1, 0.12, 1.0)]
    ['50 % less than', 'about as much as with', '20 % more than', '10 times as much as']
    """
    if not constant > 0:
        return "in contrast to" if ours > 0 else "as with"
    ratio = ours / constant
    if abs(ratio - 1) < 0.005:
        return "about as much as with"
    if ratio < 2:
        return f"{less_or_more(1 - ratio)} than"
    return f"{ratio:.3g} times as much as" if ratio < 1000 else "over 1000 times as much as"
