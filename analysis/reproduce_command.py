"""The command that reproduces every table and figure of the paper."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.cluster import ClusterOption, opened_map
from evenlight.option_panels import asked, computation, output
from evenlight.progress import shown_progress

if TYPE_CHECKING:
    from evenlight.analysis.reproduction.repeated_sets import ViewingRepeater
    from evenlight.analysis.reproduction.reproduction import DatasetSimulator, ReproductionPlan

    Simulators = tuple[DatasetSimulator, ViewingRepeater]

REPORT = "report.html"
QUICK = {
    "size": (160, 90),
    "frames_per_second": 2.0,
    "walk_frames_per_second": 2.0,
    "picture_size": (160, 90),
    "picture_frames_per_second": 1.0,
    "sets": 10,
    "quick": True,
}


def reproduce_command(simulators: Simulators) -> Callable[..., None]:
    """Return the command `reproduce`; the participants who answer it are simulated elsewhere.

    Parameters
    ----------
    simulators : (DatasetSimulator, ViewingRepeater)
        Write data sets of simulated participants, and return the trials of many.
    """

    def reproduce(
        out: Annotated[Path, output(help="Folder for tables/, figures/, report.html and more.")],
        data: Annotated[
            Path | None,
            asked(
                metavar="DIR", help="Recorded data set, or folder of them, to use in place of simulated data."
            ),
        ] = None,
        display: Annotated[
            str, asked(help="Display of the recorded calibration: a preset or a toml file.")
        ] = "varjo-xr3",
        seed: Annotated[int, computation(help="Seed of the random numbers.")] = 1,
        quick: Annotated[
            bool, computation("--quick", help="Small pictures and few frames, to see that it runs.")
        ] = False,
        cluster: ClusterOption = None,
        quiet: Annotated[
            bool, typer.Option("--quiet", help="Print no progress and no closing lines.")
        ] = False,
    ) -> None:
        """Make every table and figure of the paper, from simulated or recorded data, beside its own."""
        from evenlight.analysis.reproduction.reproduction import ReproductionPlan

        smaller = QUICK if quick else {}
        plan = ReproductionPlan(seed=seed, data=data, display=display, **smaller)  # type: ignore[arg-type] # a table of options of several types
        lead, warnings = _made(plan, simulators, cluster, out, quiet)
        for warning in warnings:
            print(f"evenlight: warning: {warning}", file=sys.stderr)
        if not quiet:
            typer.echo(lead)
            typer.echo(f"{out / REPORT} shows all tables and figures")

    return reproduce


def _made(
    plan: ReproductionPlan, simulators: Simulators, cluster: str | None, out: Path, quiet: bool
) -> tuple[str, tuple[str, ...]]:
    """Run the pipeline, write everything, and return what came out and the warnings."""
    from evenlight.analysis.earlier_results import earlier_files, remove_stale
    from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
    from evenlight.analysis.reproduction.reproduction import PIPELINE, run_pipeline
    from evenlight.analysis.reproduction.reproduction_report import SUMMARY, warnings_of, write_reproduction
    from evenlight.data_schema.recordings.dataset_layout import require_apart
    from evenlight.data_schema.storage.whole_files import require_sealed, results_folder, seal

    require_sealed(out / PIPELINE, "reproduction")
    if plan.data is not None:
        require_apart(out, plan.data)
    before = earlier_files(out / SUMMARY)
    with (
        results_folder(out, replacing=(PIPELINE,)) as folder,
        opened_map(cluster, quiet) as mapped,
        shown_progress(quiet) as progress,
        marked_figures(QUICK_MARK if plan.quick else ""),
    ):
        made = run_pipeline(plan, simulators, folder / PIPELINE, progress.step, mapped)
        seal(folder / PIPELINE)
        progress.step("the last step, tables and figures")
        lead, files = write_reproduction(made, folder)
    remove_stale(out, before, files)
    return lead, warnings_of(made)
