"""The objective: how differently the frames lose contrast (the sum in Eq. 6, as a mean)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray


def pairwise_spread(loss: ArrayLike) -> float:
    """Return the mean absolute difference of contrast loss over all pairs of frames (Eq. 6 / its pairs).

    Sorted, the k-th smallest of N values is the larger one in k pairs and the smaller one in N-1-k, so the
    double sum is Σ_k (2k - N + 1) · loss_(k), k from 0: O(N log N). This is Gini's mean difference.

    Parameters
    ----------
    loss : array_like, (N,)
        𝓛_c of each frame.

    Returns
    -------
    float
        Σ_{i<j} |loss_i - loss_j| / (N (N-1) / 2); 0 for a single frame.

    >>> pairwise_spread([0.0, 1.0, 3.0])
    2.0
    """
    values = np.sort(np.asarray(loss, dtype=np.float64))
    n = len(values)
    if n < 2:
        return 0.0
    # Centred on the median, so that a common level of loss leaves no rounding error behind.
    total = float(order_weights(n) @ (values - values[n // 2]))
    return max(total, 0.0) / (n * (n - 1) / 2)


def order_weights(n: int) -> NDArray[np.float64]:
    """Return the weight that each order statistic has in the pair sum: -(n-1), -(n-3), ..., n-1.

    >>> order_weights(3).tolist()
    [-2.0, 0.0, 2.0]
    """
    return np.arange(1.0 - n, n, 2.0)


def proximal_spread(values: ArrayLike, strength: float) -> NDArray[np.float64]:
    """Return the v that minimizes strength · Σ_{i<j} |v_i - v_j| + ½ Σ (v_i - values_i)².

    The minimizer keeps the order of the values; in that order the pair sum is linear, so the answer is the
    isotonic regression of the sorted values, each moved towards the middle by strength · its order weight.

    Parameters
    ----------
    values : array_like, (N,)
        Where to start from.
    strength : float
        Weight of the pair sum, at least 0.

    >>> proximal_spread([0.0, 4.0], 1.0).tolist()
    [1.0, 3.0]
    >>> proximal_spread([0.0, 4.0], 5.0).tolist()
    [2.0, 2.0]
    """
    start = np.asarray(values, dtype=np.float64)
    order = np.argsort(start, kind="stable")
    result = np.empty_like(start)
    result[order] = isotonic_regression(start[order] - strength * order_weights(len(start)))
    return result


@numba.njit(cache=True)
def isotonic_regression(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the non-decreasing sequence nearest to the values: pool adjacent violators, O(N).

    >>> isotonic_regression(np.array([1.0, 3.0, 2.0])).tolist()
    [1.0, 2.5, 2.5]
    """
    mean = np.empty(len(values))
    size = np.empty(len(values), dtype=np.int64)
    blocks = 0
    for value in values:
        mean[blocks] = value
        size[blocks] = 1
        blocks += 1
        while blocks > 1 and mean[blocks - 2] > mean[blocks - 1]:
            total = size[blocks - 2] + size[blocks - 1]
            weighted = mean[blocks - 2] * size[blocks - 2] + mean[blocks - 1] * size[blocks - 1]
            mean[blocks - 2] = weighted / total
            size[blocks - 2] = total
            blocks -= 1
    return np.repeat(mean[:blocks], size[:blocks])
