"""The online controller while somebody looks: it dims what a window shows, as losses come in (Section 6).

A loss that is measured is the answer to a frame that has been shown. The controller then says which factor is
due after as long as has passed since its last word, and the factor goes there in even steps, refresh by
refresh, so that no step is faster than the rate limit allows. If the next loss is late, the factor stands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from data_schema.live_control import LiveRefresh
from experiments.loss_meters import LossMeter
from method.controller import Controller, ControllerState, FrameSeen

LONGEST = 0.25  # [s] since the last loss that a step may make up for: after a pause it starts afresh


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


class LiveDimmer:
    """Dims by the controller's answers to what a meter measures.

    Parameters
    ----------
    controller : Controller
        Target, gains, bounds and rate limit.
    meter : LossMeter
        Measures the pictures shown.
    factor : float
        To begin with.
    refresh_duration : float
        How long a refresh lasts [s].
    """

    def __init__(
        self, controller: Controller, meter: LossMeter, factor: float, refresh_duration: float
    ) -> None:
        self._controller, self._meter, self._duration = controller, meter, refresh_duration
        self._way = _Way(0.0, 0.0, factor, factor)
        self._state: ControllerState | None = None
        self._answered = self._shown_at = self._due = 0.0
        self._before = factor
        self._asked: int | None = None
        self._known: tuple[int, float, float] | None = None
        self.factor = factor
        self.rows: list[LiveRefresh] = []

    def next_factor(self, now: float) -> float:
        """Return the factor for the picture that is about to be shown, and begin to measure it.

        Parameters
        ----------
        now : float
            When it will appear, since the first [s]; later than at any earlier call.
        """
        self._shown_at, self._due, self._before = self._due, now, self.factor
        seen = self._meter.result()
        if seen is not None and self._asked is not None:
            self._known = self._asked, seen.loss, seen.mean_luminance
            self._answer(FrameSeen(seen.loss, seen.mean_luminance, self._duration), now)
        self.factor = self._way.at(now)
        if self._meter.begin(self.factor):
            self._asked = len(self.rows)
        return self.factor

    def note(self, flip_time: float) -> None:
        """Note when the picture appeared, since the first [s]."""
        row = LiveRefresh(len(self.rows), flip_time, self.factor)
        if self._known is not None:
            measured, loss, luminance = self._known
            step, passed = self.factor - self._before, self._due - self._shown_at
            row = replace(
                row,
                contrast_loss=loss,
                measured_refresh=measured,
                mean_luminance=luminance,
                rate=step * luminance / passed if step else 0.0,
                rate_limit=min(
                    self._controller.rate_limit(b * luminance) for b in (self.factor, self._before)
                ),
            )
        self.rows.append(row)

    def _answer(self, frame: FrameSeen, now: float) -> None:
        """Set out for the factor that the controller wants by the time of its next answer."""
        if self._state is None:
            self._state, self._answered = self._controller.start(self.factor, frame), now
            return
        passed = min(max(now - self._answered, self._duration), LONGEST)
        # The steps will be made at the luminance that is seen now, not at that of the last answer.
        state = replace(self._state, factor=self.factor, luminance=frame.luminance, duration=passed)
        self._state, self._answered = self._controller.step(state, frame), now
        self._way = _Way(self._shown_at, self._shown_at + passed, self.factor, self._state.factor)

    def close(self) -> None:
        """Let go of the meter."""
        self._meter.close()
