"""What a live controller was, and what it did, refresh by refresh."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.brightness_track import BudgetUnit
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity


@dataclass(frozen=True, slots=True)
class LiveRefresh:
    """A refresh of the display under the live controller; a row of `live_control.csv`.

    Attributes
    ----------
    refresh : int
        From 0 on.
    flip_time : float
        When it appeared, since the first [s].
    factor : float
        Brightness factor b that it was shown with.
    contrast_loss : float or None
        The loss that the controller knew last; None before the first.
    measured_refresh : int or None
        The refresh whose picture was measured.
    measured_factor : float or None
        The factor at which it was: the one that was due by the time of the answer.
    mean_luminance : float or None
        Of the picture of this refresh at factor 1 [cd/m^2].
    rate : float or None
        Luminance change per second that the modulation made from the refresh before, at the mean of both
        pictures' luminance; signed [cd/m^2/s]. None at the first refresh.
    rate_limit : float or None
        What it might be, at either picture [cd/m^2/s].
    target_loss : float or None
        c_r, the contrast loss that was to be held; a budget moves it. None where the first loss is to set it.
    power, full_power : float or None
        Of the panel with this picture, at its factor and at 1 [W]; None without a budget in power or watt.
    budget_held : bool or None
        Whether, at the last answer, a bound kept the factor from where the budget would have it; None without
        a budget.
    """

    refresh: int = quantity("1", "number of the refresh, from 0 on", minimum=0)
    flip_time: float = quantity("s", "when it appeared, since the first", minimum=0.0)
    factor: float = quantity("1", "brightness factor", above=0.0, maximum=1.0)
    contrast_loss: float | None = quantity(
        "1", "contrast loss known last", minimum=0.0, maximum=1.0, default=None
    )
    measured_refresh: int | None = quantity("1", "refresh whose loss that is", minimum=0, default=None)
    measured_factor: float | None = quantity(
        "1", "brightness factor at which it was measured", above=0.0, maximum=1.0, default=None
    )
    mean_luminance: float | None = quantity(
        "cd/m^2", "mean luminance of the picture at factor 1", minimum=0.0, default=None
    )
    rate: float | None = quantity(
        "cd/m^2/s", "change by the modulation, from the refresh before", default=None
    )
    rate_limit: float | None = quantity("cd/m^2/s", "largest such change allowed", minimum=0.0, default=None)
    target_loss: float | None = quantity(
        "1", "contrast loss that was to be held", minimum=0.0, maximum=1.0, default=None
    )
    power: float | None = quantity("W", "power by the model", minimum=0.0, default=None)
    full_power: float | None = quantity("W", "the same at factor 1", minimum=0.0, default=None)
    budget_held: bool | None = described("whether a bound kept the factor from the budget", default=None)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class LiveControl:
    """What dimmed a walk; the file `live_control.json` beside the rows of its refreshes.

    Attributes
    ----------
    scene : str
        That was walked in.
    display : Display
        That it was shown on.
    simulated : bool
        Whether nobody sat at the keys.
    target_loss : float or None
        c_r, with a budget where it began; None if nothing was to set it but a loss, and none was measured.
    proportional, integral, derivative, gain_rate : float
        K_p, K_i, K_d, and the frame rate that they are for [Hz].
    lowest_factor, highest_factor : float
        Bounds of the factor.
    rate_limit, limit_curve : str
        Name of the rate limit; the fitted curve or the lower edge of its band.
    measured_by : str
        What measured the loss.
    mean_loss, mean_factor : float or None
        Over the time in which a loss was known; over all. None without any.
    provenance : Provenance
        Software, and the SHA-256 of display and rate limit.
    budget, budget_unit, horizon : float, BudgetUnit, float
        Of the governor; None without one. The horizon is in [s].
    power_model : str or None
        Name of the model that a budget in power or watt was counted by.
    mean_power : float or None
        By that model, over time [W].
    horizon_error, horizon_excess : float or None
        Largest difference of the mean over a whole horizon from the budget, in its unit; the largest of those
        that are above it, 0 if none is. None for a walk that is shorter.
    final_target_loss : float or None
        Where the target ended.
    steered_horizon : float or None
        That the governor steered by, with the median time between two answers [s]; longer than the one asked
        for where that holds fewer than 200 answers. None where there were no two.
    achieved : float or None
        The mean over time, in the budget's unit; None without a budget.
    share_budget_held : float or None
        Share of the time in which a bound kept the factor from where the budget would have it.
    max_rate_ratio : float or None
        Largest ratio of a rate to its limit; None without two refreshes, or where it is infinite.
    """

    scene: str = described("scene that was walked in")
    display: Display = described("display that it was shown on")
    simulated: bool = described("true if nobody sat at the keys")
    target_loss: float | None = quantity("1", "contrast loss to hold", minimum=0.0, maximum=1.0)
    proportional: float = quantity("1", "K_p", minimum=0.0)
    integral: float = quantity("1", "K_i", minimum=0.0)
    derivative: float = quantity("1", "K_d", minimum=0.0)
    gain_rate: float | None = quantity(
        "Hz", "frame rate that the gains are for; null: the display's", above=0.0
    )
    lowest_factor: float = quantity("1", "lowest brightness factor", above=0.0, maximum=1.0)
    highest_factor: float = quantity("1", "highest brightness factor", above=0.0, maximum=1.0)
    rate_limit: str = described("name of the rate limit")
    limit_curve: str = described("fitted, or safe: the lower edge of its band")
    measured_by: str = described("what measured the loss")
    mean_loss: float | None = quantity("1", "mean over time of the losses known", minimum=0.0, maximum=1.0)
    mean_factor: float | None = quantity("1", "mean of the factor over time", minimum=0.0, maximum=1.0)
    provenance: Provenance = described("how the files were made")
    budget: float | None = quantity("1", "the governor's budget, in its unit", above=0.0, default=None)
    budget_unit: BudgetUnit | None = described("unit of the budget", default=None)
    horizon: float | None = quantity("s", "horizon of the governor", above=0.0, default=None)
    power_model: str | None = described("power model of a budget in power or watt", default=None)
    mean_power: float | None = quantity("W", "mean power by it", minimum=0.0, default=None)
    horizon_error: float | None = quantity(
        "1", "largest difference of the mean over a horizon from the budget", minimum=0.0, default=None
    )
    horizon_excess: float | None = quantity(
        "1", "largest mean over a horizon above the budget, less it", minimum=0.0, default=None
    )
    final_target_loss: float | None = quantity(
        "1", "contrast loss to hold, at the end", minimum=0.0, maximum=1.0, default=None
    )
    steered_horizon: float | None = quantity(
        "s", "horizon that the governor steered by", above=0.0, default=None
    )
    achieved: float | None = quantity("1", "mean over time, in the budget's unit", minimum=0.0, default=None)
    share_budget_held: float | None = quantity(
        "1",
        "share of the time in which a bound kept it from the budget",
        minimum=0.0,
        maximum=1.0,
        default=None,
    )
    max_rate_ratio: float | None = quantity(
        "1", "largest ratio of a rate to its limit", minimum=0.0, default=None
    )

    def __post_init__(self) -> None:
        check_limits(self)
