"""The command that measures speed against error, with the benchmarks of a checkout."""

from __future__ import annotations

import enum
import importlib
import sys
from pathlib import Path
from typing import Annotated

import typer

from evenlight.cluster import ClusterOption
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.option_panels import ForceOption, QuietOption, expert

CHECKOUT = Path(__file__).resolve().parents[1]


class SubjectName(enum.Enum):
    """What `evenlight bench` measures."""

    CURVES = "curves"
    OPTIMIZER = "optimizer"
    FIT = "fit"
    ONLINE = "online"
    APPLY = "apply"
    SCALE = "scale"
    ALL = "all"


def bench(
    subject: Annotated[
        SubjectName,
        typer.Argument(help="What to measure: curves, optimizer, fit, online, apply, scale, or all."),
    ],
    out: Annotated[Path, typer.Option(help="Folder for benchmarks.md, tables and figures.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Small sizes, each timed once: rough figures.")
    ] = False,
    seed: Annotated[int, expert(help="Seed of the random numbers.")] = 1,
    compare: Annotated[
        Path | None,
        typer.Option(metavar="PAGE", help="Stored benchmarks.md: tell what takes over 15 % longer now."),
    ] = None,
    cluster: ClusterOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
) -> None:
    """Measure how fast and how exact Evenlight is on this computer. It needs a checkout."""
    require_seed(seed)
    if not (CHECKOUT / "benchmarks" / "__init__.py").exists():
        raise InputError(
            "the benchmarks are not part of the installed package; clone Evenlight's repository, "
            "run `make setup` there, and then `.venv/bin/evenlight bench`"
        )
    sys.path.insert(0, str(CHECKOUT))  # before a folder `benchmarks` of somebody else
    names = [n for n in SubjectName if n is not SubjectName.ALL] if subject is SubjectName.ALL else [subject]
    if cluster is not None:
        names = [n for n in names if n is not SubjectName.SCALE]
        if not names:
            raise InputError("scale starts workers of its own; leave out --cluster")
    run = importlib.import_module("benchmarks.run")
    asked = [n.value for n in names], out, quick, seed, quiet, cluster
    if not run.run(*asked, force=force, compare=compare):
        raise typer.Exit(1)
