"""Trials in a fixed order: handed out once, again where flagged, and only those of the session."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.experiments.sessions.dropped_frames import most_repeats

MAX_SHOWINGS = 3  # of a trial that is flagged each time
FEWEST_SHOWINGS = 2  # one may be a hiccup of the computer
SAME = 1e-9  # relative, of a number that was computed and written


class PlannedTrial(SimpleNamespace):
    """A trial that is to come: the columns of its row that are known before, and what only showing it needs.

    Parameters
    ----------
    shown : mapping, optional
        What only showing it needs.
    **columns
        Of its row, by the names of the trial's fields. `block`, from 1 and 0 for practice, is among them.

    >>> planned = PlannedTrial({"seconds": 2.0}, sequence="gym", block=1)
    >>> planned.sequence, planned.seconds, planned.columns
    ('gym', 2.0, {'sequence': 'gym', 'block': 1})
    """

    def __init__(self, shown: Mapping[str, Any] | None = None, /, **columns: Any) -> None:
        super().__init__(**(shown or {}), **columns)
        vars(self).update(_shown=dict(shown or {}), columns=columns)

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse a change, which the columns would not have; `but` makes another trial."""
        raise AttributeError(f"a planned trial cannot be changed: use but({name}=...)")

    def but(self, **columns: Any) -> PlannedTrial:
        """Return the same trial with some other columns, or more of them."""
        return PlannedTrial(self._shown, **{**self.columns, **columns})


class FixedOrder:
    """Hands out trials in their order; a flagged one comes again at the end, if it is to.

    Parameters
    ----------
    trials : sequence of PlannedTrial
        In their order.
    repeat_flagged : bool
        Whether a flagged trial is shown again, at most three times in all, until a quarter of the trials
        was shown again; none is where every showing so far was flagged, for it would be flagged too.
    """

    gives_up = True  # where every showing so far was flagged

    def __init__(self, trials: Sequence[PlannedTrial], repeat_flagged: bool) -> None:
        if other := next((each for each in trials if not isinstance(each, PlannedTrial)), None):
            raise TypeError(f"planned trials are of the class PlannedTrial, got {other!r}")
        self._queue = [(trial, 1) for trial in trials]
        self._repeat_flagged = repeat_flagged
        self._place = self._dropped = 0
        self._last_block = max((trial.block for trial in trials), default=0)
        self._next: PlannedTrial | None = None
        self.n_trials = len(self._queue)

    def next_trial(self) -> PlannedTrial | None:
        """Return the trial that comes next, the same until `take` is called; None when all are done."""
        return self._queued() if self.n_left else None

    @property
    def n_left(self) -> int:
        """Trials still to come, as far as is known."""
        hopeless = self.gives_up and self._dropped == self._place >= FEWEST_SHOWINGS
        most = self.n_trials + (0 if hopeless else most_repeats(self.n_trials))
        return max(min(len(self._queue), most) - self._place, 0)

    def _queued(self) -> PlannedTrial | None:
        """Return the trial that is next in the queue, of which not all may be shown."""
        if self._next is None and self._place < len(self._queue):
            self._next = self._completed(self._queue[self._place][0])
        return self._next

    def _completed(self, planned: PlannedTrial) -> PlannedTrial:
        """Return a trial that is about to be shown with all that the answers so far say of it."""
        return planned

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
                f"design, display, stimuli and seed of the session say ({', '.join(different)}); a session "
                "goes on only with those, and the version of Evenlight, that it began with"
            )
        queued, showings = self._queue[self._place]
        self._place, self._next = self._place + 1, None
        # What is left out for having been seen before would only be seen once more.
        dropped = trial.flag is TrialFlag.DROPPED_FRAMES
        self._dropped += dropped
        if dropped and self._repeat_flagged and showings < MAX_SHOWINGS:
            self._queue.append((queued.but(block=self._last_block + 1), showings + 1))


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
    return getattr(value, "value", value)
