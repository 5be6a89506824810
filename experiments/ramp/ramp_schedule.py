"""The course of a ramp session: which trial comes next, given the answers so far.

A schedule is a function of design, display, seed, place of the participant and the trials taken, and of
nothing else: a session that broke off is taken up by handing the recorded trials to a fresh schedule.
"""

from __future__ import annotations

import math

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign, RampTrial, TrialFlag
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.chance import Purpose, generator_for, williams_row
from evenlight.experiments.ramp.adaptive_placement import CANDIDATES, AdaptivePlacement, placement_grid
from evenlight.experiments.ramp.ramp_plan import (
    levels_of,
    planned_ramp,
    ramp_conditions,
    session_plan,
)
from evenlight.experiments.sessions.fixed_order import FixedOrder, PlannedTrial
from evenlight.stimuli.ramp import require_reachable

PRACTICE_CATCH_SHARE = 1 / 3  # more than in the session: no one should learn that something always changes


class RampSchedule(FixedOrder):
    """Which trial comes next.

    Parameters
    ----------
    design : RampDesign
        What is shown and asked.
    display : Display
        What it is shown on.
    seed : int
        Of all chance.
    order_index : int, optional
        The participant's place in the data set: row of the counterbalanced order of blocks, and part of the
        key of all chance, so that participants differ under the same seed.
    actuator : Actuator, optional
        What makes the brightness, which decides how dark and how bright a ramp can get.
    smallest_factor : float, optional
        Of the backlight.

    Raises
    ------
    InputError
        If the display would cut off a ramp of the design, or adaptive placement has but one rate.
    """

    gives_up = False
    _candidate: int | None = None  # which rate adaptive placement has chosen for the next trial

    def __init__(
        self,
        design: RampDesign,
        display: Display,
        seed: int,
        order_index: int = 0,
        actuator: Actuator = Actuator.PIXELS,
        *,
        smallest_factor: float = 0.0,
    ) -> None:
        _require_all_reachable(design, display, actuator, smallest_factor)
        self._design, self._display = design, display
        self._session = (seed, order_index)
        super().__init__(session_plan(design, display, *self._session), design.repeat_flagged)
        self._adaptive = _adaptive(design)

    def practice(self, number: int = 0) -> tuple[PlannedTrial, ...]:
        """Return the trials of a round of practice, from 0: ramps and, in yes/no, some trials without any.

        All ramps are as fast as the design has them; where it has a criterion, they get slower evenly in
        ln(rate), down to the middle of the design's rates, which is near the threshold of most people.
        """
        design, n = self._design, self._design.practice_trials
        rng = generator_for(*self._session, Purpose.PRACTICE, *([number] if number else []))
        catches = round(n * PRACTICE_CATCH_SHARE) if design.has_catch_trials else 0
        is_catch = rng.permutation(np.arange(n) < catches)
        first = ramp_conditions(design)[williams_row(len(ramp_conditions(design)), self._session[1])[0]]
        levels = levels_of(design, self._display, first)
        rates = design.rates_of(first.duration)
        slowest = math.sqrt(min(rates) * max(rates)) if design.practice_correct else max(rates)
        steps = iter(np.geomspace(max(rates), slowest, n - catches).tolist())
        two = design.procedure is Procedure.TWO_INTERVAL
        return tuple(
            planned_ramp(
                level := levels[k % len(levels)],
                first,
                0.0 if is_catch[k] else next(steps) * level.luminance,
                ramp_interval=int(rng.integers(1, 3)) if two else None,
            )
            for k in range(n)
        )

    def fastest(self) -> PlannedTrial:
        """Return the fastest ramp of the design: at the first level, over the shortest duration."""
        condition = min(ramp_conditions(self._design), key=lambda c: c.duration)
        level = levels_of(self._design, self._display, condition)[0]
        rate = max(self._design.rates_of(condition.duration)) * level.luminance
        two = self._design.procedure is Procedure.TWO_INTERVAL
        return planned_ramp(level, condition, rate, ramp_interval=1 if two else None)

    def _completed(self, planned: PlannedTrial) -> PlannedTrial:
        """Return the trial of a slot, its rate as placement has it."""
        rates = self._design.rates_of(planned.condition.duration)
        self._candidate = None
        if planned.is_catch:
            relative = 0.0
        elif self._adaptive:
            jitter = float(generator_for(*self._session, Purpose.JITTER, planned.number).random())
            self._candidate = self._adaptive.candidate((planned.level, planned.condition), jitter)
            relative = float(np.geomspace(min(rates), max(rates), CANDIDATES)[self._candidate])
        else:
            relative = rates[planned.rate_index or 0]
        rate, interval = relative * planned.level.luminance, planned.ramp_interval
        return planned_ramp(
            planned.level, planned.condition, rate, ramp_interval=interval, block=planned.block
        )

    def take(self, trial: RampTrial) -> None:
        """Take an answered trial: it counts, unless it is flagged, and the next one may depend on it.

        Practice is passed over.

        Raises
        ------
        InputError
            If it is not the trial that `next_trial` returned.
        """
        if trial.practice:
            return
        self._queued()
        slot, candidate = self._queue[min(self._place, len(self._queue) - 1)][0], self._candidate
        super().take(trial)
        if trial.flag is TrialFlag.NONE and self._adaptive:
            if candidate is None:
                self._adaptive.take_catch(trial.success)
            else:
                self._adaptive.take((slot.level, slot.condition), candidate, trial.success)


def _adaptive(design: RampDesign) -> AdaptivePlacement | None:
    if design.placement is Placement.CONSTANT:
        return None
    low, high = min(design.relative_rates), max(design.relative_rates)
    if low == high:
        raise InputError(
            f"{design.placement.value} placement moves between the lowest and the highest of "
            f"relative_rates_per_s, got only {low:g}; give two at least"
        )
    return AdaptivePlacement(
        design.placement, placement_grid(high / low, design.procedure is Procedure.TWO_INTERVAL)
    )


def _require_all_reachable(
    design: RampDesign, display: Display, actuator: Actuator, smallest_factor: float
) -> None:
    """Refuse a design with a ramp that the display would cut off: the fastest of each level tells."""
    for condition in ramp_conditions(design):
        for level in levels_of(design, display, condition):
            fastest = max(design.rates_of(condition.duration)) * level.luminance
            require_reachable(
                level.luminance,
                planned_ramp(level, condition, fastest).final_luminance,
                level.pixel_value,
                display,
                actuator,
                smallest_factor=smallest_factor,
            )
