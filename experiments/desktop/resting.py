"""When a desktop is not to be dimmed, and what else moves its brightness: programs that run, mains power."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

PROCESSES, SUPPLIES = Path("/proc"), Path("/sys/class/power_supply")
OFTEN = 5.0  # [s] between two looks
# Change brightness or colours by themselves.
OTHERS = ("clight", "wluma", "redshift", "gammastep", "wlsunset", "hyprsunset", "kwin_redshift")


def programs(root: Path = PROCESSES) -> set[str]:
    """Return the names of the programs that run, as the system cuts them: to 15 letters."""
    found = set()
    for file in root.glob("[0-9]*/comm"):
        try:
            found.add(file.read_text(encoding="utf-8", errors="replace").strip())
        except OSError:  # it has ended
            continue
    return found


def named(names: Sequence[str], programs: set[str]) -> list[str]:
    """Return the programs that begin with names: gimp-2.10 is gimp."""
    return sorted(one for one in programs if one.startswith(tuple(name[:15] for name in names)))


def on_mains(root: Path = SUPPLIES) -> bool:
    """Return whether a supply of mains power is connected; true where the computer has no battery."""
    own = [path for path in root.glob("*") if _first_line(path / "scope") != "Device"]  # not a mouse's
    supplies = {path: _first_line(path / "type") for path in own}
    mains = [path for path, kind in supplies.items() if kind in ("Mains", "USB")]
    return "Battery" not in supplies.values() or any(_first_line(path / "online") == "1" for path in mains)


def reasons(
    rest_with: Sequence[str],
    on_battery: bool,
    running: Callable[[], set[str]] = programs,
    mains: Callable[[], bool] = on_mains,
) -> Callable[[float], str]:
    """Return what says why nothing is to be dimmed at a time [s]: of some programs, one runs; mains power."""

    @functools.lru_cache(maxsize=1)
    def looked(_: int) -> str:
        if rest_with and (seen := named(rest_with, running())):
            return f"{seen[0]} runs"
        return "mains power" if on_battery and mains() else ""

    return lambda now: looked(int(now // OFTEN))


def others_at_work(running: Callable[[], set[str]] = programs) -> str:
    """Return a line on programs that change brightness or colours by themselves; empty for none."""
    found = named(OTHERS, running())
    return f"{', '.join(found)} runs: a brightness that it sets counts as set by you" if found else ""


def _first_line(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").partition("\n")[0].strip()
    except OSError:
        return ""
