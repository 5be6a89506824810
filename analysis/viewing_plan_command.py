"""`evenlight plan rating`, `comparison` and `search`: what their options mean, and what they write."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from evenlight.analysis.plans.viewing_plan import Truth, ViewingPlan, ViewingRequest

TABLE, SUMMARY, FIGURE = "plan.csv", "plan.json", "plan.png"
PARTICIPANTS = {"rating": "10,17,25,40,60", "comparison": "17,30,50,70,100,150", "search": "8,12,17,25"}
RUNS = {"rating": 2000, "comparison": 2000, "search": 150}  # a fit of search times takes its time
QUICKER = 4  # so many fewer experiments with --quick
SHOWN = (  # columns of the printed table: heading, how a row fills it
    ("test", "{0.test}"),
    ("people", "{0.participants}"),
    ("power", "{0.power:.1%}"),
    ("(95 %)", "{0.power_low:.0%} to {0.power_high:.0%}"),
    ("type I error", "{0.type_i_error:.1%}"),
)


def viewing_request(
    task: str, truth: Mapping[str, Any], participants: tuple[int, ...], settings: Mapping[str, Any]
) -> ViewingRequest:
    """Return what is to be planned.

    Parameters
    ----------
    task : str
        "rating", "comparison" or "search".
    truth : mapping of str to float or int
        What is true of people, as far as it was said.
    participants : tuple of int
        How many are tried.
    settings : mapping of str to float or int
        Power and seed, as far as they were said, and "runs".
    """
    from evenlight.analysis.plans.viewing_plan import ViewingRequest

    return ViewingRequest(task, _truth(task, truth), participants, **settings)


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


def runs_of(task: str, quick: bool) -> int:
    """Return how many experiments are simulated.

    >>> runs_of("rating", quick=True)
    500
    """
    return RUNS[task] // (QUICKER if quick else 1)


def planned(
    request: ViewingRequest, mapped: Callable[..., Iterable[Any]], report: Callable[[int, int], None]
) -> ViewingPlan:
    """Return a plan, its work shared among what `mapped` stands for."""
    from evenlight.analysis.plans.viewing_plan import plan_viewing

    return plan_viewing(request, mapped, report)


def write_viewing_plan(folder: Path, plan: ViewingPlan) -> None:
    """Write `plan.csv`, `plan.json` and `plan.png`."""
    from evenlight.analysis.figure_style import write_png
    from evenlight.analysis.plans.viewing_plan import in_words
    from evenlight.analysis.plans.viewing_plan_figure import viewing_plan_figure
    from evenlight.data_schema.mapping import mapping_from_record
    from evenlight.data_schema.plan import ViewingPlanRow
    from evenlight.data_schema.provenance import provenance_now
    from evenlight.data_schema.text_files import write_json, write_rows

    request = plan.request
    write_rows(folder / TABLE, ViewingPlanRow, plan.rows)
    content: dict[str, Any] = {
        "task": request.task,
        "simulated": True,
        "power": request.power,
        "runs": request.runs,
        "truth": dataclasses.asdict(request.truth),  # type: ignore[call-overload] # every truth is a record
        "truth_in_words": request.truth.in_words,
        "in_words": list(in_words(plan)),
        "rows": [mapping_from_record(row) for row in plan.rows],
        "provenance": mapping_from_record(provenance_now(request.seed)),
    }
    write_json(folder / SUMMARY, content)
    write_png(folder / FIGURE, viewing_plan_figure(plan))


def tell_viewing_plan(plan: ViewingPlan, out: Path) -> None:
    """Print the table, what was assumed, and what it comes to."""
    from evenlight.analysis.plans.viewing_plan import in_words

    rows = [[heading for heading, _ in SHOWN]]
    rows += [[cell.format(row) if row.runs or heading != "(95 %)" else "exact" for heading, cell in SHOWN]
             for row in plan.rows]  # fmt: skip
    widths = [max(len(row[k]) for row in rows) for k in range(len(SHOWN))]
    for row in rows:
        first, *others = (cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in
                          enumerate(zip(row, widths, strict=True)))  # fmt: skip
        typer.echo("  ".join([first, *others]))
    typer.echo(f"assumed: {plan.request.truth.in_words}")
    for sentence in in_words(plan):
        typer.echo(sentence)
    typer.echo(f"all with simulated participants; results in {out}")
