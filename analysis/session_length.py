"""How long a session of the ramp experiment takes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from data_schema.ramp import Procedure, RampDesign, RampTrial

ANSWER_TIME = 1.5  # [s] from the question to the answer (choice)
BREAK_TIME = 60.0  # [s] a break (choice)
INSTRUCTION_TIME = 180.0  # [s] consent, instructions, adaptation to the room (choice)


def session_minutes(trials: Sequence[RampTrial], design: RampDesign) -> float:
    """Return how long a participant takes [min]: instructions, practice, trials, breaks.

    Parameters
    ----------
    trials : sequence of RampTrial
        Of one participant; practice may be among them or not.
    design : RampDesign
        How they are shown.
    """
    main = [trial for trial in trials if not trial.practice]
    typical = sum(trial_seconds(trial.duration, design) for trial in main) / max(len(main), 1)
    between = design.trials_between_breaks
    breaks = max(math.ceil(len(main) / between) - 1, 0) if between else 0
    seconds = typical * (len(main) + design.practice_trials) + breaks * BREAK_TIME + INSTRUCTION_TIME
    return seconds / 60


def trial_seconds(duration: float, design: RampDesign) -> float:
    """Return how long a trial with a ramp of a duration [s] takes, up to the next one [s].

    >>> trial_seconds(5.0, RampDesign())  # 1 + 5 + 1, 1.5 to answer, 0.5 until the next
    9.0
    >>> trial_seconds(5.0, RampDesign(procedure=Procedure.TWO_INTERVAL))  # twice 7, 0.5 between, and 2
    16.5
    """
    interval = design.adaptation_duration + duration + design.hold_duration
    if design.procedure is Procedure.TWO_INTERVAL:
        interval = 2 * interval + design.interval_gap
    return interval + ANSWER_TIME + design.pause_duration
