"""The command that reproduces every table and figure of the paper."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from evenlight.cluster import ClusterOption, opened_map
from evenlight.option_panels import ForceOption, QuietOption, asked, computation, expert, output
from evenlight.progress import shown_progress

REPORT = "report.html"


def reproduce(
    out: Annotated[Path, output(help="Folder for tables/, figures/, report.html and more.")],
    data: Annotated[
        Path | None,
        asked(metavar="DIR", help="Recorded data set, or folder of them, to use in place of simulated data."),
    ] = None,
    display: Annotated[
        str, expert(help="Display of the recorded calibration: a preset or a toml file.")
    ] = "varjo-xr3",
    seed: Annotated[int, expert(help="Seed of the random numbers.")] = 1,
    quick: Annotated[
        bool, computation("--quick", help="Small pictures and few frames, to see that it runs.")
    ] = False,
    cluster: ClusterOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
) -> None:
    """Make every table and figure of the paper, from simulated or recorded data, beside its own."""
    from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
    from evenlight.analysis.reproduction.reproduction import PIPELINE, ReproductionPlan, run_pipeline
    from evenlight.analysis.reproduction.reproduction_report import reproduction_result
    from evenlight.data_schema.recordings.dataset_layout import require_apart
    from evenlight.data_schema.storage.result_folders import result_folder

    plan = ReproductionPlan(seed=seed, data=data, display=display)
    if data is not None:
        require_apart(out, data)
    with (
        result_folder(out, "reproduce", force=force) as folder,
        opened_map(cluster, quiet) as mapped,
        shown_progress(quiet) as progress,
        marked_figures(QUICK_MARK if quick else ""),
    ):
        made = run_pipeline(plan.made_quick if quick else plan, folder / PIPELINE, progress.step, mapped)
        progress.step("the last step, tables and figures")
        result = reproduction_result(made)
        result.write(folder)
    for warning in result.warnings:
        print(f"evenlight: warning: {warning}", file=sys.stderr)
    if not quiet:
        typer.echo(result.summary())
        typer.echo(f"{out / REPORT} shows all tables and figures")
