"""Trials in a fixed order: handed out once, again where flagged, and only those of the session."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Generic, Protocol, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.experiments.sessions.dropped_frames import most_repeats

MAX_SHOWINGS = 3  # of a trial that is flagged each time
FEWEST_SHOWINGS = 2  # one may be a hiccup of the computer
SAME = 1e-9  # relative, of a number that was computed and written


class PlannedTrial(Protocol):
    """A trial of a fixed order."""

    @property
    def block(self) -> int:
        """Of the session, from 1; 0 for practice."""

    @property
    def columns(self) -> dict[str, Any]:
        """What of its row is known before it is shown."""


Planned = TypeVar("Planned", bound=PlannedTrial)


class FixedOrder(Generic[Planned]):
    """Hands out trials in their order; a flagged one comes again at the end, if it is to.

    Parameters
    ----------
    trials : sequence of planned trials
        In their order.
    repeat_flagged : bool
        Whether a flagged trial is shown again, at most three times in all, until a quarter of the trials
        was shown again; none is where every showing so far was flagged, for it would be flagged too.
    """

    def __init__(self, trials: Sequence[Planned], repeat_flagged: bool) -> None:
        self._queue: list[tuple[Planned, int]] = [(trial, 1) for trial in trials]
        self._repeat_flagged = repeat_flagged
        self._place = self._dropped = 0
        self._last_block = max((trial.block for trial in trials), default=0)
        self.n_trials = len(self._queue)

    def next_trial(self) -> Planned | None:
        """Return the trial that comes next, the same until `take` is called; None when all are done."""
        return self._queued() if self.n_left else None

    @property
    def n_left(self) -> int:
        """Trials still to come, as far as is known."""
        hopeless = self._dropped == self._place >= FEWEST_SHOWINGS
        most = self.n_trials + (0 if hopeless else most_repeats(self.n_trials))
        return max(min(len(self._queue), most) - self._place, 0)

    def _queued(self) -> Planned | None:
        """Return the trial that is next in the queue, of which not all may be shown."""
        return self._queue[self._place][0] if self._place < len(self._queue) else None

    def take(self, trial: Any) -> None:
        """Take an answered trial, just given or read from an interrupted session.

        Raises
        ------
        InputError
            If it is not the trial that `next_trial` returned.
        """
        planned = self._queued()  # earlier versions showed more of them again
        different = ["no further trial"] if planned is None else _differences(trial, planned.columns)
        if planned is None or different:
            raise InputError(
                f"trial {trial.trial_index} of participant {trial.participant_id} is not the one that "
                f"design, stimuli and seed of the session say ({', '.join(different)}); a session goes on "
                "only with those it began with"
            )
        showings = self._queue[self._place][1]
        self._place += 1
        # What is left out for having been seen before would only be seen once more.
        dropped = trial.flag is TrialFlag.DROPPED_FRAMES
        self._dropped += dropped
        if dropped and self._repeat_flagged and showings < MAX_SHOWINGS:
            again = dataclasses.replace(planned, block=self._last_block + 1)  # type: ignore[type-var] # a dataclass
            self._queue.append((again, showings + 1))


def _differences(trial: Any, columns: dict[str, Any]) -> list[str]:
    """Return in which columns a trial is not as it was planned, in words."""
    return [
        f"{name} {_plain(getattr(trial, name))}, not {_plain(value)}"
        for name, value in columns.items()
        if not _same(getattr(trial, name), value)
    ]


def _same(got: Any, planned: Any) -> bool:
    """Return whether two values are the same, numbers but for their rounding."""
    if isinstance(planned, float):
        return math.isclose(got, planned, rel_tol=SAME, abs_tol=SAME)
    return bool(got == planned)


def _plain(value: Any) -> object:
    """Return a value as it is read in a message."""
    return getattr(value, "value", value)
