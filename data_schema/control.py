"""What the online controller did with a video: its settings, how steady it was, targets, tuned gains."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.brightness_track import BudgetUnit
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity

ONLINE = "pid"  # the solver of tracks that nobody planned


@dataclass(frozen=True, slots=True)
class LoopReport:
    """Gains of the controller, how far its loop is from ringing, and what it does with the content.

    Attributes
    ----------
    proportional, integral, derivative : float
        K_p, K_i, K_d.
    stable_slope : float or None
        Slope of the loss over the factor up to which the loop is stable; None for gains of 0.
    gain_margin_db, phase_margin_deg : float or None
        At the slope of the content; None where there is no such margin.
    sensitivity_peak : float or None
        Largest amplification of a wave in the content's loss; None for a loop that is not stable.
    sd_loss, rms_error : float
        Standard deviation of the loss over time, and root mean square of what it is from the target.
    share_limited : float
        Share of the time in which the rate limit or a bound held the factor back.
    """

    proportional: float = quantity("1", "K_p", minimum=0.0)
    integral: float = quantity("1", "K_i", minimum=0.0)
    derivative: float = quantity("1", "K_d", minimum=0.0)
    stable_slope: float | None = quantity("1", "slope up to which the loop is stable", minimum=0.0)
    gain_margin_db: float | None = quantity("1", "gain margin in dB at the slope of the content")
    phase_margin: float | None = quantity("deg", "phase margin at the slope of the content")
    sensitivity_peak: float | None = quantity("1", "largest amplification of the content's waves")
    sd_loss: float = quantity("1", "standard deviation of the loss over time", minimum=0.0)
    rms_error: float = quantity("1", "root mean square of loss - target over time", minimum=0.0)
    share_limited: float = quantity("1", "share of the time held back", minimum=0.0, maximum=1.0)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class TuningReport:
    """Gains tuned on some content, with margins of stability; the file `tuning.json`.

    Attributes
    ----------
    video : str
        The content.
    target_loss : float
        c_r.
    gain_rate : float
        Frame rate that the gains are for [Hz].
    frame_rate : float
        Of the content, at which the margins are [Hz].
    quantile, slope, steepest_slope : float
        The margins are at `slope`, this quantile of the frames by the steepest slope of their loss; the
        steepest of all.
    least_gain_margin_db, least_phase_margin : float
        What was to be kept.
    before, after : LoopReport
        With the gains that were given, and with those found.
    tries : int
        Runs over the content that the search took.
    provenance : Provenance
        Software and inputs.
    """

    video: str = described("name of the video")
    target_loss: float = quantity("1", "contrast loss to hold", minimum=0.0, maximum=1.0)
    gain_rate: float = quantity("Hz", "frame rate that the gains are for", above=0.0)
    frame_rate: float = quantity("Hz", "frame rate of the video", above=0.0)
    quantile: float = quantity("1", "quantile of the frames by slope", minimum=0.0, maximum=1.0)
    slope: float = quantity("1", "slope of the loss that the margins are at", above=0.0)
    steepest_slope: float = quantity("1", "slope of the steepest frame", minimum=0.0)
    least_gain_margin_db: float = quantity("1", "gain margin to be kept, in dB", minimum=0.0)
    least_phase_margin: float = quantity("deg", "phase margin to be kept", minimum=0.0)
    before: LoopReport = described("with the gains that were given")
    after: LoopReport = described("with the gains that were found")
    tries: int = quantity("1", "runs over the content", minimum=0)
    provenance: Provenance = described("how the file was made")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class TargetRow:
    """A video under the controller with one target; a row of `target_sweep.csv`.

    Attributes
    ----------
    target_loss : float
        c_r.
    mean_factor, mean_loss : float
        Means over time of what came of it.
    sd_loss, sd_loss_constant : float
        Standard deviation of the loss over time: of the controller, of constant dimming by its mean factor.
    share_limited : float
        Share of the time in which the rate limit or a bound held the factor back.
    mean_power : float
        [W].
    """

    target_loss: float = quantity("1", "contrast loss to hold", minimum=0.0, maximum=1.0)
    mean_factor: float = quantity("1", "mean brightness factor over time", above=0.0, maximum=1.0)
    mean_loss: float = quantity("1", "mean contrast loss over time", minimum=0.0, maximum=1.0)
    sd_loss: float = quantity("1", "standard deviation of the loss over time", minimum=0.0)
    sd_loss_constant: float = quantity("1", "the same, for constant dimming by mean_factor", minimum=0.0)
    share_limited: float = quantity("1", "share of the time held back", minimum=0.0, maximum=1.0)
    mean_power: float = quantity("W", "mean power", minimum=0.0)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class ControlSummary:
    """How the online controller held the contrast loss of a video; the file `control.json`.

    Attributes
    ----------
    video : str
        Name of the video.
    target_loss : float
        c_r, with a governor where it began.
    final_target_loss : float
        Where it ended: the same without a governor.
    proportional, integral, derivative, gain_rate : float
        The gains, and the frame rate that they are for [Hz]; None: that of the video.
    start_factor : float
        Of the first frame.
    mean_loss, sd_loss, sd_loss_constant : float
        Mean and standard deviation of the loss over time; the latter also of constant dimming by the mean
        factor.
    mean_factor, mean_power : float
        Over time; power in [W].
    share_limited : float
        Share of the time in which the rate limit or a bound held the factor back.
    budget, budget_unit, horizon : float, BudgetUnit, float
        Of the governor; None without one. The horizon is in [s].
    horizon_error, horizon_excess : float or None
        Largest difference of the mean over a whole horizon from the budget, in its unit; the largest of those
        that are above it, 0 if none is. None without a governor, and for a video that is shorter.
    share_budget_held : float or None
        Share of the time in which a bound kept the governor from its budget.
    steered_horizon : float or None
        Over which the governor looks for its budget [s]: longer than the horizon where that holds too few
        frames.
    """

    video: str = described("name of the video")
    target_loss: float = quantity("1", "contrast loss to hold, at the beginning", minimum=0.0, maximum=1.0)
    final_target_loss: float = quantity("1", "the same, at the end", minimum=0.0, maximum=1.0)
    proportional: float = quantity("1", "K_p", minimum=0.0)
    integral: float = quantity("1", "K_i", minimum=0.0)
    derivative: float = quantity("1", "K_d", minimum=0.0)
    gain_rate: float | None = quantity("Hz", "frame rate that the gains are for; null: the video's")
    start_factor: float = quantity("1", "brightness factor of the first frame", above=0.0, maximum=1.0)
    mean_loss: float = quantity("1", "mean contrast loss over time", minimum=0.0, maximum=1.0)
    sd_loss: float = quantity("1", "standard deviation of the loss over time", minimum=0.0)
    sd_loss_constant: float = quantity("1", "the same, for constant dimming by mean_factor", minimum=0.0)
    mean_factor: float = quantity("1", "mean brightness factor over time", above=0.0, maximum=1.0)
    mean_power: float = quantity("W", "mean power", minimum=0.0)
    share_limited: float = quantity("1", "share of the time held back", minimum=0.0, maximum=1.0)
    provenance: Provenance = described("how the file was made")
    budget: float | None = quantity("1", "the governor's budget, in its unit", above=0.0, default=None)
    budget_unit: BudgetUnit | None = described("unit of the budget", default=None)
    horizon: float | None = quantity("s", "horizon of the governor", above=0.0, default=None)
    horizon_error: float | None = quantity(
        "1", "largest difference of the mean over a horizon from the budget", minimum=0.0, default=None
    )
    share_budget_held: float | None = quantity(
        "1", "share of the time a bound kept from the budget", minimum=0.0, maximum=1.0, default=None
    )
    horizon_excess: float | None = quantity(
        "1", "largest mean over a horizon above the budget, less it", minimum=0.0, default=None
    )
    steered_horizon: float | None = quantity(
        "s", "horizon that the governor steers by: longer where that holds too few frames", above=0.0,
        default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_limits(self)
