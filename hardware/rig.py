"""The devices that a rig names: the one place that chooses a driver, and imports it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware.driver import SIMULATED, NamedDriver, named_driver, own_simulation
from evenlight.hardware.driver_table import BOARD, IMPORTED, NO_BACKLIGHT, TRIGGERS
from evenlight.hardware.guarded_devices import (
    GuardedBacklight,
    GuardedDevice,
    GuardedLuminanceMeter,
    GuardedPowerMeter,
)
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver
from evenlight.hardware.protocols import (
    Backlight,
    LuminanceMeter,
    PowerMeter,
    TriggerOutput,
)

if TYPE_CHECKING:
    from evenlight.hardware.simulated.panel import Simulation

Guard = TypeVar("Guard", bound=GuardedDevice)


def open_luminance_meter(
    name: str,
    clock: Callable[[], float],
    simulation: Simulation | None = None,
    ask: Callable[[str], str] | None = None,
) -> LuminanceMeter:
    """Return a luminance meter, open.

    Parameters
    ----------
    name : str
        "simulated", "manual", DRIVER:ADDRESS, or "simulated:DRIVER" for the driver of a package
        on its emulated instrument.
    clock : callable
        Of the readings' times [s].
    simulation : Simulation, optional
        What a simulated one looks at.
    ask : callable, optional
        Asks the person at the bench, and returns what was typed; else the terminal does.

    Raises
    ------
    InputError
        If there is no such driver.
    InstrumentError
        If the instrument is not there, or does not answer as it should.
    """
    if name.partition(":")[0] == IMPORTED:
        raise InputError(
            f"{name}: is a table of readings made elsewhere, and no meter: name it as the rig's "
            "luminance_meter, and `evenlight run luminance-sweep` imports it"
        )
    named = find_driver(name, InstrumentKind.LUMINANCE)
    opener = partial(luminance_meter_of, clock=clock, simulation=simulation, ask=ask)
    if named.driver.guarded() or named.emulated:
        return guarded(GuardedLuminanceMeter, named, opener, simulation or own_simulation(clock))
    return opener(named)


def luminance_meter_of(
    named: NamedDriver,
    clock: Callable[[], float],
    simulation: Simulation | None,
    ask: Callable[[str], str] | None,
) -> LuminanceMeter:
    """Return the luminance meter of a driver."""
    driver = named.driver.load()
    meter: LuminanceMeter
    if named.name == SIMULATED:
        meter = driver(simulation or own_simulation(clock))
    elif named.name == "manual":
        meter = driver(ask or input, clock)
    else:
        meter = driver(named.address, clock)
    return meter


def open_power_meter(
    name: str, clock: Callable[[], float], simulation: Simulation | None = None
) -> PowerMeter:
    """Return a power meter, open; a board that is open as a backlight is shared.

    Parameters
    ----------
    name : str
        "simulated", DRIVER:ADDRESS, or "simulated:DRIVER" for the driver of a package
        on its emulated instrument.
    clock : callable
        The computer's clock, for the times at which samples arrive [s].
    simulation : Simulation, optional
        What a simulated one measures.

    Raises
    ------
    InputError
        If there is no such driver.
    InstrumentError
        If the instrument is not there, or does not answer as it should.
    """
    named = find_driver(name, InstrumentKind.POWER)
    opener = partial(power_meter_of, clock=clock, simulation=simulation)
    if named.driver.guarded() or named.emulated:
        return guarded(GuardedPowerMeter, named, opener, simulation or own_simulation(clock))
    return opener(named)


def power_meter_of(
    named: NamedDriver, clock: Callable[[], float], simulation: Simulation | None
) -> PowerMeter:
    """Return the power meter of a driver."""
    driver = named.driver.load()
    meter: PowerMeter
    if named.name == SIMULATED:
        meter = driver(simulation or own_simulation(clock))
    elif named.name == BOARD:
        from evenlight.hardware.drivers.board_link import board_at

        meter = driver(board_at(named.address, clock), clock)
    else:
        meter = driver(named.address, clock)
    return meter


def open_backlight(
    rig: Rig, clock: Callable[[], float], simulation: Simulation | None = None
) -> Backlight | None:
    """Return the rig's backlight on a clock [s], or None if it names none.

    Its factors are shares of luminance: where the rig has a `backlight_curve`, by that.

    Parameters
    ----------
    rig : Rig
        The rig, from `rig_files.load_rig`.
    clock : callable
        The window's clock [s].
    simulation : Simulation, optional
        Whose panel a simulated one dims.

    Raises
    ------
    InputError
        If there is no such backlight, or its curve is none.
    InstrumentError
        If it does not answer as it should.
    """
    if not rig.backlight_curve or rig.backlight == NO_BACKLIGHT:
        return _open_device(rig, clock, simulation, curve_known=False)
    from evenlight.hardware.backlight_curve import LinearizedBacklight, read_backlight_curve

    curve = read_backlight_curve(Path(rig.backlight_curve))
    device = _open_device(rig, clock, simulation, curve_known=True)
    return device and LinearizedBacklight(device, curve)


def open_swept_backlight(
    rig: Rig, clock: Callable[[], float], simulation: Simulation | None = None
) -> Backlight | None:
    """Return the rig's backlight by its own factors, for a sweep that measures what light they make.

    As `open_backlight`, but for the curve: a known one is not used, and none is needed.
    """
    return _open_device(rig, clock, simulation, curve_known=True)


@contextmanager
def opened_triggers(names: Sequence[str]) -> Iterator[dict[str, TriggerOutput]]:
    """Yield trigger outputs, open, by their names.

    Raises
    ------
    InputError
        If there is no such driver, or one is named twice.
    InstrumentError
        If a device is not there.
    """
    if len(set(names)) < len(names):
        raise InputError(f"the rig's triggers must differ, got {', '.join(names)}")
    with ExitStack() as opened:
        outputs: dict[str, TriggerOutput] = {}
        for name in names:
            named = named_driver(name, TRIGGERS, "trigger output")
            driver = named.driver.load()
            outputs[name] = opened.enter_context(driver() if name == SIMULATED else driver(named.address))
        yield outputs


def is_simulated(name: str) -> bool:
    """Return whether the name of an instrument or a backlight is that of a simulated one.

    >>> is_simulated("simulated"), is_simulated("ls100:/dev/ttyUSB0")
    (True, False)
    """
    return name.partition(":")[0] == SIMULATED


def backlights_smallest_factor(rig: Rig) -> float:
    """Return the lowest brightness factor of the rig's backlight, 0 if it names none.

    The device is opened for it, and left as it was found.

    >>> import dataclasses
    >>> from evenlight.hardware.rig_files import load_rig
    >>> rig = dataclasses.replace(load_rig("simulated")[0], backlight="simulated")
    >>> round(1 / backlights_smallest_factor(rig))  # 12 bits
    4095
    """
    backlight = open_backlight(rig, lambda: 0.0)
    if backlight is None:
        return 0.0
    try:
        return backlight.smallest_factor()
    finally:
        backlight.close()


def _open_device(
    rig: Rig, clock: Callable[[], float], simulation: Simulation | None, *, curve_known: bool
) -> Backlight | None:
    if rig.backlight == NO_BACKLIGHT:
        return None
    named = find_driver(rig.backlight, InstrumentKind.BACKLIGHT)
    if named.driver.guarded() or named.emulated:
        opener = partial(backlight_of, clock=clock, simulation=simulation, curve_known=True)
        return guarded(GuardedBacklight, named, opener, simulation or own_simulation(clock))
    return backlight_of(named, clock, simulation, curve_known=curve_known)


def backlight_of(
    named: NamedDriver, clock: Callable[[], float], simulation: Simulation | None, *, curve_known: bool
) -> Backlight:
    """Return the backlight of a driver, by its own factors."""
    driver = named.driver.load()
    backlight: Backlight
    if named.name == SIMULATED:
        backlight = driver(clock, follow=simulation.panel.set_backlight if simulation else None)
    elif named.name == BOARD:
        from evenlight.hardware.drivers.board_link import board_at

        backlight = driver(board_at(named.address, clock), clock)
    elif named.name == "sysfs":
        backlight = driver(named.address, curve_known=curve_known)
    elif named.name == "ddc":
        backlight = driver(int(named.address))
    else:
        backlight = driver(named.address, clock)
    return backlight


def guarded(
    guard: type[Guard],
    named: NamedDriver,
    opener: Callable[[NamedDriver], object],
    simulation: Simulation | None,
) -> Guard:
    """Return a driver under guard, on the emulated instrument that its package brings if its name says so."""
    with ExitStack() as link:
        if named.emulated and named.driver.emulator and simulation:
            address = link.enter_context(named.driver.emulator(simulation))
            named = dataclasses.replace(named, address=address)
        device = guard(named, lambda: opener(named))
        device.link = link.pop_all()
    return device
