"""The command that turns trials into thresholds and a rate limit."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from data_schema.rate_limit import RateLimitForm

if TYPE_CHECKING:
    from analysis.calibration import Calibration


def fit(
    dataset: Annotated[Path, typer.Argument(help="Data set with ramp sessions.")],
    out: Annotated[Path, typer.Option(help="Folder for thresholds.csv, rate_limit.json and the rest.")],
    form: Annotated[
        RateLimitForm, typer.Option(help="What the polynomial describes.")
    ] = RateLimitForm.LN_RATE,
    degree: Annotated[int, typer.Option(help="Degree of the polynomial.")] = 4,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar, no closing lines.")] = False,
) -> None:
    """Fit thresholds and the rate limit to the ramp sessions of a data set."""
    from rich.console import Console
    from rich.progress import Progress

    from analysis.calibration import calibrate, write_calibration
    from analysis.loading import load_ramp_data
    from analysis.rate_limit_curve import RateLimitOptions
    from data_schema.files import results_folder
    from data_schema.provenance import provenance_now

    options = RateLimitOptions(form=form, degree=degree)
    data = load_ramp_data(dataset)
    console = Console(stderr=True)
    off = quiet or not console.is_terminal
    with results_folder(out) as folder:
        with Progress(console=console, transient=True, disable=off) as progress:
            bar = progress.add_task("fitting thresholds", total=None)
            result = calibrate(
                data, options, lambda done, total: progress.update(bar, completed=done, total=total)
            )
        write_calibration(result, folder, provenance_now(inputs={"dataset": data.sha256}))
        _write_figures(result, folder)
    for warning in result.warnings:
        print(f"evenlight: warning: {warning}", file=sys.stderr)
    if not quiet:
        kind = "simulated participants" if data.simulated else "participants"
        typer.echo(
            f"{len(result.thresholds)} thresholds of {len(data.participant_ids)} {kind}, and a rate limit of "
            f"degree {degree}, in {out}"
        )


def _write_figures(calibration: Calibration, folder: Path) -> None:
    """Write the figures of a calibration."""
    from analysis.calibration_figures import write_figures

    write_figures(calibration, folder)
