"""The command `evenlight measure`: lists the instruments and talks to them, for the person at the bench."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

from evenlight.data_schema.errors import InputError
from evenlight.hardware.driver import Driver
from evenlight.hardware.driver_table import TRIGGERS
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver_of, known_drivers
from evenlight.option_panels import QuietOption, expert

INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal
measure = typer.Typer(invoke_without_command=True)
INSTRUMENT = typer.Option(
    help="The instrument; `evenlight measure list` shows them. `simulated` needs no device."
)
RIG = typer.Option(help="Rig that names the instrument, in place of --instrument: a toml file, or a preset.")
OUT = typer.Option(metavar="FILE", help="New table (.csv) of all readings, written as they come.")
SYSTEM = Path("/sys")
SERIAL_CONVERTERS = (0x0403, 0x067B, 0x10C4, 0x1A86)  # vendors: FTDI, Prolific, Silicon Labs, WCH
INSTALL = "pip install '.[instruments]' in the checkout"
LIBRARIES = {
    "ppk2_api": ("the power meter ppk2", INSTALL),
    "monitorcontrol": ("the backlight ddc", INSTALL),
    "pylsl": ("the trigger output lsl", "pip install '.[lsl]' in the checkout"),
    "pyvisa": ("the power meters scpi and visa", INSTALL),
    "pyvisa_py": ("the power meters scpi and, unless a vendor's VISA is there, visa", INSTALL),
}
PROGRAMS = {
    "spotread": ("the luminance meter spotread", "apt install argyll"),
    "adb": ("the power meter adb", "apt install adb"),
}


@measure.callback()
def start(context: typer.Context) -> None:
    """Measure with luminance meters, power meters and headsets."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@measure.command("list")
def list_instruments(
    quiet: QuietOption = False,
) -> None:
    """List the drivers, what is plugged in, and what is not installed. Nothing is opened."""
    for line in driver_names() if quiet else list_lines(connected_ports()):
        typer.echo(line)


@measure.command()
def luminance(
    instrument: Annotated[str | None, INSTRUMENT] = None,
    rig: Annotated[str | None, RIG] = None,
    count: Annotated[int, typer.Option(help="How many readings.", min=1, max=1_000_000)] = 3,
    interval_s: Annotated[
        float,
        expert(
            "--interval-s", help="Time from the start of a reading to that of the next.", min=0.0, max=86400
        ),
    ] = 0.0,
    out: Annotated[Path | None, OUT] = None,
    quiet: QuietOption = False,
) -> None:
    """Read a luminance meter: each reading, their mean and their standard deviation, in cd/m²."""
    from evenlight.hardware.measuring import measure_luminance

    name = instrument or _named(rig, "luminance_meter")
    with _saying_what_is_kept(out):
        typer.echo(measure_luminance(name, count, interval_s, out, _show(quiet)))


@measure.command()
def power(
    instrument: Annotated[str | None, INSTRUMENT] = None,
    rig: Annotated[str | None, RIG] = None,
    seconds: Annotated[float, typer.Option(help="How long to measure.", min=0.0, max=1e6)] = 10.0,
    rate_hz: Annotated[
        float | None,
        expert(
            "--rate-hz", help="Samples per second.", min=0.0, max=1e6, show_default="100, or the driver's own"
        ),
    ] = None,
    out: Annotated[Path | None, OUT] = None,
    quiet: QuietOption = False,
) -> None:
    """Measure the mean power, in watts, and count samples that were lost or came twice."""
    from evenlight.hardware.measuring import measure_power

    name = instrument or _named(rig, "power_meter")
    with _saying_what_is_kept(out):
        typer.echo(measure_power(name, seconds, rate_hz, out, _show(quiet)))


@measure.command()
def zero(
    instrument: Annotated[str, INSTRUMENT],
    yes: Annotated[
        bool, typer.Option("--yes", help="The sensor is covered, or the panel unplugged: do not ask.")
    ] = False,
    quiet: QuietOption = False,
) -> None:
    """Set the zero of a meter. It asks you to cover its sensor, or to unplug the panel, first."""
    from evenlight.hardware.measuring import measure_zero

    typer.echo(measure_zero(instrument, None if yes else input, _show(quiet)))


@measure.command()
def headset(
    rig: Annotated[str, typer.Option(help="Rig in a headset: a toml file, or a preset.")] = "headset",
    frames: Annotated[
        int, typer.Option(metavar="N", help="How many frames to time.", min=2, max=100_000)
    ] = 100,
    quiet: QuietOption = False,
) -> None:
    """Ask the OpenXR runtime about its headset, time its frames, and print the lines for a rig's file."""
    from evenlight.hardware.headset_facts import measure_headset
    from evenlight.hardware.rig_files import load_rig

    for line in measure_headset(load_rig(rig)[0], frames)[-1 if quiet else 0 :]:
        typer.echo(line)


@measure.command()
def conform(
    instrument: Annotated[str, typer.Argument(help="The instrument: DRIVER:ADDRESS.")],
    rig: Annotated[
        str | None,
        typer.Option(help="Rig whose screen the meter looks at, or feeds: a toml file, or a preset."),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(metavar="KIND", help="luminance, power or backlight, if several have this name."),
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Test what every driver promises, on an instrument; ends with 1 if one is broken.

    The rig's screen, or a simulated panel, changes meanwhile: a meter must follow. `simulated:DRIVER` is the
    emulated instrument that a package brings.
    """
    from evenlight.hardware.conformance.conform import conform as tried
    from evenlight.hardware.conformance.subject import Subject, opened_screen
    from evenlight.hardware.rig import is_simulated
    from evenlight.hardware.rig_files import load_rig

    which, named = find_driver_of(instrument, kind)
    if rig and (is_simulated(instrument) or which is InstrumentKind.BACKLIGHT):
        raise InputError(f"{instrument}: --rig is for a meter at an address; leave it out")
    with opened_screen(load_rig(rig)[0], which) if rig else nullcontext() as screen:
        kept, broken, untried = tried(Subject(which, named, screen), _show(quiet))
    others = f", {untried} not tried" if untried else ""
    typer.echo(f"{instrument}, a {which.value}: {kept} promises kept, {broken} broken{others}")
    if broken:
        raise typer.Exit(1)


def _named(rig: str | None, key: str) -> str:
    from evenlight.hardware.rig_files import load_rig

    if rig is None:
        raise InputError(
            "name an instrument with --instrument, as `evenlight measure list` has them, or a rig with --rig"
        )
    loaded = load_rig(rig)[0]
    name = str(getattr(loaded, key))
    if name == "none":
        raise InputError(
            f"the rig {loaded.name!r} names no {key.replace('_', ' ')}: set `{key}` in it, or name one with "
            "--instrument"
        )
    return name


@contextmanager
def _saying_what_is_kept(out: Path | None) -> Iterator[None]:
    begun_with = out is not None and out.exists()
    try:
        yield
    except BaseException as error:
        if isinstance(error, Exception | SystemExit) or out is None or begun_with or not out.exists():
            raise
        print(f"evenlight: interrupted; what was read until then is in {out}", file=sys.stderr)
        sys.exit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)


def _show(quiet: bool) -> Callable[[str], None]:
    return (lambda _: None) if quiet else typer.echo


def connected_ports() -> list[Any]:
    """Return the serial ports of this computer, as pyserial lists them; nothing is opened."""
    from serial.tools.list_ports import comports

    return sorted(comports(), key=lambda port: str(port.device))


def list_lines(ports: Sequence[Any], system: Path = SYSTEM) -> list[str]:
    """Return all that is to be shown, line by line: of ports of pyserial, and where Linux shows devices."""
    return [
        *_drivers("Luminance meters", known_drivers(InstrumentKind.LUMINANCE)),
        *_drivers("Power meters", known_drivers(InstrumentKind.POWER)),
        *_drivers("Backlights", known_drivers(InstrumentKind.BACKLIGHT)),
        *_drivers("Trigger outputs", TRIGGERS),
        *_found("Serial ports here", [_port_line(port) for port in ports]),
        *_found("Backlights here", [_backlight_line(path) for path in _folders(system / "class/backlight")]),
        *_found("I2C buses here, for ddc", [_bus_line(path) for path in _folders(system / "class/i2c-dev")]),
        *_found("Power sensors here, for hwmon", list(_sensor_lines(system))),
        *_found("Not installed", list(missing_lines()), "nothing: all drivers can be used"),
    ]


def driver_names() -> list[str]:
    """Return what drivers are called, in the order of the list, each once."""
    kinds = [known_drivers(kind) for kind in InstrumentKind]
    return list(dict.fromkeys(name for drivers in kinds for name in drivers))


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
    drivers = known_drivers(InstrumentKind.LUMINANCE) | known_drivers(InstrumentKind.POWER)
    return {name: driver for name, driver in drivers.items() if (vendor, product) in driver.usb_ids}


def _drivers(title: str, drivers: Mapping[str, Driver]) -> Iterable[str]:
    yield title
    for name, driver in drivers.items():
        if not driver.instrument:
            continue
        yield f"  {name:<10} {driver.instrument}"
        yield f"  {'':<10}   {driver.address}"
        whose = f"of the package {driver.package}" if driver.package else ""
        for words in (driver.settings, driver.note, whose):
            if words and words != "none":
                yield f"  {'':<10}   {words}"
    yield ""


def _found(title: str, lines: list[str], nothing: str = "none") -> Iterable[str]:
    yield title
    yield from (f"  {line}" for line in lines or [nothing])
    yield ""


def _port_line(port: Any) -> str:
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
    return sorted(root.iterdir()) if root.is_dir() else []


def _backlight_line(folder: Path) -> str:
    steps, scale = _text(folder / "max_brightness"), _text(folder / "scale")
    words = f"sysfs:{folder.name}  {steps or 'an unknown number of'} steps"
    if scale == "non-linear":
        return f"{words}, not linear in light: needs a measured `backlight_curve`"
    return words + (", linear in light" if scale == "linear" else "")


def _bus_line(folder: Path) -> str:
    return f"ddc:{folder.name.removeprefix('i2c-')}  {_text(folder / 'name') or 'without a name'}"


def _sensor_lines(system: Path) -> Iterable[str]:
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
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return ""
