"""What may be true of 17 paired differences of ratings, and what each method then does, by enumeration.

Nothing is simulated: 17 differences from -2 to 2 have 5985 histograms, and the probability of each follows
from the truth. Level and coverage are sums of such probabilities, known to rounding.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.paired_effects import Effect
from evenlight.data_schema.arrays import Array

PAIRS = 17
DIFFERENCES = np.arange(-2, 3)
TRUTHS = {  # probabilities of the differences -2, -1, 0, 1, 2
    "no effect, 30 % alike": (0.15, 0.2, 0.3, 0.2, 0.15),
    "no effect, 50 % alike": (0.0, 0.25, 0.5, 0.25, 0.0),
    "no effect, 80 % alike": (0.0, 0.1, 0.8, 0.1, 0.0),
    "no mean effect, skewed": (0.0, 0.3, 0.55, 0.0, 0.15),
    "mean 0.1, 70 % alike": (0.0, 0.1, 0.7, 0.2, 0.0),
    "mean 0.2": (0.0, 0.2, 0.45, 0.3, 0.05),
    "mean 0.44": (0.03, 0.15, 0.32, 0.35, 0.15),
    "mean 0.5, 0 or 1": (0.0, 0.0, 0.5, 0.5, 0.0),
    "mean 0.6, skewed": (0.0, 0.1, 0.5, 0.1, 0.3),
    "mean 0.84": (0.0, 0.08, 0.25, 0.42, 0.25),
}


def histograms(n: int = PAIRS, cells: int = DIFFERENCES.size) -> NDArray[np.int64]:
    """Return all histograms of n answers in some cells, one per row: bars between n stars."""
    bars = np.array(list(itertools.combinations(range(n + cells - 1), cells - 1)))
    edges = np.column_stack([np.full(len(bars), -1), bars, np.full(len(bars), n + cells - 1)])
    return np.asarray(np.diff(edges, axis=1) - 1, dtype=np.int64)


def probabilities(counts: NDArray[np.int64], truth: tuple[float, ...]) -> Array:
    """Return the probability of each histogram, of independent people (multinomial)."""
    logs = special.gammaln(counts.sum(axis=1) + 1) - special.gammaln(counts + 1).sum(axis=1)
    return np.asarray(np.exp(logs + special.xlogy(counts, np.array(truth)).sum(axis=1)))


def listed(counts: NDArray[np.int64], values: NDArray[np.int64] = DIFFERENCES) -> NDArray[np.int64]:
    """Return the differences behind each histogram, in ascending order, one set per row."""
    return np.array([np.repeat(values, row) for row in counts])


def intervals(sets: NDArray[np.int64], effect: Callable[[NDArray[np.int64]], Effect]) -> Array:
    """Return both ends of an interval for each set of differences; nan where there is none."""
    found = [effect(differences) for differences in sets]
    return np.array([(e.ci_low, e.ci_high) for e in found], dtype=np.float64)


def coverage(ends: Array, chances: Array, target: float) -> float:
    """Return how often an interval holds what is true, where there is an interval."""
    there = ~np.isnan(ends[:, 0])
    holds = (ends[:, 0] <= target + 1e-9) & (ends[:, 1] >= target - 1e-9)
    return float(chances[there & holds].sum() / chances[there].sum())


def true_effects(truth: tuple[float, ...]) -> dict[str, float]:
    """Return what each effect size estimates."""
    p = np.array(truth)
    mean = float(p @ DIFFERENCES)
    signs = np.sign(DIFFERENCES[:, None] + DIFFERENCES)
    return {
        "mean": mean,
        "d_z": mean / float(np.sqrt(p @ DIFFERENCES**2 - mean**2)),
        "superiority": 0.5 + 0.5 * float(p @ np.sign(DIFFERENCES)),
        "rank-biserial": float(p @ signs @ p),
    }
