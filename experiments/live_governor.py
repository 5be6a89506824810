"""A power budget for a walk: the governor beside the live controller (`method.governor`).

The power counts refresh by refresh, with each picture's factor, content and time; the target moves with each
answer of the controller, by what the refreshes since the last one used too much.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.brightness_track import BudgetUnit
from evenlight.data_schema.power_model import PowerModel
from evenlight.method.controller import Aim, Controller, ControllerState
from evenlight.method.frame_costs import ContentCosts, FrameCost, first_factor
from evenlight.method.governor import Excess, GovernorSettings, GovernorState, governor_of, time_constant
from evenlight.method.power import power_per_factor


@dataclass(frozen=True, slots=True)
class LiveBudget:
    """What a walk may use: a budget over a horizon, of the power that a model says."""

    settings: GovernorSettings
    model: PowerModel


@dataclass(frozen=True, slots=True)
class PictureUse:
    """What a picture used while it was shown.

    Attributes
    ----------
    factor : float
        b.
    slope : float
        `power_per_factor` of its content [W].
    seconds : float
        How long it was shown [s].
    """

    factor: float
    slope: float
    seconds: float


@dataclass(frozen=True, slots=True)
class _Taken:
    """A picture that no answer has counted yet: seconds shown, its costs, what it used too much."""

    seconds: float
    cost: FrameCost
    excess: Excess


class LiveGovernor:
    """Moves the target of a live controller so that a budget is met over its horizon.

    Parameters
    ----------
    budget : LiveBudget
        The budget.
    controller : Controller
        For the bounds of its factor.
    target : float or None
        c_r to begin with; None: the first loss that is measured.

    Attributes
    ----------
    target : float or None
        Where it is now; None before the first.
    held : bool
        Whether a bound kept the factor from where the budget would have it, at the last answer.
    """

    def __init__(self, budget: LiveBudget, controller: Controller, target: float | None) -> None:
        self._budget, self._bounds = budget, controller.settings
        self._governor = governor_of(controller, budget.settings)
        self._costs = ContentCosts(budget.settings, budget.model)
        self._state: GovernorState | None = None
        self._since: list[_Taken] = []
        self.target, self.held = target, False

    def slope_of(self, channel_means: Array) -> float:
        """Return what a factor of 1 adds to the power of a picture [W]."""
        return float(power_per_factor(self._budget.model, channel_means[None])[0])

    def power_at(self, factor: float, slope: float) -> float | None:
        """Return the power of a picture [W]; None for a budget in factors, which is about none."""
        counts = self._budget.settings.budget_unit is not BudgetUnit.FACTOR
        return self._budget.model.base_power + slope * factor if counts else None

    def first_factor(self, slope: float) -> float:
        """Return the factor at which the first picture meets the budget, within the bounds."""
        bounds = self._bounds.lowest_factor, self._bounds.highest_factor
        return first_factor(self._budget.settings, self._budget.model, slope, bounds)

    def begin(self, factor: float, loss: float) -> float:
        """Return the target to begin with, at the first loss that is measured."""
        self.target = loss if self.target is None else self.target
        self._state = self._governor.start(self.target, factor, loss)
        return self.target

    def take(self, use: PictureUse) -> None:
        """Take note of a picture that was shown."""
        if use.seconds > 0:
            cost = self._costs.of(use.slope, use.seconds)
            self._since.append(_Taken(use.seconds, cost, cost.excess(use.factor)))

    def aim(self, answer: ControllerState, factor: float, loss: float) -> Aim | None:
        """Return where the controller is to aim with its next answer.

        Parameters
        ----------
        answer : ControllerState
            Its last one.
        factor : float
            That of the picture shown last.
        loss : float
            Measured since.
        """
        if self._state is None or self.target is None:
            return None
        if not self._since:
            return Aim(self.target, 0.0)  # of two answers at one time the second has nothing to count
        seconds = sum(taken.seconds for taken in self._since)
        shown = ControllerState(factor, 0.0, 0.0, answer.luminance, seconds, answer.limited)
        self._state, aim = self._governor.step(self._state, shown, loss, self._excess(seconds))
        self._since, self.target, self.held = [], self._state.target_loss, self._state.held
        return aim

    def _excess(self, seconds: float) -> Excess:
        """Return what the pictures since the last answer used too much on average, over `seconds` in all."""

        def mean(of_each: Iterable[float]) -> float:
            return sum(one.seconds * part for one, part in zip(self._since, of_each, strict=True)) / seconds

        last = self._since[-1].excess
        # As for one picture in `ContentCosts`: the answer to what all of them used at once never leads beyond
        # the factor at which they would be allowed.
        share = seconds / time_constant(self._budget.settings.horizon, seconds)
        return Excess(
            at_once=mean(one.excess.at_once for one in self._since),
            over_horizon=mean(one.excess.over_horizon for one in self._since),
            scale=max(last.scale, mean(one.cost.per_factor for one in self._since) * share),
            in_reach=last.in_reach,
        )
