"""The objective: how differently the frames lose contrast (the sum in Eq. 6, as a mean)."""

from __future__ import annotations

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
    return 2.0 * np.arange(n) - (n - 1)
