"""The command `evenlight measure light`: PWM of a backlight, response time, latency to light."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated, Protocol

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import asked, instruments, output


class AnalyseLight(Protocol):
    """Analyses a recording."""

    def __call__(self, folder: Path, *, kept: bool) -> list[str]:
        """Write its results into its folder, if that is kept, and return what is to be said of them."""


def light_command(analyse_light: AnalyseLight) -> Callable[..., None]:
    """Return the command `measure light`, which hands the folder of a recording to an analysis.

    Parameters
    ----------
    analyse_light : callable
        The analysis.
    """

    def light(
        instrument: Annotated[
            str,
            instruments(
                help="The photodiode's sampler: adc:PORT, soundcard:, simulated, or file:FILE, a recording."
            ),
        ],
        rig: Annotated[
            str | None,
            asked(help="Rig on whose screen a corner turns white and black: for response time and latency."),
        ] = None,
        out: Annotated[Path | None, output(help="New folder for samples, results and figures.")] = None,
        seconds: Annotated[float, asked(help="Without --rig: how long the steady white is recorded.")] = 2.0,
        edges: Annotated[
            int, asked(help="With --rig: how often the corner changes.", min=10, max=10_000)
        ] = 120,
        interval_s: Annotated[
            float, asked("--interval-s", help="With --rig: time from change to change.")
        ] = 0.25,
        rate_hz: Annotated[
            float | None, instruments("--rate-hz", help="Samples per second. Otherwise the sampler's own.")
        ] = None,
        dark: Annotated[
            bool, asked("--dark", help="First measure darkness; asks you to cover the photodiode.")
        ] = False,
        simulate: Annotated[
            bool, asked("--simulate", help="Without a window: simulate photodiode and panel.")
        ] = False,
        quiet: Annotated[bool, typer.Option("--quiet", help="Print only the first line.")] = False,
    ) -> None:
        """Record light over time: flicker (PWM) of a steady white; with --rig response time and latency."""
        from evenlight.experiments.measured_light import LightRequest, record_light
        from evenlight.hardware.rig_files import load_rig

        for option, value, least, most in (
            ("--seconds", seconds, 0.5, 600.0),
            ("--interval-s", interval_s, 0.05, 10.0),
            ("--rate-hz", rate_hz, 1.0, 1e6),
        ):
            if value is not None and not least <= value <= most:
                raise InputError(f"{option} must lie between {least:g} and {most:g}, got {value:g}")
        if dark and rig is not None:
            raise InputError(
                "--dark is for a steady screen; with --rig the black corner tells the dark level"
            )
        if simulate and rig is None:
            raise InputError("--simulate rehearses the changes of a corner: give it with --rig")
        request = LightRequest(
            instrument=instrument,
            rate=rate_hz,
            seconds=seconds,
            ask=_ask if dark else None,
            rig=load_rig(rig)[0] if rig else None,
            edges=edges,
            interval=interval_s,
            simulated=simulate,
        )
        with _folder(out) as name:
            folder = Path(name)
            record_light(request, folder)
            said = analyse_light(folder, kept=out is not None)
        for line in said[:1] if quiet else said:
            typer.echo(line)
        if out and not quiet:
            typer.echo(f"light over time: {out}")

    return light


def _ask(question: str) -> None:
    """Wait for Enter."""
    try:
        input(question)
    except EOFError:
        raise InputError("no one has pressed Enter; leave --dark out, or answer at a terminal") from None


def _folder(out: Path | None) -> AbstractContextManager[Path | str]:
    """Return where files go until all of them are there: a new folder, or one that is thrown away."""
    from evenlight.data_schema.storage.whole_files import results_folder

    if out is None:
        return tempfile.TemporaryDirectory()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"--out {out}: holds something already, and measured data are never overwritten")
    return results_folder(out)
