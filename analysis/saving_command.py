"""The command `evenlight measure saving`: what a dimmed film saves on the device that plays it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

A_DAY = 86_400.0  # [s]


def saving(
    full: Annotated[str, typer.Option(help="The film at full brightness: its name, or what --play takes.")],
    dimmed: Annotated[str, typer.Option(help="Its dimmed version.")],
    out: Annotated[Path, typer.Option(help="New folder for samples, passes, saving.json and a figure.")],
    instrument: Annotated[
        str, typer.Option(help="Power meter of the device, as `measure list` has them.")
    ] = "adb:",
    rounds: Annotated[int, typer.Option(help="How often both are played.", min=2, max=1000)] = 6,
    seconds: Annotated[
        float, typer.Option(help="How long of the film is measured each time.", min=0.5, max=A_DAY)
    ] = 120.0,
    settle_s: Annotated[
        float,
        typer.Option("--settle-s", help="At the beginning of each, what does not count.", min=0.0, max=A_DAY),
    ] = 15.0,
    rate_hz: Annotated[
        float, typer.Option("--rate-hz", help="Samples each second.", min=0.01, max=1000.0)
    ] = 1.0,
    play: Annotated[
        str, typer.Option(help="Command that plays {film}; else you start each, and press Enter.")
    ] = "",
    quiet: Annotated[bool, typer.Option("--quiet", help="Only the closing lines.")] = False,
) -> None:
    """Measure what a dimmed film saves on the device that plays it, by its battery: both versions in turn."""
    from evenlight.analysis.measurement.played_power.device_saving import device_saving, write_saving
    from evenlight.hardware.device_passes import PassRequest, measure_passes

    films = {"full": full, "dimmed": dimmed}
    request = PassRequest(instrument, films, rounds, seconds, settle_s, rate_hz, play)
    passes, apparatus = measure_passes(request, out, input, (lambda _: None) if quiet else typer.echo)
    for line in write_saving(device_saving(passes, request, apparatus, out), out):
        typer.echo(line)
