"""The logs of a folder that one program writes, with the events in it and the time since it began."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from filelock import FileLock

from evenlight.data_schema.append_log import AppendLog
from evenlight.data_schema.dataset_layout import EVENTS
from evenlight.data_schema.session import EventKind, SessionEvent

Clock = Callable[[], float]
Utc = Callable[[], str]


class TimedLogs:
    """Open logs: of events, and of whatever else is recorded.

    Parameters
    ----------
    folder : Path
        Where they lie.
    names : iterable of str
        Their files, but for that of the events.
    lock : FileLock
        Of the folder, held; it is let go at the end.
    utc : callable
        Returns the time of day as text.

    Attributes
    ----------
    folder : Path
        Where they lie.
    events : list of SessionEvent
        What happened so far.
    """

    def __init__(self, folder: Path, names: Iterable[str], lock: FileLock, utc: Utc) -> None:
        self.folder, self.utc = folder, utc
        self.events: list[SessionEvent] = []
        self._lock = lock
        self._clock: Clock = float  # of 0.0 s, until there is one
        self._started = 0.0
        self._logs = {name: AppendLog(folder / name) for name in (*names, EVENTS)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the files and let go of the folder."""
        for log in self._logs.values():
            log.close()
        self._lock.release()

    def use_clock(self, clock: Clock) -> None:
        """Count time with a clock [s] from now on, from where the last event was."""
        self._clock = clock
        self._started = clock() - self.last_time

    def now(self) -> float:
        """Return the time since the beginning [s]."""
        return max(self._clock() - self._started, 0.0)

    def since_beginning(self, time: float) -> float:
        """Return a time on the clock in use as the time since the beginning [s]."""
        return max(time - self._started, 0.0)

    @property
    def last_time(self) -> float:
        """Time of the last event [s]."""
        return max((event.time for event in self.events), default=0.0)

    def note(
        self, kind: EventKind, detail: str = "", trial_index: int | None = None, attempt: int | None = None
    ) -> None:
        """Record an event."""
        event = SessionEvent(kind, self.now(), self.utc(), trial_index, attempt, detail)
        self._logs[EVENTS].append(event)
        self.events.append(event)

    def happened(self, kind: EventKind) -> bool:
        """Return whether something happened already."""
        return any(event.kind is kind for event in self.events)


def utc_now() -> str:
    """Return the time of day, UTC (ISO 8601)."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
