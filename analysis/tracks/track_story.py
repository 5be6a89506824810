"""What there is to tell about a brightness track, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.figure_style import short
from analysis.tracks.thumbnails import Image
from data_schema.brightness_track import BrightnessTrack, BudgetUnit, TrackHeader
from data_schema.quantities import read_only

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrackStory:
    """What the figure of a brightness track tells.

    Attributes
    ----------
    track : BrightnessTrack
        The track.
    baseline_factor : float
        b of constant dimming at the same power.
    baseline_loss : array, (N,)
        𝓛_c of each frame under constant dimming.
    objective, objective_baseline : float
        Mean absolute difference of contrast loss between two frames: of the track, of constant dimming.
    thumbnails : tuple of (int, array (height, width, 3), uint8)
        Some frames at full brightness, small, with their index (see `thumbnails_of`).
    lowest_factor : float
        The lowest factor that was allowed.
    """

    track: BrightnessTrack
    baseline_factor: float
    baseline_loss: Array
    objective: float
    objective_baseline: float
    thumbnails: tuple[tuple[int, Image], ...] = field(default=())
    lowest_factor: float = 0.2

    def __post_init__(self) -> None:
        object.__setattr__(self, "baseline_loss", read_only(self.baseline_loss))
        if len(self.baseline_loss) != len(self.track.times):
            raise ValueError(
                f"baseline_loss must have one value for each of the {len(self.track.times)} frames, "
                f"got {len(self.baseline_loss)}"
            )
        object.__setattr__(self, "thumbnails", tuple(sorted(self.thumbnails, key=lambda t: t[0])))


def frame_edges(times: Array) -> Array:
    """Return when frames begin, and when the last one ends: it lasts as long as the median of the others."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    return np.append(times, times[-1] + (step if step > 0 else 1.0))


def budget_in_words(header: TrackHeader) -> str:
    """Return a budget with what it counts."""
    if header.budget_unit is BudgetUnit.FACTOR:
        return f"mean brightness factor {header.budget:.3g}"
    if header.budget_unit is BudgetUnit.POWER:
        return f"{100 * header.budget:.3g} % of full power"
    return f"mean power {header.budget:.3g} W"


def outcome_in_words(story: TrackStory) -> str:
    """Return in one sentence how evenly contrast is lost."""
    ours, constant = story.objective, story.objective_baseline
    if not (story.track.contrast_loss.any() or story.baseline_loss.any()):
        return "No visible contrast is lost in any frame, nor is it under constant dimming."
    if not constant > 0:
        return "Constant dimming already loses the same share of contrast in every frame."
    less = 100 * (1 - ours / constant)
    compared = f"{less:.0f} % less than" if less >= 0.5 else "about as much as with"
    return (
        f"Contrast loss differs between two frames by {short(ours)} on average, "
        f"{compared} constant dimming ({short(constant)})."
    )
