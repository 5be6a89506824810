"""The governor: moves the controller's target loss so that the mean power over a horizon meets a budget.

Section 6 of the paper holds a contrast loss and takes what power comes of it. Here a second, slower loop
moves the target. Let u be what a frame uses more than the budget, as a factor, and m its exponentially
weighted mean over the horizon H. The factor ought to fall by

    Δb = (u + m H / 4T) Δt / T,        T = H / 10,

per frame: u would decay with the time constant T, and what has been used too much is paid back (4T gives the
pair of time constants a damping of 1). The target moves by ŝ Δb, with ŝ the slope of the loss as it shows in
what is measured anyway, loss / (1 - b); and the controller's integral is moved by Δb itself, so that the
answer waits for no error. With that the two loops do not wind around each other, however slow the controller
is: see docs/decisions/budget-governor.md for the argument.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schema.brightness_track import BudgetUnit
from data_schema.loss_curves import LossCurves
from data_schema.power_model import PowerModel
from data_schema.quantities import check_limits, quantity
from method.controller import Aim, Controller, ControllerState
from method.power import power_per_factor

REACTION = 10.0  # horizons hold so many time constants T of the governor
PAYBACK = 4.0  # times T: a damping of 1
FEWEST_FRAMES = 20.0  # that T lasts at least, so that the delay of a frame costs no phase to speak of
LEAST_SLOPE = 0.02  # by which the target follows where nothing is lost, so that it does not stand still
NO_ROOM = 1e-3  # below this distance from full brightness, loss / (1 - b) tells no slope

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GovernorSettings:
    """What the governor is to meet.

    Attributes
    ----------
    budget : float
        In `budget_unit`.
    budget_unit : BudgetUnit
        Mean factor, share of the power at full brightness, or watt.
    horizon : float
        H, over which the mean is to meet it [s].
    """

    budget: float = quantity("1", "the budget, in its unit", above=0.0)
    budget_unit: BudgetUnit = BudgetUnit.FACTOR
    horizon: float = quantity("s", "horizon of the mean", above=0.0, default=60.0)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class FrameCosts:
    """What N frames use and may use, as factors; nothing in it is of later frames than its own.

    Attributes
    ----------
    per_factor : array, (N,)
        What a frame uses is this times b.
    allowance : array, (N,)
        What a frame of its content may use: what counts at once.
    due : array, (N,)
        What the budget grants to any frame: what counts over the horizon. The same, but for an OLED panel
        with a budget in watts: there bright frames take what dark ones leave.
    """

    per_factor: Array
    allowance: Array
    due: Array


@dataclass(frozen=True, slots=True)
class GovernorState:
    """What the governor remembers.

    Attributes
    ----------
    target_loss : float
        c_r that it has moved to.
    excess : float
        m, mean of what was used more than the budget, as a factor.
    loss, dimming : float
        Means of 𝓛_c and of 1 - b, whose ratio is the slope ŝ.
    held : bool
        Whether a bound keeps it from where the budget would have it.
    """

    target_loss: float
    excess: float
    loss: float
    dimming: float
    held: bool = False


@dataclass(frozen=True, slots=True)
class Governor:
    """Moves the target of a controller.

    Attributes
    ----------
    horizon : float
        H [s].
    lowest_factor, highest_factor : float
        Bounds of the controller's factor.
    """

    horizon: float
    lowest_factor: float = 0.2
    highest_factor: float = 1.0

    def start(self, target_loss: float, factor: float, loss: float) -> GovernorState:
        """Return the state at the first frame, of some target, factor and loss."""
        return GovernorState(target_loss, 0.0, loss, 1 - factor)

    def step(
        self, state: GovernorState, shown: ControllerState, loss: float, excess: tuple[float, float]
    ) -> tuple[GovernorState, Aim]:
        """Return the state after a frame was shown, and where the controller is to aim with the next one.

        Parameters
        ----------
        state : GovernorState
            Before.
        shown : ControllerState
            The frame, its factor and how long it is shown.
        loss : float
            Its contrast loss.
        excess : (float, float)
            u, what it used more than its allowance, and more than was due, as factors (`FrameCosts`).
        """
        constant = max(self.horizon / REACTION, FEWEST_FRAMES * shown.duration)
        share = min(shown.duration / self.horizon, 1.0)
        mean = state.excess + share * (excess[1] - state.excess)
        quick = min(shown.duration / constant, 1.0)
        mean_loss = state.loss + quick * (loss - state.loss)
        dimming = state.dimming + quick * (1 - shown.factor - state.dimming)
        down = (excess[0] + mean * self.horizon / (PAYBACK * constant)) * quick
        slope = max(mean_loss / dimming if dimming > NO_ROOM else 0.0, LEAST_SLOPE)
        if self._is_held(shown.factor, down):  # what is out of reach is not remembered
            same = GovernorState(state.target_loss, state.excess, mean_loss, dimming, held=True)
            return same, Aim(state.target_loss, 0.0)
        target = min(max(state.target_loss + slope * down, 0.0), 1.0)
        return GovernorState(target, mean, mean_loss, dimming), Aim(target, -down)

    def _is_held(self, factor: float, down: float) -> bool:
        """Return whether the factor is at a bound and would have to go beyond it."""
        return factor <= self.lowest_factor if down > 0 else factor >= self.highest_factor and down < 0


def frame_costs(curves: LossCurves, settings: GovernorSettings, model: PowerModel) -> FrameCosts:
    """Return what the frames of a video use and may use.

    Watts become factors by the mean power per factor of the horizon before. An OLED's share of full power is
    that of the same content.

    Parameters
    ----------
    curves : LossCurves
        Of N frames.
    settings : GovernorSettings
        The budget.
    model : PowerModel
        Of the panel.
    """
    n, budget = curves.n_frames, settings.budget
    if settings.budget_unit is BudgetUnit.FACTOR:
        return FrameCosts(np.ones(n), np.full(n, budget), np.full(n, budget))
    slope = power_per_factor(model, curves.channel_means)
    mean = _mean_so_far(slope, np.asarray(curves.durations), settings.horizon)
    used = slope / mean
    if settings.budget_unit is BudgetUnit.POWER:
        allowed = (budget * (model.base_power + slope) - model.base_power) / mean
        return FrameCosts(used, allowed, allowed)
    due = (budget - model.base_power) / mean
    return FrameCosts(used, used * due, due)


def _mean_so_far(values: Array, durations: Array, horizon: float) -> Array:
    """Return the mean over what came so far, of older than a horizon ever less; 1 before anything came."""
    means, mean, passed = np.empty(len(values)), 0.0, 0.0
    for k, (value, duration) in enumerate(zip(values.tolist(), durations.tolist(), strict=True)):
        passed = min(passed + duration, max(horizon, duration))
        mean += (value - mean) * duration / passed
        means[k] = mean
    return np.where(means > 0, means, 1.0)  # a black beginning of an OLED uses nothing


def governor_of(controller: Controller, settings: GovernorSettings) -> Governor:
    """Return the governor of a controller."""
    return Governor(settings.horizon, controller.settings.lowest_factor, controller.settings.highest_factor)
