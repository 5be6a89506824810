"""The files of a plan: its table, its summary and its figure."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from evenlight.analysis.figure_style import write_png
from evenlight.analysis.plans import ramp_plan, viewing_plan
from evenlight.analysis.plans.ramp_plan_figure import planning_figure
from evenlight.analysis.plans.viewing_plan_figure import viewing_plan_figure
from evenlight.data_schema.analysis_results import RampPlanRow, ViewingPlanRow
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json

TABLE, SUMMARY, FIGURE = "plan.csv", "plan.json", "plan.png"


def write_plan(folder: Path, plan: ramp_plan.RampPlan) -> None:
    """Write `plan.csv`, `plan.json` and `plan.png` of a calibration."""
    request = plan.request
    inputs = {f"design {name}": sha256_of_record(design) for name, design in request.designs.items()}
    inputs["display"] = sha256_of_record(request.display)
    write_rows(folder / TABLE, RampPlanRow, plan.rows)
    content: dict[str, Any] = {
        "simulated": True,
        "precision": request.precision,
        "pool": request.pool,
        "draws": request.draws,
        "in_words": list(ramp_plan.in_words(plan)),
        "best": {task.value: row and mapping_from_record(row) for task, row in plan.best.items()},
        "rows": [mapping_from_record(row) for row in plan.rows],
        "designs": {name: mapping_from_record(design) for name, design in request.designs.items()},
        "provenance": mapping_from_record(provenance_now(request.seed, inputs)),
    }
    write_json(folder / SUMMARY, content)
    write_png(folder / FIGURE, planning_figure(plan))


def write_viewing_plan(folder: Path, plan: viewing_plan.ViewingPlan) -> None:
    """Write `plan.csv`, `plan.json` and `plan.png` of a viewing experiment."""
    request = plan.request
    write_rows(folder / TABLE, ViewingPlanRow, plan.rows)
    content: dict[str, Any] = {
        "task": request.task,
        "simulated": True,
        "power": request.power,
        "runs": request.runs,
        "truth": dataclasses.asdict(request.truth),  # type: ignore[call-overload] # every truth is a record
        "truth_in_words": request.truth.in_words,
        "in_words": list(viewing_plan.in_words(plan)),
        "rows": [mapping_from_record(row) for row in plan.rows],
        "provenance": mapping_from_record(provenance_now(request.seed)),
    }
    write_json(folder / SUMMARY, content)
    write_png(folder / FIGURE, viewing_plan_figure(plan))
