"""What a running `evenlight live` tells others: a file of its user, read by --status and --pause."""

from __future__ import annotations

import contextlib
import json
import os
import signal
from dataclasses import asdict, dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.hardware.drivers.device_lock import DeviceLock
from evenlight.hardware.protocols import InstrumentError
from evenlight.stimuli.scenes.engine.array_cache import cache_folder


@dataclass(frozen=True, slots=True)
class MonitorState:
    """One monitor now."""

    backlight: str
    ceiling: float  # what its user has set
    factor: float  # share of it
    loss: float  # 𝓛_c beside it
    resting: str  # why it is not dimmed; empty where it is


@dataclass(frozen=True, slots=True)
class LiveState:
    """A running `evenlight live`."""

    pid: int
    seconds: float  # since its begin
    mean_factor: float  # over that time and its monitors
    saved_wh: float | None  # by the power model; None without one
    work_s: float  # processor time
    monitors: tuple[MonitorState, ...]

    def in_words(self) -> str:
        """Return it in a line for each monitor, and one for the whole."""
        lines = [
            f"{one.backlight}: factor {one.factor:.2f} of the brightness set ({one.ceiling:.0%}), loses "
            f"{one.loss:.1%} of its visible contrast" + (f"; resting: {one.resting}" if one.resting else "")
            for one in self.monitors
        ]
        saved = (
            "savings unknown: no power model" if self.saved_wh is None else f"{self.saved_wh:.3g} Wh saved"
        )
        work = f"{self.work_s / max(self.seconds, 1e-9):.1%} of one core"
        return "\n".join(
            [*lines, f"{self.seconds / 3600:.1f} h, {saved}, mean factor {self.mean_factor:.2f}; {work}"]
        )


def state_file() -> Path:
    """Return where the state of this user's program is."""
    session = os.environ.get("XDG_RUNTIME_DIR")
    if session and Path(session).is_dir():
        return Path(session) / "evenlight-live.json"
    return cache_folder() / "live.json"


def only_one() -> DeviceLock:
    """Return a lock that one program of this user may hold: two would take each other for their user.

    It ends with its process. What is left of an earlier one is removed: its number may be another's by now.

    Raises
    ------
    InstrumentError
        If another one runs.
    """
    file = state_file().with_suffix(".lock")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    lock = DeviceLock(file, "evenlight live")
    state_file().unlink(missing_ok=True)
    return lock


def write_state(state: LiveState) -> None:
    """Keep what is now."""
    write_whole(state_file(), json.dumps(asdict(state)).encode())


def running() -> LiveState:
    """Return the state of this user's program.

    Raises
    ------
    InputError
        If none runs.
    """
    try:
        with contextlib.suppress(InstrumentError):
            only_one().release()  # and its state is gone
        found = json.loads(state_file().read_bytes())
        monitors = tuple(MonitorState(**one) for one in found.pop("monitors"))
        return LiveState(**found, monitors=monitors)
    except (OSError, ValueError, TypeError, KeyError):
        raise InputError("evenlight live does not run: start it with --backlight, or --install it") from None


def toggle_pause() -> None:
    """Tell the running program to rest, or to go on."""
    os.kill(running().pid, signal.SIGUSR1)
