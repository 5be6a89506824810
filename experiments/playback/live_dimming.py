"""The online controller at a window: it dims the pictures shown as losses come in (Section 6).

A loss that is measured is the answer to a frame that has been shown. The controller then says which factor is
due after as long as has passed since its last word, and the factor goes there in even steps, refresh by
refresh. The next loss is measured at the factor that is due by then, so that each answer is to the last one
given, as offline. Each picture's luminance is known before it is shown: no step is faster than the rate limit
allows at either of its ends. If the next loss is late, the factor stands where it was to go. With a budget, a
governor (`online.governor`) moves the target from answer to answer: power counts refresh by refresh, with
each picture's factor, content and time, and the excess since the last answer moves the target.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveRefresh
from evenlight.experiments.playback.loss_meters import LossMeter
from evenlight.method.online.controller import Controller, ControllerState, FrameMeasurement, SteeredTarget
from evenlight.method.online.governor import (
    BudgetExcess,
    ContentCosts,
    FrameCost,
    GovernorSettings,
    GovernorState,
    first_factor,
    governor_of,
    time_constant,
)
from evenlight.method.power import power_per_factor

LONGEST = 0.25  # [s] since the last loss, or the last refresh, that a step may make up for
JITTER = 1e-3  # [s] that two flip times may be nearer to each other than a refresh lasts: that of clocks


@dataclass(frozen=True, slots=True)
class _FactorPath:
    """From which factor to which the brightness goes, and when [s]."""

    begin: float
    end: float
    first: float
    last: float

    def at(self, now: float) -> float:
        """Return the factor at a time."""
        if now >= self.end:
            return self.last
        share = max(now - self.begin, 0.0) / (self.end - self.begin)
        return self.first + share * (self.last - self.first)


@dataclass(frozen=True, slots=True)
class _PendingMeasurement:
    """What is being measured: the picture of a refresh, at a factor."""

    refresh: int
    factor: float


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """A picture: its factor, Ī at factor 1 [cd/m^2], when it appeared [s], and its slope of the power [W]."""

    factor: float
    luminance: float
    flip_time: float
    slope: float


@dataclass(eq=False)
class LiveDimmer:
    """Dims by the controller's answers to what a meter measures."""

    controller: Controller  # target, gains, bounds and rate limit
    meter: LossMeter  # measures the pictures shown
    begins_with: float | None  # factor; None: that at which the first picture meets the governor's budget
    duration: float  # of a refresh, at least [s]
    governor: LiveGovernor | None = None  # what moves the target

    def __post_init__(self) -> None:
        self._slope = 0.0
        self._begins_by_budget = self.begins_with is None and self.governor is not None
        factor = self.controller.settings.highest_factor if self.begins_with is None else self.begins_with
        self._way = _FactorPath(0.0, 0.0, factor, factor)
        self._state: ControllerState | None = None
        self._answered = self._shown_at = self._due = 0.0
        self._shown: ShownPicture | None = None
        self._luminance = 0.0
        self._asked: _PendingMeasurement | None = None
        self._known: tuple[_PendingMeasurement, float] | None = None
        self.factor = factor
        self.rows: list[LiveRefresh] = []

    def next_factor(self, now: float) -> float:
        """Return the factor for the picture that is about to be shown, and begin to measure it.

        Parameters
        ----------
        now : float
            When it will appear if this very refresh is caught, since the first [s]: a refresh from the moment
            of the call. Later than at any earlier call.
        """
        self._shown_at, self._due = self._due, now
        self._luminance = self.meter.mean_luminance()
        if self.governor is not None:
            self._slope = self.governor.slope_of(self.meter.channel_means())
            if self._shown is None and self._begins_by_budget:
                first = self.governor.first_factor(self._slope)
                self._way = _FactorPath(0.0, 0.0, first, first)
        loss = self.meter.result()
        if loss is not None and self._asked is not None:
            self._known = self._asked, loss
            self._answer(loss, now)
        self.factor = self._allowed(self._way.at(now), now)
        if self.meter.begin(self._way.last):
            self._asked = _PendingMeasurement(len(self.rows), self._way.last)
        return self.factor

    def note(self, flip_time: float) -> None:
        """Note when the picture appeared, since the first [s]."""
        now = ShownPicture(self.factor, self._luminance, flip_time, self._slope)
        row = LiveRefresh(
            len(self.rows), flip_time, now.factor, mean_luminance=now.luminance,
            target_loss=self.controller.settings.target_loss,
        )  # fmt: skip
        if self.governor is not None:
            row = self._governed(row, self.governor, now)
        if self._shown is not None:
            rate, limit = self._rate(self._shown, now)
            row = replace(row, rate=rate, rate_limit=limit)
        if self._known is not None:
            asked, loss = self._known
            row = replace(
                row, contrast_loss=loss, measured_refresh=asked.refresh, measured_factor=asked.factor
            )
        self._shown = now
        self.rows.append(row)

    def _governed(self, row: LiveRefresh, governor: LiveGovernor, now: ShownPicture) -> LiveRefresh:
        """Return a row with what a governor says of it; the picture before it has used its power by then."""
        if self._shown is not None:
            passed = now.flip_time - self._shown.flip_time
            governor.take(PictureUse(self._shown.factor, self._shown.slope, passed))
        used, full = (governor.power_at(factor, now.slope) for factor in (now.factor, 1.0))
        return replace(
            row, target_loss=governor.target, power=used, full_power=full, budget_held=governor.held
        )

    def _answer(self, loss: float, now: float) -> None:
        """Set out for the factor that the controller wants by the time of its next answer."""
        frame, governor = FrameMeasurement(loss, self._luminance, self.duration), self.governor
        if self._state is None:
            if governor is not None:
                target = governor.begin(self.factor, loss)
                settings = replace(self.controller.settings, target_loss=target)
                self.controller = replace(self.controller, settings=settings)
            self._state, self._answered = self.controller.start(self.factor, frame), now
            return
        passed = min(max(now - self._answered, self.duration), LONGEST)
        # The steps will be made at the luminance that is seen now, not at that of the last answer.
        state = replace(self._state, factor=self.factor, luminance=frame.luminance, duration=passed)
        aim = None if governor is None else governor.aim(self._state, self.factor, loss)
        self._state, self._answered = self.controller.step(state, frame, aim), now
        self._way = _FactorPath(self._shown_at, self._shown_at + passed, self.factor, self._state.factor)

    def _allowed(self, goal: float, now: float) -> float:
        """Return the factor nearest to a goal that the step from the picture before may lead to."""
        before = self._shown
        if before is None:
            return goal
        passed = self._passed(before, now)
        state = ControllerState(before.factor, 0.0, 0.0, before.luminance, passed)
        return self.controller.towards(state, FrameMeasurement(0.0, self._luminance, passed), goal)

    def _passed(self, before: ShownPicture, now: float) -> float:
        """Return the time that a step is sure to have, from the picture before to one that is due now [s].

        The picture cannot appear before the moment of the call, nor before the last one's refresh is over.
        """
        return min(max(now - self.duration - before.flip_time, self.duration), LONGEST)

    def _rate(self, before: ShownPicture, now: ShownPicture) -> tuple[float, float]:
        passed = now.flip_time - before.flip_time
        if passed > self.duration - JITTER:
            passed = max(passed, self.duration)
        rate = (now.factor - before.factor) * (now.luminance + before.luminance) / 2 / max(passed, JITTER)
        return rate, min(self.controller.rate_limit(one.factor * one.luminance) for one in (before, now))

    def close(self) -> None:
        """Let go of the meter."""
        self.meter.close()


@dataclass(frozen=True, slots=True)
class LiveBudget:
    """What a walk may use: a budget over a horizon, of the power that a model says."""

    settings: GovernorSettings
    model: PowerModel | None  # None: not known, for a budget in factors


@dataclass(frozen=True, slots=True)
class PictureUse:
    """What a picture used while it was shown."""

    factor: float  # b
    slope: float  # `power_per_factor` of its content [W]
    seconds: float  # how long it was shown [s]


@dataclass(frozen=True, slots=True)
class _UncountedPicture:
    """A picture that no answer has counted yet: seconds shown, its costs, what it used too much."""

    seconds: float
    cost: FrameCost
    excess: BudgetExcess


@dataclass(eq=False)
class LiveGovernor:
    """Moves the target of a live controller so that a budget is met over its horizon."""

    budget: LiveBudget
    controller: Controller  # for the bounds of its factor
    target: float | None  # c_r now; None, before the first: the first loss that is measured
    held: bool = False  # whether a bound keeps the factor from where the budget would have it

    def __post_init__(self) -> None:
        self._bounds = self.controller.settings
        self._governor = governor_of(self.controller, self.budget.settings)
        self._costs = ContentCosts(self.budget.settings, self.budget.model)
        self._state: GovernorState | None = None
        self._since: list[_UncountedPicture] = []

    def slope_of(self, channel_means: Array) -> float:
        """Return what a factor of 1 adds to the power of a picture [W]."""
        return float(power_per_factor(self.budget.model, channel_means[None])[0])

    def power_at(self, factor: float, slope: float) -> float | None:
        """Return the power of a picture [W]; None for a budget in factors, which is about none."""
        model, unit = self.budget.model, self.budget.settings.budget_unit
        return None if model is None or unit is BudgetUnit.FACTOR else model.base_power + slope * factor

    def first_factor(self, slope: float) -> float:
        """Return the factor at which the first picture meets the budget, within the bounds."""
        bounds = self._bounds.lowest_factor, self._bounds.highest_factor
        return first_factor(self.budget.settings, self.budget.model, slope, bounds)

    def begin(self, factor: float, loss: float) -> float:
        """Return the target to begin with, at the first loss that is measured."""
        self.target = loss if self.target is None else self.target
        self._state = self._governor.start(self.target, factor, loss)
        return self.target

    def take(self, use: PictureUse) -> None:
        """Take note of a picture that was shown."""
        if use.seconds > 0:
            cost = self._costs.of(use.slope, use.seconds)
            self._since.append(_UncountedPicture(use.seconds, cost, cost.excess(use.factor)))

    def aim(self, answer: ControllerState, factor: float, loss: float) -> SteeredTarget | None:
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
            return SteeredTarget(
                self.target, 0.0
            )  # of two answers at one time the second has nothing to count
        seconds = sum(taken.seconds for taken in self._since)
        shown = ControllerState(factor, 0.0, 0.0, answer.luminance, seconds, answer.limited)
        self._state, aim = self._governor.step(self._state, shown, loss, self._excess(seconds))
        self._since, self.target, self.held = [], self._state.target_loss, self._state.held
        return aim

    def _excess(self, seconds: float) -> BudgetExcess:
        """Return what the pictures since the last answer used too much on average, over `seconds` in all."""

        def mean(of_each: Iterable[float]) -> float:
            return sum(one.seconds * part for one, part in zip(self._since, of_each, strict=True)) / seconds

        last = self._since[-1].excess
        # As for one picture in `ContentCosts`: the answer to what all of them used at once never leads beyond
        # the factor at which they would be allowed.
        share = seconds / time_constant(self.budget.settings.horizon, seconds)
        return BudgetExcess(
            at_once=mean(one.excess.at_once for one in self._since),
            over_horizon=mean(one.excess.over_horizon for one in self._since),
            scale=max(last.scale, mean(one.cost.per_factor for one in self._since) * share),
            in_reach=last.in_reach,
        )
