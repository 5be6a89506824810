"""The pool that a plan draws from: simulated participants, what was fitted to them, and what is true."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from evenlight.analysis.calibration.rate_limit_curve import luminances_needed
from evenlight.analysis.calibration.thresholds import fit_thresholds_of
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.ramp import Placement, RampDesign, RampTrial
from evenlight.data_schema.session_length import session_minutes
from evenlight.data_schema.threshold import Threshold

CHUNK = 4  # participants that are simulated and fitted at once: the unit of work and of progress
TrueThresholds = Mapping[tuple[str, float], float]  # by participant and initial luminance [cd/m^2/s]


class SimulateRamps(Protocol):
    """Simulated participants of the ramp experiment, and what is true of them."""

    def __call__(
        self, design: RampDesign, display: Display, participants: int, seed: int
    ) -> tuple[Sequence[RampTrial], TrueThresholds]:
        """Return all trials, and the thresholds that a perfect fit would find."""


@dataclass(frozen=True, slots=True)
class Work:
    """A few participants of a design: what is simulated and fitted at once.

    Attributes
    ----------
    design : RampDesign
        With as many trials as the longest session has.
    display : Display
        What the ramps are shown on.
    trials_per_level : tuple of int
        After how many ramps per level thresholds are fitted.
    participants, seed : int
        How many are simulated, from which seed.
    """

    design: RampDesign
    display: Display
    trials_per_level: tuple[int, ...]
    participants: int
    seed: int


@dataclass(frozen=True, slots=True)
class PoolMember:
    """A simulated participant.

    Attributes
    ----------
    thresholds : dict of int to tuple of Threshold
        What was fitted, by the ramps per level.
    minutes : dict of int to float
        Length of the session, by the ramps per level [min].
    truth : dict of float to float
        True thresholds [cd/m^2/s] by initial luminance [cd/m^2].
    """

    thresholds: dict[int, tuple[Threshold, ...]]
    minutes: dict[int, float]
    truth: dict[float, float]


def work_of(
    design: RampDesign, display: Display, trials: Sequence[int], participants: int, seed: int
) -> list[Work]:
    """Return the work that a pool of participants takes, in parts.

    Parts differ in their seed, designs do not: the same participants are met by every design.
    """
    longest = with_trials_per_level(design, max(trials))
    seeds = np.random.SeedSequence(seed).generate_state(math.ceil(participants / CHUNK))
    sizes = [min(CHUNK, participants - start) for start in range(0, participants, CHUNK)]
    return [
        Work(longest, display, tuple(sorted(trials)), size, int(part))
        for size, part in zip(sizes, seeds, strict=True)
    ]


def require_plannable(design: RampDesign, degree: int) -> None:
    """Refuse a design whose limit cannot be planned for, before anybody is simulated.

    The effects of several durations or directions would have to be planned for too.
    """
    levels, needed = len(design.screens) * len(design.factors), luminances_needed(degree)
    if levels < needed:
        raise InputError(
            f"a rate limit of degree {degree} needs {needed} or more levels, the design has {levels}; add "
            "factors or a screen to it"
        )
    if len(design.directions) > 1 or len(design.ramp_durations) > 1:
        raise InputError(
            f"a plan is made for one direction and one duration of the ramps, got "
            f"{len(design.directions)} and {len(design.ramp_durations)}; plan each alone"
        )


def with_trials_per_level(design: RampDesign, trials: int) -> RampDesign:
    """Return a design with at least so many ramps per level.

    >>> with_trials_per_level(RampDesign(), 20).repetitions  # of eight rates
    3
    """
    repetitions = math.ceil(trials / len(design.relative_rates))
    if design.placement is Placement.CONSTANT:
        return dataclasses.replace(design, repetitions=repetitions)
    return dataclasses.replace(design, trials_per_level=trials)


def pool_of(work: Work, simulate: SimulateRamps) -> list[PoolMember]:
    """Simulate participants, and fit their thresholds after each number of trials.

    Parameters
    ----------
    work : Work
        Who and what.
    simulate : function
        Who answers.
    """
    trials, truth = simulate(work.design, work.display, work.participants, work.seed)
    members = []
    for who in sorted({trial.participant_id for trial in trials}):
        own = [trial for trial in trials if trial.participant_id == who and trial.usable]
        first = {count: first_trials(own, count) for count in work.trials_per_level}
        members.append(
            PoolMember(
                {
                    n: tuple(fit.threshold for fit in fit_thresholds_of(part, judge=False))
                    for n, part in first.items()
                },
                {n: session_minutes(work.design, len(part)) for n, part in first.items()},
                {luminance: rate for (person, luminance), rate in truth.items() if person == who},
            )
        )
    return members


def first_trials(trials: Iterable[RampTrial], per_level: int) -> list[RampTrial]:
    """Return one participant's trials as far as a shorter session would have gone.

    Of every level the first so many ramps, and the same share of the catch trials: an adaptive placement
    knows nothing of the trials to come, and constant stimuli come in passes of all rates.
    """
    ordered = sorted(trials, key=lambda trial: trial.trial_index)
    ramps = [trial for trial in ordered if not trial.is_catch]
    catches = [trial for trial in ordered if trial.is_catch]
    seen: dict[tuple[str, float], int] = {}
    kept = []
    for trial in ramps:
        level = (trial.screen, trial.factor)
        seen[level] = seen.get(level, 0) + 1
        if seen[level] <= per_level:
            kept.append(trial)
    share = len(kept) / max(len(ramps), 1)
    return sorted(kept + catches[: round(share * len(catches))], key=lambda trial: trial.trial_index)
