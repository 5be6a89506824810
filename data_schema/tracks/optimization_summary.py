"""What an optimization achieved: how evenly contrast is lost, by which measures, at what rates and power."""

from __future__ import annotations

from typing import ClassVar

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, count, described, quantity, record, share
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.tracks.brightness_track import (
    PROCEDURE,
    WIDE_BAND,
    BudgetUnit,
    TrackHeader,
    WatchedTrack,
)
from evenlight.data_schema.tracks.film_reading import FilmReading

ROUNDING = 1e-9  # losses, and differences of them, up to here are none


@record
class MinimizedOutcome:
    """What a track achieves of something that was minimized."""

    name: str = described(
        "spread+mean (and level_weight times the mean contrast loss, frames by their weights), minimax (the "
        "largest contrast loss of any frame that counts), worst of A, B, ... (the largest spread by these "
        "measures, each as a share of that of constant dimming, of at least 1e-6), or a measure (the spread "
        "by it)"
    )
    value: float = quantity("1", "of the track", minimum=0.0)
    baseline: float = quantity("1", "of constant dimming at equal power", minimum=0.0)
    bound: float = quantity(
        "1", "no track within the limits has a smaller value; 0 for one of several clips", minimum=0.0
    )

    def __post_init__(self) -> None:
        if self.bound > self.value:
            raise ValueError(f"bound must be at most the value, got {self.bound:g} and {self.value:g}")


@record
class MeasuredTrack:
    """What one measure says of a track and of constant dimming at equal power."""

    measure: str = described("name of the measure")
    spread: float = quantity(
        "1", "mean absolute difference of loss between two frames of the track", minimum=0.0
    )
    spread_constant: float = quantity("1", "the same for constant dimming", minimum=0.0)
    mean_loss: float = share("mean loss of the track")
    mean_loss_constant: float = share("the same for constant dimming")
    largest_loss: float = share("largest loss of a frame of the track")
    largest_loss_constant: float = share("the same for constant dimming")

    @property
    def gain(self) -> float | None:
        """Share of the spread that the track saves, below 0 where it is less even; None where none is."""
        return 1 - self.spread / self.spread_constant if self.spread_constant > ROUNDING else None


@record
class ControlSummary:
    """How the online controller held the contrast loss of a video."""

    target_loss: float = share("target c_r: contrast loss to hold, with a governor at the beginning")
    final_target_loss: float = share("the target at the end; the same without a governor")
    proportional: float | None = quantity(
        "1", "proportional gain K_p; null, as are the others, with a lookahead, which has none", minimum=0.0
    )
    integral: float | None = quantity("1", "integral gain K_i", minimum=0.0)
    derivative: float | None = quantity("1", "derivative gain K_d", minimum=0.0)
    gain_rate: float | None = quantity(
        "Hz", "frame rate that the gains are for; null: the video's, or no gains"
    )
    start_factor: float = share("brightness factor of the first frame", above=0.0)
    sd_loss: float = quantity("1", "standard deviation of the loss over time", minimum=0.0)
    sd_loss_constant: float = quantity("1", "the same, for constant dimming by the mean factor", minimum=0.0)
    share_limited: float = share("share of the time in which the rate limit or a bound held the factor back")
    budget: float | None = quantity(
        "1", "the governor's budget, in budget_unit; null without a governor", above=0.0, default=None
    )
    budget_unit: BudgetUnit | None = described("what the budget counts", default=None)
    horizon: float | None = quantity(
        "s", "horizon of the governor, over which the budget is to be met on average", above=0.0, default=None
    )
    horizon_error: float | None = quantity(
        "1",
        "largest difference of the mean over a whole horizon from the budget; null for a shorter video",
        minimum=0.0,
        default=None,
    )
    share_budget_held: float | None = share(
        "share of the time in which a bound kept the governor from its budget", default=None
    )
    horizon_excess: float | None = quantity(
        "1",
        "largest mean over a whole horizon less the budget, 0 if none is above it; null for a shorter video",
        minimum=0.0,
        default=None,
    )
    steered_horizon: float | None = quantity(
        "s",
        "horizon that the governor steers by: longer than the one asked for if that holds too few frames",
        above=0.0,
        default=None,
    )
    lookahead: float | None = quantity(
        "s",
        "how much of the video to come was known at each frame; null: none, and the PID controller",
        minimum=0.0,
        default=None,
    )


@record
class OptimizationSummary:
    """What an optimization achieved; the keys of `summary.json`."""

    FORMER_KEYS: ClassVar = ("curves_tolerance", "counted", "detectability", "windows", "windows_noticed")

    video: str = as_in(TrackHeader, "video")
    display: str = described("name of the display")
    rate_limit: str = as_in(TrackHeader, "rate_limit")
    power_model: str | None = as_in(TrackHeader, "power_model")
    frames: int = count("number of frames", minimum=1)
    duration: float = quantity("s", "duration of the video", above=0.0)
    budget: float = quantity(
        "1", "what was asked, in budget_unit; one of several clips has that of all", above=0.0
    )
    budget_unit: BudgetUnit = described("what the budget counts")
    achieved: float = quantity("1", "what the track has, in the budget's unit", above=0.0)
    objective: float = quantity(
        "1", "mean absolute difference of contrast loss between two frames of the track", minimum=0.0
    )
    objective_baseline: float = quantity("1", "the same for constant dimming at equal power", minimum=0.0)
    lower_bound: float = quantity(
        "1",
        "no track within the limits has a smaller objective by curves straight between knots; 0 for one of "
        "several clips, and where losses themselves are minimized (see minimized)",
        minimum=0.0,
    )
    max_rate_ratio: float = quantity(
        "1", "largest ratio of a step's rate to its limit; at most 1", minimum=0.0
    )
    mean_contrast_loss: float = quantity("1", "mean contrast loss of the track", minimum=0.0)
    mean_contrast_loss_baseline: float = quantity("1", "the same, for constant dimming", minimum=0.0)
    mean_factor: float = quantity("1", "mean brightness factor of the track", above=0.0)
    baseline_factor: float = quantity("1", "factor of constant dimming at equal power", above=0.0)
    mean_power: float | None = quantity(
        "W", "mean power of the track; null without a power model", minimum=0.0
    )
    baseline_power: float | None = quantity("W", "mean power of constant dimming", minimum=0.0)
    full_power: float | None = quantity("W", "mean power at full brightness", minimum=0.0)
    limit_curve: str = described(
        "curve of the rate limit that was obeyed: fitted or safe (the lower edge of its band)"
    )
    modulated: str = described("luminance that the rate limit was about: frame_mean or white_field")
    lowest_factor: float = share("lowest brightness factor allowed", above=0.0)
    pixels_per_degree: float = quantity("1", "pixels of the video per degree of the visual field", above=0.0)
    contrast_model: str = described("choices of the contrast model, by name or file")
    simulated: bool = described("true if the rate limit rests on simulated participants")
    frames_without_contrast: int = count(
        "frames in which nothing is visible even undimmed; they have nothing to lose"
    )
    solver: str = described("which solver made the track")
    iterations: int = count("iterations of the solver; for one of several clips, those of all")
    calm: float = share("share of the gain that may be given up, at most, for a calmer track")
    solve_s: float = quantity("s", "time that the optimizer took", minimum=0.0, key="solve_s")
    curves_s: float = quantity("s", "time that the loss curves took", minimum=0.0, key="curves_s")
    bound_s: float = quantity("s", "time that the lower bound took", minimum=0.0, key="bound_s")
    seed: int | None = count("seed of the random numbers; null where none were drawn")
    versions: dict[str, str] = described(
        "versions of Evenlight and of the packages that the numbers depend on"
    )
    provenance: Provenance = described("how the file was made")
    rate_limit_procedure: Procedure | None = described(PROCEDURE, default=None)
    curves_computed_on: str = described(
        "what computed the loss curves: cpu, or gpu and its name", default="cpu"
    )
    clips: int = count("number of clips that share the budget", minimum=1, default=1)
    weighted: bool = described(
        "true if frames count differently in the objective, its baseline's and the bound", default=False
    )
    largest_allowance: float | None = quantity(
        "1",
        "largest multiple of the rate limit that a step of the video may reach",
        minimum=0.0,
        default=None,
    )
    max_rate_ratio_fitted: float | None = quantity(
        "1",
        "largest ratio of a step's rate to the limit without allowances; null in older files",
        minimum=0.0,
        default=None,
    )
    wide_band_accepted: bool = described(WIDE_BAND, default=False)
    field_of_view: float | None = as_in(TrackHeader, "field_of_view")
    pixel_aspect: float = quantity(
        "1",
        "width of a pixel of the video's file over its height; if not 1, the frames were resampled to square "
        "pixels. One for several clips is that of the first",
        above=0.0,
        default=1.0,
    )
    film: FilmReading | None = as_in(TrackHeader, "film")
    share_at_limit: float | None = share(
        "share of the time in which the rate is within 1 % of the limit; null in older files", default=None
    )
    share_near_limit: float | None = share(
        "share of the time in which the rate is above 0.9 of the limit; null in older files", default=None
    )
    reversals_per_s: float | None = quantity(
        "1/s",
        "how often brightness turns from rising to falling or back; null in older files",
        minimum=0.0,
        key="reversals_per_s",
        default=None,
    )
    noticed: float | None = as_in(TrackHeader, "noticed")
    watched: WatchedTrack | None = as_in(TrackHeader, "watched")
    minimized: MinimizedOutcome | None = described(
        "what was minimized, where that is not the objective (the spread); else null", default=None
    )
    level_weight: float | None = quantity(
        "1",
        "weight of the mean contrast loss that was added to the spread; null if none was",
        above=0.0,
        default=None,
    )
    by_measure: tuple[MinimizedOutcome, ...] = described(
        "the spread by each measure, where the worst of several was minimized; the first is the objective",
        default=(),
    )
    measured: tuple[MeasuredTrack, ...] = described(
        "what other measures of loss say of frames_measured sampled frames; empty where none were at hand",
        default=(),
    )
    frames_measured: int = count("sampled frames in measured", default=0)
    worst_contrast_loss: float | None = quantity(
        "1", "largest contrast loss of any frame; null in older files", minimum=0.0, default=None
    )
    worst_contrast_loss_baseline: float | None = quantity(
        "1", "the same, for constant dimming", minimum=0.0, default=None
    )
    battery_capacity: float | None = quantity(
        "Wh", "capacity of the battery, if it was given", above=0.0, key="battery_capacity_wh", default=None
    )
    battery_life: float | None = quantity(
        "h",
        "how long that lasts at the mean power of the track, with nothing but the display of the power model",
        above=0.0,
        key="battery_life_h",
        default=None,
    )
    battery_life_full: float | None = quantity(
        "h", "the same at full brightness", above=0.0, key="battery_life_full_h", default=None
    )
    control: ControlSummary | None = described(
        "what the online controller did; null of a track that was planned as a whole", default=None
    )

    def __post_init__(self) -> None:
        if self.lower_bound > self.objective:
            raise ValueError(
                f"lower_bound must be at most the objective, got {self.lower_bound:g} and {self.objective:g}"
            )

    def __repr__(self) -> str:
        budget = f"budget {self.budget:g} ({self.budget_unit.value})"
        losses = f"objective {self.objective:.3g}, baseline {self.objective_baseline:.3g}"
        return f"<OptimizationSummary {self.video!r}: {self.frames} frames, {budget}, {losses}>"
