"""What a running `evenlight live` tells others: a file of its user, read by --status and --pause."""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.hardware.drivers.device_lock import DeviceLock
from evenlight.hardware.protocols import InstrumentError
from evenlight.stimuli.scenes.engine.array_cache import cache_folder

CORE = 5.0  # [W] assumed of a busy core of a laptop
SELDOM = 600.0  # [s] between two states that are kept on disk, unless its user has set the brightness
JUDGED = 60.0  # [s] after which it is said whether it is worth it
PAUSED = "paused"


def day() -> str:
    """Return which day it is here."""
    return datetime.date.today().isoformat()


@dataclass(frozen=True, slots=True)
class MonitorState:
    """One monitor now."""

    backlight: str
    ceiling: float  # what its user has set
    factor: float  # share of it
    loss: float  # 𝓛_c beside it
    resting: str  # why it is not dimmed by its picture; empty where it is


@dataclass(slots=True)
class DayTotal:
    """What was counted today, however often it was started."""

    day: str = field(default_factory=day)  # ISO 8601
    seconds: float = 0.0  # that it ran
    dimmed: float = 0.0  # sum of its monitors' mean factor times seconds
    saved_wh: float = 0.0  # by the power model
    work_s: float = 0.0  # processor time


@dataclass(frozen=True, slots=True)
class LiveState:
    """A running `evenlight live`."""

    pid: int
    today: DayTotal
    saves: bool  # whether a power model says what is saved
    monitors: tuple[MonitorState, ...]  # none once it has ended, and their brightness is back
    measured_w: float | None = None  # mean of a meter since it began

    @property
    def ceilings(self) -> dict[str, float]:
        """What the user has set, by backlight."""
        return {one.backlight: one.ceiling for one in self.monitors}

    def in_words(self) -> str:
        """Return it in a line for each monitor, and some for the whole."""
        today, hours = self.today, max(self.today.seconds, 1e-9) / 3600
        own = today.work_s * CORE / 3600
        lines = [
            f"{one.backlight}: factor {one.factor:.2f} of the brightness set ({one.ceiling:.0%}), "
            + (one.resting or f"loses {one.loss:.1%} of its visible contrast")
            for one in self.monitors
        ]
        saved = f"{today.saved_wh:.3g} Wh saved" if self.saves else "savings unknown (no power model)"
        lines.append(f"today, in {hours:.1f} h: {saved}, mean factor {today.dimmed / hours / 3600:.2f}")
        lines.append(
            f"its own work: {today.work_s / hours / 3600:.1%} of one core, about {own:.2g} Wh at {CORE:g} W"
        )
        if self.measured_w is not None:
            lines.append(f"measured since it began: {self.measured_w:.2f} W on average")
        if self.saves and today.saved_wh <= own and today.seconds > JUDGED:
            lines.append("that is no less than it saved: it is not worth it here")
        return "\n".join(lines)


def state_file() -> Path:
    """Return where the state of this user's program is."""
    session = os.environ.get("XDG_RUNTIME_DIR")
    return Path(session) / "evenlight-live.json" if session else cache_folder() / "live.json"


def kept_file() -> Path:
    """Return where a state is kept beyond the session, on disk."""
    return cache_folder() / "live-day.json"


def only_one() -> DeviceLock:
    """Return a lock that one program of this user may hold, until it ends: two would fight each other."""
    file = state_file().with_suffix(".lock")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    return DeviceLock(file, "evenlight live")


def write_state(state: LiveState) -> None:
    """Keep what is now; beyond the session now and then, and when its user has set the brightness."""
    content = json.dumps(mapping_from_record(state))
    with contextlib.suppress(OSError, InputError):  # a full disk is no reason to end
        write_whole(state_file(), content)
        kept = _read(kept_file())
        due = kept is None or kept_file().stat().st_mtime + SELDOM < time.time()
        if due or (kept is not None and kept.ceilings != state.ceilings):
            kept_file().parent.mkdir(parents=True, exist_ok=True)
            write_whole(kept_file(), content)


def earlier() -> tuple[DayTotal, dict[str, float]]:
    """Return what was counted today, and by backlight a brightness that a power cut kept from coming back.

    It did where a state is on disk only: that of the session ends with the computer. It is removed.
    """
    session, kept = _read(state_file()), _read(kept_file())
    state_file().unlink(missing_ok=True)  # its process's number may be another's by now
    totals = [one.today for one in (session, kept) if one and one.today.day == day()]
    left = kept.ceilings if kept and not session else {}
    return max(totals, key=lambda one: one.seconds, default=DayTotal()), left


def running() -> LiveState:
    """Return the state of this user's program; raise `InputError` where none runs."""
    try:
        only_one().release()
    except InstrumentError:  # it is held
        if state := _read(state_file()):
            return state
    raise InputError("evenlight live does not run: start it with --backlight, or --install it")


def toggle_pause() -> str:
    """Tell the running program to rest, or to go on; return which."""
    state = running()
    os.kill(state.pid, signal.SIGUSR1)
    rested = any(PAUSED in one.resting for one in state.monitors)
    return (
        "it goes on" if rested else "it goes back to your brightness, and rests until --pause is given again"
    )


def _read(file: Path) -> LiveState | None:
    try:
        return record_from_mapping(LiveState, json.loads(file.read_bytes()), str(file))
    except (OSError, ValueError, InputError):
        return None
