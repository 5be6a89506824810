"""How far a long command is: a bar on a terminal; elsewhere (a file, a batch job) a line now and then."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from datetime import timedelta
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

told_by_default = False  # set by the command
_shown: list[Progress] = []  # what shows the progress of the command that runs
INTERVAL = 10.0  # between two lines, and before the first: what takes less says nothing [s]
COMPILING = "compiling (once, about 20 s)"
Item = TypeVar("Item")


class Progress(Protocol):
    """What a command tells of its work: steps, one after the other, each of so many parts."""

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a step; `total` is None where nobody knows of how many parts it is."""

    def at(self, done: int, total: int | None = None) -> None:
        """Tell how many parts of the step are done; `total` where it is known only now."""

    def note(self, words: str) -> None:
        """Say something of a part that is done, in a line that stays."""

    def aside(self, words: str, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """Begin work within the step, and yield what takes how many parts of it are done."""

    def compiling(self, begun: bool) -> None:
        """Tell that loops are being compiled, which no estimate of time may count; or that they are."""


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
        self._words, self._done, self._compiling = "starting", 0, False
        self._total: int | None = None

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a step, and tell so if the command has taken long already."""
        self._words, self._done, self._total = words, 0, total
        if self._clock() - self._begun >= INTERVAL:
            self._tell()

    def at(self, done: int, total: int | None = None) -> None:
        """Take note of how many parts of the step are done."""
        self._done, self._total = done, total or self._total

    def note(self, words: str) -> None:
        """Write a line."""
        self._write(f"evenlight: {words}")

    @contextmanager
    def aside(self, words: str, total: int) -> Iterator[Callable[[int], None]]:
        """Tell of work within the step, and then of the step again."""
        before = self._words, self._done, self._total
        self.step(words, total)
        try:
            yield self.at
        finally:
            self._words, self._done, self._total = before

    def compiling(self, begun: bool) -> None:
        """Take note of whether loops are being compiled."""
        self._compiling = begun

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
        words = COMPILING if self._compiling else self._words
        self._write(f"evenlight: {since}: {words}{count and ', '}{count}")


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
            from rich.progress import BarColumn, TextColumn
            from rich.progress import Progress as Bars

            told = TextColumn("{task.fields[count]}"), TextColumn("[cyan]{task.fields[left]}")
            bars = Bars(TextColumn("{task.description}"), BarColumn(), *told, console=console, transient=True)
            progress = _Bar(stack.enter_context(bars))
        else:
            progress = stack.enter_context(_told_regularly(ProgressLines(_to_standard_error, time.monotonic)))
        _shown.append(progress)
        stack.callback(_shown.remove, progress)
        stack.enter_context(_compilation_told(progress))
        yield progress


@contextmanager
def _compilation_told(progress: Progress) -> Iterator[None]:
    """Tell when Numba compiles a loop, not when its machine code is read."""
    from numba.core import event  # not needed by commands that are done at once

    class CompilationListener(event.Listener):
        depth = 0  # loops that wait for another one, which they use

        def on_start(self, event: object) -> None:
            self.depth += 1
            if self.depth == 1:
                progress.compiling(True)

        def on_end(self, event: object) -> None:
            self.depth -= 1
            if self.depth == 0:
                progress.compiling(False)

    with event.install_listener("numba:compile", CompilationListener()):
        yield


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
        self._bars, self._task = bars, bars.add_task("starting", total=None, count="", left="")
        self._words, self._done, self._compiling = "starting", 0, False
        self._total: int | None = None
        self._since = bars.get_time(), 0  # from when on, and from how many done, the time left is estimated

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a bar."""
        self._bars.remove_task(self._task)
        self._words, self._done, self._total, self._since = words, 0, total, (self._bars.get_time(), 0)
        self._task = self._bars.add_task(words, total=total, count="", left=self._left())

    def at(self, done: int, total: int | None = None) -> None:
        """Move the bar."""
        self._done, self._total = done, total or self._total
        self._show()

    def compiling(self, begun: bool) -> None:
        """Say that loops are being compiled; the time left is estimated anew from what is done afterwards."""
        self._compiling, self._since = begun, (self._bars.get_time(), self._done)
        self._show()

    def _show(self) -> None:
        """Show the words, how much is done, and the time that is left."""
        self._bars.update(
            self._task,
            description=COMPILING if self._compiling else self._words,
            completed=self._done,
            total=self._total,
            count=count_in_words(self._done, self._total),
            left=self._left(),
        )

    def _left(self) -> str:
        """Return the time left, as what is done took: the last parts may have come all at once."""
        (since, before), total = self._since, self._total
        if total is None:
            return ""
        if self._compiling or self._done <= before:
            return "-:--:--"
        each = (self._bars.get_time() - since) / (self._done - before)
        return str(timedelta(seconds=math.ceil(each * max(total - self._done, 0))))

    def note(self, words: str) -> None:
        """Write a line above the bar."""
        self._bars.console.print(words, highlight=False, markup=False, soft_wrap=True)

    @contextmanager
    def aside(self, words: str, total: int) -> Iterator[Callable[[int], None]]:
        """Show a bar below that of the step."""
        below = _Bar(self._bars)
        below.step(words, total)
        try:
            yield below.at
        finally:
            self._bars.remove_task(below._task)


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
