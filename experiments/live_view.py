"""The live view of a session, read from its files as they grow: in the terminal of `run`, and of `watch`.

In the session's own process it is read and drawn between two trials, when no flip is awaited, and written to
the terminal by a thread: a terminal that takes no text for a while holds up no participant. Thresholds are
what adaptive placement believes, for every design, on its grid; that of `evenlight fit` is finer.
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
from typing import Any, NamedTuple, TextIO

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.printed import printable, terminal_of
from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import (
    Direction,
    Placement,
    Procedure,
    RampDesign,
    RampTrial,
    trial_seconds,
)
from evenlight.data_schema.recordings.session import TASKS, SessionEvent, SessionManifest, SessionStatus
from evenlight.data_schema.storage.text_files import parse_json, read_json_record
from evenlight.experiments.ramp.adaptive_placement import AdaptivePlacement, placement_grid, success_chances

LOOK_EVERY = 0.5  # of `watch` [s]
SILENT = 60.0  # [s] after which it is told that nothing new comes
SOONEST = 0.2  # between two drawings [s]: a rehearsal has hundreds of trials a second
PATIENCE = 2.0  # [s] that the end of a session waits for a terminal
INTERVAL = (0.025, 0.975)
LEAST_RATIO = 4.0  # of the highest to the lowest rate of the grid, for designs of one rate

Level = tuple[str, float, Direction, float]  # screen, factor, direction, duration [s]


class LevelSoFar(NamedTuple):
    """A level's threshold so far: posterior mean of ln(threshold), 95 % credible interval [cd/m^2/s]."""

    level: Level
    luminance: float  # before the ramp [cd/m^2]
    threshold: float
    ci_low: float
    ci_high: float
    n_ramps: int  # usable ones
    n_seen: int  # of these: "yes", or the right interval


class ThresholdsSoFar:
    """The thresholds of a session of some design at each level."""

    def __init__(self, design: RampDesign) -> None:
        ratio = max(max(design.relative_rates) / min(design.relative_rates), LEAST_RATIO)
        self._design = design
        self._grid = placement_grid(ratio, design.procedure is Procedure.TWO_INTERVAL)
        self._beliefs = AdaptivePlacement(Placement.TARGETED, self._grid)
        self._ramps: dict[Level, list[RampTrial]] = {}
        self.latest: Level | None = None

    def take(self, trial: RampTrial) -> None:
        """Learn from an answer; practice and flagged trials are passed over."""
        if not trial.usable:
            return
        if trial.is_catch:
            self._beliefs.take_catch(trial.success)
            return
        level = self.latest = trial.screen, trial.factor, trial.direction, trial.duration
        self._ramps.setdefault(level, []).append(trial)
        place = np.log([trial.rate / self._lowest(trial)])
        chances = success_chances(place, self._grid.thresholds, self._grid.guess_rates)[0]
        self._beliefs.learn(level, chances, trial.success)

    def levels(self) -> list[LevelSoFar]:
        """Return the levels that had ramps of the kind shown last: white before gray, bright before dark."""
        kind = self.latest and self.latest[2:]
        shown = sorted((level for level in self._ramps if level[2:] == kind), reverse=True)
        grid, levels = self._grid, []
        edges = np.append(grid.thresholds - grid.step / 2, grid.thresholds[-1] + grid.step / 2)
        for level in shown:
            ramps, masses = self._ramps[level], self._beliefs.posterior(level).sum(axis=(1, 2, 3))
            ends = np.interp(INTERVAL, np.append(0.0, np.cumsum(masses)), edges)
            rates = self._lowest(ramps[-1]) * np.exp([grid.thresholds @ masses, *ends])
            threshold, low, high = rates.tolist()
            light, seen = ramps[-1].initial_luminance, sum(trial.success for trial in ramps)
            levels.append(LevelSoFar(level, light, threshold, low, high, len(ramps), seen))
        return levels

    def _lowest(self, trial: RampTrial) -> float:
        """Return the rate of the grid's first candidate at the level of a trial [cd/m^2/s]."""
        return min(self._design.rates_of(trial.duration)) * trial.initial_luminance


class SessionSoFar:
    """What a session has recorded so far in a folder, and what follows from it; nothing there is touched.

    Raises `InputError` if its manifest or a line cannot be used, or its task is unknown.
    """

    def __init__(self, folder: Path) -> None:
        self.trials: list[Any] = []
        self.events: list[SessionEvent] = []
        self._folder = folder
        self._taken = {TRIALS: 0, EVENTS: 0}  # bytes
        self.thresholds: ThresholdsSoFar | None = None
        self.update()

    def update(self) -> None:
        """Read what is new."""
        path = self._folder / MANIFEST
        self.manifest = read_json_record(SessionManifest, path)
        if self.manifest.task not in TASKS:
            raise InputError(f"{path}: the task {self.manifest.task!r} is not known here")
        if self.thresholds is None and isinstance(self.manifest.design, RampDesign):
            self.thresholds = ThresholdsSoFar(self.manifest.design)
        self.events += self._new(EVENTS, SessionEvent)
        new = self._new(TRIALS, TASKS[self.manifest.task].trial)
        self.trials += new
        if self.thresholds is not None:
            for trial in new:
                self.thresholds.take(trial)

    def _new(self, name: str, cls: type[Any]) -> list[Any]:
        """Return the new records of a log, one a line; a line without its end waits until it is whole."""
        path, where = self._folder / name, str(self._folder / name)
        if not path.exists() or path.stat().st_size <= self._taken[name]:
            return []
        content = path.read_bytes()[self._taken[name] :]
        whole = content[: content.rfind(b"\n") + 1]
        self._taken[name] += len(whole)
        lines = [line for line in whole.decode(errors="replace").split("\n") if line.strip()]
        return [record_from_mapping(cls, parse_json(line, where, cls.__name__), where) for line in lines]

    @property
    def ended(self) -> bool:
        """Whether nothing more comes."""
        return self.manifest.status is not SessionStatus.RUNNING

    @property
    def usable(self) -> list[Any]:
        """The trials that count."""
        return [trial for trial in self.trials if trial.usable]

    @property
    def flagged(self) -> int:
        """How many trials are left out of the analysis."""
        return sum(not (trial.practice or trial.usable) for trial in self.trials)

    @property
    def silence(self) -> float:
        """How long nothing was written [s]."""
        return time.time() - max(path.stat().st_mtime for path in self._folder.iterdir())

    @property
    def seconds_left(self) -> float | None:
        """The trials left at the pace so far [s], of ramps by the design at first; None if unknown."""
        design, usable = self.manifest.design, self.usable
        left = self.manifest.n_trials - len(usable)
        first = usable[0].trial_index if usable else -1
        begun = next((event.time for event in self.events if event.trial_index == first), None)
        if begun is None:
            return left * trial_seconds(design) if isinstance(design, RampDesign) else None
        return left / len(usable) * (self.events[-1].time - begun)


def in_words(session: SessionSoFar) -> list[str]:
    """Return how a session stands: trials and time left, flags and drops, false alarms, thresholds."""
    manifest, left, status = session.manifest, session.seconds_left, session.manifest.status
    who = f"participant {manifest.participant_id}, session {manifest.session_id}"
    trials = f"{len(session.usable)} of {manifest.n_trials} trials"
    timed = not manifest.apparatus.get("clock", "").startswith("refreshes")
    if session.ended:
        trials += "; stopped, go on with --resume" if status is SessionStatus.ABORTED else f"; {status.value}"
    elif left is not None:
        trials += f", about {left / 60:.0f} min left" if left >= 60 else f", about {left:.0f} s left"
        trials += "" if timed else " on the session's own clock"
    if not session.ended and session.silence >= SILENT:
        trials += f"; nothing new for {session.silence / 60:.0f} min: does it still run?"
    dropped = f"in {sum(bool(getattr(t, 'frames_dropped', None)) for t in session.trials)} trials"
    drops = dropped if timed else "not timed in this rehearsal"
    catches = [t.success for t in session.usable if isinstance(t, RampTrial) and t.is_catch]
    return [
        f"{manifest.task}, {who}{', SIMULATED' if manifest.simulated else ''}",
        trials,
        f"{session.flagged} flagged, frames dropped: {drops}",
        *([f"false alarms: {sum(catches)} of {len(catches)}"] if catches else []),
        *(_levels_in_words(session.thresholds) if session.thresholds else ()),
    ]


def _levels_in_words(thresholds: ThresholdsSoFar) -> list[str]:
    """Return the levels of the ramps shown last, a line each; the one shown last has a star."""
    if thresholds.latest is None:
        return []
    *_, direction, seconds = thresholds.latest
    row, way = "{:<12}{:>9}{:>12}{:>19}{:>8}", "rising" if direction is Direction.UP else "falling"
    lines = ["", row.format("level", "cd/m²", "threshold", "95 %, cd/m²/s", "ramps")]
    for level, luminance, threshold, low, high, ramps, seen in thresholds.levels():
        name = f"{level[0]} {level[1]:g}{' *' if level == thresholds.latest else ''}"
        cells = f"{threshold:#.3g}", f"{low:#.3g} to {high:#.3g}"
        if seen in (0, ramps):  # of answers all alike the prior makes the threshold: only its side is known
            cells = "–", f"above {low:#.3g}" if seen == 0 else f"below {high:#.3g}"
        lines.append(row.format(name, f"{luminance:.3g}", *cells, ramps))
    return [*lines, f"{way} within {seconds:g} s"]


@contextmanager
def live_view(folder: Path, quiet: bool) -> Iterator[Callable[[], None]]:
    """Yield what shows on the terminal how a session stands, whose folder comes later; nothing if quiet."""
    if quiet or not sys.stderr.isatty():
        yield lambda: None
        return
    session: SessionSoFar | None = None
    due = 0.0
    terminal = terminal_of(sys.stderr)
    with _Pen(terminal) as pen, _drawn(Console(file=pen, force_terminal=True, highlight=False)) as draw:

        def show(*, last: bool = False) -> None:
            nonlocal session, due
            if time.monotonic() < due and not last:
                return
            due = time.monotonic() + SOONEST
            try:
                session = session or SessionSoFar(folder)
                session.update()
                draw(session)
            except Exception as error:  # a picture of the session must not end it
                due = float("inf")
                if not last:
                    pen.write(f"evenlight: the live view ends, the session goes on: {error}\n")

        yield show
        show(last=True)


def _said(session: SessionSoFar) -> str:
    return printable("\n".join(in_words(session)))


@contextmanager
def _drawn(console: Console) -> Iterator[Callable[[SessionSoFar], None]]:
    """Yield what draws how a session stands, in place of what it drew before."""
    # No thread refreshes it by itself: that would take the processor from the flips of a trial.
    live = Live(console=console, auto_refresh=False)

    def draw(session: SessionSoFar) -> None:
        live.start()  # not before there is something to show: what is refused is told in one line
        live.update(Text(_said(session)), refresh=True)

    try:
        yield draw
    finally:
        live.stop()


def watch_session(folder: Path, once: bool, sleep: Callable[[float], None] = time.sleep) -> None:
    """Show how a session stands on standard output until it ends; once, where there is no terminal."""
    console, session = Console(highlight=False), SessionSoFar(folder)
    if once or not console.is_terminal:
        console.print(_said(session), markup=False)
        return
    with _drawn(console) as draw, suppress(KeyboardInterrupt):
        draw(session)
        while not session.ended:
            sleep(LOOK_EVERY)
            session.update()
            draw(session)


class _Pen(io.StringIO):
    """Writes to a terminal by a thread, until nothing more is to come, or nobody reads it any longer."""

    def __init__(self, terminal: TextIO) -> None:
        super().__init__()
        self._texts: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, args=[terminal], daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        """Wait a while for what is not written yet."""
        self._texts.put(None)
        self._thread.join(PATIENCE)

    def write(self, text: str) -> int:
        self._texts.put(text)
        return len(text)

    def _work(self, terminal: TextIO) -> None:
        with suppress(OSError, ValueError):
            while (text := self._texts.get()) is not None:
                terminal.write(text)
                terminal.flush()
