"""What the online controller did live in a walk: settings, refreshes, steadiness."""

from __future__ import annotations

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, count, described, quantity, record, share
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import ControlSummary, OptimizationSummary

ONLINE, LOOKAHEAD = "pid", "lookahead"  # the solvers of tracks that were not planned as a whole


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
    noticed: float | None = as_in(OptimizationSummary, "noticed")
    hidden_share: float | None = share(
        "share of the eye's picture that a headset's lens never shows, and that counts neither in the mean "
        "luminance nor in the loss; null where its runtime does not say, and on a screen: all counts",
        default=None,
    )
