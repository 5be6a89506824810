"""When a desktop is not to be dimmed, and what else moves its brightness: programs that run, mains power."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path

USERS = Path("/run/systemd/users")  # by number: STATE=active while a session of theirs is on the screen
OFTEN = 5.0  # [s] between two looks
# Change brightness or colours by themselves.
OTHERS = ("clight", "wluma", "redshift", "gammastep", "wlsunset", "hyprsunset", "kwin_redshift")


def named(names: Sequence[str]) -> list[str]:
    """Return the programs that run and begin with names: gimp-2.10 is gimp."""
    import psutil

    running = {one.info["name"] or "" for one in psutil.process_iter(["name"])}
    return sorted(one for one in running if one.startswith(tuple(names)))


def reasons(rest_with: Sequence[str], on_battery: bool) -> Callable[[float], str]:
    """Return what says why nothing is to be dimmed at a time [s]: a program runs; mains power; a session."""
    import psutil

    user = USERS / str(os.getuid())

    @functools.lru_cache(maxsize=1)
    def looked(_: int) -> str:
        if rest_with and (seen := named(rest_with)):
            return f"{seen[0]} runs"
        if user.is_file() and "\nSTATE=active\n" not in user.read_text(encoding="utf-8"):
            return "another session is on the screen"
        battery = psutil.sensors_battery() if on_battery else None
        return "mains power" if on_battery and (battery is None or battery.power_plugged is not False) else ""

    return lambda now: looked(int(now // OFTEN))


def others_at_work() -> str:
    """Return a line on programs that change brightness or colours by themselves; empty for none."""
    found = named(OTHERS)
    return f"{', '.join(found)} runs: a brightness that it sets counts as set by you" if found else ""
