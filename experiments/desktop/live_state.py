"""What a running `evenlight live` tells others: a file of its user, read by --status and --pause."""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import signal
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.hardware.drivers.device_lock import DeviceLock
from evenlight.hardware.protocols import InstrumentError
from evenlight.stimuli.scenes.engine.array_cache import cache_folder

CORE = 5.0  # [W] assumed of a busy core of a laptop
KEPT = "live-day.json"  # beyond the session
SELDOM = 600.0  # [s] between two states that are kept on disk
NOT_READ = OSError, ValueError, TypeError, KeyError
JUDGED = 60.0  # [s] after which it is said whether it is worth it


@dataclass(frozen=True, slots=True)
class MonitorState:
    """One monitor now."""

    backlight: str
    ceiling: float  # what its user has set
    factor: float  # share of it
    loss: float  # 𝓛_c beside it
    resting: str  # why it is not dimmed by its picture; empty where it is


@dataclass(frozen=True, slots=True)
class DayTotal:
    """What was counted today, however often it was started."""

    day: str  # ISO 8601
    seconds: float = 0.0  # that it ran
    dimmed: float = 0.0  # sum of its monitors' mean factor times seconds
    saved_wh: float = 0.0  # by the power model
    work_s: float = 0.0  # processor time

    @classmethod
    def kept(cls) -> DayTotal:
        """Return what was kept of today, by the session or, from before it, on disk."""
        found = [cls(day())]
        for file in (state_file(), cache_folder() / KEPT):
            with contextlib.suppress(*NOT_READ):
                found.append(cls(**json.loads(file.read_bytes())["today"]))
        return max((one for one in found if one.day == found[0].day), key=lambda one: one.seconds)


@dataclass(frozen=True, slots=True)
class LiveState:
    """A running `evenlight live`."""

    pid: int
    today: DayTotal
    saves: bool  # whether a power model says what is saved
    monitors: tuple[MonitorState, ...]
    measured_w: float | None = None  # mean of a meter

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
            words = f" ({today.saved_wh / hours:.2f} W are saved, by the model)" if self.saves else ""
            lines.append(f"measured: {self.measured_w:.2f} W on average{words}")
        if self.saves and today.saved_wh <= own and today.seconds > JUDGED:
            lines.append("that is no less than it saved: it is not worth it here")
        return "\n".join(lines)


def day() -> str:
    """Return which day it is here."""
    return datetime.date.today().isoformat()


def state_file() -> Path:
    """Return where the state of this user's program is."""
    session = os.environ.get("XDG_RUNTIME_DIR")
    if session and Path(session).is_dir():
        return Path(session) / "evenlight-live.json"
    return cache_folder() / "live.json"


def only_one() -> DeviceLock:
    """Return a lock that one program of this user may hold: two would take each other for their user.

    It ends with its process. What is left of an earlier one is removed: its number may be another's by now.
    """
    file = state_file().with_suffix(".lock")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    lock = DeviceLock(file, "evenlight live")
    state_file().unlink(missing_ok=True)
    return lock


def write_state(state: LiveState, to_disk: bool = False) -> None:
    """Keep what is now, and now and then, or at the end, beyond the session."""
    content = json.dumps(asdict(state))
    kept = cache_folder() / KEPT
    with contextlib.suppress(OSError, InputError):  # a full disk is no reason to end
        write_whole(state_file(), content)
        kept.parent.mkdir(parents=True, exist_ok=True)
        if to_disk or not kept.exists() or time.time() - kept.stat().st_mtime > SELDOM:
            write_whole(kept, content)


def running() -> LiveState:
    """Return the state of this user's program; raise `InputError` where none runs."""
    try:
        with contextlib.suppress(InstrumentError):
            only_one().release()  # and its state is gone
        found = json.loads(state_file().read_bytes())
        monitors = tuple(MonitorState(**one) for one in found.pop("monitors"))
        return LiveState(today=DayTotal(**found.pop("today")), monitors=monitors, **found)
    except NOT_READ:
        raise InputError("evenlight live does not run: start it with --backlight, or --install it") from None


def toggle_pause() -> None:
    """Tell the running program to rest, or to go on."""
    os.kill(running().pid, signal.SIGUSR1)
