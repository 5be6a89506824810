"""The command `plan`: how many participants and trials an experiment takes, by simulation."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import Field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.analysis.plans.questions import QUESTIONS, people_in_words, whole_numbers
from evenlight.analysis.wording import percent, sentence
from evenlight.cluster import ClusterOption, opened_map
from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS
from evenlight.data_schema.errors import InputError
from evenlight.option_panels import (
    ForceOption,
    QuietOption,
    asked,
    computation,
    expert,
    output,
    words_and_files,
)
from evenlight.progress import counted, shown_progress

if TYPE_CHECKING:
    from evenlight.analysis.plans.plan import Plan
    from evenlight.data_schema.analysis_results import ViewingPlanRow

OF_TASK = {
    task: [*(own.name for own in fields(kind)), *(["thorough"] if "thorough" in kind.efforts else [])]
    for task, kind in QUESTIONS.items()
}
RAMP_PANEL, VIEWING_PANEL = "Of ramp, a calibration", "Of rating, comparison and search"
USUAL = inspect.Parameter.POSITIONAL_OR_KEYWORD
KINDS = {"int": int, "str": str, "tuple[str, ...]": list[str]}
FOR_EXPERTS = {"agreement", "display", "locations", "margin", "ratio", "repetitions", "sequences", "share"}
FOR_EXPERTS |= {"analysis", "spread", "undetected"}
SLOW = ("ramp", "search")  # shared among processes
Columns = Mapping[str, Callable[[Any], str]]  # of the printed table: heading, and how a row fills it


def _power_interval(row: ViewingPlanRow) -> str:
    return f"{100 * row.power_low:.0f} to {percent(row.power_high, 0)}" if row.runs else "exact"


RAMP_COLUMNS: Columns = {
    "design": lambda row: str(row.design),
    "trials": lambda row: str(row.trials_per_level),
    "people": lambda row: str(row.participants),
    "min each": lambda row: f"{row.minutes:.0f}",
    "hours": lambda row: f"{row.total_hours:.0f}",
    "±band": lambda row: percent(row.half_width),
    "80 % within": lambda row: percent(row.half_width_assured),
    "true error": lambda row: percent(row.error),
    "bias": lambda row: f"{100 * row.bias:+.1f} %",
    "people needed": people_in_words,
}
VIEWING_COLUMNS: Columns = {
    "test": lambda row: str(row.test),
    "people": lambda row: str(row.participants),
    "power": lambda row: percent(row.power),
    "(95 %)": _power_interval,
    "type I error": lambda row: percent(row.type_i_error),
}


def plan(
    task: Annotated[
        str,
        typer.Argument(
            help="Which experiment: ramp (a calibration), rating, comparison or search.",
            autocompletion=words_and_files(*QUESTIONS),
        ),
    ],
    out: Annotated[Path, output(help="Folder for plan.csv, plan.json and plan.png.")],
    participants: Annotated[
        str | None, asked(metavar="N,N", help="Numbers of participants to try, such as 10,20,40.")
    ] = None,
    seed: Annotated[int, expert(help="Seed of the random numbers.")] = 1,
    quick: Annotated[
        bool,
        computation(
            "--quick",
            help="In half of the time or less, but rough: participants needed may be off by half.",
        ),
    ] = False,
    thorough: Annotated[
        bool,
        expert(
            "--thorough",
            help="ramp: simulate three times as many people; ramp and search: twice the experiments.",
        ),
    ] = False,
    preregister: Annotated[
        Path | None,
        output(
            metavar="FILE",
            help="Write the plan of one design as a pre-registration, too. As preregistration.md in the data "
            "set, `fit` and `analyze` compare the run with it.",
        ),
    ] = None,
    cluster: ClusterOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
    **options: Any,
) -> None:
    """Plan an experiment: how many participants and trials does it need? Found by simulation."""
    given = {name: value for name, value in options.items() if value is not None}
    design = given.pop("design", None) if preregister and task != "ramp" else None
    _refuse_options_of_others(task, [*given, "thorough"] if thorough else given)
    if quick and thorough:
        raise InputError("--quick and --thorough cannot be had together; give one of them")
    if "analysis" in given and not preregister:
        raise InputError("--analysis is of a pre-registration; give it together with --preregister FILE")
    from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
    from evenlight.analysis.plans.preregistration import design_to_register, register
    from evenlight.analysis.plans.ramp_plan import plan_ramps
    from evenlight.analysis.plans.viewing_plan import plan_viewing
    from evenlight.data_schema.provenance import require_seed
    from evenlight.data_schema.storage.result_folders import result_folder
    from evenlight.experiments.calibration_age import utc_now

    require_seed(seed)
    given |= {"design": design} if design else {}
    registered = design_to_register(preregister, task, given) if preregister else None
    try:
        question = QUESTIONS[task](**given)
    except ValueError as error:
        raise InputError(f"{task}: {error}") from None
    numbers = whole_numbers(participants or question.participants, "--participants", (2, MOST_PARTICIPANTS))
    runs = question.efforts["quick" if quick else "thorough" if thorough else "default"]
    planned: Callable[..., Plan] = plan_ramps if task == "ramp" else plan_viewing
    with marked_figures(QUICK_MARK if quick else ""), result_folder(out, "plan", force=force) as folder:
        with _several(task, cluster, quiet) as mapped, shown_progress(quiet) as progress:

            def told(function: Callable[..., Any], works: list[Any]) -> Iterator[Any]:
                return counted(progress, mapped(function, works), "simulating experiments", len(works))

            found = planned(question, numbers, runs, seed, told)
        found.write(folder)
    if preregister and registered:
        register(preregister, question, found, registered, utc_now())
    if not quiet:
        _print_plan(found, RAMP_COLUMNS if task == "ramp" else VIEWING_COLUMNS, out)
        if preregister:
            typer.echo(f"{preregister} is the pre-registration: fill in what stands in square brackets")


def _with_options(command: Callable[..., None]) -> inspect.Signature:
    """Return the signature of the command, with an option for each field of what is asked of the tasks."""
    declared: dict[str, dict[str, Field[Any]]] = {}
    for task, asks in QUESTIONS.items():
        for field in fields(asks):
            declared.setdefault(field.name, {})[task] = field
    added = []
    for name, by_task in declared.items():
        docs = {task: field.metadata["doc"] for task, field in by_task.items()}
        alike = "ramp" in docs or (len(docs) == len(QUESTIONS) - 1 and len(set(docs.values())) == 1)
        help_ = {doc: [task for task, own in docs.items() if own == doc] for doc in docs.values()}
        parts = (doc if alike else f"{', '.join(tasks)}: {doc}" for doc, tasks in help_.items())
        defaults = (
            field.default for field in by_task.values() if isinstance(field.default, float | int | str)
        )
        option = typer.Option(
            help=f"{sentence('; '.join(parts))}.",
            show_default=" or ".join(dict.fromkeys(map(str, defaults))) or False,
            hidden=name in FOR_EXPERTS,
            rich_help_panel=RAMP_PANEL if "ramp" in docs else VIEWING_PANEL,
        )
        (kind,) = {KINDS.get(str(field.type), float) for field in by_task.values()}
        annotation = Annotated[kind | None, option]  # type: ignore[valid-type] # known when it runs
        added.append(inspect.Parameter(name, USUAL, default=None, annotation=annotation))
    own = inspect.signature(command, eval_str=True)
    *usual, _ = own.parameters.values()
    return own.replace(parameters=[*usual[:3], *added, *usual[3:]])


def _refuse_options_of_others(task: str, given: Collection[str]) -> None:
    """Refuse a task that there is not, and options that do not go with the task."""
    if task not in OF_TASK:
        raise InputError(f"task {task!r} cannot be planned; there is {', '.join(map(repr, OF_TASK))}")
    for name in given:
        if name not in OF_TASK[task]:
            others = [other for other, names in OF_TASK.items() if name in names]
            raise InputError(
                f"--{name} goes with {' and '.join(others)}, not with {task}, which has "
                f"{', '.join(f'--{known}' for known in OF_TASK[task])}"
            )


@contextmanager
def _several(task: str, cluster: str | None, quiet: bool) -> Iterator[Callable[..., Iterable[Any]]]:
    """Yield a `map`: a cluster's if one is named, else over the cores where it takes long."""
    if cluster is not None or task not in SLOW:
        with opened_map(cluster, quiet) as mapped:
            yield mapped
        return
    import signal
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from evenlight.method.choices import AnalysisEffort

    # Ctrl-C is for the parent alone: each process would show its own traceback.
    ignored = signal.signal, (signal.SIGINT, signal.SIG_IGN)
    executor = ProcessPoolExecutor(AnalysisEffort(jobs=0).threads, get_context("spawn"), *ignored)
    try:
        yield executor.map
    finally:
        executor.shutdown(cancel_futures=True)


def _print_plan(found: Plan, columns: Columns, out: Path) -> None:
    """Print a table (headings first; the first column to the left), and last what it comes to."""
    rows: list[Sequence[str]] = [list(columns)]
    rows.extend([cell(row) for cell in columns.values()] for row in found.rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *others in rows:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        typer.echo("  ".join([first.ljust(widths[0]), *cells]))
    typer.echo(f"all with simulated participants; results in {out}")
    for words in found.said:
        typer.echo(words)


plan.__signature__ = _with_options(plan)  # type: ignore[attr-defined] # which Typer reads
