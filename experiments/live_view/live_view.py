"""The live view of a session: in the terminal of `run`, and of `watch` from anywhere.

In the session's own process it is read and drawn between two trials, when no flip is awaited, and written to
the terminal by a thread: a terminal that takes no text for a while holds up no participant.
"""

from __future__ import annotations

import io
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from evenlight import progress
from evenlight.data_schema.recordings.ramp import Direction
from evenlight.experiments.live_view.session_so_far import SessionSoFar
from evenlight.experiments.live_view.thresholds_so_far import LevelSoFar

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

LOOK_EVERY = 0.5  # of `watch` [s]
SOONEST = 0.2  # between two drawings of a rehearsal [s], which has hundreds of trials a second
LONGER = 6  # so many times as long as other commands a session says nothing where there is no terminal
PATIENCE = 2.0  # [s] that the end of a session waits for a terminal
SILENT = 120.0  # [s] without anything new, which is worth telling


def session_view(session: SessionSoFar) -> RenderableType:
    """Return a picture of how a session stands: below its facts the levels of the present condition."""
    from rich import box
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    title, *facts = in_words(session)
    lines = [Text(title, "bold yellow" if session.manifest.simulated else "bold"), *map(Text, facts)]
    levels = session.levels
    if not levels:
        return Group(*lines)
    present = next((level.level[2:] for level in levels if level.latest), levels[0].level[2:])
    shown = [level for level in levels if level.level[2:] == present]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, caption_justify="left")
    for heading in ("level", "cd/m²", "threshold", "95 %, cd/m²/s", "ramps", "seen"):
        table.add_column(heading, justify="left" if heading == "level" else "right", no_wrap=True)
    for level in shown:
        table.add_row(*_cells(level), style="bold" if level.latest else "")
    way, seconds = ("rising" if present[0] is Direction.UP else "falling"), present[1]
    others = f"; {len(levels) - len(shown)} levels of other ramps" if len(levels) > len(shown) else ""
    table.caption = f"{way} within {seconds:g} s{others}"
    return Group(*lines, table)


def in_words(session: SessionSoFar) -> list[str]:
    """Return how a session stands: its title, what goes on, and what the trials so far say of each other."""
    manifest, left = session.manifest, session.seconds_left
    title = f"{manifest.task}, participant {manifest.participant_id}, session {manifest.session_id}"
    now = session.state
    if not session.ended:
        now += f", about {_minutes(left)} left" if left is not None else ""
        now += f", nothing new for {_minutes(session.silence)}" if session.silence > SILENT else ""
    trials = f"{len(session.usable)} of {manifest.n_trials} trials, {session.flagged} flagged"
    dropped = "not timed in this rehearsal" if session.dropped is None else f"in {session.dropped} trials"
    alarms = session.false_alarms
    return [
        title + (", SIMULATED" if manifest.simulated else ""),
        now,
        f"{trials}, frames dropped: {dropped}",
        *([f"false alarms: {alarms[0]} of {alarms[1]}"] if alarms else []),
    ]


def _minutes(seconds: float) -> str:
    """Return a time in words.

    >>> _minutes(100.0), _minutes(59.0)
    ('2 min', '59 s')
    """
    return f"{seconds / 60:.0f} min" if seconds >= 60 else f"{seconds:.0f} s"


def _cells(level: LevelSoFar) -> list[str]:
    """Return the cells of a level."""
    screen, factor, *_ = level.level
    # Of answers that are all alike the prior makes the threshold: only its side is known.
    bounds = {0: f"above {level.ci_low:#.3g}", level.n_ramps: f"below {level.ci_high:#.3g}"}
    bound = bounds.get(level.n_seen)
    return [
        f"{screen} {factor:g}",
        f"{level.luminance:.3g}",
        "–" if bound else f"{level.threshold:#.3g}",
        bound or f"{level.ci_low:#.3g} to {level.ci_high:#.3g}",
        str(level.n_ramps),
        f"{100 * level.n_seen / level.n_ramps:.0f} %",
    ]


@contextmanager
def live_view(folder: Path, quiet: bool, rehearsal: bool = False) -> Iterator[Callable[[], None]]:
    """Yield what shows how a session stands on standard error, to be called between trials.

    Parameters
    ----------
    folder : Path
        Of the session; it need not be there yet.
    quiet : bool
        Whether to show nothing.
    rehearsal : bool, optional
        Whether trials may come faster than one can look.
    """
    from rich.console import Console

    if quiet:
        yield lambda: None
    elif sys.stderr.isatty():
        pen = _Pen(sys.stderr)
        with pen, _drawn(Console(file=pen, force_terminal=True)) as draw:
            view = _View(folder, draw, SOONEST if rehearsal else 0.0)
            yield view.show
            view.show(last=True)
    else:
        yield _View(folder, _tell, LONGER * progress.INTERVAL, told=time.monotonic()).show


class _View:
    """What is shown of a session whose folder comes later; its failures end it, never the session."""

    def __init__(
        self, folder: Path, draw: Callable[[SessionSoFar], None], every: float, told: float = float("-inf")
    ) -> None:
        self._folder, self._draw, self._every, self._told = folder, draw, every, told
        self._session: SessionSoFar | None = None

    def show(self, *, last: bool = False) -> None:
        """Show how the session stands, if that is due."""
        if not last and time.monotonic() - self._told < self._every:
            return
        self._told = time.monotonic()
        try:
            self._session = self._session or SessionSoFar(self._folder)
            self._session.update()
            self._draw(self._session)
        except Exception as error:  # a picture of the session must not end it
            self._told = float("inf")
            if not last:
                print(f"evenlight: the live view ends, the session goes on: {error}", file=sys.stderr)


@contextmanager
def _drawn(console: Console) -> Iterator[Callable[[SessionSoFar], None]]:
    """Yield what draws how a session stands, in place of what it drew before."""
    from rich.live import Live

    # No thread refreshes it by itself: that would take the processor from the flips of a trial.
    live = Live(console=console, auto_refresh=False)

    def draw(session: SessionSoFar) -> None:
        live.start()  # not before there is something to show: what is refused is told in one line
        live.update(session_view(session), refresh=True)

    try:
        yield draw
    finally:
        live.stop()


def watch_session(folder: Path, once: bool, sleep: Callable[[float], None] = time.sleep) -> None:
    """Show how a session stands on standard output until it ends; once, where there is no terminal.

    Parameters
    ----------
    folder, once : Path, bool
        Of the session; whether to look only once.
    sleep : callable, optional
        Waits for a time [s].
    """
    from rich.console import Console

    console, session = Console(), SessionSoFar(folder)
    if once or not console.is_terminal:
        console.print(session_view(session))
        return
    with _drawn(console) as draw, suppress(KeyboardInterrupt):
        draw(session)
        while not session.ended:
            sleep(LOOK_EVERY)
            session.update()
            draw(session)


def _tell(session: SessionSoFar) -> None:
    """Write how a session stands as a line, if anybody still reads it."""
    with suppress(OSError, ValueError):
        print(f"evenlight: {'; '.join(in_words(session))}", file=sys.stderr, flush=True)


class _Pen(io.StringIO):
    """Writes to a terminal by a thread.

    Parameters
    ----------
    terminal : TextIO
        Where to.
    """

    def __init__(self, terminal: TextIO) -> None:
        super().__init__()
        self._terminal = terminal
        self._texts: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        """Wait a while for what is not written yet."""
        self._texts.put(None)
        self._thread.join(PATIENCE)

    def write(self, text: str) -> int:
        """Take a text, to be written soon."""
        self._texts.put(text)
        return len(text)

    def _work(self) -> None:
        """Write until there is nothing more to come, or nobody reads it any longer."""
        with suppress(OSError, ValueError):
            while (text := self._texts.get()) is not None:
                self._terminal.write(text)
                self._terminal.flush()
