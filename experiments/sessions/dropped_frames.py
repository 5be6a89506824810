"""Dropped frames: how many a session accepts before it begins, in its first trials, and in all.

Decision (docs/decisions/frame-timing.md): a display that makes more than a quarter of the trials useless is
refused before the session, or stops it as soon as its trials show that; repeats prolong it by a quarter at
most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy import special

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.experiments.stage import PausePressed, SessionStopped

MAX_FLAGGED_SHARE = 0.25  # of trials (choice)
MAX_REPEATED_SHARE = 0.25  # of a session's trials, shown again (choice)
CHECK_SECONDS = 2.0  # of a stimulus before the session
FEWEST_TRIALS = 5  # before a session is stopped
ERROR_RATE = 0.05  # share of sessions stopped, over all looks, with just the accepted share
WHAT_TO_DO = (
    "close other programs, switch off notifications and the desktop's effects, use the display's own "
    "resolution and a lower refresh rate"
)


class ShownStimulus(Protocol):
    """Something that was shown, refresh by refresh."""

    @property
    def onset(self) -> float:
        """When its first frame appeared, on the stage's clock [s]."""

    @property
    def flip_times(self) -> tuple[float, ...]:
        """Of each refresh, since the first [s]."""

    @property
    def frames_dropped(self) -> int:
        """Refreshes that passed without a new frame."""


@dataclass(frozen=True, slots=True)
class FrameDemand:
    """What trials ask of a display."""

    # for each kind of trial, all of them equally frequent: its refreshes, and how many of them may be dropped
    trials: tuple[tuple[int, int], ...]
    setting: str  # of the design, that says how many may be dropped

    def flagged_share(self, dropped: int, refreshes: int) -> float:
        """Return the share of trials that are flagged where so many of so many refreshes are dropped.

        Each refresh is dropped or not independently of the others, so the number in a trial is binomial.

        >>> demand = FrameDemand(trials=((2, 0),), setting="max_dropped_frames")
        >>> demand.flagged_share(1, 10)  # 1 - 0.9²
        0.19
        """
        rate = dropped / refreshes
        shares = [float(special.bdtrc(most, n, rate)) if most < n else 0.0 for n, most in self.trials]
        return round(float(np.mean(shares)), 12)


def require_few_drops(show: Callable[[], ShownStimulus], demand: FrameDemand, refresh_rate: float) -> None:
    """Refuse a display that drops so many frames that too many trials would be flagged.

    One bad showing may be a hiccup of the computer, so a second one decides.

    Parameters
    ----------
    show : callable
        Shows about two seconds of the design's own stimulus.
    demand : FrameDemand
        What the trials ask.
    refresh_rate : float
        Of the rig [Hz].

    Raises
    ------
    InputError
        With the numbers, if too many trials would be flagged; if it was interrupted.
    """
    told = ""
    for _ in range(2):
        try:
            shown = show()
        except (PausePressed, SessionStopped) as stopped:
            by = stopped if isinstance(stopped, SessionStopped) else "by the pause key"
            raise InputError(f"the check of dropped frames was interrupted {by}; start again") from None
        dropped, refreshes = shown.frames_dropped, len(shown.flip_times) + shown.frames_dropped
        share = demand.flagged_share(dropped, refreshes)
        if share <= MAX_FLAGGED_SHARE:
            return
        told = f"{dropped} of {refreshes} frames in {refreshes / refresh_rate:.1f} s ({_pace(shown)})"
    raise InputError(
        f"the display drops too many frames of this design: {told}, with {refresh_rate:g} Hz in the rig; so "
        f"{share:.0%} of the trials would be flagged, and at most {MAX_FLAGGED_SHARE:.0%} may be: "
        f"{WHAT_TO_DO}, or raise {demand.setting} in the design"
    )


def _pace(shown: ShownStimulus) -> str:
    steps = np.diff(shown.flip_times)
    if not steps.size or not np.median(steps) > 0:
        return "no second frame came"
    return f"measured {1 / np.median(steps):.1f} Hz, the longest frame {1000 * steps.max():.0f} ms"


def too_many_flagged(flags: Sequence[bool]) -> bool:
    """Return whether the trials so far show that too many are flagged.

    They do if they are 20 times as likely under shares above what a session accepts, all of them equally
    likely beforehand, as under that share itself. However often and long one looks, that comes about in at
    most 1 of 20 sessions whose share is accepted (Ville 1939; Robbins 1970).

    >>> [too_many_flagged([True] * k + [False] * (6 - k)) for k in (4, 5)]
    [False, True]
    """
    n, flagged = len(flags), sum(flags)
    if n < FEWEST_TRIALS or flagged <= MAX_FLAGGED_SHARE * n:
        return False
    above = flagged + 1, n - flagged + 1
    others = special.betaln(*above) + math.log(special.betaincc(*above, MAX_FLAGGED_SHARE))
    accepted = special.xlogy(flagged, MAX_FLAGGED_SHARE) + special.xlogy(
        n - flagged + 1, 1 - MAX_FLAGGED_SHARE
    )
    return bool(others - accepted > -math.log(ERROR_RATE))


def drop_counts(trials: Sequence[Any]) -> dict[str, int]:
    """Return how many trials were flagged for dropped frames, and the drops of the worst; empty if none.

    Parameters
    ----------
    trials : sequence of trials
        With a `flag`; with `frames_dropped` and `n_frames`, those shown, if they were counted.
    """
    flagged = [trial for trial in trials if trial.flag is TrialFlag.DROPPED_FRAMES]
    if not flagged:
        return {}
    counts = [(getattr(t, "frames_dropped", 0) or 0, getattr(t, "n_frames", 0) or 0) for t in flagged]
    dropped, shown = max(counts)
    return {"flagged": len(flagged), "answered": len(trials), "dropped": dropped, "frames": dropped + shown}


def most_repeats(n_trials: int) -> int:
    """Return how many trials a session of so many shows again at most.

    >>> most_repeats(60), most_repeats(1)
    (15, 1)
    """
    return math.ceil(MAX_REPEATED_SHARE * n_trials)
