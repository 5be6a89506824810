"""The command `evenlight measure`: talks to the instruments, for the person at the bench."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError

INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal

measure = typer.Typer(invoke_without_command=True)

QUIET = typer.Option("--quiet", help="Only the closing line.")
RIG = typer.Option(help="Rig that names the instrument: a toml file, or a preset.")
OUT = typer.Option(help="New table (csv) for all that is read, on the disk as it comes.")


@measure.callback()
def start(context: typer.Context) -> None:
    """Talk to the instruments: list, luminance, power, zero. Each has --help and --quiet."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@measure.command("list")
def list_instruments(
    quiet: Annotated[bool, typer.Option("--quiet", help="Only the names of the drivers.")] = False,
) -> None:
    """Show drivers, what is plugged in, and what is not installed; nothing is opened."""
    from evenlight.hardware.instrument_list import connected_devices, driver_names, list_lines

    for line in driver_names() if quiet else list_lines(connected_devices()):
        typer.echo(line)


@measure.command()
def luminance(
    instrument: Annotated[
        str | None, typer.Option(help="DRIVER:ADDRESS, as `measure list` has them.")
    ] = None,
    rig: Annotated[str | None, RIG] = None,
    count: Annotated[int, typer.Option(help="How many readings.", min=1)] = 3,
    interval_s: Annotated[
        float, typer.Option("--interval-s", help="From the begin of one reading to the next.", min=0.0)
    ] = 0.0,
    out: Annotated[Path | None, OUT] = None,
    quiet: Annotated[bool, QUIET] = False,
) -> None:
    """Read a luminance meter, and show each reading, their mean and their standard deviation."""
    from evenlight.hardware.measuring import measure_luminance

    name = instrument or _named(rig, "luminance_meter")
    with _saying_what_is_kept(out):
        typer.echo(measure_luminance(name, count, interval_s, out, _show(quiet)))


@measure.command()
def power(
    instrument: Annotated[
        str | None, typer.Option(help="DRIVER:ADDRESS, as `measure list` has them.")
    ] = None,
    rig: Annotated[str | None, RIG] = None,
    seconds: Annotated[float, typer.Option(help="How long.", min=0.0)] = 10.0,
    rate_hz: Annotated[float, typer.Option("--rate-hz", help="Samples each second.", min=0.0)] = 100.0,
    out: Annotated[Path | None, OUT] = None,
    quiet: Annotated[bool, QUIET] = False,
) -> None:
    """Average the power that a meter measures, and show how many samples were lost or came twice."""
    from evenlight.hardware.measuring import measure_power

    name = instrument or _named(rig, "power_meter")
    with _saying_what_is_kept(out):
        typer.echo(measure_power(name, seconds, rate_hz, out, _show(quiet)))


@measure.command()
def zero(
    instrument: Annotated[str, typer.Option(help="DRIVER:ADDRESS, as `measure list` has them.")],
    yes: Annotated[bool, typer.Option("--yes", help="All is ready: do not ask.")] = False,
    quiet: Annotated[bool, QUIET] = False,
) -> None:
    """Set the zero of a meter: asks to cover its sensor, or to unplug the panel, and for Enter."""
    from evenlight.hardware.measuring import measure_zero

    typer.echo(measure_zero(instrument, None if yes else input, _show(quiet)))


def _named(rig: str | None, key: str) -> str:
    """Return the instrument that a rig names under a key."""
    from evenlight.hardware.rig_files import load_rig

    if rig is None:
        raise InputError(
            "name an instrument with --instrument, as `evenlight measure list` has them, or a rig with --rig"
        )
    loaded = load_rig(rig)[0]
    name = str(getattr(loaded, key))
    if name == "none":
        raise InputError(
            f"the rig {loaded.name!r} names no {key.replace('_', ' ')}: add `{key}` to it, or name one with "
            "--instrument"
        )
    return name


@contextmanager
def _saying_what_is_kept(out: Path | None) -> Iterator[None]:
    """Say where the table is, if the measurement is interrupted."""
    begun_with = out is not None and out.exists()
    try:
        yield
    except BaseException as error:
        if isinstance(error, Exception | SystemExit) or out is None or begun_with or not out.exists():
            raise
        print(f"evenlight: interrupted; what was read until then is in {out}", file=sys.stderr)
        sys.exit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)


def _show(quiet: bool) -> Callable[[str], None]:
    """Return what shows a line."""
    return (lambda _: None) if quiet else typer.echo
