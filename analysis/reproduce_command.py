"""The command that reproduces every table and figure of the paper."""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.progress import shown_progress

if TYPE_CHECKING:
    from evenlight.analysis.reproduction.reproduction import DatasetSimulator, ReproductionPlan

REPORT = "report.html"
QUICK = {"size": (160, 90), "frames_per_second": 2.0, "walk_frames_per_second": 2.0, "quick": True}


def reproduce_command(simulate: DatasetSimulator) -> Callable[..., None]:
    """Return the command `reproduce`; the participants who answer it are simulated elsewhere.

    Parameters
    ----------
    simulate : DatasetSimulator
        Writes data sets of simulated participants.
    """

    def reproduce(
        out: Annotated[Path, typer.Option(help="Folder for tables/, figures/, report.html and the rest.")],
        data: Annotated[
            Path | None,
            typer.Option(help="Data set, or folder with several results: takes the place of simulated data."),
        ] = None,
        display: Annotated[
            str, typer.Option(help="Display of recorded calibrations: a preset or a toml file.")
        ] = "varjo-xr3",
        seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 1,
        quick: Annotated[
            bool, typer.Option("--quick", help="Small pictures and few frames: to see that it runs.")
        ] = False,
        quiet: Annotated[bool, typer.Option("--quiet", help="No progress, no closing lines.")] = False,
    ) -> None:
        """Reproduce every table and figure of the paper, published numbers beside our own."""
        from evenlight.analysis.reproduction.reproduction import ReproductionPlan

        smaller = QUICK if quick else {}
        plan = ReproductionPlan(seed=seed, data=data, display=display, **smaller)  # type: ignore[arg-type] # a table of options of several types
        lead, warnings = _made(plan, simulate, out, quiet)
        for warning in warnings:
            print(f"evenlight: warning: {warning}", file=sys.stderr)
        if not quiet:
            typer.echo(lead)
            typer.echo(f"{out / REPORT} shows all tables and figures")

    return reproduce


def _made(
    plan: ReproductionPlan, simulate: DatasetSimulator, out: Path, quiet: bool
) -> tuple[str, tuple[str, ...]]:
    """Run the pipeline, write everything, and return what came out and the warnings."""
    from evenlight.analysis.earlier_results import earlier_files, remove_stale
    from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
    from evenlight.analysis.reproduction.reproduction import PIPELINE, STEPS, run_pipeline
    from evenlight.analysis.reproduction.reproduction_report import SUMMARY, warnings_of, write_reproduction
    from evenlight.data_schema.recordings.dataset_layout import require_apart
    from evenlight.data_schema.storage.whole_files import require_sealed, results_folder, seal

    require_sealed(out / PIPELINE, "reproduction")
    if plan.data is not None:
        require_apart(out, plan.data)
    before = earlier_files(out / SUMMARY)
    with results_folder(out, replacing=(PIPELINE,)) as folder, shown_progress(quiet) as progress:
        numbers = count(1)

        def report(step: str) -> None:
            progress.step(f"step {next(numbers)} of {STEPS + 1}, {step}")

        with marked_figures(QUICK_MARK if plan.quick else ""):
            made = run_pipeline(plan, simulate, folder / PIPELINE, report)
            seal(folder / PIPELINE)
            report("tables and figures")
            lead, files = write_reproduction(made, folder)
    remove_stale(out, before, files)
    return lead, warnings_of(made)
