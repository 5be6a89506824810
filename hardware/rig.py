"""The devices that a rig names: the one place that chooses a driver, and imports it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware.driver import SIMULATED, NamedDriver, named_driver, own_simulation
from evenlight.hardware.driver_table import IMPORTED, NO_BACKLIGHT, TRIGGERS
from evenlight.hardware.guarded_devices import GUARDS
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver
from evenlight.hardware.protocols import Backlight, LuminanceMeter, PowerMeter, TriggerOutput

if TYPE_CHECKING:
    from evenlight.hardware.simulated.panel import Simulation


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
    meter: LuminanceMeter = _opened(name, InstrumentKind.LUMINANCE, clock, simulation, ask=ask)
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
    meter: PowerMeter = _opened(name, InstrumentKind.POWER, clock, simulation)
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
    backlight: Backlight = _opened(
        rig.backlight, InstrumentKind.BACKLIGHT, clock, simulation, curve_known=curve_known
    )
    return backlight


def _opened(
    name: str,
    kind: InstrumentKind,
    clock: Callable[[], float],
    simulation: Simulation | None,
    **options: Any,
) -> Any:
    """Return a device, under guard where its driver is another's."""
    named = find_driver(name, kind)
    if named.driver.guarded() or named.emulated:
        opener = partial(device_of, kind=kind, clock=clock, simulation=simulation, **options)
        return guarded(kind, named, opener, simulation or own_simulation(clock))
    return device_of(named, kind, clock, simulation, **options)


def device_of(
    named: NamedDriver,
    kind: InstrumentKind,
    clock: Callable[[], float],
    simulation: Simulation | None,
    *,
    ask: Callable[[str], str] | None = None,
    curve_known: bool = True,
) -> Any:
    """Return the device of a driver, a backlight by its own factors; arguments as of `open_luminance_meter`.

    `curve_known` says that a backlight's steps need not be linear in light.
    """
    driver, follow = named.driver.load(), simulation.panel.set_backlight if simulation else None
    match named.name:
        case "simulated" if kind is InstrumentKind.BACKLIGHT:
            return driver(clock, follow=follow)
        case "simulated":
            return driver(simulation or own_simulation(clock))
        case "manual":
            return driver(ask or input, clock)
        case "sysfs":
            return driver(named.address, curve_known=curve_known)
        case "ddc":
            return driver(int(named.address))
    return driver(named.address, clock)


def guarded(
    kind: InstrumentKind,
    named: NamedDriver,
    opener: Callable[[NamedDriver], object],
    simulation: Simulation | None,
) -> Any:
    """Return a driver under guard, on the emulated instrument that its package brings if its name says so."""
    with ExitStack() as link:
        if named.emulated and named.driver.emulator and simulation:
            address = link.enter_context(named.driver.emulator(simulation))
            named = dataclasses.replace(named, address=address)
        device = GUARDS[kind](named, lambda: opener(named))
        device.link = link.pop_all()
    return device
