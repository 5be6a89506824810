"""The governor: moves the controller's target loss so that the mean power over a horizon meets a budget.

Section 6 of the paper holds a contrast loss and takes what power comes of it. Here a second, slower loop
moves the target. Let u be what a frame uses more than the budget, in the budget's unit, m its exponentially
weighted mean over the horizon H, and g what a factor of 1 uses. The factor ought to fall by

    Δb = (u + m H / 4T) Δt / gT,        T = H / 10,

per frame: u would decay with the time constant T, and what has been used too much is paid back (with m, the
roots of T H s² + (T + H) s + 1 + H/4T have a damping of 11 / 2√35 = 0.93 at H = 10 T). The target moves by ŝ
Δb, with ŝ the slope of the loss as it shows in what is measured anyway, loss / (1 - b); and the controller's
integral is moved by Δb itself, so that the answer waits for no error. With that the two loops do not wind
around each other, however slow the controller is: see docs/decisions/budget-governor.md for the argument.

Where power does not depend on content every frame may use the same. Of an OLED panel with a budget in watts
the content decides at which factor the budget is met (`ContentCosts`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.quantities import check_limits, quantity
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.online.controller import Controller, ControllerState, SteeredTarget
from evenlight.method.power import power_per_factor

HORIZON = 60.0  # [s] where none is asked for
HORIZONS = 0.1, 1e6  # [s] from and to: those that may be asked for
REACTION = 10.0  # horizons hold so many time constants T of the governor
PAYBACK = 4.0  # times T: a damping of 0.93
FEWEST_FRAMES = 20.0  # that T lasts at least, so that the delay of a frame costs no phase to speak of
LEAST_SLOPE = 0.02  # by which the target follows where nothing is lost, so that it does not stand still
WINDOW = 2.0  # times faster m ages at a bound: a plain mean over H is H/2 old on average, m is H old
NO_ROOM = 1e-3  # below this distance from full brightness, loss / (1 - b) tells no slope
LEAST_WHOLE = 1e-9  # of the largest: less is rounding
LATE = 3.0  # times T: over so long content counts where it has become brighter
LEAST_SCALE = 0.01  # of what white uses: less is not told from black


@dataclass(frozen=True, slots=True)
class GovernorSettings:
    """What the governor is to meet."""

    budget: float = quantity("1", "the budget, in `budget_unit`", above=0.0)
    budget_unit: BudgetUnit = BudgetUnit.FACTOR  # mean factor, share of the power at full brightness, or watt
    horizon: float = quantity("s", "H, over which the mean is to meet the budget", above=0.0, default=HORIZON)

    def __post_init__(self) -> None:
        check_limits(self)


class BudgetExcess(NamedTuple):
    """What a frame used too much, in the budget's unit."""

    at_once: float  # u: more than its allowance (`FrameCost`)
    over_horizon: float  # u: more than was due
    scale: float = 1.0  # g, what a factor of 1 uses
    # whether its content can use up its allowance: what night leaves of an OLED's watts cannot be used
    in_reach: bool = True


@dataclass(frozen=True, slots=True)
class GovernorState:
    """What the governor remembers."""

    target_loss: float  # c_r that it has moved to
    excess: float  # m, mean of what was used more than the budget, in its unit
    # means of 𝓛_c and of 1 - b, whose ratio is the slope ŝ
    loss: float
    dimming: float
    factor: float  # b that the last frame was shown with
    held: bool = False  # whether a bound keeps it from where the budget would have it


@dataclass(frozen=True, slots=True)
class Governor:
    """Moves the target of a controller."""

    horizon: float  # H [s]
    # bounds of the controller's factor
    lowest_factor: float = 0.2
    highest_factor: float = 1.0

    def start(self, target_loss: float, factor: float, loss: float) -> GovernorState:
        """Return the state at the first frame, of some target, factor and loss."""
        return GovernorState(target_loss, 0.0, loss, 1 - factor, factor)

    def step(
        self, state: GovernorState, shown: ControllerState, loss: float, excess: BudgetExcess
    ) -> tuple[GovernorState, SteeredTarget]:
        """Return the state after a frame was shown, and where the controller is to aim with the next one.

        At a bound m goes on, as what is paid back there is paid; only what is out of reach counts as met,
        so that it is not remembered, and what was remembered before ages. So it does on the way up to full
        brightness, while the rate limit sets the pace, where even that would use less than is due.

        Parameters
        ----------
        state : GovernorState
            Before.
        shown : ControllerState
            The frame, its factor and how long it is shown.
        loss : float
            Its contrast loss.
        excess : BudgetExcess
            u, what it used too much.
        """
        constant = time_constant(self.horizon, shown.duration)
        share = min(shown.duration / self.horizon, 1.0)
        mean = state.excess + share * (excess.over_horizon - state.excess)
        quick = min(shown.duration / constant, 1.0)
        mean_loss = state.loss + quick * (loss - state.loss)
        dimming = state.dimming + quick * (1 - shown.factor - state.dimming)
        down = (excess.at_once + mean * self.horizon / (PAYBACK * constant)) * quick / excess.scale
        held = self._is_held(shown.factor, down)
        # On its way there as fast as the rate limit lets it, the factor would not follow the target further.
        follows = not (held or (shown.limited and (state.factor - shown.factor) * down > 0))
        if held or not (follows or excess.in_reach or down > 0):
            mean = self._mean_at_a_bound(state.excess, excess.over_horizon, share)
        slope = max(mean_loss / dimming if dimming > NO_ROOM else 0.0, LEAST_SLOPE)
        target = min(max(state.target_loss + follows * slope * down, 0.0), 1.0)
        after = GovernorState(target, mean, mean_loss, dimming, shown.factor, held)
        return after, SteeredTarget(target, 0.0 if held else -down)

    def _mean_at_a_bound(self, mean: float, excess: float, share: float) -> float:
        """Return m after a frame at a bound: nearer to 0 by what was paid back, or else by age."""
        ageing = min(WINDOW * share, 1.0)
        return min(mean + ageing * (excess - mean), (1 - ageing) * mean, key=abs)

    def _is_held(self, factor: float, down: float) -> bool:
        return factor <= self.lowest_factor if down > 0 else factor >= self.highest_factor and down < 0


def time_constant(horizon: float, duration: float) -> float:
    """Return T of the governor over a horizon, with frames of some duration [s].

    >>> time_constant(60.0, 0.1), time_constant(20.0, 0.5)
    (6.0, 10.0)
    """
    return max(horizon / REACTION, FEWEST_FRAMES * duration)


def steered_horizon(settings: GovernorSettings, duration: float) -> float:
    """Return the horizon that the governor steers by [s]: longer than asked where that holds too few frames.

    >>> steered_horizon(GovernorSettings(0.5, horizon=20.0), 0.1)
    20.0
    >>> steered_horizon(GovernorSettings(0.5, horizon=20.0), 0.5)
    100.0
    """
    steered = time_constant(settings.horizon, duration) * REACTION
    return steered if steered > settings.horizon * (1 + 1e-9) else settings.horizon


def horizon_warning(settings: GovernorSettings, duration: float, counted: str = "frames") -> str | None:
    """Return what is to be said of a horizon that holds too few frames for the governor; None if it is fine.

    >>> horizon_warning(GovernorSettings(0.5, horizon=20.0), 0.5)
    'the horizon of 20 s holds 40 frames, too few to steer by: look for the budget over 100 s'
    """
    steered = steered_horizon(settings, duration)
    if steered == settings.horizon:
        return None
    return (
        f"the horizon of {settings.horizon:g} s holds {settings.horizon / duration:.0f} {counted}, too "
        f"few to steer by: look for the budget over {steered:.4g} s"
    )


def governor_of(controller: Controller, settings: GovernorSettings) -> Governor:
    """Return the governor of a controller."""
    return Governor(settings.horizon, controller.settings.lowest_factor, controller.settings.highest_factor)


class HorizonErrors(NamedTuple):
    """Largest differences of a mean over a horizon from the budget: either way, and above it (0 if none)."""

    either_way: float
    above: float


def horizon_errors(
    used: Array, of: Array, durations: Array, asked: tuple[float, float]
) -> HorizonErrors | None:
    """Return by how much the mean over a horizon differs from the budget at most.

    Of every horizon within the video, wherever it begins. Those in which `of` is 0 throughout are left out,
    as nothing is a share of 0; None if there is no other, or if the video is shorter than the horizon.

    Parameters
    ----------
    used, of : array, (N,)
        What each frame uses, and what that is to be a share of; 1 where it is none.
    durations : array, (N,)
        How long each frame is shown [s].
    asked : (float, float)
        The budget, and the horizon [s].

    >>> used, second = np.array([0.25, 0.75, 0.25, 1.0]), np.ones(4)
    >>> horizon_errors(used, second, second, (0.75, 2.0))
    HorizonErrors(either_way=0.25, above=0.0)
    """
    budget, horizon = asked
    ends = np.append(0.0, np.cumsum(durations))
    last = ends[-1] - horizon
    if last < -1e-9 * horizon:
        return None
    # In between, both sums are straight lines and their ratio goes one way: the extremes lie here.
    begins = np.clip(np.concatenate([ends, ends - horizon]), 0.0, max(last, 0.0))
    over, whole = (_over_windows(part, durations, begins, horizon) for part in (used, of))
    # Beside a window of 0 the ratio is that of one frame alone, up to the next place in the list.
    counts = whole > LEAST_WHOLE * horizon * of.max()
    if not counts.any():
        return None
    away = over[counts] / whole[counts] - budget
    return HorizonErrors(float(np.abs(away).max()), max(float(away.max()), 0.0))


def _over_windows(values: Array, durations: Array, begins: Array, horizon: float) -> Array:
    ends, total = (np.append(0.0, np.cumsum(part)) for part in (durations, values * durations))
    return np.asarray(np.interp(begins + horizon, ends, total) - np.interp(begins, ends, total))


class FrameCost(NamedTuple):
    """What a frame uses and may use, in the budget's unit; nothing in it is of frames to come."""

    per_factor: float  # what it uses is this times b
    allowance: float  # what a frame of its content may use: what counts at once
    # what the budget grants to any frame: what counts over the horizon. The same, but for an OLED panel with
    # a budget in watts: there bright frames take what dark ones leave.
    due: float
    scale: float  # g, what a factor of 1 uses, above 0: by it an excess becomes a change of the factor

    def excess(self, factor: float) -> BudgetExcess:
        """Return what the frame uses too much at a factor."""
        used = self.per_factor * factor
        in_reach = self.allowance < self.per_factor
        return BudgetExcess(used - self.allowance, used - self.due, self.scale, in_reach)

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
    model : PowerModel or None
        Of the panel; None, not known, for a budget in factors.
    """

    def __init__(self, settings: GovernorSettings, model: PowerModel | None) -> None:
        self._settings, self._base = settings, 0.0 if model is None else model.base_power
        self._least_scale = LEAST_SCALE * float(power_per_factor(model, np.ones((1, 3)))[0])
        self._over_horizon, self._of_late = MeanSoFar(), MeanSoFar()

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
    settings: GovernorSettings, model: PowerModel | None, slope: float, bounds: tuple[float, float]
) -> float:
    """Return the factor at which the first frame meets the budget, as near as the bounds allow.

    Parameters
    ----------
    settings : GovernorSettings
        The budget.
    model : PowerModel or None
        Of the panel; None, not known, for a budget in factors.
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


class MeanSoFar:
    """The mean over what came so far, of older than some time ever less.

    Parameters
    ----------
    mean, passed : float
        What is known before the first value, and over how long [s].
    """

    def __init__(self, mean: float = 0.0, passed: float = 0.0) -> None:
        self.mean, self._passed = mean, passed

    def with_next(self, value: float, duration: float, over: float) -> float:
        """Return the mean with one more value, over some time [s]."""
        self._passed = min(self._passed + duration, max(over, duration))
        self.mean += (value - self.mean) * duration / self._passed
        return self.mean


def frame_costs(curves: LossCurves, settings: GovernorSettings, model: PowerModel | None) -> list[FrameCost]:
    """Return what the N frames of a video use and may use.

    Parameters
    ----------
    curves : LossCurves
        Of the video.
    settings : GovernorSettings
        The budget.
    model : PowerModel or None
        Of the panel; None, not known, for a budget in factors.
    """
    costs, slopes = ContentCosts(settings, model), power_per_factor(model, curves.channel_means)
    frames = zip(slopes.tolist(), curves.durations.tolist(), strict=True)
    return [costs.of(slope, duration) for slope, duration in frames]
