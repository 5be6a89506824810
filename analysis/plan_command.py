"""The command that plans an experiment; who answers in simulated calibrations is handed in."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from evenlight.analysis.calibration.planning import Plan, PlanRequest
    from evenlight.analysis.calibration.planning_pool import SimulateRamps
    from evenlight.data_schema.ramp import RampDesign

OPTIONS_OF_TASK = {  # beside those that go with every task
    "ramp": ("precision", "trials", "design", "display"),
    "rating": ("power", "difference", "spread", "agreement", "sequences"),
    "comparison": ("power", "share", "margin", "spread", "repetitions", "sequences"),
    "search": ("power", "ratio", "undetected", "margin", "spread", "locations"),
}
RAMP_PARTICIPANTS, RAMP_TRIALS = "5,10,20,40", "20,40,60,100"
DISPLAY = "varjo-xr3"
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
        task: Annotated[str, typer.Argument(help="Experiment: ramp, rating, comparison or search.")],
        out: Annotated[Path, typer.Option(help="Folder for plan.csv, plan.json and plan.png.")],
        participants: Annotated[
            str | None, typer.Option(help="How many participants to try, such as 10,20,40.")
        ] = None,
        precision: Annotated[
            float | None,
            typer.Option(
                help="ramp: half-width of the 95 % band of the rate limit wanted, as a share [0.1]."
            ),
        ] = None,
        trials: Annotated[str | None, typer.Option(help="ramp: how many ramps per level to try.")] = None,
        design: Annotated[
            list[str] | None,
            typer.Option(help="ramp: a preset or a toml file of a design; may be given repeatedly."),
        ] = None,
        display: Annotated[
            str | None, typer.Option(help="ramp: a preset or a toml file of a display [varjo-xr3].")
        ] = None,
        power: Annotated[float | None, typer.Option(help="All but ramp: power wanted [0.8].")] = None,
        difference: Annotated[
            float | None,
            typer.Option(help="rating: true mean difference in rating points [the paper's 0.46]."),
        ] = None,
        share: Annotated[
            float | None, typer.Option(help="comparison: true share choosing ours [0.5 + margin].")
        ] = None,
        ratio: Annotated[
            float | None, typer.Option(help="search: median time with ours over the baseline's [0.8].")
        ] = None,
        margin: Annotated[
            float | None,
            typer.Option(
                help="What counts as none: distance of a share from 0.5 [0.15], or ratio of times [1.25]."
            ),
        ] = None,
        spread: Annotated[
            float | None,
            typer.Option(help="How people differ: rating points [0.8], log-odds [0.5] or ln ratio [0.15]."),
        ] = None,
        agreement: Annotated[
            float | None, typer.Option(help="rating: correlation of a person's differences [0.25].")
        ] = None,
        undetected: Annotated[
            float | None, typer.Option(help="search: share of undetected rings, baseline [0.1].")
        ] = None,
        sequences: Annotated[int | None, typer.Option(help="rating, comparison: how many [4].")] = None,
        repetitions: Annotated[int | None, typer.Option(help="comparison: of each sequence [1].")] = None,
        locations: Annotated[
            int | None, typer.Option(help="search: brightened, or dimmed ones [10].")
        ] = None,
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
        """Plan an experiment: participants for a wanted precision or power, by simulation."""
        options = {
            "precision": precision, "trials": trials, "design": design, "display": display, "power": power,
            "difference": difference, "share": share, "ratio": ratio, "margin": margin, "spread": spread,
            "agreement": agreement, "undetected": undetected, "sequences": sequences,
            "repetitions": repetitions, "locations": locations,
        }  # fmt: skip
        given = {name: value for name, value in options.items() if value is not None}
        _refuse_options_of_others(task, given)
        if task == "ramp":
            request = _ramp_request(given, participants or RAMP_PARTICIPANTS, seed, load_design)
            if quick:
                request = dataclasses.replace(request, pool=QUICK_POOL, draws=QUICK_DRAWS)
            _plan_ramps(request, simulate, out, quiet)
        else:
            _plan_viewing(task, given, participants, {"seed": seed, "quick": quick, "quiet": quiet}, out)

    return plan


def _refuse_options_of_others(task: str, given: Collection[str]) -> None:
    """Refuse a task that there is not, and options that do not go with the task."""
    if task not in OPTIONS_OF_TASK:
        raise InputError(f"task {task!r} cannot be planned; there is {', '.join(map(repr, OPTIONS_OF_TASK))}")
    own = OPTIONS_OF_TASK[task]
    for name in given:
        if name not in own:
            others = [other for other, names in OPTIONS_OF_TASK.items() if name in names]
            raise InputError(
                f"--{name} goes with {' and '.join(others)}, not with {task}, which has "
                f"{', '.join(f'--{known}' for known in own)}"
            )


def _ramp_request(
    given: Mapping[str, Any], participants: str, seed: int, load_design: Callable[[str], RampDesign]
) -> PlanRequest:
    """Return what is to be planned of a calibration."""
    from evenlight.analysis.calibration.planning import PlanRequest
    from evenlight.method.preset_files import load_display

    return PlanRequest(
        designs={name: load_design(name) for name in given.get("design") or STANDARD_DESIGNS},
        display=load_display(given.get("display", DISPLAY)),
        precision=given.get("precision", 0.1),
        participants=whole_numbers(participants, "--participants"),
        trials=whole_numbers(given.get("trials", RAMP_TRIALS), "--trials"),
        seed=seed,
    )


def _plan_ramps(request: PlanRequest, simulate: SimulateRamps, out: Path, quiet: bool) -> None:
    """Plan a calibration, write the plan and tell it."""
    from evenlight.data_schema.files import results_folder

    with results_folder(out) as folder:
        plan = _planned(request, simulate, quiet)
        write_plan(folder, plan)
    if not quiet:
        _tell(plan, out)


def _plan_viewing(
    task: str, given: dict[str, Any], participants: str | None, settings: Mapping[str, Any], out: Path
) -> None:
    """Plan a viewing experiment, write the plan and tell it."""
    from evenlight.analysis import viewing_plan_command as viewing
    from evenlight.data_schema.files import results_folder

    truth = dict(given)
    wanted = {"power": truth.pop("power")} if "power" in truth else {}
    request = viewing.viewing_request(
        task,
        truth,
        whole_numbers(participants or viewing.PARTICIPANTS[task], "--participants"),
        {**wanted, "seed": settings["seed"], "runs": viewing.runs_of(task, settings["quick"])},
    )
    quiet = settings["quiet"]
    several = _processes() if task == "search" else nullcontext(map)  # the others take seconds
    with results_folder(out) as folder:
        with several as mapped, _bar(quiet) as report:
            plan = viewing.planned(request, mapped, report)
        viewing.write_viewing_plan(folder, plan)
    if not quiet:
        viewing.tell_viewing_plan(plan, out)


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
    from evenlight.analysis.calibration.planning import in_words
    from evenlight.analysis.calibration.planning_figure import planning_figure
    from evenlight.analysis.figure_style import write_png
    from evenlight.data_schema.mapping import mapping_from_record
    from evenlight.data_schema.plan import RampPlanRow
    from evenlight.data_schema.provenance import provenance_now, sha256_of_record
    from evenlight.data_schema.text_files import write_json, write_rows

    request = plan.request
    inputs = {f"design {name}": sha256_of_record(design) for name, design in request.designs.items()}
    inputs["display"] = sha256_of_record(request.display)
    write_rows(folder / TABLE, RampPlanRow, plan.rows)
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
    from evenlight.analysis.calibration.planning import plan_ramps

    with _processes() as mapped, _bar(quiet) as report:
        return plan_ramps(request, simulate, mapped, report)


@contextmanager
def _bar(quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Yield what moves a progress bar: what is done, and of how much."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    off = quiet or not console.is_terminal
    with Progress(console=console, transient=True, disable=off) as progress:
        bar = progress.add_task("simulating experiments", total=None)
        yield lambda done, total: progress.update(bar, completed=done, total=total)


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
    from evenlight.analysis.calibration.planning import in_words

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
