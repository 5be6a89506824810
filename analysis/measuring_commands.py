"""The commands that measure, and analyse what they measured: `run`, `measure played` and `measure saving`."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from evenlight.experiments import run_command
from evenlight.experiments.playback.play_options import FilmOptions, PowerOptions
from evenlight.option_panels import QuietOption, asked, expert, instruments, output, with_options

A_DAY = 86_400.0  # [s]


@functools.wraps(run_command.run)
def run(**asked: Any) -> None:
    """Run a session or a sweep; the results of a complete sweep go into its folder."""
    folder = run_command.run(**asked)
    if folder is not None:
        from evenlight.analysis.sweeps.sweep_report import fit_sweep

        _tell(fit_sweep(folder, folder), quiet=asked["quiet"])


def _played(film: FilmOptions, power: PowerOptions) -> None:
    """Measure the panel's power while a video is played in turn by its track, constantly, and undimmed."""
    from evenlight.analysis.played_power.power_report import write_power_results
    from evenlight.experiments.playback.measured_play import measure_power
    from evenlight.method.preset_files import load_power_model

    folder = measure_power(film, power)
    model = load_power_model(power.power_model) if power.power_model else None
    _tell(write_power_results(folder, folder, model), quiet=film.quiet)


played = with_options(_played, FilmOptions, PowerOptions)


def _tell(lines: Sequence[str], *, quiet: bool) -> None:
    for line in () if quiet else lines:
        typer.echo(line)


def saving(
    full: Annotated[
        str, asked(metavar="FILM", help="The film at full brightness: its name, or what --play takes.")
    ],
    dimmed: Annotated[str, asked(metavar="FILM", help="Its dimmed version.")],
    out: Annotated[Path, output(help="New folder for samples, passes, saving.json and a figure.")],
    instrument: Annotated[
        str, instruments(help="Power meter of the device; `evenlight measure list` shows them.")
    ] = "adb:",
    rounds: Annotated[int, asked(help="How often both are played.", min=2, max=1000)] = 6,
    seconds: Annotated[
        float, asked(help="How long each version is measured each time.", min=0.5, max=A_DAY)
    ] = 120.0,
    settle_s: Annotated[
        float,
        expert(
            "--settle-s",
            metavar="SECONDS",
            help="How long to wait at the beginning of each before it counts.",
            min=0.0,
            max=A_DAY,
        ),
    ] = 15.0,
    rate_hz: Annotated[float, expert("--rate-hz", help="Samples per second.", min=0.01, max=1000.0)] = 1.0,
    play: Annotated[
        str,
        asked(
            metavar="COMMAND",
            help="Command that plays a film; {film} in it is replaced by --full and --dimmed. Otherwise you "
            "start each film yourself, and press Enter.",
        ),
    ] = "",
    quiet: QuietOption = False,
) -> None:
    """Measure what a dimmed film saves on the device that plays it: both versions in turn, by its battery."""
    from evenlight.analysis.played_power.device_saving import device_saving, write_saving
    from evenlight.hardware.device_passes import PassRequest, measure_passes

    films = {"full": full, "dimmed": dimmed}
    request = PassRequest(instrument, films, rounds, seconds, settle_s, rate_hz, play)
    passes, apparatus = measure_passes(request, out, input, (lambda _: None) if quiet else typer.echo)
    for line in write_saving(device_saving(passes, request, apparatus, out), out):
        typer.echo(line)
