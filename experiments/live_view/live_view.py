"""The live view of a session: in the terminal of `run`, and of `watch` from anywhere.

In the session's own process it is read and drawn between two trials, when no flip is awaited, and written to
the terminal by a thread: a terminal that takes no text for a while holds up no participant.
"""

from __future__ import annotations

import io
import queue
import sys
import textwrap
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
    from rich.table import Table

LOOK_EVERY = 0.5  # of `watch` [s]
SOONEST = 0.2  # between two drawings of a rehearsal [s], which has hundreds of trials a second
LONGER = 6  # so many times as long as other commands a session says nothing where there is no terminal
PATIENCE = 2.0  # [s] that the end of a session waits for a terminal
ANY_HEIGHT = 1000  # lines, where nothing is drawn over
SILENT = 120.0  # [s] without anything new, which is worth telling
LABEL_WIDTH = 9
HEAD_LINES = 2  # of the table of levels
NARROW = 70  # columns; where there are fewer, the table leaves some out
LEFT_OUT = ("cd/m²", "%/s")


def session_view(session: SessionSoFar, size: tuple[int, int]) -> RenderableType:
    """Return a picture of how a session stands.

    Parameters
    ----------
    session : SessionSoFar
        The session.
    size : (int, int)
        Columns and lines of the terminal.
    """
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    width, height = size
    title = Text(session.title, "bold")
    if session.manifest.simulated:
        title.append("  ").append(" SIMULATED ", "black on yellow")
    facts = Table.grid(padding=(0, 1))
    facts.add_column(width=LABEL_WIDTH, style="dim")
    facts.add_column()
    room, lines = max(width - LABEL_WIDTH - 3, 20), 1
    for label, words in _facts(session, room).items():
        alarming = label == "note" or (label == "frames" and session.flagged)
        facts.add_row(label, Text(words, "yellow" if alarming else ""))
        lines += len(textwrap.wrap(words, room))
    levels = session.levels
    if not levels:
        return Group(title, facts)
    return Group(title, facts, _table(levels, session.two_interval, width, height - lines - HEAD_LINES))


def in_one_line(session: SessionSoFar) -> str:
    """Return how a session stands, for where there is no terminal."""
    title = session.title + (", SIMULATED" if session.manifest.simulated else "")
    flagged = f", {session.flagged} flagged" if session.flagged else ""
    return f"{title}: {_count(session)} trials{flagged}, {_times(session)}, {session.state}"


def _facts(session: SessionSoFar, room: int) -> dict[str, str]:
    """Return what is told above the levels, for so many columns."""
    length = min(max(room - 38, 8), 40)
    full = round(length * len(session.usable) / max(session.manifest.n_trials, 1))
    flagged = f", {session.flagged} flagged" if session.flagged else ""
    facts = {
        "now": session.state + _silence(session),
        "trials": f"{'━' * full}{'─' * (length - full)} {_count(session)}{flagged}",
        "time": _times(session),
        "practice": session.practice,
        "answers": session.answers,
        "last": session.last_answers,
        "frames": session.frames,
        "note": session.note,
    }
    return {label: words for label, words in facts.items() if words}


def _silence(session: SessionSoFar) -> str:
    """Return for how long a running session has recorded nothing, if that is long: it may have died."""
    silent = 0.0 if session.ended else time.time() - session.last_change
    return f", nothing new for {_minutes(silent)}" if silent > SILENT else ""


def _count(session: SessionSoFar) -> str:
    """Return how many usable trials are done."""
    return f"{len(session.usable)} of {session.manifest.n_trials}"


def _times(session: SessionSoFar) -> str:
    """Return how long the session has taken and still takes, and when the next break comes."""
    words = f"{_minutes(session.time_used)} used"
    left, rest = session.to_come()
    if session.ended or len(session.usable) >= session.manifest.n_trials:
        return words
    if left is not None:
        at = time.strftime("%H:%M", time.localtime(time.time() + left))
        words += f", about {_minutes(left)} left (until {at})"
    return words + (f", break in {rest} trial{'s' if rest > 1 else ''}" if rest else "")


def _minutes(seconds: float) -> str:
    """Return a time in words.

    >>> _minutes(100.0), _minutes(59.0)
    ('2 min', '59 s')
    """
    return f"{seconds / 60:.0f} min" if seconds >= 60 else f"{seconds:.0f} s"


def _table(levels: list[LevelSoFar], two_interval: bool, width: int, room: int) -> Table:
    """Return the table of the levels; where there is not room for all, of the present condition first."""
    from rich import box
    from rich.table import Table

    n, several = len(levels), len({level.level[2:] for level in levels}) > 1
    if n > room:
        now = {level.level[2:] for level in levels if level.latest}
        first = sorted(levels, key=lambda level: (not level.latest, level.level[2:] not in now))
        levels = [level for level in levels if level in first[: max(room - 1, 1)]]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    headings = (
        *("level", "cd/m²", "threshold", "95 %, cd/m²/s", "%/s", "ramps"),
        "right" if two_interval else "yes",
    )
    narrow = width < NARROW + 10 * several
    places = [k for k, heading in enumerate(headings) if not (narrow and heading in LEFT_OUT)]
    for k in places:
        table.add_column(headings[k], justify="right" if k else "left", no_wrap=True)
    for level in levels:
        cells = _cells(level, several)
        table.add_row(*(cells[k] for k in places), style="bold" if level.latest else "")
    if len(levels) < n:
        table.caption = f"{n - len(levels)} more levels: a taller window shows them"
    return table


def _cells(level: LevelSoFar, several: bool) -> list[str]:
    """Return the cells of a level; its direction and duration where there are several."""
    screen, factor, direction, duration = level.level
    way = "↑" if direction is Direction.UP else "↓"
    # Of answers that are all alike the prior makes the threshold: only its side is known.
    bounds = {0: f"above {level.ci_low:#.3g}", level.n_ramps: f"below {level.ci_high:#.3g}"}
    bound = bounds.get(level.n_seen)
    return [
        f"{screen} {factor:g}" + (f" {way} {duration:g} s" if several else ""),
        f"{level.luminance:.3g}",
        "–" if bound else f"{level.threshold:#.3g}",
        bound or f"{level.ci_low:#.3g} to {level.ci_high:#.3g}",
        "–" if bound else f"{100 * level.threshold / level.luminance:.1f}",
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
        live.update(session_view(session, (console.width, console.height)), refresh=True)

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
        console.print(session_view(session, (console.width, ANY_HEIGHT)))
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
        print(f"evenlight: {in_one_line(session)}", file=sys.stderr, flush=True)


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
