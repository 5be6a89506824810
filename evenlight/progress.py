"""How far long work is: a bar on a terminal or in a notebook; elsewhere (a batch job) a line now and then."""

from __future__ import annotations

import functools
import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import timedelta
from html import escape
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

told_by_default = False  # set by the command
in_notebooks = True  # whether calls of Python tell there; the user's
begun: float | None = None  # when the command began, by the clock of rich; set by the command [s]
_shown: list[Progress] = []  # what shows the progress of the command that runs
_told_under: set[str] = set()  # cells of a notebook that have a line
INTERVAL = 10.0  # between two lines, and before the first: what takes less says nothing [s]
IN_NOTEBOOKS = 1.0  # the same there, where the line is written anew [s]
COMPILING = "compiling (once, about 20 s)"
Item = TypeVar("Item")


class Progress:
    """What a command tells of its work: steps, one after the other, each of so many parts.

    The bars of rich keep what is done; where nobody sees them, `write` takes lines in their place.
    """

    def __init__(
        self, bars: Bars, write: Callable[[str], None] | None = None, begun: float | None = None
    ) -> None:
        self._bars, self.write, self._compiling = bars, write, False
        self._told, self.interval = bars.get_time(), INTERVAL
        # A command may show several, one after the other.
        self._begun = self._told if begun is None else begun
        self._step = self._bar("starting", None)

    def step(self, words: str, total: int | None = None) -> None:
        """Begin a step; `total` is None where nobody knows of how many parts it is."""
        self._bars.remove_task(self._step)
        self._step = self._bar(words, total)
        self.tell_if_due(since=self._begun)

    def at(self, done: int, total: int | None = None) -> None:
        """Tell how many parts of the step are done; `total` where it is known only now."""
        self._show(self._step, completed=done, total=total)

    def note(self, words: str) -> None:
        """Say something of a part that is done, in a line that stays."""
        if self.write is not None:
            self.write(f"evenlight: {words}")
        elif not self._bars.disable:
            self._bars.console.print(words, highlight=False, markup=False, soft_wrap=True)

    @contextmanager
    def aside(self, words: str, total: int) -> Iterator[Callable[[int], None]]:
        """Begin work within the step, and yield what takes how many parts of it are done."""
        below = self._bar(words, total)
        self.tell_if_due(since=self._begun)
        try:
            yield lambda done: self._show(below, completed=done)
        finally:
            self._bars.remove_task(below)

    def compiling(self, begun: bool) -> None:
        """Tell that loops are being compiled, or that they are; the time left is estimated anew from then."""
        self._compiling = begun
        for task in self._bars.tasks:
            self._show(task.id, since=(self._bars.get_time(), task.completed))

    def tell_if_due(self, since: float | None = None) -> None:
        """Write a line of what is going on if the last one, or `since`, is as old as the interval."""
        now, last = self._bars.get_time(), self._bars.tasks[-1]
        if self.write is not None and now - (self._told if since is None else since) >= self.interval:
            self._told = now
            minutes, seconds = divmod(int(now - self._begun), 60)
            time = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
            words = ", ".join(filter(None, (last.description, last.fields["count"])))
            self.write(f"evenlight: {time}: {words}")

    def _bar(self, words: str, total: int | None) -> TaskID:
        since = (self._bars.get_time(), 0)
        told: dict[str, Any] = {"words": words, "since": since, "count": "", "left": ""}
        bar = self._bars.add_task(words, total=total, visible=False, **told)
        self._bars.tasks[-1].start_time = self._begun  # the clock is that of the whole
        self._show(bar, visible=True, refresh=True)  # drawn at once
        return bar

    def _show(self, bar: TaskID, **news: Any) -> None:
        """Show how much is done, and the time left: by all of it, as the last parts may come all at once."""
        self._bars.update(bar, **news)
        task = next(task for task in self._bars.tasks if task.id == bar)
        (since, before), done, left = task.fields["since"], int(task.completed), ""
        if task.total is not None and done > before and not self._compiling:
            each = (self._bars.get_time() - since) / (done - before)
            left = f"{timedelta(seconds=math.ceil(each * max(task.total - done, 0)))} left"
        count = f"{done} of {task.total:.0f}" if task.total else str(done or "")
        words = COMPILING if self._compiling else task.fields["words"]
        self._bars.update(bar, description=words, count=count, left=left)


@contextmanager
def shown_progress(quiet: bool, words: str = "", total: int | None = None) -> Iterator[Progress]:
    """Show progress on standard error while a command works, and yield what it tells it to.

    The first step may be named here. In a notebook, its cell shows work that is quiet elsewhere too.
    """
    from numba.core.event import install_listener  # not needed by commands that are done at once
    from rich.console import Console
    from rich.progress import BarColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    console, ended = Console(stderr=True), threading.Event()
    seen = console.is_terminal and not quiet
    columns = (
        "{task.description}", BarColumn(), "{task.fields[count]}", TimeElapsedColumn(),
        "[cyan]{task.fields[left]}",
    )  # fmt: skip
    with Bars(*columns, console=console, transient=True, disable=not seen) as bars, ExitStack() as stack:
        progress = Progress(bars, None if seen or quiet else _to_standard_error, begun)
        if (shell := _notebook()) is not None:
            progress.write, progress.interval = functools.partial(_to_notebook, shell, bars), IN_NOTEBOOKS
            stack.callback(progress.write, "")
        if words:
            progress.step(words, total)

        def tell() -> None:  # beside the work, which may not come to tell anything for minutes
            while not ended.wait(1.0):
                progress.tell_if_due()

        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        stack.callback(teller.join)
        stack.callback(ended.set)
        _shown.append(progress)
        stack.callback(_shown.remove, progress)
        stack.enter_context(install_listener("numba:compile", _compilation_listener(progress)))
        yield progress


@contextmanager
def aside(words: str, total: int) -> Iterator[Callable[[int], None]]:
    """Tell of long work deep within a command, and yield what takes how many parts are done.

    In a program that uses the Python interface nothing is told.
    """
    with ExitStack() as stack:
        progress = _shown[-1] if _shown else stack.enter_context(shown_progress(not told_by_default))
        yield stack.enter_context(progress.aside(words, total))


def note(words: str) -> None:
    """Say something from deep within a command, in a line that stays; nothing in a program."""
    if _shown:
        _shown[-1].note(words)
    elif told_by_default:
        _to_standard_error(f"evenlight: {words}")


def counted(progress: Progress, items: Iterable[Item], words: str, total: int | None) -> Iterator[Item]:
    """Yield the items of a step, and tell how many were taken."""
    progress.step(words, total)
    for done, item in enumerate(items, start=1):
        yield item
        progress.at(done)


def _compilation_listener(progress: Progress) -> Any:
    """Return what tells when Numba compiles a loop, with those that it uses, not when it reads its code."""
    from numba.core.event import Listener

    class CompilationListener(Listener):
        depth = 0

        def on_start(self, event: object) -> None:
            self.depth += 1
            if self.depth == 1:
                progress.compiling(True)

        def on_end(self, event: object) -> None:
            self.depth -= 1
            if self.depth == 0:
                progress.compiling(False)

    return CompilationListener()


def _to_standard_error(line: str) -> None:
    with suppress(OSError, ValueError):  # nobody reads it any more
        print(line, file=sys.stderr, flush=True)


def _notebook() -> Any:
    """Return what runs the cells of a notebook; None elsewhere."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell if in_notebooks and hasattr(shell, "kernel") else None


def _to_notebook(shell: Any, bars: Bars, line: str) -> None:
    """Write the one line of progress under a cell, anew if it is there; an empty one when all is done."""
    task, name = bars.tasks[-1], f"evenlight {shell.execution_count}"
    if line or name in _told_under:
        share = f' value="{task.completed:g}" max="{task.total:g}"' if task.total else ""
        page = f"<progress{share}></progress> {escape(line)}" if line else ""
        shown, place = {"text/plain": line, "text/html": page}, {"display_id": name}
        shell.display_pub.publish(shown, transient=place, update=name in _told_under)
        _told_under.add(name)
