"""What each frame uses of a power budget, and what it may use, frame by frame.

Where power does not depend on content every frame may use the same. Of an OLED panel with a budget in watts
the content decides at which factor the budget is met: see docs/decisions/budget-governor.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.online.governor import Excess, GovernorSettings, time_constant
from evenlight.method.power import power_per_factor

LATE = 3.0  # times T: over so long content counts where it has become brighter
LEAST_SCALE = 0.01  # of what white uses: less is not told from black


class FrameCost(NamedTuple):
    """What a frame uses and may use, in the budget's unit; nothing in it is of frames to come.

    Attributes
    ----------
    per_factor : float
        What it uses is this times b.
    allowance : float
        What a frame of its content may use: what counts at once.
    due : float
        What the budget grants to any frame: what counts over the horizon. The same, but for an OLED panel
        with a budget in watts: there bright frames take what dark ones leave.
    scale : float
        g, what a factor of 1 uses, above 0: by it an excess becomes a change of the factor.
    """

    per_factor: float
    allowance: float
    due: float
    scale: float

    def excess(self, factor: float) -> Excess:
        """Return what the frame uses too much at a factor."""
        used = self.per_factor * factor
        in_reach = self.allowance < self.per_factor
        return Excess(used - self.allowance, used - self.due, self.scale, in_reach)

    @property
    def fair_factor(self) -> float:
        """Factor at which it uses its allowance, bounds aside; 1 for black, which uses nothing at any."""
        return self.allowance / self.per_factor if self.per_factor > 0 else 1.0


class ContentCosts:
    """Computes the costs of frames, one after the other.

    A budget in watts allows each frame the factor at which the content so far would meet it, but no more
    than 1: what it takes on average over the horizon, or of late (3 T of the governor) where that is more.
    By the horizon alone a day that comes after a night would shine for most of a horizon before it counts.
    An OLED's share of full power is that of the same content.

    Parameters
    ----------
    settings : GovernorSettings
        The budget.
    model : PowerModel
        Of the panel.
    """

    def __init__(self, settings: GovernorSettings, model: PowerModel) -> None:
        self._settings, self._base = settings, model.base_power
        self._least_scale = LEAST_SCALE * float(power_per_factor(model, np.ones((1, 3)))[0])
        self._over_horizon, self._of_late = _MeanSoFar(), _MeanSoFar()

    def of(self, slope: float, duration: float) -> FrameCost:
        """Return the costs of the next frame.

        Parameters
        ----------
        slope : float
            `power_per_factor` of it [W].
        duration : float
            How long it is shown [s].
        """
        unit, budget, horizon = self._settings.budget_unit, self._settings.budget, self._settings.horizon
        if unit is BudgetUnit.FACTOR:
            return FrameCost(1.0, budget, budget, 1.0)
        constant = time_constant(horizon, duration)
        mean = max(
            self._over_horizon.with_next(slope, duration, horizon),
            self._of_late.with_next(slope, duration, LATE * constant),
        )
        # With the last of them the answer to a frame never leads beyond the factor at which it is allowed.
        scale = max(mean, self._least_scale, slope * duration / constant)
        if unit is BudgetUnit.POWER:
            allowed = budget * (self._base + slope) - self._base
            return FrameCost(slope, allowed, allowed, scale)
        due = budget - self._base
        # Of what has been black throughout all may be used: there is nothing to share out.
        return FrameCost(slope, slope * due / mean if mean > max(due, 0.0) else slope, due, scale)


def first_factor(
    settings: GovernorSettings, model: PowerModel, slope: float, bounds: tuple[float, float]
) -> float:
    """Return the factor at which the first frame meets the budget, as near as the bounds allow.

    Parameters
    ----------
    settings : GovernorSettings
        The budget.
    model : PowerModel
        Of the panel.
    slope : float
        `power_per_factor` of the frame [W].
    bounds : (float, float)
        Lowest and highest factor.

    >>> from evenlight.data_schema.power_model import PanelKind
    >>> oled = PowerModel("p", PanelKind.OLED, 0.5, green_power=2.0)
    >>> first_factor(GovernorSettings(1.25, BudgetUnit.WATT), oled, 1.0, (0.2, 1.0))
    0.75
    """
    cost = ContentCosts(settings, model).of(slope, 1.0)  # the first mean is of it alone, however long it is
    return min(max(cost.fair_factor, bounds[0]), bounds[1])


class _MeanSoFar:
    """The mean over what came so far, of older than some time ever less."""

    def __init__(self) -> None:
        self._mean = self._passed = 0.0

    def with_next(self, value: float, duration: float, over: float) -> float:
        """Return the mean with one more value, over some time [s]."""
        self._passed = min(self._passed + duration, max(over, duration))
        self._mean += (value - self._mean) * duration / self._passed
        return self._mean


def frame_costs(curves: LossCurves, settings: GovernorSettings, model: PowerModel) -> list[FrameCost]:
    """Return what the N frames of a video use and may use.

    Parameters
    ----------
    curves : LossCurves
        Of the video.
    settings : GovernorSettings
        The budget.
    model : PowerModel
        Of the panel.
    """
    costs, slopes = ContentCosts(settings, model), power_per_factor(model, curves.channel_means)
    frames = zip(slopes.tolist(), curves.durations.tolist(), strict=True)
    return [costs.of(slope, duration) for slope, duration in frames]
