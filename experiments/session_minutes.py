"""How long a session of a viewing experiment takes, about."""

from __future__ import annotations

READING = 120.0  # [s] consent, instructions, practice pages
ANSWERING = 4.0  # [s] a question, and going on


def viewing_minutes(shown: float, n_trials: int) -> float:
    """Return the minutes of a session that shows something for some time [s] in some trials.

    >>> viewing_minutes(440.0, 10)
    10.0
    """
    return (READING + shown + ANSWERING * n_trials) / 60
