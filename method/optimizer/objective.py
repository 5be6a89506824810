"""The objective: how differently the frames lose contrast (the sum in Eq. 6, as a mean).

Frames may count differently (docs/decisions/frame-weights.md): a pair then counts by the product of its two
frames' weights, as if a frame of weight 2 were there twice.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

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


@numba.njit(cache=True)
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
