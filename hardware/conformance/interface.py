"""Promises of a driver's class, which are seen without an instrument."""

from __future__ import annotations

import inspect
import subprocess
import sys
from collections.abc import Collection
from typing import Any

from evenlight.hardware.conformance.subject import Subject, promised
from evenlight.hardware.driver import Driver
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import Backlight, LuminanceMeter, PowerMeter

PROTOCOLS: dict[InstrumentKind, type] = {
    InstrumentKind.LUMINANCE: LuminanceMeter,
    InstrumentKind.POWER: PowerMeter,
    InstrumentKind.BACKLIGHT: Backlight,
}
LIBRARIES = ("serial", "ppk2_api", "monitorcontrol", "pyvisa", "pyvisa_py", "psychopy")  # of devices


def methods_of_the_protocol(subject: Subject) -> None:
    """Require each method of the protocol, and that more arguments than there have defaults."""
    cls, protocol = subject.named.driver.load(), PROTOCOLS[subject.kind]
    for method in (name for name in dir(protocol) if not name.startswith("_")):
        own: Any = getattr(cls, method, None)
        promised(callable(own), f"there is no method {method}")
        has, asked = (
            list(inspect.signature(one).parameters.values()) for one in (own, getattr(protocol, method))
        )
        more = [one.name for one in has[len(asked) :] if one.default is one.empty]
        same = [one.name for one in has[: len(asked)]] == [one.name for one in asked]
        promised(same and not more, f"{method} takes {[o.name for o in has]}, not {[o.name for o in asked]}")
    promised(hasattr(cls, "zero") == hasattr(cls, "before_zero"), "zero and before_zero come together")


def imported_without_libraries(subject: Subject) -> None:
    """Require that libraries are imported where an instrument is opened, and no earlier."""
    why = import_failure([subject.named.driver])
    promised(not why, why)


def import_failure(drivers: Collection[Driver]) -> str:
    """Return why drivers cannot be imported without device libraries; nothing if they can.

    That is tried in a process of its own, where importing one of the libraries fails.
    """
    classes = [each.load() for each in drivers if each.place]
    lines = [f"import sys; sys.path[:] = {sys.path!r}; sys.modules.update(dict.fromkeys({LIBRARIES}))"]
    lines += [f"import {module}" for module in dict.fromkeys(cls.__module__ for cls in classes)]
    words = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.stderr.strip().rpartition("\n")[2] if done.returncode else ""
