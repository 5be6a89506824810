"""What the online controller did, with a video or live in a walk: settings and steadiness."""

from __future__ import annotations

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, count, described, quantity, record, share
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

ONLINE, LOOKAHEAD = "pid", "lookahead"  # the solvers of tracks that were not planned as a whole


@record
class ControlSummary:
    """How the online controller held the contrast loss of a video; the file `control.json`."""

    video: str = described("name of the video")
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
    mean_loss: float = share("mean contrast loss over time")
    sd_loss: float = quantity("1", "standard deviation of the loss over time", minimum=0.0)
    sd_loss_constant: float = quantity("1", "the same, for constant dimming by mean_factor", minimum=0.0)
    mean_factor: float = share("mean brightness factor over time", above=0.0)
    mean_power: float = quantity("W", "mean power over time", minimum=0.0)
    share_limited: float = share("share of the time in which the rate limit or a bound held the factor back")
    provenance: Provenance = described("how the file was made")
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
class LiveRefresh:
    """A refresh of the display under the live controller; a row of `live_control.csv`."""

    refresh: int = count("number of the refresh, from 0 on")
    flip_time: float = quantity("s", "when it appeared, since the first", minimum=0.0)
    factor: float = share("brightness factor b that it was shown with", above=0.0)
    contrast_loss: float | None = share(
        "contrast loss that the controller knew last; empty before the first", default=None
    )
    measured_refresh: int | None = count("refresh whose picture was measured for it", default=None)
    measured_factor: float | None = share(
        "brightness factor at which it was measured: the one due by the time of the answer",
        above=0.0,
        default=None,
    )
    mean_luminance: float | None = quantity(
        "cd/m^2", "mean luminance of the picture at factor 1", minimum=0.0, default=None
    )
    rate: float | None = quantity(
        "cd/m^2/s",
        "luminance change per second that the modulation made from the refresh before, at the "
        "mean luminance of both pictures; signed, empty at the first",
        default=None,
    )
    rate_limit: float | None = quantity(
        "cd/m^2/s", "what that change may be at most, in either direction", minimum=0.0, default=None
    )
    target_loss: float | None = share(
        "target c_r: contrast loss to hold, which a budget moves; empty before the first loss has set it",
        default=None,
    )
    power: float | None = quantity(
        "W",
        "power of the panel with this picture, by the power model; empty without a budget in power or watt",
        minimum=0.0,
        default=None,
    )
    full_power: float | None = quantity("W", "the same at factor 1", minimum=0.0, default=None)
    budget_held: bool | None = described(
        "true if a bound kept the factor from where the budget would have it; empty without a budget",
        default=None,
    )


@record
class LiveControl:
    """What dimmed a walk; the file `live_control.json` beside the rows of its refreshes."""

    scene: str = described("scene that was walked in")
    display: Display = described(
        "display that it was shown on, at the pixels per degree that were drawn and measured"
    )
    simulated: bool = described("true if no person sat at the keys")
    target_loss: float | None = share(
        "target c_r: contrast loss to hold, with a budget at the beginning; null if no loss "
        "was measured to set it"
    )
    proportional: float = quantity("1", "proportional gain K_p", minimum=0.0)
    integral: float = as_in(ControlSummary, "integral")
    derivative: float = as_in(ControlSummary, "derivative")
    gain_rate: float | None = quantity(
        "Hz", "frame rate that the gains are for; null: the display's", above=0.0
    )
    lowest_factor: float = share("lowest brightness factor", above=0.0)
    highest_factor: float = share("highest brightness factor", above=0.0)
    rate_limit: str = described("name of the rate limit")
    limit_curve: str = described("fitted, or safe: the lower edge of the limit's band")
    measured_by: str = described("what measured the loss")
    mean_loss: float | None = share("mean contrast loss over the time in which it was known")
    mean_factor: float | None = share("mean brightness factor over time")
    provenance: Provenance = described("how the files were made")
    budget: float | None = as_in(ControlSummary, "budget")
    budget_unit: BudgetUnit | None = described("what the budget counts", default=None)
    horizon: float | None = as_in(ControlSummary, "horizon")
    power_model: str | None = described("power model of a budget in power or watt", default=None)
    mean_power: float | None = quantity("W", "mean power over time, by that model", minimum=0.0, default=None)
    horizon_error: float | None = quantity(
        "1",
        "largest difference of the mean over a whole horizon from the budget; null for a shorter walk",
        minimum=0.0,
        default=None,
    )
    horizon_excess: float | None = quantity(
        "1",
        "largest mean over a whole horizon less the budget, 0 if none is above it; null for a shorter walk",
        minimum=0.0,
        default=None,
    )
    final_target_loss: float | None = share("target at the end", default=None)
    steered_horizon: float | None = quantity(
        "s",
        "horizon that the governor steered by: longer than the one asked for if that holds "
        "fewer than 200 answers; null without two answers",
        above=0.0,
        default=None,
    )
    achieved: float | None = quantity(
        "1", "mean over time, in budget_unit; null without a budget", minimum=0.0, default=None
    )
    share_budget_held: float | None = share(
        "share of the time in which a bound kept the factor from where the budget would have it", default=None
    )
    max_rate_ratio: float | None = quantity(
        "1",
        "largest ratio of a rate to its limit; null without two refreshes, or if infinite",
        minimum=0.0,
        default=None,
    )
    wide_band_accepted: bool = as_in(OptimizationSummary, "wide_band_accepted")
