"""The course of a ramp session: which trial comes next, given the answers so far.

A schedule is a function of design, display, seed, place of the participant and the trials taken, and of
nothing else: a session that broke off is taken up by handing the recorded trials to a fresh schedule.

Adaptive placement puts the next ramp around the 75 % point, or where most is learnt. Its grid of beliefs is
coarser than that of the fit, since it only has to say where to look next, between two trials. Rates are
counted in steps of a list of candidates, evenly spaced in ln(rate) from the lowest to the highest rate of a
design, so that answers pool by rate and one grid serves all levels and durations.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign, RampTrial, TrialFlag
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.chance import Purpose, generator_for, williams_row
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
from evenlight.method.psychometric import THRESHOLD_PROBABILITY, WIDTH_LOGITS
from evenlight.stimuli.ramp import require_reachable

MAX_SHOWINGS = 3  # of one trial; of all, `most_repeats` are shown again
PRACTICE_CATCH_SHARE = 1 / 3  # more than in the session: no one should learn that something always changes
SAME = 1e-9  # relative: luminances and rates that were written and read back
JITTER_STEPS = 3  # at most, either way, around the 75 % point; see docs/decisions/placement.md
CANDIDATES = 27  # over the default rates, a factor of 15, a step of 11 %
STEPS_BEYOND = 9  # nodes of the threshold below the lowest and above the highest candidate
WIDTHS = np.geomspace(0.5, 5.1, 7)  # of the rise, in ln(rate); the fit's prior within two standard deviations
WIDTH_MEDIAN, WIDTH_SPREAD = 1.6, 0.6  # the fit's prior (docs/decisions/threshold-definition.md)
GUESS_RATES = np.array([0.01, 0.03, 0.06, 0.1, 0.16, 0.25, 0.4, 0.6])  # dense where most people are
GUESS_PRIOR = (1.0, 10.0)  # Beta, the fit's
LAPSE_RATES = np.array([0.004, 0.015, 0.04, 0.08, 0.15])
LAPSE_PRIOR = (1.0, 30.0)  # Beta, the fit's; of two intervals half as many, as half of the misses are right
FALLOFF = 0.5  # of the threshold's prior beyond the candidates, in ln(rate): the fit's
TWO_INTERVAL_GUESS = 0.5  # one of two intervals by chance


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


class AdaptivePlacement:
    """What is believed of one participant's thresholds, and where to look next; no file, no clock, no chance.

    Each condition (a level at one direction and duration) has a threshold, a width and a lapse rate of its
    own; the guess rate is the participant's, and catch trials inform it for all conditions.

    Parameters
    ----------
    placement : Placement
        Which rule: `TARGETED` or `PSI_MARGINAL`.
    grid : PlacementGrid
        Nodes and candidates.

    >>> adaptive = AdaptivePlacement(Placement.TARGETED, placement_grid(15.0, two_interval=False))
    >>> first = adaptive.candidate("level", jitter=0.5)
    >>> adaptive.take("level", first, success=True)
    >>> adaptive.candidate("level", jitter=0.5) < first  # seen: the next ramp is slower
    True
    """

    def __init__(self, placement: Placement, grid: PlacementGrid) -> None:
        self._placement = placement
        self._grid = grid
        self._likelihoods: dict[Hashable, NDArray[np.float64]] = {}
        self._catch_likelihood = np.ones(grid.guess_rates.size)

    def candidate(self, condition: Hashable, jitter: float) -> int:
        """Return which candidate to show next.

        Parameters
        ----------
        condition : hashable
            Where.
        jitter : float
            Chance, in [0, 1): where within the jitter around the 75 % point; `PSI_MARGINAL` takes no notice.
        """
        posterior = self.posterior(condition)
        if self._placement is Placement.PSI_MARGINAL:
            return int(np.argmin(expected_entropy(posterior, self._grid)))
        middle = float(self._grid.thresholds @ posterior.sum(axis=(1, 2, 3))) / self._grid.step
        wanted = middle + JITTER_STEPS * (2 * jitter - 1)
        return int(np.clip(round(wanted), 0, CANDIDATES - 1))

    def take(self, condition: Hashable, candidate: int, success: bool) -> None:
        """Learn from an answer to a ramp."""
        self.learn(condition, self._grid.success[candidate], success)

    def learn(self, condition: Hashable, chances: NDArray[np.float64], success: bool) -> None:
        """Learn from an answer to a ramp of any rate, whose success has these chances at the grid's nodes."""
        known = self._likelihoods.get(condition, np.ones(chances.shape))
        known = known * (chances if success else 1 - chances)
        self._likelihoods[condition] = known / known.max()

    def take_catch(self, yes: bool) -> None:
        """Learn from an answer to a trial without change."""
        guess = self._grid.guess_rates
        known = self._catch_likelihood * (guess if yes else 1 - guess)
        self._catch_likelihood = known / known.max()

    def posterior(self, condition: Hashable) -> NDArray[np.float64]:
        """Return the probability of each node of the grid, given all answers."""
        masses = self._grid.prior * self._catch_likelihood[:, None]
        if condition in self._likelihoods:
            masses = masses * self._likelihoods[condition]
        return np.asarray(masses / masses.sum())


def expected_entropy(posterior: NDArray[np.float64], grid: PlacementGrid) -> NDArray[np.float64]:
    """Return the entropy of ln(threshold) to be expected after showing each candidate (Prins 2013).

    Width, guess and lapse rate are summed over before the entropy is taken: an answer that only tells about
    them is worth nothing.

    Parameters
    ----------
    posterior : array (n_threshold, n_width, n_guess, n_lapse)
        Probability of each node.
    grid : PlacementGrid
        Nodes and candidates.

    Returns
    -------
    array (CANDIDATES,)
        Entropy [nat].
    """
    n = grid.thresholds.size
    before = posterior.reshape(n, -1)
    yes = np.einsum("tk,ctk->ct", before, grid.success.reshape(CANDIDATES, n, -1))
    no = before.sum(axis=1) - yes
    # Entropy of p / s weighed with s, s the sum of p: sum(-p ln p) + s ln s; special.entr is -p ln p.
    return np.asarray(sum(special.entr(p).sum(axis=1) - special.entr(p.sum(axis=1)) for p in (yes, no)))


@dataclass(frozen=True, slots=True)
class PlacementGrid:
    """Nodes, prior, and what every node says of the answer to every candidate; arrays are read-only."""

    step: float  # between two candidates, in ln(rate)
    thresholds: NDArray[np.float64]  # (n_threshold,): ln(threshold / rate of the first candidate)
    guess_rates: NDArray[np.float64]  # (n_guess,): γ
    # (n_threshold, n_width, n_guess, n_lapse): probability of each node before the first answer
    prior: NDArray[np.float64]
    # (CANDIDATES, n_threshold, n_width, n_guess, n_lapse): P("yes"), or P(correct) of two intervals
    success: NDArray[np.float64]


@cache
def placement_grid(ratio: float, two_interval: bool) -> PlacementGrid:
    """Return the grid for a design whose highest rate is `ratio` times its lowest.

    >>> grid = placement_grid(15.0, two_interval=True)
    >>> grid.guess_rates.tolist(), round(float(grid.prior.sum()), 12)
    ([0.5], 1.0)
    """
    step = float(np.log(ratio)) / (CANDIDATES - 1)
    candidates = step * np.arange(CANDIDATES, dtype=np.float64)
    thresholds = step * np.arange(-STEPS_BEYOND, CANDIDATES + STEPS_BEYOND, dtype=np.float64)
    guess_rates = np.array([TWO_INTERVAL_GUESS]) if two_interval else GUESS_RATES
    outside = np.maximum(0.0, np.maximum(-thresholds, thresholds - candidates[-1])) / FALLOFF
    off_middle = np.log(WIDTHS / WIDTH_MEDIAN) / WIDTH_SPREAD
    prior = (
        np.exp(-0.5 * outside**2)[:, None, None, None]
        * np.exp(-0.5 * off_middle**2)[:, None, None]
        * _beta_masses(guess_rates, *GUESS_PRIOR)[:, None]
        * _beta_masses(LAPSE_RATES, LAPSE_PRIOR[0], LAPSE_PRIOR[1] * (2 if two_interval else 1))
    )
    success = success_chances(candidates, thresholds, guess_rates)
    grid = PlacementGrid(step, thresholds, guess_rates, prior / prior.sum(), success)
    for array in (grid.thresholds, grid.guess_rates, grid.prior, grid.success):
        array.flags.writeable = False
    return grid


def _beta_masses(nodes: NDArray[np.float64], a: float, b: float) -> NDArray[np.float64]:
    """Return the probability that a Beta density gives to the neighbourhood of each node."""
    edges = np.concatenate([[0.0], (nodes[1:] + nodes[:-1]) / 2, [1.0]])
    return np.asarray(np.diff(special.betainc(a, b, edges)))


def success_chances(
    candidates: NDArray[np.float64], thresholds: NDArray[np.float64], guess_rates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return ψ of `method.psychometric` for every candidate at every node."""
    guess, lapse = guess_rates[:, None], LAPSE_RATES
    at_threshold = np.log((THRESHOLD_PROBABILITY - guess) / (1 - THRESHOLD_PROBABILITY - lapse))
    distance = (candidates[:, None] - thresholds)[:, :, None] / WIDTHS
    logit = WIDTH_LOGITS * distance[..., None, None] + at_threshold
    return np.asarray(guess + (1 - guess - lapse) * special.expit(logit))
