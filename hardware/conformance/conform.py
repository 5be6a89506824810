"""All that drivers promise, tried on one of them, as a table in words: `evenlight measure conform`."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.hardware.conformance import interface, working
from evenlight.hardware.conformance.subject import BrokenPromiseError, Subject, promised
from evenlight.hardware.driver import SIMULATED
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver, known_drivers

MANUAL = "manual"
LUMINANCE, POWER, BACKLIGHT = InstrumentKind
METERS = (LUMINANCE, POWER)
OPEN_FILES = (Path("/proc/self/fd"), Path("/dev/fd"))  # Linux, macOS
LAST_WAY = 2.0  # [s] that a thread may still be on


@dataclass(frozen=True, slots=True)
class Promise:
    """What drivers promise."""

    words: str
    check: Callable[[Subject], None]  # raises BrokenPromiseError, which says what the driver did
    kinds: tuple[InstrumentKind, ...] = tuple(InstrumentKind)
    opens: bool = True  # whether the device is opened for it

    def untried(self, subject: Subject) -> str:
        """Return why it is not tried on a driver; nothing if it is."""
        if self.opens and subject.named.name == MANUAL:
            return "a person gives the readings"
        return ""


INTERFACE = (
    Promise(
        "has each method of its protocol, with the same arguments",
        interface.methods_of_the_protocol,
        opens=False,
    ),
    Promise(
        "is imported where no device library is installed", interface.imported_without_libraries, opens=False
    ),
)
WORKING = (
    Promise(
        "reads luminances that can be, with unit and times", working.luminance_is_a_reading, (LUMINANCE,)
    ),
    Promise("samples powers that can be, with counts and times", working.power_is_sampled, (POWER,)),
    Promise("has no samples before it is started", working.samples_need_a_start, (POWER,)),
    Promise("sets the nearest step, and reports it", working.factor_is_the_nearest_step, (BACKLIGHT,)),
    Promise("leaves the backlight as it was found", working.backlight_is_left_as_found, (BACKLIGHT,)),
    Promise("says what it is", working.says_what_it_is, METERS),
    Promise("is closed as often as one likes, and then refuses", working.closed_it_refuses),
    Promise("refuses rates that it has not", working.wrong_values_are_refused, (POWER,)),
    Promise("refuses factors that it has not", working.wrong_values_are_refused, (BACKLIGHT,)),
)
PROMISES = (*INTERFACE, *WORKING)


def subject_named(name: str, kind: str | None) -> Subject:
    """Return the driver that a name says.

    Parameters
    ----------
    name : str
        DRIVER:ADDRESS, or "simulated:DRIVER".
    kind : str, optional
        "luminance", "power" or "backlight", where drivers of several kinds have the name.

    Raises
    ------
    InputError
        If there is no such driver, or it is not clear which.
    """
    driver = name.removeprefix(f"{SIMULATED}:").partition(":")[0]
    kinds = {each.name.lower(): each for each in InstrumentKind}
    if kind is not None and kind not in kinds:
        raise InputError(f"--kind must be {', '.join(kinds)}, got {kind!r}")
    having = [word for word, each in kinds.items() if driver in known_drivers(each)]
    if kind is None and not having:
        raise InputError(
            f"{name}: there is no driver {driver!r}; `evenlight measure list` shows those there are"
        )
    if kind is None and len(having) > 1:
        words = " or ".join(f"--kind {word}" for word in having)
        raise InputError(f"{name}: drivers of several kinds have the name {driver!r}; give {words}")
    chosen = kinds[kind or having[0]]
    return Subject(chosen, find_driver(name, chosen))


def conform(subject: Subject, show: Callable[[str], None]) -> tuple[int, int, int]:
    """Try all that a driver promises, and show each in a line.

    Returns
    -------
    kept, broken, untried : int
        How many promises are kept, broken, and not tried here.

    Raises
    ------
    InputError, InstrumentError
        If there is no instrument at the address.
    """
    if not subject.emulated and subject.named.name != MANUAL:  # is it there at all?
        with subject.bench() as bench:
            bench.device.close()
    counts = {"kept": 0, "BROKEN": 0, "not tried": 0}
    for promise in PROMISES:
        if subject.kind not in promise.kinds:
            continue
        if why := promise.untried(subject):
            word = "not tried"
        else:
            why = broken(promise, subject)
            word = "BROKEN" if why else "kept"
        counts[word] += 1
        show(f"{word:<9}  {promise.words}" + (f": {why}" if why else ""))
    return counts["kept"], counts["BROKEN"], counts["not tried"]


def broken(promise: Promise, subject: Subject) -> str:
    """Return what a driver did in place of what it promised; nothing if it kept the promise."""
    try:
        with nothing_left_open():
            promise.check(subject)
    except BrokenPromiseError as error:
        return _line(error)
    except (Exception, SystemExit) as error:  # whatever a driver of someone else raises
        return _line(f"{type(error).__name__}: {error}")
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
    """Return how many files are open, where the system tells, and how many threads run."""
    folder = next((each for each in OPEN_FILES if each.is_dir()), None)
    return len(list(folder.iterdir())) if folder else 0, threading.active_count()


def _line(words: object) -> str:
    """Return words in one line."""
    return " ".join(str(words).split())
