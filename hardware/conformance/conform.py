"""All that drivers promise, tried on one of them, as a table in words: `evenlight measure conform`."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from evenlight.hardware.conformance import devices, meters
from evenlight.hardware.conformance.subject import Bench, BrokenPromiseError, Subject, promised
from evenlight.hardware.installed_drivers import InstrumentKind

OPEN_FILES = (Path("/proc/self/fd"), Path("/dev/fd"))  # Linux, macOS
LAST_WAY = 2.0  # [s] that a thread may still be on
METERS = (devices.meter_says_what_it_is, devices.closed_it_refuses)
# Each raises `BrokenPromiseError`, which says what the driver did; its docstring is what was promised.
PROMISES: dict[InstrumentKind, tuple[Callable[[Bench], None], ...]] = {
    InstrumentKind.LUMINANCE: (meters.luminance_is_timed, meters.luminance_follows, *METERS),
    InstrumentKind.POWER: (
        devices.samples_need_a_start,
        devices.wrong_rates_are_refused,
        meters.power_keeps_time,
        meters.power_follows,
        *METERS,
    ),
    InstrumentKind.BACKLIGHT: (
        devices.factor_is_the_nearest_step,
        devices.wrong_factors_are_refused,
        devices.backlight_is_left_as_found,
        devices.closed_it_refuses,
    ),
}
FOLLOWING = (meters.luminance_follows, meters.power_follows)  # what they measure must change, and be known


def conform(subject: Subject, show: Callable[[str], None]) -> tuple[int, int, int]:
    """Try all that a driver promises, show each in a line, and count those kept, broken and not tried.

    Raises
    ------
    InputError, InstrumentError
        If there is no instrument at the address.
    """
    if not subject.simulated:  # is it there at all?
        with subject.bench():
            pass
    counts = Counter[str]()
    for promise in PROMISES[subject.kind]:
        if subject.screen:
            subject.screen.show(1.0)
        if promise in FOLLOWING and not (subject.simulated or subject.screen):
            word, why = "not tried", "give --rig, whose screen the instrument looks at, or feeds"
        else:
            why = broken(promise, subject)
            word = "BROKEN" if why else "kept"
        counts[word] += 1
        show(f"{word:<9}  {promise.__doc__}".rstrip(".") + (f": {why}" if why else ""))
    return counts["kept"], counts["BROKEN"], counts["not tried"]


def broken(promise: Callable[[Bench], None], subject: Subject) -> str:
    """Return what a driver did in place of what it promised, in a line; nothing if it kept the promise."""
    try:
        with nothing_left_open(), subject.bench() as bench:
            promise(bench)
    except BrokenPromiseError as error:
        return " ".join(str(error).split())
    except (Exception, SystemExit) as error:  # whatever a driver of someone else raises
        return " ".join(f"{type(error).__name__}: {error}".split())
    return ""


@contextlib.contextmanager
def nothing_left_open() -> Iterator[None]:
    """Refuse what leaves more files open, or threads running, than there were."""
    before = _held()
    yield
    end = time.monotonic() + LAST_WAY
    while any(map(int.__gt__, _held(), before)) and time.monotonic() < end:
        time.sleep(0.01)
    for what, was, is_ in zip(("files", "threads"), before, _held(), strict=True):
        promised(is_ <= was, f"leaves {is_ - was} more {what} open than there were")


def _held() -> tuple[int, int]:
    folder = next((each for each in OPEN_FILES if each.is_dir()), None)
    return len(list(folder.iterdir())) if folder else 0, threading.active_count()
