"""What a video of a catalogue loses at a few budgets, for a budget that all share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evenlight.analysis.catalogue.results import CatalogueTask, curves_of
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.optimize import optimize, pose
from evenlight.method.optimizer.request import budget_line
from evenlight.method.optimizer.shared_price import BudgetTable, loss_quantiles
from evenlight.method.optimizer.solvers import make_solver

BUDGETS = 9  # from the lowest factor to 1, in equal ratios, as loss bends


@one_blas_thread
def budget_table(task: CatalogueTask) -> BudgetTable:
    """Return what a video loses at each of some budgets, by its best track there.

    Its loss curves must be there.
    """
    curves, asked = curves_of(task), task.video.asked
    _, request = asked.posed()
    problem = pose(curves, request)
    offset, scale, _ = budget_line(curves, request)
    solver = make_solver(asked.solver, np.random.default_rng(asked.seed))
    factors = np.geomspace(problem.lowest_factor, 1.0, BUDGETS)
    losses = []
    for factor in factors:
        at = replace(problem, baseline_factor=float(factor))
        losses.append(loss_quantiles(at.loss(optimize(at, solver).factors), at.importance))
    weight = float(curves.durations.sum())
    if request.budget_unit is BudgetUnit.POWER:  # shares of unlike powers: joules add up
        base, slope, _ = budget_line(curves, replace(request, budget_unit=BudgetUnit.WATT))
        weight *= base + slope
    return BudgetTable(offset + scale * factors, np.array(losses), weight, float(curves.n_frames))
