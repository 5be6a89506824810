"""A run of `evenlight bench`: the subjects by name, measured one after the other, and the closing lines."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import typer

from benchmarks.compare import read_page, slower_rows
from benchmarks.measured import RunSettings, Subject
from benchmarks.results import measure_all
from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
from evenlight.cluster import LOCAL, opened_map
from evenlight.data_schema.storage.result_folders import result_folder
from evenlight.progress import shown_progress


def subjects(names: Sequence[str]) -> dict[str, Subject]:
    """Return the subjects of some names, imported only now: each brings its peers."""
    return {name: importlib.import_module(f"benchmarks.{name}_subject").measure for name in names}


def run(
    names: Sequence[str],
    out: Path,
    quick: bool,
    seed: int,
    quiet: bool,
    cluster: str | None = None,
    *,
    force: bool = False,
    compare: Path | None = None,
) -> bool:
    """Measure subjects, write their files, and say what was found; return whether nothing became slower.

    Parameters
    ----------
    names : sequence of str
        Of the subjects: "curves", "optimizer", "fit", "online", "apply", "scale".
    out : Path
        The folder of results.
    quick : bool
        Small sizes, each timed once.
    seed : int
        Of everything that is drawn.
    quiet : bool
        No progress, no closing lines.
    cluster : str, optional
        Where to measure. On this computer one subject at a time: two would slow each other down.
    force : bool, optional
        Whether to remove what else lies in the folder.
    compare : Path, optional
        A stored page: what takes more than 15 % longer than there is said.
    """
    stored = None if compare is None else read_page(compare)
    with (
        result_folder(out, "bench", force=force) as folder,
        opened_map(f"{LOCAL}:1" if cluster == LOCAL else cluster, quiet) as mapped,
        shown_progress(quiet) as progress,
        marked_figures(QUICK_MARK if quick else ""),
    ):
        settings = RunSettings(quick, seed)
        if cluster is None:  # else nobody hears what a worker says
            settings = replace(settings, say=lambda words: progress.step(f"measuring: {words}"))
        else:
            progress.step("measuring on the cluster")
        measured = measure_all(subjects(names), settings, folder, mapped)
    slower = [] if stored is None else slower_rows(read_page(out / "benchmarks.md"), stored)
    for line in slower:
        typer.echo(line)
    if quiet:
        return len(slower) < 2
    for one in measured:
        typer.echo(one.lead)
    missed = sum(claim.met is False for one in measured for claim in one.claims)
    if missed:
        typer.echo(f"{missed} of the targets missed; the page says by how much")
    typer.echo(f"{out / 'benchmarks.md'} has the tables and figures")
    return len(slower) < 2
