"""Claims about planning: how the answer is told, in words, files and a figure, and what is refused."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import pytest
from planned_ramps import DESIGN, simulated

from evenlight.analysis.figure_style import COLUMN, PAGE, SLIDE, FigureFormat, png_bytes
from evenlight.analysis.plan_command import RAMP_TRIALS, plan_command, whole_numbers
from evenlight.analysis.plans.plan_files import planning_figure, write_plan
from evenlight.analysis.plans.ramp_plan import (
    NOT_COMPARABLE,
    PlanRequest,
    RampPlan,
    in_words,
    plan_ramps,
)
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import (
    Procedure,
)
from evenlight.experiments.design_files import load_design
from evenlight.method.preset_files import load_display

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan() -> RampPlan:
    """Eight people and six experiments of each size: enough to be told of."""
    small = {"participants": (4, 8), "trials": (15, 30), "pool": 8, "draws": 6}
    return plan_ramps(PlanRequest({"made": DESIGN}, load_display("varjo-xr3"), **small), simulated)


def test_people_needed_are_told_with_their_interval(plan: RampPlan) -> None:
    row = dataclasses.replace(
        plan.rows[0], participants_needed=33, participants_needed_low=26, participants_needed_high=40
    )
    assert row.participants_needed_in_words == "33 (26 to 40)"
    far = dataclasses.replace(row, participants_needed=None, participants_needed_high=None)
    assert far.participants_needed_in_words == "above 1000 (26 to above 1000)"
    beyond = dataclasses.replace(far, participants_needed_low=None)
    assert beyond.participants_needed_in_words == "above 1000"


@pytest.mark.parametrize("text", ["", "five", "5;10", "5,,10", "5.5"])
def test_numbers_that_are_none_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError, match="--trials takes whole numbers"):
        whole_numbers(text, "--trials")


def test_an_unknown_design_is_refused_by_its_name(command, tmp_path: Path) -> None:
    result = command("plan", "ramp", "--design", "papper", "--out", tmp_path / "out")
    assert result.code == 2
    assert result.err.count("\n") == 1
    assert "papper" in result.err
    assert not (tmp_path / "out").exists()


def test_a_task_that_there_is_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="task 'reading' cannot be planned; there is 'ramp', 'rating'"):
        plan_command(simulated, lambda name: DESIGN)("reading", out=tmp_path / "out")


def test_the_files_say_that_they_are_simulated_and_hold_every_row(plan: RampPlan, tmp_path: Path) -> None:
    write_plan(tmp_path, plan)
    with (tmp_path / "plan.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(plan.rows) == 4
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["simulated"] is True
    assert content["rows"][0]["half_width"] == float(rows[0]["half_width"])
    assert content["provenance"]["seed"] == 1
    assert (tmp_path / "plan.png").read_bytes()[:4] == b"\x89PNG"


def test_the_answer_comes_first_in_the_file_with_what_it_rests_on(plan: RampPlan, tmp_path: Path) -> None:
    write_plan(tmp_path, plan)
    content = json.loads((tmp_path / "plan.json").read_text())
    assert next(iter(content)) == "in_words"
    assert content["in_words"] == list(in_words(plan))
    assert content["effort"] == "other"  # 8 people, and 6 experiments of each size
    assert "8 simulated participants and 6 experiments per size" in content["monte_carlo_error"]
    assert "faster than the joint model" in content["model"]
    assert PlanRequest({}, load_display("varjo-xr3")).effort == "default"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["ramp", "--quick", "--thorough"], "--quick and --thorough cannot be had together"),
        (["rating", "--thorough"], "--thorough goes with ramp, not with rating"),
    ],
)
def test_efforts_that_do_not_go_together_are_refused(
    command, tmp_path: Path, words: list[str], message: str
) -> None:
    result = command("plan", *words, "--out", tmp_path / "out")
    assert (result.code, result.err.count("\n")) == (2, 1)
    assert message in result.err
    assert not (tmp_path / "out").exists()


def test_the_closing_words_name_the_cheapest_row_that_is_precise_enough(plan: RampPlan) -> None:
    loose = RampPlan(
        dataclasses.replace(plan.request, precision=2.0),
        tuple(dataclasses.replace(row, meets=True) for row in plan.rows),
    )
    cheapest = min(plan.rows, key=lambda row: row.total_hours)
    (words,) = in_words(loose)
    assert words.startswith(f"{cheapest.participants} participants x {cheapest.trials_per_level} trials")
    assert words.endswith(f"; 200 % takes {cheapest.participants_needed_in_words} participants")
    none = RampPlan(plan.request, tuple(dataclasses.replace(row, meets=False) for row in plan.rows))
    assert "no number tried gives ΔL(L) to 10 %" in in_words(none)[0]


def test_the_answer_is_the_recommended_design_as_the_guides_run_it(plan: RampPlan) -> None:
    """In these rows it needs 33 people with the 30 trials per level of its file, and fewer with 60."""
    design = load_design("recommended")
    assert design.trials_per_level in PlanRequest({}, load_display("varjo-xr3")).trials
    assert str(design.trials_per_level) in RAMP_TRIALS.split(",")
    request = dataclasses.replace(plan.request, designs={"recommended": design}, trials=(30, 60))
    rows = tuple(
        dataclasses.replace(
            row, design="recommended", trials_per_level=trials, minutes=100.4, participants_needed=needed,
            participants_needed_low=needed - 7, participants_needed_high=needed + 7,
        )
        for row in plan.rows
        for trials, needed in ((60, 23), (30, 33))
    )  # fmt: skip
    answer, *others = in_words(RampPlan(request, rows))
    assert answer == (
        "recommended: 33 (26 to 40) participants for ΔL(L) to 10 %, each with `evenlight run ramp --design "
        "recommended` (30 trials per level, 100 min)"
    )
    assert others == list(in_words(RampPlan(plan.request, rows)))  # a design of another name


def test_two_tasks_are_not_set_off_against_each_other(plan: RampPlan) -> None:
    two = tuple(dataclasses.replace(row, procedure=Procedure.TWO_INTERVAL.value) for row in plan.rows)
    words = in_words(RampPlan(plan.request, plan.rows + two))
    assert len(words) == 3
    assert words[-1] == NOT_COMPARABLE


@pytest.mark.parametrize("medium", [PAGE, SLIDE, COLUMN], ids=["page", "slide", "column"])
def test_the_figure_draws_every_row_and_the_precision_that_is_wanted(
    plan: RampPlan, medium: FigureFormat
) -> None:
    figure = planning_figure(plan, dataclasses.replace(medium, dots_per_inch=40.0))
    panels = figure.axes[: len(plan.request.participants)]
    drawn = {round(float(y), 9) for axes in panels for line in axes.lines[:1] for y in line.get_ydata()}
    assert drawn == {round(100 * row.half_width, 9) for row in plan.rows}
    assert all(axes.lines[-1].get_ydata()[0] == 10 for axes in panels)
    assert png_bytes(figure)[:4] == b"\x89PNG"


def test_the_command_plans_a_preset_with_processes_of_its_own(command, tmp_path: Path) -> None:
    result = command(
        "plan", "ramp", "--quick", "--design", "yes_no_targeted", "--trials", "6", "--participants", "2,4",
        "--precision", "0.5", "--out", tmp_path,
    )  # fmt: skip
    assert result.code == 0, result.err
    assert result.err == ""
    assert "yes_no_targeted" in result.out
    assert "simulated participants" in result.out
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["effort"] == "quick"
    assert result.out.splitlines()[-len(content["in_words"]) :] == content["in_words"]  # the answer, last
    assert content["monte_carlo_error"] in result.out
    assert len((tmp_path / "plan.csv").read_text().splitlines()) == 3
