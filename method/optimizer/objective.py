"""The objective: how differently the frames lose contrast (the sum in Eq. 6, as a mean), and how much.

The pair sum of the paper is content where all frames lose alike, however much. `Spread` is that, and with a
level the mean loss besides; `LargestLoss` is about the worst frame alone (docs/decisions/objectives.md). Each
is the largest Σ w·loss over a set of weights w, which is all that solver and certificate need to know: see
`Objective`.

Frames may count differently (docs/decisions/objectives.md): a pair then counts by the product of its two
frames' weights, as if a frame of weight 2 were there twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.method.choices import ObjectiveName
from evenlight.method.compiled_loop import compiled_loop

LARGEST_LEVEL_WEIGHT = 1e6  # beyond, the spread would be lost in rounding
LEAST_WEIGHT = 1e-9  # in a proximal step, of a frame that counts for nothing: it stays near


def pairwise_spread(loss: ArrayLike, weights: ArrayLike | None = None) -> float:
    """Return the mean absolute difference of contrast loss over all pairs of frames (Eq. 6 / its pairs).

    Sorted, the k-th smallest of N values is the larger one in k pairs and the smaller one in N-1-k, so the
    double sum is Σ_k (2k - N + 1) · loss_(k), k from 0: O(N log N). This is Gini's mean difference.

    Parameters
    ----------
    loss : array_like, (N,)
        𝓛_c of each frame.
    weights : array_like, (N,), optional
        ω, how much each frame counts, at least 0; all alike if not given.

    Returns
    -------
    float
        Σ_{i<j} ω_i ω_j |loss_i - loss_j| / Σ_{i<j} ω_i ω_j; 0 if less than two frames count.

    >>> pairwise_spread([0.0, 1.0, 3.0])
    2.0
    >>> pairwise_spread([0.0, 1.0, 3.0], [1, 1, 0])
    1.0
    """
    values = np.asarray(loss, dtype=np.float64)
    counts = np.ones(len(values)) if weights is None else np.asarray(weights, dtype=np.float64)
    pairs = weight_of_pairs(counts)
    if not pairs > 0:
        return 0.0
    order = np.argsort(values, kind="stable")
    # Centred on the median, so that a common level of loss leaves no rounding error behind.
    total = float(order_weights(counts[order]) @ (values[order] - values[order[len(order) // 2]]))
    return max(total, 0.0) / pairs


def weight_of_pairs(weights: NDArray[np.float64]) -> float:
    """Return Σ_{i<j} ω_i ω_j.

    >>> weight_of_pairs(np.array([1.0, 2.0, 3.0]))
    11.0
    """
    before = np.cumsum(weights) - weights  # sums of what is positive: a difference of squares would cancel
    return float(before @ weights)


def order_weights(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight of each order statistic in the pair sum, from the weights of the ordered frames.

    That is ω times what lies below less what lies above: of N frames that count alike, 1-N, 3-N, ..., N-1.

    >>> order_weights(np.ones(3)).tolist()
    [-2.0, 0.0, 2.0]
    >>> order_weights(np.array([1.0, 3.0])).tolist()
    [-3.0, 3.0]
    """
    return weights * _middle_ranks(weights)


def _middle_ranks(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight below each frame less that above it."""
    below = np.cumsum(weights)
    return np.asarray(2 * below - weights - below[-1])


def proximal_spread(
    values: ArrayLike, strength: float, weights: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Return the v that minimizes strength · Σ_{i<j} ω_i ω_j |v_i - v_j| + ½ Σ ω_i (v_i - values_i)².

    The minimizer keeps the order of the values; in that order the pair sum is linear, so the answer is the
    isotonic regression of the sorted values, each moved towards the middle by strength · its rank.

    Parameters
    ----------
    values : array_like, (N,)
        Where to start from.
    strength : float
        Weight of the pair sum, at least 0.
    weights : array_like, (N,), optional
        ω, how much each frame counts; all alike if not given.

    >>> proximal_spread([0.0, 4.0], 1.0).tolist()
    [1.0, 3.0]
    >>> proximal_spread([0.0, 4.0], 5.0).tolist()
    [2.0, 2.0]
    >>> proximal_spread([0.0, 4.0], 5.0, [3, 1]).tolist()
    [1.0, 1.0]
    """
    start = np.asarray(values, dtype=np.float64)
    counts = np.ones(len(start)) if weights is None else np.asarray(weights, dtype=np.float64)
    counts = np.where(counts > 0, counts, LEAST_WEIGHT)
    order = np.argsort(start, kind="stable")
    result = np.empty_like(start)
    ranks = _middle_ranks(counts[order])
    result[order] = isotonic_regression(start[order] - strength * ranks, counts[order])
    return result


@compiled_loop()
def isotonic_regression(values: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the non-decreasing sequence nearest to the values: pool adjacent violators, O(N).

    Parameters
    ----------
    values, weights : array, (N,)
        What to be near to, and how much each distance counts, above 0.

    >>> isotonic_regression(np.array([1.0, 3.0, 2.0]), np.ones(3)).tolist()
    [1.0, 2.5, 2.5]
    """
    mean, weight = np.empty(len(values)), np.empty(len(values))
    size = np.empty(len(values), dtype=np.int64)
    blocks = 0
    for value, counts in zip(values, weights):  # noqa: B905 # numba knows no strict=
        mean[blocks], weight[blocks], size[blocks] = value, counts, 1
        blocks += 1
        while blocks > 1 and mean[blocks - 2] > mean[blocks - 1]:
            total = weight[blocks - 2] + weight[blocks - 1]
            weighted = mean[blocks - 2] * weight[blocks - 2] + mean[blocks - 1] * weight[blocks - 1]
            mean[blocks - 2], weight[blocks - 2] = weighted / total, total
            size[blocks - 2] += size[blocks - 1]
            blocks -= 1
    return np.repeat(mean[:blocks], size[:blocks])


class Objective(Protocol):
    """What is minimized: the largest Σ w·loss over a set of frame weights w, divided by a size.

    `loss` is that of each of N frames, `weights` (N,) how much each counts, ω.
    """

    @property
    def name(self) -> ObjectiveName:
        """What the command calls it."""

    @property
    def level_weight(self) -> float | None:
        """Weight of the mean loss, if it has one."""

    def value(self, loss: Array, weights: Array | None) -> float:
        """Return what is minimized."""

    def size(self, weights: Array) -> float:
        """Return the number Σ w·loss is divided by; 0 if all tracks are as good."""

    def frame_weights(self, loss: Array, weights: Array) -> Array:
        """Return a w for which Σ w·loss is largest, (N,): size times a (sub)gradient of the value."""

    def largest_weights(self, weights: Array) -> Array:
        """Return the largest |w| that each frame can have, (N,)."""

    def proximal(self, values: Array, strength: float, weights: Array | None) -> Array:
        """Return the v that minimizes strength · size · value(v) + ½ Σ ω (v - values)², (N,).

        What it takes away from the values, times ω, is a w of the set times the strength, and the one nearest
        to them (Moreau): so it projects weights on the set, too.
        """


@dataclass(frozen=True, slots=True)
class Spread:
    """The mean absolute difference of loss over all pairs of frames, the paper's; it may have a level.

    w: the permutahedron, with a level shifted.
    """

    level_weight: float | None = None  # λ: as often the mean loss is added, each frame by its weight

    @property
    def name(self) -> ObjectiveName:
        """What the command calls it."""
        return ObjectiveName.SPREAD if self.level_weight is None else ObjectiveName.SPREAD_AND_MEAN

    def value(self, loss: Array, weights: Array | None) -> float:
        """Return what is minimized."""
        spread = pairwise_spread(loss, weights)
        if self.level_weight is None:
            return spread
        return spread + self.level_weight * float(np.average(loss, weights=weights))

    def size(self, weights: Array) -> float:
        """Return the weight of all pairs; with a level, of a single frame that counts, half its square."""
        pairs = weight_of_pairs(weights)
        return pairs if pairs or self.level_weight is None else float(weights.sum()) ** 2 / 2

    def frame_weights(self, loss: Array, weights: Array) -> Array:
        """Return the order weights, each for the frame that has its place, and what the level adds."""
        order = np.argsort(loss, kind="stable")
        placed = np.empty(len(loss))
        placed[order] = order_weights(weights[order])
        return placed + self._shift(weights) * weights

    def largest_weights(self, weights: Array) -> Array:
        """Return those of a frame whose loss is the largest."""
        return np.asarray(weights * (weights.sum() - weights) + self._shift(weights) * weights)

    def proximal(self, values: Array, strength: float, weights: Array | None) -> Array:
        """Return values drawn together, by `proximal_spread`, once a level has moved them down."""
        counts = np.ones(len(values)) if weights is None else weights
        return proximal_spread(values - strength * self._shift(counts), strength, weights)

    def _shift(self, weights: Array) -> float:
        """Return what the level adds to w per ω."""
        if self.level_weight is None:
            return 0.0
        return self.level_weight * self.size(weights) / float(weights.sum())


SPREAD = Spread()


@dataclass(frozen=True, slots=True)
class LargestLoss:
    """The largest loss of any frame that counts, however much it does. w: at least 0, of one sum.

    >>> LargestLoss().value(np.array([0.2, 0.5, 0.9]), np.array([1.0, 2.0, 0.0]))
    0.5
    """

    name = ObjectiveName.MINIMAX
    level_weight = None

    def value(self, loss: Array, weights: Array | None) -> float:
        """Return what is minimized."""
        return float(np.max(loss if weights is None else loss[weights > 0]))

    def size(self, weights: Array) -> float:
        """Return half the square of the weight of all frames: about that of all pairs."""
        return float(weights.sum()) ** 2 / 2

    def frame_weights(self, loss: Array, weights: Array) -> Array:
        """Return all of the weight at the frame that loses most."""
        placed = np.zeros(len(loss))
        placed[np.argmax(np.where(weights > 0, loss, -np.inf))] = self.size(weights)
        return placed

    def largest_weights(self, weights: Array) -> Array:
        """Return all of the weight for every frame that counts."""
        return np.where(weights > 0, self.size(weights), 0.0)

    def proximal(self, values: Array, strength: float, weights: Array | None) -> Array:
        """Return values clipped from above, at the level at which strength · size is cut off.

        >>> LargestLoss().proximal(np.array([0.0, 3.0, 4.0]), 1.0, np.array([1.0, 0.5, 0.5])).tolist()
        [0.0, 1.5, 1.5]
        """
        counts = np.ones(len(values)) if weights is None else weights
        highest = np.flatnonzero(counts > 0)
        highest = highest[np.argsort(-values[highest], kind="stable")]
        above = counts[highest]
        excess = np.cumsum(above * values[highest]) - strength * self.size(counts)
        levels = excess / np.cumsum(above)
        cut = np.flatnonzero(values[highest] >= levels)
        return np.where(counts > 0, np.minimum(values, levels[cut[-1]] if len(cut) else np.inf), values)


def objective_named(name: ObjectiveName, level_weight: float | None = None) -> Objective:
    """Return the objective of a name.

    Parameters
    ----------
    name : ObjectiveName
        Which.
    level_weight : float, optional
        λ, above 0, of the mean loss in `SPREAD_AND_MEAN`, which needs it; the others take none.

    Raises
    ------
    InputError
        If the level weight is missing, has no place, or cannot be used.
    """
    if name is not ObjectiveName.SPREAD_AND_MEAN:
        if level_weight is not None:
            raise ArgumentError(
                "level_weight", f"{level_weight:g} is for the objective spread+mean, not for {name.value}"
            )
        return SPREAD if name is ObjectiveName.SPREAD else LargestLoss()
    if level_weight is None:
        raise InputError(
            "the objective spread+mean needs `level_weight` above 0, e.g. 0.5: how much a "
            "point of mean loss counts against a point of spread"
        )
    if not 0 < level_weight <= LARGEST_LEVEL_WEIGHT:
        raise ArgumentError(
            "level_weight", f"must lie above 0 and up to {LARGEST_LEVEL_WEIGHT:g}, got {level_weight:g}"
        )
    return Spread(level_weight)
