"""The drivers that can be opened, by kind of instrument: our own, and those of installed packages.

A package names `Driver` records in its entry points, under their names (docs/drivers.md). They are read only
where a name is none of our own: for `measure list`, and for an instrument of a package.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import re
import sys
from collections.abc import Mapping
from importlib import metadata

from evenlight.data_schema.errors import InputError
from evenlight.hardware.driver import SIMULATED, Driver, NamedDriver, named_driver
from evenlight.hardware.driver_table import BACKLIGHTS, LUMINANCE_METERS, POWER_METERS

NAME = re.compile(r"[a-z][a-z0-9_-]*")


class InstrumentKind(enum.Enum):
    """What an instrument is, as messages name it."""

    LUMINANCE = "luminance meter"
    POWER = "power meter"
    BACKLIGHT = "backlight"

    @property
    def ours(self) -> Mapping[str, Driver]:
        """Our own drivers of the kind."""
        return {
            InstrumentKind.LUMINANCE: LUMINANCE_METERS,
            InstrumentKind.POWER: POWER_METERS,
            InstrumentKind.BACKLIGHT: BACKLIGHTS,
        }[self]

    @property
    def group(self) -> str:
        """The group of entry points: `evenlight.luminance_meters`, `.power_meters`, `.backlights`."""
        return f"evenlight.{self.value.replace(' ', '_')}s"


def find_driver(name: str, kind: InstrumentKind) -> NamedDriver:
    """Return what the name of an instrument says, of our own drivers or a package's.

    Raises
    ------
    InputError
        As `named_driver`.

    >>> find_driver("ls100:COM3", InstrumentKind.LUMINANCE).name
    'ls100'
    """
    driver = name.removeprefix(f"{SIMULATED}:").partition(":")[0]
    return named_driver(name, kind.ours if driver in kind.ours else known_drivers(kind), kind.value)


def find_driver_of(name: str, kind: str | None = None) -> tuple[InstrumentKind, NamedDriver]:
    """Return kind and driver of an instrument, which is "luminance", "power" or "backlight" if more have it.

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
    return chosen, find_driver(name, chosen)


def known_drivers(kind: InstrumentKind) -> dict[str, Driver]:
    """Return all drivers of a kind by name, our own first.

    A package that cannot be loaded, or whose driver has the name of another, is left out and told of in one
    line on standard error, once.
    """
    return {**kind.ours, **_installed(kind, tuple(sys.path))}


@functools.cache
def _installed(kind: InstrumentKind, path: tuple[str, ...]) -> dict[str, Driver]:
    found: dict[str, Driver] = {}
    for entry in metadata.entry_points(group=kind.group):
        package = entry.dist.name if entry.dist else "of no name"
        try:
            driver = entry.load()
            wrong = _wrong_with(entry.name, driver, {**kind.ours, **found})
        except (Exception, SystemExit) as error:  # whatever a module of someone else raises
            wrong = f"cannot be loaded: {type(error).__name__}: {' '.join(str(error).split())}"
        if wrong:
            where = f"the installed package {package}: its {kind.value} {entry.name!r} ({entry.value})"
            print(f"evenlight: note: {where} {wrong}", file=sys.stderr)
        else:
            found[entry.name] = dataclasses.replace(driver, package=package)
    return found


def _wrong_with(name: str, driver: object, taken: Mapping[str, Driver]) -> str:
    if name in taken:
        whose = taken[name].package
        return f"is left out: {name!r} is a driver of {f'the package {whose}' if whose else 'Evenlight'}"
    if not NAME.fullmatch(name):
        return "is left out: a name is of small letters, digits, - and _"
    if not isinstance(driver, Driver):
        return f"is not an evenlight.Driver, but of the type {type(driver).__name__}"
    if not (isinstance(driver.place, type) and (driver.emulator is None or callable(driver.emulator))):
        return "is left out: the place of its driver must be a class, and its emulator can be called"
    if not driver.instrument or driver.address.partition(":")[0] != name:
        return f"is left out: it must say what it drives, and have an address of the form {name}:…"
    return ""
