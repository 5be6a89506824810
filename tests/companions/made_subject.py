"""A subject of `evenlight bench` that takes no time; workers find it here by name."""

import os

import numpy as np

from benchmarks.measured import Approach, RunSettings, SubjectResults, point
from benchmarks.records import Role
from benchmarks.stopwatch import Times


def measure(settings: RunSettings) -> SubjectResults:
    """Return one point, and which process measured it."""
    settings.say("nothing")
    approach = Approach("one frame", "ours", Role.DEFAULT, 1, "frames")
    made = point(approach, Times(np.ones(1), np.ones(1), np.ones(1)))
    return SubjectResults("made", "Made", f"Measured by {os.getpid()}.", (made,), ())
