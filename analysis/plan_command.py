"""The command `plan`: participants for a wanted precision or power. Simulated calibrations are handed in."""

from __future__ import annotations

import dataclasses
import functools
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.cluster import ClusterOption, opened_map
from evenlight.data_schema.errors import InputError
from evenlight.option_panels import asked, computation, output, words_and_files
from evenlight.progress import shown_progress

if TYPE_CHECKING:
    from evenlight.analysis.plans.ramp_plan import PlanRequest
    from evenlight.analysis.plans.ramp_plan_pool import LoadRampDesign, SimulateRamps
    from evenlight.analysis.plans.viewing_plan import Truth

ramps_option = functools.partial(typer.Option, rich_help_panel="Of ramp, a calibration")
viewings_option = functools.partial(typer.Option, rich_help_panel="Of rating, comparison and search")
OPTIONS_OF_TASK = {  # beside those that go with every task
    "ramp": ("precision", "trials", "design", "display", "thorough"),
    "rating": ("power", "difference", "spread", "agreement", "sequences"),
    "comparison": ("power", "share", "margin", "spread", "repetitions", "sequences"),
    "search": ("power", "ratio", "undetected", "margin", "spread", "locations"),
}
RAMP_PARTICIPANTS, RAMP_TRIALS = "5,10,20,40", "20,30,40,60,100"
DISPLAY = "varjo-xr3"
STANDARD_DESIGNS = ("paper", "yes_no_targeted", "recommended", "psi_marginal")
RAMP_COLUMNS = {  # of the printed table: heading, and how a row fills it
    "design": "{0.design}",
    "trials": "{0.trials_per_level}",
    "people": "{0.participants}",
    "min each": "{0.minutes:.0f}",
    "hours": "{0.total_hours:.0f}",
    "±band": "{0.half_width:.1%}",
    "80 % within": "{0.half_width_assured:.1%}",
    "true error": "{0.error:.1%}",
    "bias": "{0.bias:+.1%}",
    "people needed": "{0.participants_needed_in_words}",
}
PARTICIPANTS = {"rating": "10,17,25,40,60", "comparison": "17,30,50,70,100,150", "search": "8,12,17,25"}
RUNS = {"rating": 2000, "comparison": 2000, "search": 150}  # a fit of search times takes its time
QUICKER = 4  # so many fewer experiments with --quick
VIEWING_COLUMNS = {  # of the printed table: heading, and how a row fills it
    "test": "{0.test}",
    "people": "{0.participants}",
    "power": "{0.power:.1%}",
    "(95 %)": "{0.power_low:.0%} to {0.power_high:.0%}",
    "type I error": "{0.type_i_error:.1%}",
}


def plan_command(simulate: SimulateRamps, load_design: LoadRampDesign) -> Callable[..., None]:
    """Return the command `plan` for participants who are simulated elsewhere.

    Parameters
    ----------
    simulate : SimulateRamps
        Simulates the participants. Other processes find it by its name, so it must be a function of a module.
    load_design : LoadRampDesign
        Reads the design of a name or file.
    """

    def plan(
        task: Annotated[
            str,
            typer.Argument(
                help="Which experiment: ramp (a calibration), rating, comparison or search.",
                autocompletion=words_and_files(*OPTIONS_OF_TASK),
            ),
        ],
        out: Annotated[Path, output(help="Folder for plan.csv, plan.json and plan.png.")],
        participants: Annotated[
            str | None, asked(metavar="N,N", help="Numbers of participants to try, such as 10,20,40.")
        ] = None,
        precision: Annotated[
            float | None,
            ramps_option(
                metavar="SHARE",
                help="Wanted half-width of the rate limit's 95 % pointwise band, as a share of the limit.",
                show_default="0.1",
            ),
        ] = None,
        trials: Annotated[
            str | None,
            ramps_option(
                metavar="N,N",
                help="Numbers of ramps at each luminance level to try.",
                show_default=RAMP_TRIALS,
            ),
        ] = None,
        design: Annotated[
            list[str] | None,
            ramps_option(
                help="Design of the session: a preset or a toml file. Otherwise four presets are compared."
            ),
        ] = None,
        display: Annotated[
            str | None,
            ramps_option(help="Display to calibrate: a preset or a toml file.", show_default=DISPLAY),
        ] = None,
        power: Annotated[
            float | None, viewings_option(help="Wanted statistical power.", show_default="0.8")
        ] = None,
        difference: Annotated[
            float | None,
            viewings_option(
                metavar="POINTS",
                help="rating: the true mean difference of ratings.",
                show_default="0.46, the paper's",
            ),
        ] = None,
        share: Annotated[
            float | None,
            viewings_option(
                help="comparison: the true share of choices for ours.", show_default="0.5 + margin"
            ),
        ] = None,
        ratio: Annotated[
            float | None,
            viewings_option(
                help="search: the true median time with ours, divided by the baseline's.", show_default="0.8"
            ),
        ] = None,
        margin: Annotated[
            float | None,
            viewings_option(
                help="comparison, search: what counts as no difference. A share's distance from 0.5, or a "
                "ratio of times.",
                show_default="0.15 or 1.25",
            ),
        ] = None,
        spread: Annotated[
            float | None,
            viewings_option(
                help="Standard deviation between people: in rating points, log-odds or ln(ratio of times).",
                show_default="0.8, 0.5 or 0.15",
            ),
        ] = None,
        agreement: Annotated[
            float | None,
            viewings_option(
                help="rating: correlation between one person's differences.", show_default="0.25"
            ),
        ] = None,
        undetected: Annotated[
            float | None,
            viewings_option(help="search: share of rings not found with the baseline.", show_default="0.1"),
        ] = None,
        sequences: Annotated[
            int | None, viewings_option(help="rating, comparison: how many sequences.", show_default="4")
        ] = None,
        repetitions: Annotated[
            int | None,
            viewings_option(help="comparison: how often each sequence is shown.", show_default="1"),
        ] = None,
        locations: Annotated[
            int | None,
            viewings_option(
                help="search: places of rings where ours is brighter, and as many darker.", show_default="10"
            ),
        ] = None,
        seed: Annotated[int, computation(help="Seed of the random numbers.")] = 1,
        quick: Annotated[
            bool,
            computation(
                "--quick",
                help="In half of the time or less, but rough: participants needed may be off by half.",
            ),
        ] = False,
        thorough: Annotated[
            bool,
            computation(
                "--thorough", help="ramp: simulate three times as many people, and twice the experiments."
            ),
        ] = False,
        cluster: ClusterOption = None,
        quiet: Annotated[bool, typer.Option("--quiet", help="Print no progress and no table.")] = False,
    ) -> None:
        """Plan an experiment: how many participants and trials does it need? Found by simulation."""
        from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
        from evenlight.analysis.plans.ramp_plan import EFFORTS

        options = {
            "precision": precision, "trials": trials, "design": design, "display": display, "power": power,
            "difference": difference, "share": share, "ratio": ratio, "margin": margin, "spread": spread,
            "agreement": agreement, "undetected": undetected, "sequences": sequences,
            "repetitions": repetitions, "locations": locations, "thorough": thorough or None,
        }  # fmt: skip
        given = {name: value for name, value in options.items() if value is not None}
        _refuse_options_of_others(task, given)
        if quick and thorough:
            raise InputError("--quick and --thorough cannot be had together; give one of them")
        with marked_figures(QUICK_MARK if quick else ""):
            if task == "ramp":
                request = _ramp_request(given, participants or RAMP_PARTICIPANTS, seed, load_design)
                pool, draws = EFFORTS["quick" if quick else "thorough" if thorough else "default"]
                request = dataclasses.replace(request, pool=pool, draws=draws)
                _plan_ramps(request, simulate, cluster, out, quiet)
            else:
                settings = {"seed": seed, "quick": quick, "cluster": cluster, "quiet": quiet}
                _plan_viewing(task, given, participants, settings, out)

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
    given: Mapping[str, Any], participants: str, seed: int, load_design: LoadRampDesign
) -> PlanRequest:
    """Return what is to be planned of a calibration."""
    from evenlight.analysis.plans.ramp_plan import PlanRequest
    from evenlight.method.preset_files import load_display

    return PlanRequest(
        designs={name: load_design(name) for name in given.get("design") or STANDARD_DESIGNS},
        display=load_display(given.get("display", DISPLAY)),
        precision=given.get("precision", 0.1),
        participants=whole_numbers(participants, "--participants"),
        trials=whole_numbers(given.get("trials", RAMP_TRIALS), "--trials"),
        seed=seed,
    )


def _plan_ramps(
    request: PlanRequest, simulate: SimulateRamps, cluster: str | None, out: Path, quiet: bool
) -> None:
    """Plan a calibration, write the plan and print it."""
    from evenlight.analysis.plans.plan_files import write_plan
    from evenlight.analysis.plans.ramp_plan import PLANNED_MODEL, chance_in_words, in_words, plan_ramps
    from evenlight.data_schema.storage.whole_files import results_folder

    with results_folder(out) as folder:
        with _several("ramp", cluster, quiet) as mapped, shown_progress(quiet) as progress:
            progress.step("simulating experiments")
            plan = plan_ramps(request, simulate, mapped, progress.at)
        write_plan(folder, plan)
    if not quiet:
        rows = [[cell.format(row) for cell in RAMP_COLUMNS.values()] for row in plan.rows]
        answer, *others = in_words(plan)
        words = (PLANNED_MODEL, chance_in_words(plan), *others, answer)
        _print_plan([list(RAMP_COLUMNS), *rows], words, out)


def _plan_viewing(
    task: str, given: dict[str, Any], participants: str | None, settings: Mapping[str, Any], out: Path
) -> None:
    """Plan a viewing experiment, write the plan and print it."""
    from evenlight.analysis.plans.plan_files import write_viewing_plan
    from evenlight.analysis.plans.viewing_plan import ViewingRequest, in_words, plan_viewing
    from evenlight.data_schema.storage.whole_files import results_folder

    wanted = {"power": given.pop("power")} if "power" in given else {}
    numbers = whole_numbers(participants or PARTICIPANTS[task], "--participants")
    runs = RUNS[task] // (QUICKER if settings["quick"] else 1)
    request = ViewingRequest(task, _truth(task, given), numbers, runs=runs, seed=settings["seed"], **wanted)
    quiet = settings["quiet"]
    with results_folder(out) as folder:
        with _several(task, settings["cluster"], quiet) as mapped, shown_progress(quiet) as progress:
            progress.step("simulating experiments")
            plan = plan_viewing(request, mapped, progress.at)
        write_viewing_plan(folder, plan)
    if not quiet:
        columns = VIEWING_COLUMNS.items()
        rows = [
            [
                "exact" if heading == "(95 %)" and not row.runs else cell.format(row)
                for heading, cell in columns
            ]
            for row in plan.rows
        ]
        words = (f"assumed: {plan.request.truth.in_words}", *in_words(plan))
        _print_plan([list(VIEWING_COLUMNS), *rows], words, out)


def _truth(task: str, options: Mapping[str, Any]) -> Truth:
    """Return what is true of the people of a task."""
    if task == "rating":
        from evenlight.analysis.plans.viewing_plan_rating import RatingTruth

        return RatingTruth(**options)
    if task == "comparison":
        from evenlight.analysis.plans.viewing_plan_comparison import ComparisonTruth

        return ComparisonTruth(**options)
    from evenlight.analysis.plans.viewing_plan_search import SearchTruth

    return SearchTruth(**options)


def _print_plan(rows: Sequence[Sequence[str]], words: Iterable[str], out: Path) -> None:
    """Print a table (headings first; the first column to the left), and last what it comes to."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        others = (cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))
        typer.echo("  ".join([row[0].ljust(widths[0]), *others]))
    typer.echo(f"all with simulated participants; results in {out}")
    for sentence in words:
        typer.echo(sentence)


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """Return the numbers of a list such as "5,10,20", each once, in order.

    >>> whole_numbers("20, 5,20", "--participants")
    (5, 20)
    """
    if not re.fullmatch(" *-?[0-9]{1,9} *(, *-?[0-9]{1,9} *)*", text):
        raise InputError(
            f"{option} takes whole numbers with commas between them, such as 5,10,20; got {text!r}"
        )
    return tuple(sorted({int(part) for part in text.split(",")}))


def _several(
    task: str, cluster: str | None, quiet: bool
) -> AbstractContextManager[Callable[..., Iterable[Any]]]:
    """Return what yields a `map`: a cluster's if one is named, else over the cores where it takes long."""
    if cluster is not None:
        return opened_map(cluster, quiet)
    return _processes() if task in ("ramp", "search") else nullcontext(map)


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
