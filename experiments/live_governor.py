"""A power budget for a walk: the governor beside the live controller (`method.governor`).

The power counts refresh by refresh, with each picture's factor, content and time; the target moves with each
answer of the controller, by what the refreshes since the last one used too much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schema.brightness_track import BudgetUnit
from data_schema.power_model import PowerModel
from method.controller import Aim, Controller, ControllerState
from method.frame_costs import ContentCosts
from method.governor import Excess, GovernorSettings, GovernorState, governor_of
from method.power import power_per_factor

Array = NDArray[np.float64]


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
    """

    def __init__(self, budget: LiveBudget, controller: Controller, target: float | None) -> None:
        self._budget, self._bounds = budget, controller.settings
        self._governor = governor_of(controller, budget.settings)
        self._costs = ContentCosts(budget.settings, budget.model)
        self._state: GovernorState | None = None
        self._since: list[tuple[float, Excess]] = []
        self._aim: Aim | None = None
        self.target = target

    def slope_of(self, channel_means: Array) -> float:
        """Return what a factor of 1 adds to the power of a picture [W]."""
        return float(power_per_factor(self._budget.model, channel_means[None])[0])

    def power_at(self, factor: float, slope: float) -> float | None:
        """Return the power of a picture [W]; None for a budget in factors, which is about none."""
        counts = self._budget.settings.budget_unit is not BudgetUnit.FACTOR
        return self._budget.model.base_power + slope * factor if counts else None

    def first_factor(self, slope: float) -> float:
        """Return the factor at which the first picture meets the budget, within the bounds."""
        cost = ContentCosts(self._budget.settings, self._budget.model).of(slope, 1.0)
        wanted = cost.allowance / cost.per_factor if cost.per_factor > 0 else 1.0
        return min(max(wanted, self._bounds.lowest_factor), self._bounds.highest_factor)

    def begin(self, factor: float, loss: float) -> float:
        """Return the target to begin with, at the first loss that is measured."""
        self.target = loss if self.target is None else self.target
        self._state = self._governor.start(self.target, factor, loss)
        return self.target

    def take(self, use: PictureUse) -> None:
        """Take note of a picture that was shown."""
        if use.seconds > 0:
            self._since.append((use.seconds, self._costs.of(use.slope, use.seconds).excess(use.factor)))

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
        if self._state is None or not self._since:
            return self._aim
        seconds = sum(passed for passed, _ in self._since)
        at_once, over_horizon = (
            sum(passed * excess[part] for passed, excess in self._since) / seconds for part in (0, 1)
        )
        excess = self._since[-1][1]._replace(at_once=at_once, over_horizon=over_horizon)
        shown = ControllerState(factor, 0.0, 0.0, answer.luminance, seconds, answer.limited)
        self._state, self._aim = self._governor.step(self._state, shown, loss, excess)
        self._since, self.target = [], self._state.target_loss
        return self._aim
