"""What is asked of the optimizer: budget, rate limit, sections; and whether a video can meet it.

Every budget is linear in the factors, so that all units become one: a weighted mean of the factors. Sections
give frames their weights (docs/decisions/objectives.md) and steps their allowances
(docs/decisions/rate-constraint.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, VideoSection
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import LimitCurve, ModulatedLuminance
from evenlight.method.detectability import limit_at_share
from evenlight.method.optimizer.objective import SPREAD, Objective
from evenlight.method.power import power_per_factor


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of the optimizer, beside the video."""

    budget: float  # in `budget_unit`
    budget_unit: BudgetUnit  # mean factor, share of the power at full brightness, or watt
    power_model: PowerModel | None  # of the panel; None: not known, and the budget is a factor
    rate_limit: RateLimit  # ΔL(L) as fitted, on the curves' display
    limit_curve: LimitCurve = LimitCurve.FITTED  # the fitted curve, or the lower edge of its band
    modulated: ModulatedLuminance = ModulatedLuminance.FRAME_MEAN  # whose luminance the rate limit is about
    weights: tuple[VideoSection, ...] = ()  # sections that count more or less than others
    # sections in which brightness may change faster than the rate limit, or not at all
    allowances: tuple[VideoSection, ...] = ()
    minimized: Objective = SPREAD  # what is minimized
    battery: float | None = None  # capacity of the battery that the panel draws on [Wh]; None: not known
    noticed: float | None = None  # share of detections to keep to; None: that of the fitted limit

    @property
    def panel(self) -> PowerModel:
        """The power model; `InputError` where none is known."""
        if self.power_model is None:
            raise InputError(f"a budget in {self.budget_unit.value} needs `power_model`, that of the display")
        return self.power_model

    @property
    def limit(self) -> RateLimit:
        """The rate limit to keep to: as fitted, or for the share of detections that is asked for."""
        return self.rate_limit if self.noticed is None else limit_at_share(self.rate_limit, self.noticed)


def budget_as_factor(curves: LossCurves, request: Request) -> tuple[float, Array]:
    """Return the constant factor that meets the budget, and each frame's share in the budget.

    Every budget is linear in the factors, so all units become one: Σ weights · b = factor. Averages are over
    time, which is the paper's average over frames where all last equally long.

    Raises
    ------
    InputError
        If that factor lies outside the curves' range.
    """
    lowest = float(curves.factors[0])
    require_possible(request, lowest)
    offset, scale, weights = budget_line(curves, request)
    _require_between(request, (offset + scale * lowest, offset + scale), lowest)
    return min(max((request.budget - offset) / scale, lowest), 1.0), weights


def budget_line(curves: LossCurves, request: Request) -> tuple[float, float, Array]:
    """Return what a video uses of its budget: offset + scale · Σ weights · b, in the budget's unit.

    Returns
    -------
    offset, scale : float
        In the unit of the budget.
    weights : array, (N,)
        Each frame's share; they add up to 1.

    Raises
    ------
    InputError
        If dimming saves nothing.
    """
    time_share = curves.durations / curves.durations.sum()
    if request.budget_unit is BudgetUnit.FACTOR:
        return 0.0, 1.0, time_share
    slope = power_per_factor(request.panel, curves.channel_means)
    mean_slope, base = float(time_share @ slope), request.panel.base_power
    if not mean_slope > 0:
        raise InputError("the video is black throughout: dimming an OLED panel saves no power on it")
    weights = time_share * slope / mean_slope
    if request.budget_unit is BudgetUnit.POWER:
        return base / (mean_slope + base), mean_slope / (mean_slope + base), weights
    return base, mean_slope, weights


def require_possible(request: Request, lowest_factor: float) -> None:
    """Raise `InputError` if no video at all could meet the budget, so that none is analysed in vain.

    Parameters
    ----------
    request : Request
        With the budget.
    lowest_factor : float
        Lowest brightness factor allowed.
    """
    unit = request.budget_unit
    if request.power_model is None and unit is BudgetUnit.FACTOR:
        _require_between(request, (lowest_factor, 1.0), lowest_factor)
        return
    model = request.panel
    if model.kind is PanelKind.OLED:
        if unit is BudgetUnit.FACTOR:
            raise InputError(
                "the budget unit factor says nothing of the power of an OLED panel, which depends on "
                "content: give power or watt"
            )
        _require_possible_on_oled(request, lowest_factor)
        return
    full = model.base_power + model.power_per_luminance * model.peak_luminance
    least = model.base_power + lowest_factor * (full - model.base_power)
    low, high = {
        BudgetUnit.FACTOR: (lowest_factor, 1.0),
        BudgetUnit.POWER: (least / full, 1.0),
        BudgetUnit.WATT: (least, full),
    }[unit]
    _require_between(request, (low, high), lowest_factor)


def _require_possible_on_oled(request: Request, lowest_factor: float) -> None:
    """Raise `InputError` if no content meets the budget: black uses the base alone, white the most.

    Dimming saves the largest share on white: (base + b s) / (base + s) falls as s grows.
    """
    base = request.panel.base_power
    white = float(power_per_factor(request.panel, np.ones((1, 3)))[0])
    if request.budget_unit is BudgetUnit.POWER:
        _require_between(request, ((base + lowest_factor * white) / (base + white), 1.0), lowest_factor)
    elif not base < request.budget <= (base + white) * (1 + 1e-12):
        raise InputError(
            f"the budget {request.budget:g} (watt) cannot be met on any content: the panel takes "
            f"{base:.4g} W for black and up to {base + white:.4g} W for white"
        )


def _require_between(request: Request, limits: tuple[float, float], lowest_factor: float) -> None:
    (low, high), budget = limits, request.budget
    rounding = 1e-12 * high  # watts of any size
    if low - rounding <= budget <= high + rounding:
        return
    way_out = f"; to dim further, lower `min_factor`, now {lowest_factor:g}" if 0 < budget < low else ""
    if high == 1 and low <= budget / 100 <= 1:
        way_out = f"; {budget:g} % are {budget / 100:g}"
    raise InputError(
        f"the budget {budget:g} ({request.budget_unit.value}) cannot be met: factors from "
        f"{lowest_factor:g} to 1 use {low:.4g} to {high:.4g}{way_out}"
    )


def frame_weights(curves: LossCurves, sections: Sequence[VideoSection]) -> Array | None:
    """Return how much each frame counts, 1 on average; None where all count alike, (N,).

    Raises
    ------
    InputError
        If sections overlap or hold no frame, or if nothing is left that counts.
    """
    if not sections:
        return None
    weights = _by_section(curves, sections, [s.weight for s in sections], "weights")
    if not weights.max() > 0:
        raise InputError("weights: they give every frame the weight 0: at least one must count")
    return np.asarray(weights / weights.mean())


def step_allowances(
    curves: LossCurves, sections: Sequence[VideoSection], joints: Sequence[int] = ()
) -> Array | None:
    """Return how many times the rate limit each step may reach; None where all may reach just that, (N-1,).

    Parameters
    ----------
    curves : LossCurves
        N frames.
    sections : sequence of VideoSection
        A step belongs to the moment at which the later one of its two frames appears.
    joints : sequence of int
        Frames that begin another clip: the step to them is not seen, and is free.

    Raises
    ------
    InputError
        If sections overlap or hold no frame.
    """
    if not sections and not joints:
        return None
    of_frames = _by_section(curves, sections, [s.allowance for s in sections], "allowances")
    of_frames[list(joints)] = np.inf
    return of_frames[1:]


def _by_section(
    curves: LossCurves,
    sections: Sequence[VideoSection],
    values: Sequence[float | None],
    argument: str,
) -> Array:
    """Return the value of the section that each frame belongs to; 1 outside all, (N,)."""
    of_frames, taken = np.ones(curves.n_frames), np.zeros(curves.n_frames, dtype=bool)
    for section, value in zip(sections, values, strict=True):
        inside = (curves.times >= section.start) & (curves.times < section.end)
        where = f"{argument}: the section from {section.start:g} to {section.end:g} s"
        if not inside.any():
            last = float(curves.times[-1])
            raise InputError(f"{where} holds no frame: frames appear from {curves.times[0]:g} to {last:g} s")
        if (inside & taken).any():
            raise InputError(f"{where} overlaps another one; give each frame one section")
        of_frames[inside], taken = 1.0 if value is None else value, taken | inside
    return of_frames
