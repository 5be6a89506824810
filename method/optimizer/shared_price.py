"""One budget for many videos: how much of it each gets, found by its price (docs/decisions/shared-price.md).

Of each video, tracks at a few budgets are known by the quantiles of their losses. What is minimized is the
mean absolute difference of loss between two frames of any two videos, E|X - Y|, as if all were one. It
couples videos through one distribution alone: that of all losses. With that held, a video costs its frames'
mean distance E|l - X| from it, and the rest is a price: each video buys budget as long as a unit of it saves
more than the price, which is such that all together use the budget. The distribution is then renewed.
E|X - Y| is concave in the distribution, so that no such step makes it larger (but for the interpolation
between budgets).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError

QUANTILES = 64  # of the losses of a track
ROUNDS = 100
ENOUGH = 1e-6  # share of the difference by which a round must lower it


@dataclass(frozen=True, slots=True)
class BudgetTable:
    """What a video loses at K budgets.

    Attributes
    ----------
    budgets : array, (K,)
        Rising, in the unit of the budget.
    losses : array, (K, QUANTILES)
        Quantiles of its frames' contrast loss, of the best track at each budget.
    weight : float
        What a unit of its budget counts in that of all: its duration [s], times its power at full brightness
        where budgets are shares of that [J].
    frames : float
        How many frames count.
    """

    budgets: Array
    losses: Array
    weight: float
    frames: float


def loss_quantiles(loss: Array, importance: Array | None = None) -> Array:
    """Return the quantiles of losses at the middles of equal shares, (QUANTILES,).

    >>> loss_quantiles(np.array([0.2, 0.1]))[[0, -1]].tolist()
    [0.1, 0.2]
    """
    order = np.argsort(loss, kind="stable")
    weights = np.ones(len(loss)) if importance is None else importance[order]
    shares = np.cumsum(weights) / weights.sum()
    at = np.searchsorted(shares, (np.arange(QUANTILES) + 0.5) / QUANTILES - 1e-12)
    return np.asarray(loss[order][np.minimum(at, len(loss) - 1)], dtype=np.float64)


def shared_budgets(tables: Sequence[BudgetTable], budget: float) -> Array:
    """Return the budget of each video, so that all together have a budget, (V,).

    Parameters
    ----------
    tables : sequence of BudgetTable
        Of V videos, with K budgets each.
    budget : float
        Mean over all, by their weights.

    Raises
    ------
    InputError
        If all cannot have that budget, which says what they can have.
    """
    weights = np.array([table.weight for table in tables])
    budgets = np.array([table.budgets for table in tables])
    low, high = (float(weights @ budgets[:, k] / weights.sum()) for k in (0, -1))
    if not low - 1e-9 <= budget <= high + 1e-9:
        raise InputError(
            f"the shared budget {budget:g} cannot be met: all together can use {low:.4g} to {high:.4g}"
        )
    budget = min(max(budget, low), high)
    share = (budget - low) / (high - low) if high > low else 0.0
    chosen = budgets[:, 0] + share * (budgets[:, -1] - budgets[:, 0])
    best, least = chosen, _difference(tables, chosen)
    for _ in range(ROUNDS):
        chosen = _bought(tables, _costs(tables, chosen), budget * weights.sum())
        reached = _difference(tables, chosen)
        if not reached < least * (1 - ENOUGH):
            break
        best, least = chosen, reached
    return np.asarray(best, dtype=np.float64)


def _mixture(tables: Sequence[BudgetTable], chosen: Array) -> tuple[Array, Array]:
    """Return the losses of all videos at chosen budgets, rising, and the share of all frames with each."""
    losses = []
    for table, budget in zip(tables, chosen, strict=True):
        k = int(np.clip(np.searchsorted(table.budgets, budget) - 1, 0, len(table.budgets) - 2))
        step = table.budgets[k + 1] - table.budgets[k]
        part = (budget - table.budgets[k]) / step if step > 0 else 0.0
        losses.append((1 - part) * table.losses[k] + part * table.losses[k + 1])
    shares = np.repeat([table.frames / QUANTILES for table in tables], QUANTILES)
    values = np.concatenate(losses)
    order = np.argsort(values, kind="stable")
    return values[order], shares[order] / shares.sum()


def _difference(tables: Sequence[BudgetTable], chosen: Array) -> float:
    """Return E|X - Y| of all losses at chosen budgets."""
    values, shares = _mixture(tables, chosen)
    below = np.cumsum(shares)
    return float(2 * np.sum(np.diff(values) * below[:-1] * (1 - below[:-1])))


def _costs(tables: Sequence[BudgetTable], chosen: Array) -> Array:
    """Return what each video costs at each of its budgets: its frames' distances from all losses, (V, K)."""
    values, shares = _mixture(tables, chosen)
    below, mean_below = np.cumsum(shares), np.cumsum(shares * values)
    costs = []
    for table in tables:
        at = np.searchsorted(values, table.losses, side="right") - 1
        share = np.where(at >= 0, below[at], 0.0)
        part = np.where(at >= 0, mean_below[at], 0.0)
        distance = table.losses * (2 * share - 1) + mean_below[-1] - 2 * part  # E|l - X|
        costs.append(table.frames * distance.mean(axis=1))
    return np.array(costs)


def _bought(tables: Sequence[BudgetTable], costs: Array, total: float) -> Array:
    """Return the budgets at the price at which all together use the total, (V,).

    Each cost is replaced by its lower convex hull: its edges are bought, the one that saves most per unit
    first. The last one, whose saving is the price, is bought in part.
    """
    edges = []
    for number, (table, cost) in enumerate(zip(tables, costs, strict=True)):
        corners = _lower_hull(table.budgets, cost)
        for a, b in pairwise(corners):
            size = float(table.budgets[b] - table.budgets[a]) * table.weight
            edges.append(((cost[b] - cost[a]) / size, number, size))
    chosen = np.array([table.budgets[0] for table in tables])
    left = total - sum(table.weight * float(table.budgets[0]) for table in tables)
    for _, number, size in sorted(edges):
        part = min(size, left)
        chosen[number] += part / tables[number].weight
        left -= part
        if left <= 0:
            break
    return chosen


def _lower_hull(x: Array, y: Array) -> list[int]:
    """Return the corners of the lower convex hull of points at rising places (Andrew 1979).

    >>> _lower_hull(np.array([0.0, 1.0, 2.0, 3.0]), np.array([3.0, 2.5, 0.0, 0.0]))
    [0, 2, 3]
    """
    corners: list[int] = []
    for k in range(len(x)):
        while len(corners) > 1:
            a, b = corners[-2], corners[-1]
            if (y[b] - y[a]) * (x[k] - x[a]) < (y[k] - y[a]) * (x[b] - x[a]):
                break
            corners.pop()
        if not corners or x[k] > x[corners[-1]]:
            corners.append(k)
    return corners
