"""A catalogue of videos: its results, and what each result was made of."""

from __future__ import annotations

from dataclasses import field

from evenlight.data_schema.quantities import count, described, quantity, record, share
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import ROUNDING, OptimizationSummary


@record
class CatalogueRow:
    """What came of a video of a catalogue; a row of `catalogue.csv`. Cells of a failed one are empty."""

    name: str = described("folder of its results, beside the table")
    video: str = described("as the catalogue names it, without passwords")
    frames: int | None = count("number of frames", minimum=1, default=None)
    duration: float | None = quantity("s", "duration of the video", above=0.0, default=None)
    budget: float | None = quantity("1", "what it was to have, in budget_unit", above=0.0, default=None)
    budget_unit: BudgetUnit | None = described("what the budget counts", default=None)
    achieved: float | None = quantity("1", "what its track has", above=0.0, default=None)
    objective: float | None = quantity(
        "1",
        "mean absolute difference of contrast loss between two frames of the track",
        minimum=0.0,
        default=None,
    )
    objective_baseline: float | None = quantity(
        "1", "the same for constant dimming at equal power", minimum=0.0, default=None
    )
    lower_bound: float | None = quantity(
        "1", "no track within the limits has a smaller objective", minimum=0.0, default=None
    )
    gap: float | None = share("share of the objective that a better track could gain at most", default=None)
    mean_contrast_loss: float | None = quantity(
        "1", "mean contrast loss of the track", minimum=0.0, default=None
    )
    mean_contrast_loss_baseline: float | None = quantity(
        "1", "the same for constant dimming at equal power", minimum=0.0, default=None
    )
    max_rate_ratio: float | None = quantity(
        "1", "largest ratio of a step's rate to its limit; at most 1", minimum=0.0, default=None
    )
    mean_power: float | None = quantity("W", "mean power of the track", minimum=0.0, default=None)
    full_power: float | None = quantity("W", "mean power at full brightness", minimum=0.0, default=None)
    frames_held: int | None = count("frames that damage made show the picture before", default=None)
    frames_skipped: int | None = count("pictures that are left out, as damage costs them", default=None)
    seconds: float | None = quantity(
        "s", "time that it took, when it was made", minimum=0.0, key="seconds", default=None
    )
    error: str = described("why there is no result; empty where there is one", default="")

    @property
    def gain(self) -> float | None:
        """By which share less the loss differs than with constant dimming; None where that is even."""
        ours, constant = self.objective, self.objective_baseline or 0.0
        return 1 - ours / constant if ours is not None and constant > ROUNDING else None


def row_of(name: str, video: str, summary: OptimizationSummary, seconds: float) -> CatalogueRow:
    """Return the row of a video whose track has a summary."""
    value, bound = summary.objective, summary.lower_bound
    if (minimized := summary.minimized) is not None:
        value, bound = minimized.value, minimized.bound
    return CatalogueRow(
        name=name,
        video=video,
        gap=1 - bound / value if value > 0 else 0.0,
        frames_held=None if summary.film is None else summary.film.frames_held,
        frames_skipped=None if summary.film is None else summary.film.frames_skipped,
        seconds=seconds,
        **{key: getattr(summary, key) for key in OF_SUMMARY},
    )


OF_SUMMARY = (
    "frames",
    "duration",
    "budget",
    "budget_unit",
    "achieved",
    "objective",
    "objective_baseline",
    "lower_bound",
    "mean_contrast_loss",
    "mean_contrast_loss_baseline",
    "max_rate_ratio",
    "mean_power",
    "full_power",
)


@record
class CatalogueResult:
    """What the results of a video were made of, by which a later run knows them: `catalogue.json`."""

    key: str = described("SHA-256 of all that they depend on: inputs, options, software")
    curves_key: str = described("SHA-256 of what the loss curves depend on")
    video_sha256: str = described("SHA-256 of the video")
    row: CatalogueRow = described("what came of it")
    video_state: str | None = described(
        "size and time of change of the video's file, by which a later run knows that it is the same; null "
        "where it has none",
        default=None,
    )
    files: tuple[str, ...] = field(default=(), metadata={"doc": "what was written beside this file"})
