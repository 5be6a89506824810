"""The online controller while somebody looks: it dims what a window shows, as losses come in (Section 6).

A loss that is measured is the answer to a frame that has been shown. The controller then says which factor is
due after as long as has passed since its last word, and the factor goes there in even steps, refresh by
refresh. The next loss is measured at the factor that is due by then, so that each answer is to the last one
given, as offline. Each picture's luminance is known before it is shown: no step is faster than the rate limit
allows at either of its ends. If the next loss is late, the factor stands where it was to go. With a budget, a
governor moves the target from answer to answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from evenlight.data_schema.live_control import LiveRefresh
from evenlight.experiments.live_governor import LiveGovernor, PictureUse
from evenlight.experiments.loss_meters import LossMeter
from evenlight.method.controller import Controller, ControllerState, FrameSeen

LONGEST = 0.25  # [s] since the last loss, or the last refresh, that a step may make up for
JITTER = 1e-3  # [s] that two flip times may be nearer to each other than a refresh lasts: that of clocks


@dataclass(frozen=True, slots=True)
class _Way:
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
class _Asked:
    """What is being measured: the picture of a refresh, at a factor."""

    refresh: int
    factor: float


@dataclass(frozen=True, slots=True)
class _Shown:
    """A picture: its factor, Ī at factor 1 [cd/m^2], when it appeared [s], and its slope of the power [W]."""

    factor: float
    luminance: float
    flip_time: float
    slope: float


class LiveDimmer:
    """Dims by the controller's answers to what a meter measures.

    Parameters
    ----------
    controller : Controller
        Target, gains, bounds and rate limit.
    meter : LossMeter
        Measures the pictures shown.
    factor : float or None
        To begin with; None: that at which the first picture meets the governor's budget.
    refresh_duration : float
        How long a refresh lasts at least [s].
    governor : LiveGovernor, optional
        What moves the target.
    """

    def __init__(
        self,
        controller: Controller,
        meter: LossMeter,
        factor: float | None,
        refresh_duration: float,
        governor: LiveGovernor | None = None,
    ) -> None:
        self._controller, self._meter, self._duration = controller, meter, refresh_duration
        self._governor, self._slope = governor, 0.0
        self._begins_by_budget = factor is None and governor is not None
        factor = controller.settings.highest_factor if factor is None else factor
        self._way = _Way(0.0, 0.0, factor, factor)
        self._state: ControllerState | None = None
        self._answered = self._shown_at = self._due = 0.0
        self._shown: _Shown | None = None
        self._luminance = 0.0
        self._asked: _Asked | None = None
        self._known: tuple[_Asked, float] | None = None
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
        self._luminance = self._meter.mean_luminance()
        if self._governor is not None:
            self._slope = self._governor.slope_of(self._meter.channel_means())
            if self._shown is None and self._begins_by_budget:
                first = self._governor.first_factor(self._slope)
                self._way = _Way(0.0, 0.0, first, first)
        seen = self._meter.result()
        if seen is not None and self._asked is not None:
            self._known = self._asked, seen.loss
            self._answer(seen.loss, now)
        self.factor = self._allowed(self._way.at(now), now)
        if self._meter.begin(self._way.last):
            self._asked = _Asked(len(self.rows), self._way.last)
        return self.factor

    def note(self, flip_time: float) -> None:
        """Note when the picture appeared, since the first [s]."""
        now = _Shown(self.factor, self._luminance, flip_time, self._slope)
        row = LiveRefresh(
            len(self.rows), flip_time, now.factor, mean_luminance=now.luminance,
            target_loss=self._controller.settings.target_loss,
        )  # fmt: skip
        if self._governor is not None:
            row = self._governed(row, self._governor, now)
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

    def _governed(self, row: LiveRefresh, governor: LiveGovernor, now: _Shown) -> LiveRefresh:
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
        frame, governor = FrameSeen(loss, self._luminance, self._duration), self._governor
        if self._state is None:
            if governor is not None:
                target = governor.begin(self.factor, loss)
                settings = replace(self._controller.settings, target_loss=target)
                self._controller = replace(self._controller, settings=settings)
            self._state, self._answered = self._controller.start(self.factor, frame), now
            return
        passed = min(max(now - self._answered, self._duration), LONGEST)
        # The steps will be made at the luminance that is seen now, not at that of the last answer.
        state = replace(self._state, factor=self.factor, luminance=frame.luminance, duration=passed)
        aim = None if governor is None else governor.aim(self._state, self.factor, loss)
        self._state, self._answered = self._controller.step(state, frame, aim), now
        self._way = _Way(self._shown_at, self._shown_at + passed, self.factor, self._state.factor)

    def _allowed(self, goal: float, now: float) -> float:
        """Return the factor nearest to a goal that the step from the picture before may lead to."""
        before = self._shown
        if before is None:
            return goal
        # The picture cannot appear before the moment of the call, nor before the last one's refresh is over.
        passed = min(max(now - self._duration - before.flip_time, self._duration), LONGEST)
        state = ControllerState(before.factor, 0.0, 0.0, before.luminance, passed)
        return self._controller.towards(state, FrameSeen(0.0, self._luminance, passed), goal)

    def _rate(self, before: _Shown, now: _Shown) -> tuple[float, float]:
        """Return the rate of the modulation between two pictures, as offline, and its limit [cd/m^2/s]."""
        passed = now.flip_time - before.flip_time
        if passed > self._duration - JITTER:
            passed = max(passed, self._duration)
        rate = (now.factor - before.factor) * (now.luminance + before.luminance) / 2 / max(passed, JITTER)
        return rate, min(self._controller.rate_limit(one.factor * one.luminance) for one in (before, now))

    def close(self) -> None:
        """Let go of the meter."""
        self._meter.close()
