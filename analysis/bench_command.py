"""The command that measures speed against error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analysis.benchmarks.subjects import SubjectName, subjects
from data_schema.seeds import require_seed


def bench(
    subject: Annotated[SubjectName, typer.Argument(help="What to measure; `all` writes the page of all.")],
    out: Annotated[Path, typer.Option(help="Folder for benchmarks.md, the tables and the figures.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Small sizes, each timed once: rough figures.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of everything that is drawn.")] = 1,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress, no closing lines.")] = False,
) -> None:
    """Measure speed against error: loss curves, optimizer, psychometric fit, online controller."""
    from rich.console import Console

    from analysis.benchmarks.measured import Pains
    from analysis.benchmarks.results import measure_all
    from data_schema.files import results_folder

    require_seed(seed)
    console = Console(stderr=True)
    console.quiet = quiet or not console.is_terminal
    with results_folder(out) as folder, console.status("measuring") as status:
        pains = Pains(quick, seed, lambda words: status.update(f"measuring: {words}"))
        measured = measure_all(subjects(subject), pains, folder)
    if not quiet:
        for one in measured:
            typer.echo(one.lead)
        missed = sum(claim.met is False for one in measured for claim in one.claims)
        if missed:
            typer.echo(f"{missed} of the targets missed; the page says by how much")
        typer.echo(f"{out / 'benchmarks.md'} has the tables and figures")
