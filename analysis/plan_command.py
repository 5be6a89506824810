"""The command that plans a calibration; who answers in its simulations is handed in."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from data_schema.errors import InputError

if TYPE_CHECKING:
    from analysis.planning import Plan, PlanRequest
    from analysis.planning_pool import SimulateRamps
    from data_schema.ramp import RampDesign

PLANNED_TASKS = ("ramp",)
STANDARD_DESIGNS = ("paper", "yes_no_targeted", "recommended", "psi_marginal")
QUICK_POOL, QUICK_DRAWS = 12, 12
TABLE, SUMMARY, FIGURE = "plan.csv", "plan.json", "plan.png"
SHOWN = (  # columns of the printed table: heading, how a row fills it
    ("design", "{0.design}"),
    ("trials", "{0.trials_per_level}"),
    ("people", "{0.participants}"),
    ("min each", "{0.minutes:.0f}"),
    ("hours", "{0.total_hours:.0f}"),
    ("±band", "{0.half_width:.1%}"),
    ("80 % within", "{0.half_width_assured:.1%}"),
    ("true error", "{0.error:.1%}"),
    ("bias", "{0.bias:+.1%}"),
    ("people needed", "{0.participants_needed_in_words}"),
)


def plan_command(simulate: SimulateRamps, load_design: Callable[[str], RampDesign]) -> Callable[..., None]:
    """Return the command `plan` for participants who are simulated elsewhere.

    Parameters
    ----------
    simulate : function
        Who answers; processes are told of it by its name, so that it must be a module's own function.
    load_design : function
        The design of a name or file.
    """

    def plan(
        task: Annotated[str, typer.Argument(help="Experiment: ramp.")],
        out: Annotated[Path, typer.Option(help="Folder for plan.csv, plan.json and plan.png.")],
        precision: Annotated[
            float, typer.Option(help="Half-width of the 95 % band of the rate limit wanted, as a share.")
        ] = 0.1,
        participants: Annotated[str, typer.Option(help="How many participants to try.")] = "5,10,20,40",
        trials: Annotated[str, typer.Option(help="How many ramps per level to try.")] = "20,40,60,100",
        design: Annotated[
            list[str] | None, typer.Option(help="Design: a preset or a toml file; may be given repeatedly.")
        ] = None,
        display: Annotated[str, typer.Option(help="Display: a preset or a toml file.")] = "varjo-xr3",
        seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 1,
        quick: Annotated[
            bool,
            typer.Option(
                "--quick",
                help="Rough, in a third of the time: people needed are off by a quarter, typically.",
            ),
        ] = False,
        quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar, no table.")] = False,
    ) -> None:
        """Plan a calibration: trials, minutes and participants for a wanted precision, by simulation."""
        if task not in PLANNED_TASKS:
            raise InputError(
                f"task {task!r} cannot be planned; there is {', '.join(map(repr, PLANNED_TASKS))}"
            )
        from analysis.planning import PlanRequest
        from data_schema.files import results_folder
        from method.preset_files import load_display

        request = PlanRequest(
            designs={name: load_design(name) for name in design or STANDARD_DESIGNS},
            display=load_display(display),
            precision=precision,
            participants=whole_numbers(participants, "--participants"),
            trials=whole_numbers(trials, "--trials"),
            seed=seed,
        )
        if quick:
            request = dataclasses.replace(request, pool=QUICK_POOL, draws=QUICK_DRAWS)
        with results_folder(out) as folder:
            plan = _planned(request, simulate, quiet)
            write_plan(folder, plan)
        if not quiet:
            _tell(plan, out)

    return plan


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """Return the numbers of a list such as "5,10,20", each once, in order.

    >>> whole_numbers("20, 5,20", "--participants")
    (5, 20)
    """
    try:
        return tuple(sorted({int(part) for part in text.split(",")}))
    except ValueError:
        raise InputError(
            f"{option} takes whole numbers with commas between them, such as 5,10,20; got {text!r}"
        ) from None


def write_plan(folder: Path, plan: Plan) -> None:
    """Write `plan.csv`, `plan.json` and `plan.png`."""
    from analysis.figure_style import write_png
    from analysis.planning import PlanRow, in_words
    from analysis.planning_figure import planning_figure
    from data_schema.mapping import mapping_from_record
    from data_schema.provenance import provenance_now, sha256_of_record
    from data_schema.text_files import write_json, write_rows

    request = plan.request
    inputs = {f"design {name}": sha256_of_record(design) for name, design in request.designs.items()}
    inputs["display"] = sha256_of_record(request.display)
    write_rows(folder / TABLE, PlanRow, plan.rows)
    content: dict[str, Any] = {
        "simulated": True,
        "precision": request.precision,
        "pool": request.pool,
        "draws": request.draws,
        "in_words": list(in_words(plan)),
        "best": {task.value: row and mapping_from_record(row) for task, row in plan.best.items()},
        "rows": [mapping_from_record(row) for row in plan.rows],
        "designs": {name: mapping_from_record(design) for name, design in request.designs.items()},
        "provenance": mapping_from_record(provenance_now(request.seed, inputs)),
    }
    write_json(folder / SUMMARY, content)
    write_png(folder / FIGURE, planning_figure(plan))


def _planned(request: PlanRequest, simulate: SimulateRamps, quiet: bool) -> Plan:
    """Return the plan, its work shared among processes, under a progress bar."""
    from rich.console import Console
    from rich.progress import Progress

    from analysis.planning import plan_ramps

    console = Console(stderr=True)
    off = quiet or not console.is_terminal
    with _processes() as mapped, Progress(console=console, transient=True, disable=off) as progress:
        bar = progress.add_task("simulating experiments", total=None)
        return plan_ramps(
            request,
            simulate,
            mapped,
            lambda done, total: progress.update(bar, completed=done, total=total),
        )


@contextmanager
def _processes() -> Iterator[Callable[..., Any]]:
    """Yield a `map` over as many processes as there are cores; the plain one where there is one core."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores < 2:
        yield map
        return
    executor = ProcessPoolExecutor(cores, mp_context=get_context("spawn"), initializer=_single_threaded)
    try:
        yield executor.map
    finally:
        executor.shutdown(cancel_futures=True)


def _single_threaded() -> None:
    """Leave interruptions to the parent: each process would show its own traceback."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _tell(plan: Plan, out: Path) -> None:
    """Print the table and what it comes to."""
    from analysis.planning import in_words

    rows = [[heading for heading, _ in SHOWN]]
    rows += [[cell.format(row) for _, cell in SHOWN] for row in plan.rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(SHOWN))]
    for row in rows:
        first, *others = (cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in
                          enumerate(zip(row, widths, strict=True)))  # fmt: skip
        typer.echo("  ".join([first, *others]))
    for sentence in in_words(plan):
        typer.echo(sentence)
    typer.echo(f"all with simulated participants; results in {out}")
