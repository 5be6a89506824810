"""How far a long command is: a bar on a terminal; elsewhere (a file, a batch job) a line now and then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

told_by_default = False  # set by the command
_shown: list[Progress] = []  # what shows the progress of the command that runs
INTERVAL = 10.0  # between two lines, and before the first: what takes less says nothing [s]
Item = TypeVar("Item")


class Progress(Protocol):
    """What a command tells of its work: steps, one after the other, each of so many parts."""

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a step; `total` is None where nobody knows of how many parts it is."""

    def at(self, done: int, total: int | None = None) -> None:
        """Tell how many parts of the step are done; `total` where it is known only now."""

    def aside(self, words: str, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """Begin work within the step, and yield what takes how many parts of it are done."""


class ProgressLines:
    """Lines that say what is done, how much of it, and since when.

    Parameters
    ----------
    write : callable
        Takes a line.
    clock : callable
        Gives the time [s].
    """

    def __init__(self, write: Callable[[str], None], clock: Callable[[], float]) -> None:
        self._write, self._clock = write, clock
        self._begun = self._told = clock()
        self._words, self._done = "starting", 0
        self._total: int | None = None

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a step, and tell so if the command has taken long already."""
        self._words, self._done, self._total = words, 0, total
        if self._clock() - self._begun >= INTERVAL:
            self._tell()

    def at(self, done: int, total: int | None = None) -> None:
        """Take note of how many parts of the step are done."""
        self._done, self._total = done, total or self._total

    @contextmanager
    def aside(self, words: str, total: int) -> Iterator[Callable[[int], None]]:
        """Tell of work within the step, and then of the step again."""
        before = self._words, self._done, self._total
        self.step(words, total)
        try:
            yield self.at
        finally:
            self._words, self._done, self._total = before

    def tell_if_due(self) -> None:
        """Write a line if the last one is `INTERVAL` old."""
        if self._clock() - self._told >= INTERVAL:
            self._tell()

    def _tell(self) -> None:
        """Write a line."""
        self._told = self._clock()
        minutes, seconds = divmod(int(self._told - self._begun), 60)
        since = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
        count = count_in_words(self._done, self._total)
        self._write(f"evenlight: {since}: {self._words}{count and ', '}{count}")


def count_in_words(done: int, total: int | None) -> str:
    """Return how much of a step is done; nothing where it has no parts.

    >>> count_in_words(3, 12), count_in_words(3, None), count_in_words(0, None)
    ('3 of 12', '3', '')
    """
    return f"{done} of {total}" if total else str(done or "")


@contextmanager
def shown_progress(quiet: bool) -> Iterator[Progress]:
    """Show progress on standard error while a command works, and yield what it tells it to.

    Parameters
    ----------
    quiet : bool
        Whether to show nothing.
    """
    from rich.console import Console  # not needed by commands that are done at once

    console = Console(stderr=True)
    with ExitStack() as stack:
        progress: Progress
        if quiet:
            progress = ProgressLines(lambda line: None, lambda: 0.0)
        elif console.is_terminal:
            from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Bars

            columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[count]}")
            bars = Bars(*columns, TimeRemainingColumn(), console=console, transient=True)
            progress = _Bar(stack.enter_context(bars))
        else:
            progress = stack.enter_context(_told_regularly(ProgressLines(_to_standard_error, time.monotonic)))
        _shown.append(progress)
        stack.callback(_shown.remove, progress)
        yield progress


@contextmanager
def aside(words: str, total: int) -> Iterator[Callable[[int], None]]:
    """Tell of long work deep within whatever is going on, and yield what takes how many parts are done.

    It is told where the command that runs shows its progress, in lines where it shows none, and nowhere in a
    program that uses the Python interface.
    """
    if _shown:
        with _shown[-1].aside(words, total) as at:
            yield at
    else:
        tell = _to_standard_error if told_by_default else lambda line: None
        with _told_regularly(ProgressLines(tell, time.monotonic)) as lines, lines.aside(words, total) as at:
            yield at


def counted(progress: Progress, items: Iterable[Item], words: str, total: int | None) -> Iterator[Item]:
    """Yield the items of a step, and tell how many were taken."""
    progress.step(words, total)
    for done, item in enumerate(items, start=1):
        yield item
        progress.at(done)


class _Bar:
    """A bar on a terminal; a new one for each step."""

    def __init__(self, bars: Bars) -> None:
        self._bars, self._task = bars, bars.add_task("starting", total=None, count="")

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a bar."""
        self._bars.remove_task(self._task)
        self._task = self._bars.add_task(words, total=total, count="")

    def at(self, done: int, total: int | None = None) -> None:
        """Move the bar."""
        total = total or self._bars.tasks[-1].total  # type: ignore[assignment] # a whole number, as given
        self._bars.update(self._task, completed=done, total=total, count=count_in_words(done, total))

    @contextmanager
    def aside(self, words: str, total: int) -> Iterator[Callable[[int], None]]:
        """Show a bar below that of the step."""
        task = self._bars.add_task(words, total=total, count="")
        try:
            yield lambda done: self._bars.update(task, completed=done, count=count_in_words(done, total))
        finally:
            self._bars.remove_task(task)


@contextmanager
def _told_regularly(lines: ProgressLines) -> Iterator[ProgressLines]:
    """Have lines written beside the work, which may not come to tell anything for minutes."""
    ended = threading.Event()

    def tell() -> None:
        while not ended.wait(1.0):
            lines.tell_if_due()

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield lines
    finally:
        ended.set()
        teller.join()


def _to_standard_error(line: str) -> None:
    """Write a line, if anybody still reads it."""
    with suppress(OSError, ValueError):
        print(line, file=sys.stderr, flush=True)
