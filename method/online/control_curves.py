"""The online controller over loss curves that are known already, frame by frame as it would run live."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.quantities import read_only
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_at
from evenlight.method.online.controller import Controller, ControllerState, FrameMeasurement, SteeredTarget
from evenlight.method.online.governor import FrameCost, Governor, GovernorState
from evenlight.method.online.lookahead import ForeseenFrame, LookaheadController, LookaheadSettings
from evenlight.method.rate_limit import allowed_rate, modulation_rate


@dataclass(frozen=True, slots=True)
class ControlledTrack:
    """What the controller made of a video of N frames."""

    durations: Array  # (N,): how long each frame is shown [s]
    factors: Array  # (N,): b of each frame
    contrast_loss: Array  # (N,): 𝓛_c of each frame at its factor
    # (N,): luminance change that the modulation makes to the next frame, and the largest allowed [cd/m^2/s]
    rate: Array
    rate_limit: Array
    # (N,): where the rate limit or a bound kept the factor from where the controller wanted it
    limited: NDArray[np.bool_]
    targets: Array  # (N,): c_r, the contrast loss that was to be held; a governor moves it
    # (N,): where a bound kept the governor from meeting its budget; nowhere without one
    budget_held: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name in ("durations", "factors", "contrast_loss", "rate", "rate_limit", "targets"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def time_share(self) -> Array:
        """Share of the time that each frame is shown, (N,)."""
        return np.asarray(self.durations / self.durations.sum())

    @property
    def mean_factor(self) -> float:
        """Mean of b over time: constant dimming by it has the same mean brightness."""
        return float(self.time_share @ self.factors)


def control_curves(
    curves: LossCurves,
    controller: Controller,
    start_factor: float | None = None,
    luminance: Array | None = None,
    governed: tuple[Governor, list[FrameCost]] | None = None,
) -> ControlledTrack:
    """Return what the controller does with a video, seeing one frame after the other.

    Parameters
    ----------
    curves : LossCurves
        Contrast loss of each of N frames over the factor.
    controller : Controller
        Target, gains, bounds and rate limit.
    start_factor : float, optional
        b of the first frame; without it, where that frame has the target loss.
    luminance : array, (N,), optional
        Ī, the luminance at factor 1 that the rate limit is about [cd/m^2]; without it, the frame's mean.
    governed : (Governor, list of FrameCost), optional
        What moves the target from that of the controller, so that a budget is met, and what each frame costs.

    Raises
    ------
    InputError
        If the controller may choose factors that the curves do not reach.
    """
    shown, first = _prepared(curves, controller, start_factor, luminance)
    states, targets, held = _states(curves, controller, shown, first, governed)
    return _track(curves, shown, controller, (states, targets, held))


def control_ahead(
    curves: LossCurves,
    controller: Controller,
    ahead: LookaheadSettings,
    start_factor: float | None = None,
    luminance: Array | None = None,
    costs: list[FrameCost] | None = None,
    level_is_given: bool = True,
) -> ControlledTrack:
    """Return what a controller does with a video that knows the next frames of it (`online.lookahead`).

    Parameters
    ----------
    curves, controller, start_factor, luminance : LossCurves, Controller, float or None, array or None
        As of `control_curves`; the gains do nothing.
    ahead : LookaheadSettings
        How far it looks.
    costs : list of FrameCost, optional
        What each frame costs; without them there is no budget.
    level_is_given : bool
        Whether the controller's target was asked for, as of `LookaheadController`.

    Raises
    ------
    InputError
        If the controller may choose factors that the curves do not reach.
    """
    shown, first = _prepared(curves, controller, start_factor, luminance)
    planner = LookaheadController(controller, ahead, curves.factors, first, level_is_given)
    of_frames: Sequence[FrameCost | None] = costs or [None] * curves.n_frames
    planned = []
    for losses, light, duration, cost in zip(
        curves.loss, shown.tolist(), curves.durations.tolist(), of_frames, strict=True
    ):
        planned += planner.push(ForeseenFrame(losses, light, duration, cost))
    planned += planner.finish()
    columns = zip(*((one.state, one.target_loss, one.budget_held) for one in planned), strict=True)
    states, targets, held = (list(column) for column in columns)
    return _track(curves, shown, controller, (states, targets, held))


def _track(
    curves: LossCurves,
    luminance: Array,
    controller: Controller,
    run: tuple[list[ControllerState], list[float], list[bool]],
) -> ControlledTrack:
    states, targets, held = run
    factors = np.array([state.factor for state in states])
    limits = np.array([controller.rate_limit(light) for light in (factors * luminance).tolist()])
    return ControlledTrack(
        durations=curves.durations,
        factors=factors,
        contrast_loss=loss_at(curves, factors),
        rate=modulation_rate(factors, luminance, curves.durations),
        rate_limit=allowed_rate(factors, luminance, lambda _: limits),
        limited=np.array([state.limited for state in states]),
        targets=np.array(targets),
        budget_held=np.array(held),
    )


def _prepared(
    curves: LossCurves, controller: Controller, start_factor: float | None, luminance: Array | None
) -> tuple[Array, float]:
    settings = controller.settings
    lowest, highest, known = settings.lowest_factor, settings.highest_factor, float(curves.factors[0])
    if lowest < known:
        raise InputError(
            f"the controller's lowest_factor is {lowest:g}, the loss curves of {curves.video!r} begin at "
            f"{known:g}; raise the one, or analyse the video for lower factors"
        )
    if start_factor is None:
        wanted = factor_at_loss(curves, np.full(curves.n_frames, settings.target_loss))[0]
        start_factor = float(np.clip(wanted, lowest, highest))
    if not lowest <= start_factor <= highest:
        raise InputError(f"the first factor must lie in {lowest:g} to {highest:g}, got {start_factor:g}")
    return curves.mean_luminance if luminance is None else luminance, start_factor


def _states(
    curves: LossCurves,
    controller: Controller,
    luminance: Array,
    first_factor: float,
    governed: tuple[Governor, list[FrameCost]] | None,
) -> tuple[list[ControllerState], list[float], list[bool]]:
    knots = curves.factors.tolist()
    frames = zip(curves.loss.tolist(), luminance.tolist(), curves.durations.tolist(), strict=True)
    steering = _Steering(controller.settings.target_loss, governed)
    states: list[ControllerState] = []
    targets: list[float] = []
    held: list[bool] = []
    for losses, light, duration in frames:
        factor = states[-1].factor if states else first_factor
        seen = FrameMeasurement(_interpolated(factor, knots, losses), light, duration)
        state = controller.step(states[-1], seen, steering.aim) if states else controller.start(factor, seen)
        states.append(state)
        targets.append(steering.target)
        if governed is not None:
            steering.take(state, _interpolated(state.factor, knots, losses))
        held.append(steering.held)
    return states, targets, held


class _Steering:
    """The governor's side of the loop: where the controller is to aim with the next frame.

    Parameters
    ----------
    target : float
        c_r at the first frame.
    governed : (Governor, list of FrameCost) or None
        Without it, the target stays.
    """

    def __init__(self, target: float, governed: tuple[Governor, list[FrameCost]] | None) -> None:
        self.target, self.held = target, False
        self.aim: SteeredTarget | None = None
        self._state: GovernorState | None = None
        if governed is not None:
            self._governor, self._costs = governed[0], iter(governed[1])

    def take(self, shown: ControllerState, loss: float) -> None:
        """Take note of a frame that was shown with some factor and has some loss."""
        if self._state is None:
            self._state = self._governor.start(self.target, shown.factor, loss)
        excess = next(self._costs).excess(shown.factor)
        self._state, self.aim = self._governor.step(self._state, shown, loss, excess)
        self.target, self.held = self._state.target_loss, self._state.held


def _interpolated(factor: float, knots: list[float], losses: list[float]) -> float:
    """Return the loss at a factor, between knots linearly; `loss_and_slope` for one frame, much faster."""
    above = min(max(bisect_right(knots, factor), 1), len(knots) - 1)
    share = (factor - knots[above - 1]) / (knots[above] - knots[above - 1])
    return losses[above - 1] + share * (losses[above] - losses[above - 1])
