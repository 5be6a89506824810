"""The command that makes the statistics of whatever tasks a data set holds."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.recordings.session import BUILT_IN_TASKS
from evenlight.option_panels import (
    ForceOption,
    PreregisteredOption,
    QuietOption,
    asked,
    expert,
    output,
    words_and_files,
)
from evenlight.progress import shown_progress

if TYPE_CHECKING:
    from evenlight.analysis.dataset_findings import AnalysisOptions, DatasetFindings

REPORT, SUMMARY = "report.html", "analysis.json"


def analyze(
    dataset: Annotated[
        Path,
        typer.Argument(
            help="Data set with sessions: ramp, rating, comparison, search, or tasks of your own."
        ),
    ],
    out: Annotated[Path, output(help="Folder for the tables, figures and report.html.")],
    task: Annotated[
        list[str] | None,
        asked(
            metavar="TASK",
            help="Analyse only this task. Otherwise all that the data set holds.",
            autocompletion=words_and_files(*BUILT_IN_TASKS),
        ),
    ] = None,
    margin: Annotated[
        float, expert(help="Comparison: a share of choices within 0.5 ± this counts as no difference.")
    ] = 0.15,
    slowing: Annotated[
        float, expert(help="Search: times that are longer by less than this share count as no slowing.")
    ] = 0.25,
    seed: Annotated[int, expert(help="Seed of the random numbers.")] = 1,
    preregistered: PreregisteredOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
) -> None:
    """Compute the statistics of a data set, with figures and a report: every task that it holds."""
    from evenlight.analysis.dataset_findings import AnalysisOptions
    from evenlight.data_schema.errors import ArgumentError
    from evenlight.data_schema.recordings.dataset_layout import require_apart
    from evenlight.data_schema.recordings.session import TASKS
    from evenlight.data_schema.storage.result_folders import result_folder

    for name in task or ():
        if name not in TASKS:
            raise ArgumentError("task", f"must be one of {', '.join(TASKS)}, got {name!r}")
    require_apart(out, dataset)
    options = AnalysisOptions(
        seed=seed,
        margin=margin,
        slowing=slowing,
        tasks=tuple(dict.fromkeys(task or ())),
        preregistered=preregistered,
    )
    with result_folder(out, "analyze", force=force) as folder:
        found = _analyze_dataset(dataset, options, folder, quiet)
        _write(found, options, folder)
    for warning in found.warnings:
        print(f"evenlight: warning: {warning}", file=sys.stderr)
    if not quiet:
        for line in found.departures:
            typer.echo(line)
        for findings in found.findings.values():
            typer.echo(f"{findings.name}: {findings.lead}")
        if any(found.simulated.values()):
            typer.echo("simulated participants answered: this says nothing about people")
        typer.echo(f"{out / REPORT} has all results")


def _analyze_dataset(dataset: Path, options: AnalysisOptions, folder: Path, quiet: bool) -> DatasetFindings:
    """Return what the data set shows, under a progress line."""
    from evenlight.analysis.dataset_findings import find_in_dataset

    with shown_progress(quiet) as progress:
        return find_in_dataset(dataset, options, folder, lambda task: progress.step(f"analysing {task}"))


def _write(found: DatasetFindings, options: AnalysisOptions, folder: Path) -> None:
    """Write the tables and figures of each task, the report and the summary."""
    from evenlight.analysis.dataset_findings import dataset_report
    from evenlight.analysis.report import write_report
    from evenlight.data_schema.analysis_results import AnalysisSummary
    from evenlight.data_schema.provenance import provenance_now
    from evenlight.data_schema.storage.result_folders import files_in
    from evenlight.data_schema.storage.text_files import write_json_record

    origin = provenance_now(seed=options.seed, inputs=found.inputs)
    for findings in found.findings.values():
        findings.write(folder)
    simulated = any(found.simulated.values())
    leads = {task: findings.lead for task, findings in found.findings.items()}
    write_report(folder / REPORT, dataset_report(found, origin))
    files = (*files_in(folder), SUMMARY)
    said = leads, found.refused, found.warnings
    summary = AnalysisSummary(simulated, *said, origin, files, found.roll, found.departures)
    write_json_record(folder / SUMMARY, summary)
