"""What a video of a catalogue loses at a few budgets, for a budget that all share."""

from __future__ import annotations

import io
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from evenlight.analysis.catalogue.keys import keys_of
from evenlight.analysis.catalogue.results import CatalogueTask, curves_of
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.loss_curves import UNREADABLE, LossCurves
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.optimize import optimize, pose
from evenlight.method.optimizer.request import budget_line
from evenlight.method.optimizer.shared_price import BudgetTable, loss_quantiles
from evenlight.method.optimizer.solvers import make_solver

BUDGETS = 9  # from the lowest factor to 1, in equal ratios, as loss bends
TABLES = ".budgets"  # folder of the tables, which a later run need not make again


def without_budget(task: CatalogueTask) -> CatalogueTask:
    """Return a task with the power of full brightness as its budget, which any video can have."""
    asked = replace(task.video.asked, budget=1.0, budget_unit=BudgetUnit.POWER)
    return replace(task, video=replace(task.video, asked=asked))


def budget_table(task: CatalogueTask, unit: BudgetUnit) -> BudgetTable:
    """Return what a video loses at each of some budgets of a unit; its loss curves must be there."""
    curves, asked = curves_of(task), task.video.asked
    content = sha256_of_bytes(curves.loss.tobytes() + curves.durations.tobytes())
    key = sha256_of_bytes(f"{keys_of(asked, asked.posed(), content).result} {unit.value} {BUDGETS}".encode())
    path = task.out / TABLES / f"{key}.npz"
    with suppress(*UNREADABLE), path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
        return BudgetTable(kept["budgets"], kept["losses"], float(kept["weight"]), float(kept["frames"]))
    table = _table_of(curves, task, unit)
    _keep(path, table)
    return table


def _keep(path: Path, table: BudgetTable) -> None:
    """Keep a table for later runs."""
    stream = io.BytesIO()
    np.savez(stream, budgets=table.budgets, losses=table.losses, weight=table.weight, frames=table.frames)
    write_whole(path, stream.getvalue())


@one_blas_thread
def _table_of(curves: LossCurves, task: CatalogueTask, unit: BudgetUnit) -> BudgetTable:
    """Return what a video loses at each budget, by its best track there."""
    asked = task.video.asked
    _, request = asked.posed()
    problem = pose(curves, request)
    offset, scale, _ = budget_line(curves, replace(request, budget_unit=unit))
    solver = make_solver(asked.solver, np.random.default_rng(asked.seed))
    factors = np.geomspace(problem.lowest_factor, 1.0, BUDGETS)
    losses = []
    for factor in factors:
        at = replace(problem, baseline_factor=float(factor))
        losses.append(loss_quantiles(at.loss(optimize(at, solver).factors), at.importance))
    weight = float(curves.durations.sum())
    if unit is BudgetUnit.POWER:  # shares of unlike powers: joules add up
        base, slope, _ = budget_line(curves, replace(request, budget_unit=BudgetUnit.WATT))
        weight *= base + slope
    return BudgetTable(offset + scale * factors, np.array(losses), weight, float(curves.n_frames))
