"""Dimming with a look ahead: a player's buffer holds the next frames, and their whole loss curves are known.

For each frame the factors of all frames in the buffer are planned, and the first of them is shown (model
predictive control, García, Prett & Morari 1989, Automatica 25:335). The plan minimizes

    Σ Δt_j (𝓛_j(b_j) - c)² + τ (𝓛_last(b) - c)² + τ mean_past (𝓛(b) - c)²

within the rate limit. The last two terms stand for what comes after the buffer: the last frame's content goes
on for a while, and then comes what came before, as its statistics say. With nothing ahead they alone
say where to go. The sum is linearized about the plan before, which makes it a quadratic over a chain
(`optimizer.chain`), solved exactly.

With a budget the level c is the mean loss that the content would have where it meets the budget, plus ŝ D/T:
D is what has been used more than is due over the horizon H, T = H/13, ŝ the slope of the loss, which makes a
change of the factor one of the loss. The first frame counts as H/10 of content.
See docs/decisions/lookahead.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.quantities import check_limits, quantity
from evenlight.method.online.controller import Controller, ControllerState, FrameMeasurement
from evenlight.method.online.governor import HORIZON, LEAST_SLOPE, NO_ROOM, FrameCost, MeanSoFar
from evenlight.method.optimizer.chain import ChainLimits, minimize_chain
from evenlight.method.rate_limit import ROUNDING

LOOKAHEADS = 0.0, 60.0  # [s] from and to: those that may be asked for
PERSISTENCE = 2.0  # τ [s]; 1 to 5 give the same on a film with a cut every 8 s
DEBT_REACTION = 13.0  # horizons hold so many T: budget errors are then the PID controller's on average
FIRST_COUNTS = 0.1  # horizons: as so much content the first frame counts, or few frames would set the level
LARGEST_STEP = 0.9  # of the factor, in one frame: in the dark any would do
LEAST_CURVATURE = 1e-6  # of the squared loss over the factor: what loses nothing still has one plan
SAME_TIME = 1e-6  # [s]


@dataclass(frozen=True, slots=True)
class LookaheadSettings:
    """How far ahead the controller looks, and for how long it remembers."""

    seconds: float = quantity(
        "s", "how much of what is to come is known", minimum=LOOKAHEADS[0], maximum=LOOKAHEADS[1]
    )
    horizon: float = quantity(
        "s", "H, over which the mean is to meet a budget; content is remembered as long", above=0.0,
        default=HORIZON,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class ForeseenFrame:
    """A frame that is in the buffer."""

    losses: Array  # (K,): 𝓛_c at each of the knots
    luminance: float  # Ī, the luminance at factor 1 that the rate limit is about [cd/m^2]
    duration: float  # how long it will be shown [s]
    cost: FrameCost | None = None  # what it uses of a budget; None without one


@dataclass(frozen=True, slots=True)
class PlannedFrame:
    """A frame that may be shown now."""

    state: ControllerState  # its factor, and whether a limit held it back
    loss: float  # its contrast loss
    target_loss: float  # c
    budget_held: bool  # whether a bound kept it from where the budget would have it


class LookaheadController:
    """Plans the factors of the frames in a buffer, and hands them out one by one.

    Parameters
    ----------
    controller : Controller
        Bounds and rate limit; its target is c without a budget, and otherwise c to begin with.
    settings : LookaheadSettings
        How far ahead.
    knots : array, (K,)
        The factors at which frames' losses are given.
    start_factor : float
        b of the first frame.
    level_is_given : bool
        Whether the controller's target counts as a horizon of content; with a budget only.
    """

    def __init__(
        self,
        controller: Controller,
        settings: LookaheadSettings,
        knots: Array,
        start_factor: float,
        level_is_given: bool = True,
    ) -> None:
        self._controller, self._settings, self._knots = controller, settings, knots
        self._content = _ContentStatistics(knots, settings.horizon)
        given = (controller.settings.target_loss, settings.horizon) if level_is_given else (0.0, 0.0)
        self._level, self._slope = MeanSoFar(*given), MeanSoFar()
        self._start, self._debt = start_factor, 0.0
        self._losses = np.empty((0, len(knots)))
        self._waiting: list[ForeseenFrame] = []
        self._known, self._ahead = 0, 0.0  # of those waiting: how many count as known, and their seconds
        self._state: ControllerState | None = None
        self._plan = np.empty(0)

    def push(self, frame: ForeseenFrame) -> list[PlannedFrame]:
        """Put a frame into the buffer; return those that nothing more is to be known of, in their order."""
        self._waiting.append(frame)
        self._losses = np.concatenate([self._losses, frame.losses[None]])
        self._ahead += frame.duration
        return self._due(self._settings.seconds + SAME_TIME)

    def finish(self) -> list[PlannedFrame]:
        """Return all frames that are left: there are no more."""
        return self._due(-1.0)

    def _due(self, needed: float) -> list[PlannedFrame]:
        """Return the frames after whose beginning more than some seconds are known."""
        due = []
        while self._waiting and self._ahead > needed:
            due.append(self._shown())
            self._ahead -= self._waiting.pop(0).duration
            self._losses, self._known = self._losses[1:], self._known - 1
        return due

    def _shown(self) -> PlannedFrame:
        self._look()
        frame, settings = self._waiting[0], self._controller.settings
        debt = 0.0 if frame.cost is None else self._debt / frame.cost.scale
        shift = max(self._slope.mean, LEAST_SLOPE) * debt * DEBT_REACTION / self._settings.horizon
        level = settings.target_loss if frame.cost is None else self._level.mean + shift
        level = min(max(level, 0.0), 1.0)
        told = FrameMeasurement(0.0, frame.luminance, frame.duration)
        if self._state is None:
            factor, limited = self._start, False
        else:
            goal, limited = self._planned(self._state, level)
            factor = self._controller.towards(self._state, told, goal)
        self._state = ControllerState(factor, factor, 0.0, frame.luminance, frame.duration, limited)
        loss = float(np.interp(factor, self._knots, frame.losses))
        low, high = settings.lowest_factor, settings.highest_factor
        held = (factor <= low and debt > 0) or (factor >= high and debt < 0)
        self._count(frame, factor)
        return PlannedFrame(self._state, loss, level, held)

    def _look(self) -> None:
        """Take the frames that the first one may know of into the statistics."""
        seconds = sum(frame.duration for frame in self._waiting[: self._known])
        while self._known < len(self._waiting) and seconds <= self._settings.seconds + SAME_TIME:
            frame = self._waiting[self._known]
            self._content.take(frame)
            self._known += 1
            seconds += frame.duration
            if frame.cost is not None:
                settings, horizon = self._controller.settings, self._settings.horizon
                fair = min(max(frame.cost.fair_factor, settings.lowest_factor), settings.highest_factor)
                loss = float(np.interp(fair, self._knots, frame.losses))
                begins = self._known == 1 and self._state is None
                counted = max(frame.duration, FIRST_COUNTS * horizon if begins else 0.0)
                self._level.with_next(loss, counted, horizon)
                self._slope.with_next(loss / max(1 - fair, NO_ROOM), frame.duration, horizon)

    def _planned(self, before: ControllerState, level: float) -> tuple[float, bool]:
        """Return the factor of the first frame in the plan, and whether a limit holds it back."""
        frames, settings = self._waiting[: self._known], self._controller.settings
        durations = np.array([frame.duration for frame in frames])
        share = self._step_shares(before, frames)
        low, high = (
            np.full(len(frames), settings.lowest_factor),
            np.full(len(frames), settings.highest_factor),
        )
        low[0] = max(low[0], before.factor * (1 - share[0]))
        high[0] = min(high[0], before.factor * (1 + share[0]))
        flat = np.zeros(len(frames) - 1)
        limits = ChainLimits(1 - share[1:], flat, 1 + share[1:], flat, low, high)
        about = np.clip(self._plan_before(before.factor, len(frames)), self._knots[0], 1.0)
        self._plan = minimize_chain(*self._quadratic(about, durations, level), limits)
        first = float(self._plan[0])
        return first, min(first - low[0], high[0] - first) <= ROUNDING

    def _plan_before(self, factor: float, count: int) -> Array:
        last = self._plan[-1] if len(self._plan) else factor
        return np.append(self._plan[1:], np.full(count, last))[:count]

    def _step_shares(self, before: ControllerState, frames: list[ForeseenFrame]) -> Array:
        """Return by what share of itself the factor may change with each frame, near the present one."""
        light = np.array([before.luminance, *(frame.luminance for frame in frames)])
        limit, b = self._controller.rate_limit, before.factor
        allowed = np.array([limit(b * one) for one in light.tolist()])
        seconds = np.array([before.duration, *(frame.duration for frame in frames[:-1])])
        acts_on = b * (light[:-1] + light[1:]) / 2
        free = acts_on == 0  # in the dark a change of the factor is not seen
        share = np.minimum(allowed[:-1], allowed[1:]) * seconds / np.where(free, 1.0, acts_on)
        return np.where(free, LARGEST_STEP, np.minimum(share, LARGEST_STEP))

    def _quadratic(self, about: Array, durations: Array, level: float) -> tuple[Array, Array]:
        """Return half the second derivative of what the plan minimizes, and half the first at 0."""
        knots, row = self._knots, np.arange(len(about))
        above = np.clip(np.searchsorted(knots, about, side="right"), 1, len(knots) - 1)
        below_loss = self._losses[row, above - 1]
        slope = (self._losses[row, above] - below_loss) / (knots[above] - knots[above - 1])
        error = below_loss - slope * knots[above - 1] - level  # of the tangent, at a factor of 0
        weight = durations.copy()
        weight[-1] += PERSISTENCE
        curvature = weight * (slope**2 + LEAST_CURVATURE)
        gradient = weight * (slope * error - LEAST_CURVATURE * about)
        bend, rise = self._content.cost_about(float(about[-1]), level)
        curvature[-1] += PERSISTENCE * bend
        gradient[-1] += PERSISTENCE * (rise - bend * about[-1])
        return curvature, gradient

    def _count(self, frame: ForeseenFrame, factor: float) -> None:
        """Take note of what a frame uses more than is due; of older frames ever less is remembered.

        What the factor cannot answer, from one bound to the other, is not remembered. Nor is what content
        leaves that cannot use its allowance: the night on an OLED panel.
        """
        if frame.cost is None:
            return
        horizon, settings = self._settings.horizon, self._controller.settings
        excess = frame.cost.excess(factor)
        used = excess.over_horizon if excess.in_reach else max(excess.over_horizon, 0.0)
        debt = self._debt + frame.duration * (used - self._debt / horizon)
        most = (settings.highest_factor - settings.lowest_factor) * excess.scale * horizon / DEBT_REACTION
        self._debt = min(max(debt, -most), most)


class _ContentStatistics:
    """Means of the loss and of its square at each knot, of older frames ever less.

    Parameters
    ----------
    knots : array, (K,)
        The factors.
    horizon : float
        For how long content is remembered [s].
    """

    def __init__(self, knots: Array, horizon: float) -> None:
        self._knots, self._horizon, self._passed = knots, horizon, 0.0
        self._loss, self._square = np.zeros_like(knots), np.zeros_like(knots)

    def take(self, frame: ForeseenFrame) -> None:
        """Take one more frame."""
        self._passed = min(self._passed + frame.duration, max(self._horizon, frame.duration))
        share = frame.duration / self._passed
        self._loss = self._loss + share * (frame.losses - self._loss)
        self._square = self._square + share * (frame.losses**2 - self._square)

    def cost_about(self, factor: float, level: float) -> tuple[float, float]:
        """Return half the second and half the first derivative of mean (𝓛(b) - c)² at a factor.

        They are those of the parabola through the knots about it; one that bends down is taken as straight.
        """
        k = min(max(int(np.searchsorted(self._knots, factor)), 1), len(self._knots) - 2)
        near = slice(k - 1, k + 2)
        cost = self._square[near] - 2 * level * self._loss[near]
        at, width = self._knots[near], np.diff(self._knots[near])
        rise = np.diff(cost) / width
        bend = (rise[1] - rise[0]) / (at[2] - at[0])
        middle = (rise[0] * width[1] + rise[1] * width[0]) / (at[2] - at[0])
        return max(float(bend), LEAST_CURVATURE), float(middle / 2 + max(bend, 0.0) * (factor - at[1]))
