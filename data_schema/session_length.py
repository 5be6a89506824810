"""How long a session of the ramp experiment takes, for its plan and for the page that tells a participant."""

from __future__ import annotations

import math

from evenlight.data_schema.ramp import Procedure, RampDesign

ANSWER_TIME = 1.5  # [s] from the question to the answer, of a practised person (choice)
BREAK_TIME = 60.0  # [s] a break (choice)
INSTRUCTION_TIME = 180.0  # [s] consent, instructions, adaptation to the room (choice)


def session_minutes(design: RampDesign, n_trials: int) -> float:
    """Return how long a participant takes [min]: instructions, practice, trials, breaks.

    Parameters
    ----------
    design : RampDesign
        How trials are shown; of several durations each is as frequent as any other.
    n_trials : int
        Trials, catch trials among them and practice not.

    >>> design = RampDesign(practice_trials=4, trials_between_breaks=30)
    >>> round(session_minutes(design, 60), 2)  # 64 trials of 9.5 s, one break, and 3 minutes before
    14.13
    """
    between = design.trials_between_breaks
    breaks = max(math.ceil(n_trials / between) - 1, 0) if between else 0
    trials = (n_trials + design.practice_trials) * trial_seconds(design)
    return (INSTRUCTION_TIME + trials + breaks * BREAK_TIME) / 60


def trial_seconds(design: RampDesign) -> float:
    """Return how long a trial takes up to the next one, on average over the ramp's durations [s].

    >>> trial_seconds(RampDesign())  # 1 + 5 + 1, 1.5 to answer, 1 until the next
    9.5
    >>> trial_seconds(RampDesign(procedure=Procedure.TWO_INTERVAL))  # twice 7, three gaps of 0.5, and 2.5
    18.0
    """
    ramp = math.fsum(design.ramp_durations) / len(design.ramp_durations)
    shown = design.adaptation_duration + ramp + design.hold_duration
    if design.procedure is Procedure.TWO_INTERVAL:
        shown = 2 * shown + 3 * design.interval_gap
    return shown + ANSWER_TIME + design.pause_duration
