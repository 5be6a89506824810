"""What a running `evenlight live` tells others: a file of its user, read by --status and --pause."""

from __future__ import annotations

import json
import os
import signal
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.whole_files import write_whole


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
    return Path(tempfile.gettempdir()) / f"evenlight-live-{os.getuid()}.json"


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
        found = json.loads(state_file().read_bytes())
        os.kill(found["pid"], 0)
        monitors = tuple(MonitorState(**one) for one in found.pop("monitors"))
        return LiveState(**found, monitors=monitors)
    except (OSError, ValueError, TypeError, KeyError):
        raise InputError("evenlight live does not run: start it with --backlight, or --install it") from None


def toggle_pause() -> int:
    """Tell the running program to rest, or to go on; return its process number."""
    pid = running().pid
    os.kill(pid, signal.SIGUSR1)
    return pid
