"""The course of a ramp session: which trial comes next, given the answers so far.

A schedule is a function of design, display, seed, place of the participant and the trials taken, and of
nothing else: a session that broke off is taken up by handing the recorded trials to a fresh schedule.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign, RampTrial, TrialFlag
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.chance import Purpose, generator_for, williams_row
from evenlight.experiments.ramp.adaptive_placement import CANDIDATES, AdaptivePlacement, placement_grid
from evenlight.experiments.ramp.ramp_plan import (
    PlannedRamp,
    Slot,
    levels_of,
    planned_ramp,
    ramp_conditions,
    session_plan,
    trial_count,
)
from evenlight.experiments.sessions.dropped_frames import most_repeats
from evenlight.stimuli.ramp import require_reachable

MAX_SHOWINGS = 3  # of one trial; of all, `most_repeats` are shown again
PRACTICE_CATCH_SHARE = 1 / 3  # more than in the session: no one should learn that something always changes
SAME = 1e-9  # relative: luminances and rates that were written and read back


class RampSchedule:
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
        self._queue = list(session_plan(design, display, *self._session))
        self._place = 0
        self._showings: dict[int, int] = {}
        self._adaptive = _adaptive(design)
        self._upcoming: tuple[PlannedRamp, int | None] | None = None

    @property
    def n_trials(self) -> int:
        """Usable trials that the design asks for, without practice."""
        return sum(trial_count(self._design))

    @property
    def n_blocks(self) -> int:
        """Blocks of the plan; what is shown again at the end makes one more."""
        return len(ramp_conditions(self._design))

    @property
    def n_left(self) -> int:
        """Trials still to come, as far as is known."""
        most = self.n_trials + most_repeats(self.n_trials)
        return max(min(len(self._queue), most) - self._place, 0)

    def practice(self, number: int = 0) -> tuple[PlannedRamp, ...]:
        """Return the trials of a round of practice, from 0: ramps and, in yes/no, some trials without any.

        All ramps are as fast as the design has them; where it has a criterion, they get slower evenly in
        ln(rate), down to the middle of the design's rates, which is near the threshold of most people.
        """
        design, n = self._design, self._design.practice_trials
        rng = generator_for(*self._session, Purpose.PRACTICE, *([number] if number else []))
        catches = round(n * PRACTICE_CATCH_SHARE) if design.has_catch_trials else 0
        is_catch = rng.permutation(np.arange(n) < catches)
        first = ramp_conditions(design)[williams_row(self.n_blocks, self._session[1])[0]]
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

    def fastest(self) -> PlannedRamp:
        """Return the fastest ramp of the design: at the first level, over the shortest duration."""
        condition = min(ramp_conditions(self._design), key=lambda c: c.duration)
        level = levels_of(self._design, self._display, condition)[0]
        rate = max(self._design.rates_of(condition.duration)) * level.luminance
        two = self._design.procedure is Procedure.TWO_INTERVAL
        return planned_ramp(level, condition, rate, ramp_interval=1 if two else None)

    def next_trial(self) -> PlannedRamp | None:
        """Return the trial that comes next, the same until `take` is called; None when all are done."""
        return self._queued() if self.n_left else None

    def _queued(self) -> PlannedRamp | None:
        """Return the trial that is next in the queue, of which not all may be shown."""
        if self._upcoming is None and self._place < len(self._queue):
            self._upcoming = self._planned(self._queue[self._place])
        return self._upcoming[0] if self._upcoming else None

    def take(self, trial: RampTrial) -> None:
        """Take an answered trial: it counts, unless it is flagged, and the next one may depend on it.

        A flagged trial is shown again at the end of the session if the design says so, at most three times
        in all, until a quarter of the session was shown again. Practice is passed over.

        Raises
        ------
        InputError
            If it is not the trial that `next_trial` returned.
        """
        if trial.practice:
            return
        ramp = self._queued()  # earlier versions showed more of them again
        if ramp is None or self._upcoming is None or not _is_answer_to(trial, ramp):
            raise InputError(_not_expected(trial, ramp))
        slot, candidate = self._queue[self._place], self._upcoming[1]
        self._place, self._upcoming = self._place + 1, None
        if trial.flag is not TrialFlag.NONE:
            self._show_again(slot)
        elif self._adaptive and candidate is not None:
            self._adaptive.take((slot.level, slot.condition), candidate, trial.success)
        elif self._adaptive:
            self._adaptive.take_catch(trial.success)

    def _show_again(self, slot: Slot) -> None:
        """Put a trial at the end, as part of a block of its own, unless it was shown often enough."""
        showings = self._showings.get(slot.number, 1)
        if self._design.repeat_flagged and showings < MAX_SHOWINGS:
            self._showings[slot.number] = showings + 1
            self._queue.append(dataclasses.replace(slot, block=self.n_blocks + 1))

    def _planned(self, slot: Slot) -> tuple[PlannedRamp, int | None]:
        """Return the trial of a slot, and which candidate its rate is if placement is adaptive."""
        rates = self._design.rates_of(slot.condition.duration)
        candidate = None
        if slot.is_catch:
            relative = 0.0
        elif self._adaptive:
            jitter = float(generator_for(*self._session, Purpose.JITTER, slot.number).random())
            candidate = self._adaptive.candidate((slot.level, slot.condition), jitter)
            relative = float(np.geomspace(min(rates), max(rates), CANDIDATES)[candidate])
        else:
            relative = rates[slot.rate_index or 0]
        ramp = planned_ramp(
            slot.level,
            slot.condition,
            relative * slot.level.luminance,
            ramp_interval=slot.ramp_interval,
            block=slot.block,
        )
        return ramp, candidate


def _adaptive(design: RampDesign) -> AdaptivePlacement | None:
    """Return the placement of a design, None for constant stimuli."""
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


def _is_answer_to(trial: RampTrial, ramp: PlannedRamp) -> bool:
    """Return whether a recorded trial is the one that was planned."""
    named = (trial.screen, trial.factor, trial.direction, trial.ramp_interval, trial.is_catch)
    return named == (
        ramp.level.screen,
        ramp.level.factor,
        ramp.direction,
        ramp.ramp_interval,
        ramp.is_catch,
    ) and all(
        math.isclose(recorded, planned, rel_tol=SAME)
        for recorded, planned in (
            (trial.rate, ramp.rate),
            (trial.duration, ramp.duration),
            (trial.initial_luminance, ramp.level.luminance),
        )
    )


def _not_expected(trial: RampTrial, ramp: PlannedRamp | None) -> str:
    """Return what is wrong with a trial that the schedule did not ask for."""
    got = f"{trial.screen} at factor {trial.factor:g}, {trial.rate:.6g} cd/m^2/s"
    expected = "no further trial"
    if ramp is not None:
        expected = f"{ramp.level.screen} at factor {ramp.level.factor:g}, {ramp.rate:.6g} cd/m^2/s"
    return (
        f"trial {trial.trial_index} of participant {trial.participant_id} is {got}; design, display and seed "
        f"of the session say {expected}; a session goes on only with those it began with"
    )
