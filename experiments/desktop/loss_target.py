"""The loss that a monitor's pictures may have so that its power meets a budget: a governor moves it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer
from evenlight.method.online.controller import ControllerState
from evenlight.method.online.governor import BudgetExcess, Governor, GovernorState
from evenlight.method.power import power_per_factor

HORIZON = 600.0  # [s] over which the mean is to be met: the way from bound to bound takes two minutes
NEAR = 0.005  # of a factor at a bound: backlights have steps


def factor_due(budget: float, model: PowerModel | None, ceiling: float) -> float:
    """Return the share of a ceiling that takes a budget, a share of the ceiling's power; else of its light.

    >>> lcd = PowerModel("p", PanelKind.LCD, 1.0, power_per_luminance=0.008, peak_luminance=500.0)
    >>> factor_due(0.6, lcd, 1.0), factor_due(0.6, None, 1.0)
    (0.5, 0.6)
    """
    if model is None or model.kind is not PanelKind.LCD:
        return budget
    full = float(power_per_factor(model, np.ones((1, 3)))[0]) * ceiling
    return (budget * (model.base_power + full) - model.base_power) / full


class LossTarget:
    """Moves the target of a monitor's dimmer, by the factor that is `due` of a ceiling, and the lowest."""

    def __init__(self, dimmer: MonitorDimmer, due: Callable[[float], float], lowest: float) -> None:
        self._dimmer, self._due = dimmer, due
        self._governor = Governor(HORIZON, lowest + NEAR, 1 - NEAR)
        self._state: GovernorState | None = None

    def move(self, seconds: float) -> None:
        """Move it by what was used within some seconds [s]; first, to what the budget's factor would lose."""
        dimmer, due = self._dimmer, self._due(self._dimmer.ceiling)
        if self._state is None:
            dimmer.target_loss = float(dimmer.loss_at(np.array([due]))[0])
            self._state = self._governor.start(dimmer.target_loss, due, dimmer.target_loss)
            return
        excess = dimmer.factor - due
        shown = ControllerState(dimmer.factor, 0.0, 0.0, 0.0, seconds, limited=not dimmer.reached)
        used = BudgetExcess(excess, excess)
        self._state, aim = self._governor.step(self._state, shown, dimmer.loss, used)
        dimmer.target_loss = aim.target_loss
