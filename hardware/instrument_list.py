"""What `evenlight measure list` shows: drivers, what is plugged in, and what is not installed."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from evenlight.hardware.driver_table import BACKLIGHTS, LUMINANCE_METERS, POWER_METERS, Driver

SYSTEM = Path("/sys")
SERIAL_CONVERTERS = (0x0403, 0x067B, 0x10C4, 0x1A86)  # vendors: FTDI, Prolific, Silicon Labs, WCH
INSTALL = "pip install 'evenlight[instruments]'"
LIBRARIES = {
    "ppk2_api": ("the power meter ppk2", INSTALL),
    "monitorcontrol": ("the backlight ddc", INSTALL),
    "pyvisa": ("the power meter visa", INSTALL),
    "pyvisa_py": ("the power meter visa, unless a vendor's VISA is there", INSTALL),
}
PROGRAMS = {"spotread": ("the luminance meter spotread", "apt install argyll")}


class SerialPort(Protocol):
    """A serial port, as pyserial lists it."""

    device: str
    description: str
    vid: int | None
    pid: int | None
    serial_number: str | None


@dataclass(frozen=True, slots=True)
class ConnectedDevices:
    """What a computer has.

    Attributes
    ----------
    ports : tuple of SerialPort
        Serial ports.
    system : Path
        Where Linux shows devices.
    """

    ports: tuple[SerialPort, ...]
    system: Path = SYSTEM


def connected_devices() -> ConnectedDevices:
    """Return what this computer has; nothing is opened."""
    from serial.tools.list_ports import comports

    return ConnectedDevices(tuple(sorted(comports(), key=lambda port: str(port.device))))


def list_lines(present: ConnectedDevices) -> list[str]:
    """Return all that is to be shown, line by line."""
    system = present.system
    return [
        *_drivers("Luminance meters", LUMINANCE_METERS),
        *_drivers("Power meters", POWER_METERS),
        *_drivers("Backlights", BACKLIGHTS),
        *_found("Serial ports here", [_port_line(port) for port in present.ports]),
        *_found("Backlights here", [_backlight_line(path) for path in _folders(system / "class/backlight")]),
        *_found("I2C buses here, for ddc", [_bus_line(path) for path in _folders(system / "class/i2c-dev")]),
        *_found("Power sensors here, for hwmon", list(_sensor_lines(system))),
        *_found("Not installed", list(missing_lines()), "nothing: all drivers can be used"),
    ]


def driver_names() -> list[str]:
    """Return what drivers are called, in the order of the list, each once."""
    return list(dict.fromkeys((*LUMINANCE_METERS, *POWER_METERS, *BACKLIGHTS)))


def missing_lines() -> Iterable[str]:
    """Yield what is not installed, what needs it, and how to get it."""
    for name, (needed_by, install) in LIBRARIES.items():
        if importlib.util.find_spec(name) is None:
            yield f"{name}, for {needed_by}: {install}"
    for name, (needed_by, install) in PROGRAMS.items():
        if shutil.which(name) is None:
            yield f"{name}, for {needed_by}: {install}"


def known_instruments(vendor: int | None, product: int | None) -> dict[str, Driver]:
    """Return the drivers of the instruments that have a USB id, by name."""
    drivers = (*LUMINANCE_METERS.items(), *POWER_METERS.items())
    return {name: driver for name, driver in drivers if (vendor, product) in driver.usb_ids}


def _drivers(title: str, drivers: Mapping[str, Driver]) -> Iterable[str]:
    """Yield the drivers of one kind of instrument."""
    yield title
    for name, driver in drivers.items():
        if not driver.instrument:
            continue
        yield f"  {name:<10} {driver.instrument}"
        yield f"  {'':<10}   {driver.address}"
        for words in (driver.settings, driver.note):
            if words and words != "none":
                yield f"  {'':<10}   {words}"
    yield ""


def _found(title: str, lines: list[str], nothing: str = "none") -> Iterable[str]:
    """Yield what was found of one kind."""
    yield title
    yield from (f"  {line}" for line in lines or [nothing])
    yield ""


def _port_line(port: SerialPort) -> str:
    """Return a serial port, with the instrument of its USB id."""
    words = [port.device]
    if port.vid is not None and port.pid is not None:
        words.append(f"USB {port.vid:04X}:{port.pid:04X}")
    if port.description and port.description != "n/a":
        words.append(port.description)
    if port.serial_number:
        words.append(f"serial number {port.serial_number}")
    if drivers := known_instruments(port.vid, port.pid):
        words += [f"{driver.instrument}: {name}:{port.device}" for name, driver in drivers.items()]
    elif port.vid in SERIAL_CONVERTERS:
        words.append("a serial converter: its instrument does not show")
    return "  ".join(words)


def _folders(root: Path) -> list[Path]:
    """Return the folders in a folder of the system; none where there is no such."""
    return sorted(root.iterdir()) if root.is_dir() else []


def _backlight_line(folder: Path) -> str:
    """Return a backlight of Linux, with its steps and their scale."""
    steps, scale = _text(folder / "max_brightness"), _text(folder / "scale")
    words = f"sysfs:{folder.name}  {steps or 'an unknown number of'} steps"
    if scale == "non-linear":
        return f"{words}, not linear in light: needs a measured `backlight_curve`"
    return words + (", linear in light" if scale == "linear" else "")


def _bus_line(folder: Path) -> str:
    """Return an I2C bus."""
    return f"ddc:{folder.name.removeprefix('i2c-')}  {_text(folder / 'name') or 'without a name'}"


def _sensor_lines(system: Path) -> Iterable[str]:
    """Yield the sensors of power, or of current and voltage."""
    for folder in _folders(system / "class/hwmon"):
        inputs = sorted(path.name for path in folder.glob("*[0-9]_input"))
        power = [name for name in inputs if name.startswith("power")]
        both = any(n.startswith("curr") for n in inputs) and any(n.startswith("in") for n in inputs)
        if power or both:
            yield f"hwmon:{folder}  {_text(folder / 'name')}: {', '.join(power) or 'current and voltage'}"
    for folder in _folders(system / "bus/iio/devices"):
        if any(folder.glob("in_power*_raw")) or any(folder.glob("in_current*_raw")):
            yield f"hwmon:{folder}  {_text(folder / 'name')}, iio"


def _text(path: Path) -> str:
    """Return what a file of the system says; nothing where it says nothing."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""
