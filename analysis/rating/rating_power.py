"""The smallest difference that so many ratings would mostly find, by the sign-flip test.

This is not "observed power", which only says the p value again (Hoenig & Heisey 2001): of the data the spread
alone is taken, and the question is how large a difference would have to be among people who differ so much.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import optimize, special

from evenlight.analysis.inference.exact_tests import sign_flip_p_values
from evenlight.data_schema.arrays import Array

LARGEST = 4  # difference of two ratings of 1 to 5
# Steps [points], and their number up to the largest difference: finer is only slower.
FINEST, LATTICE = 0.25, 16
TOLERANCE = 0.01  # [points], and a 400th of the largest difference
ALPHA, POWER = 0.05, 0.8


def fewest_pairs(level: float = ALPHA) -> int:
    """Return how many pairs a sign-flip test takes to reject at all: the smallest p of n is 2 / 2^n.

    >>> fewest_pairs(0.05), fewest_pairs(0.05 / 4)
    (6, 8)
    """
    return 1 + math.ceil(-math.log2(level))


def smallest_difference(
    n: int, spread: float, rng: np.random.Generator, step: float = 1.0, largest: float = LARGEST
) -> float | None:
    """Return the smallest mean difference that n pairs find with a power of 80 %, at 5 % [rating points].

    Differences go in steps up to the largest. None where so few pairs never give p <= 0.05, where no
    difference is large enough, or without a spread (SD with n - 1). The same experiments are drawn for every
    difference: 17 pairs' power is known to ± 0.025.
    """
    if n < fewest_pairs() or not spread > 0:
        return None
    largest = min(largest, max(LARGEST, 50 * spread))  # far beyond what is found
    step = max(step, min(largest / LATTICE, max(spread / 2, FINEST)))
    ends = round(largest / step)
    uniform = rng.random((int(np.clip(20_000 // n, 300, 1000)), n))
    low, high = 0.0, float(largest)
    while high - low > min(largest / 400, max(spread / 50, 0.01)):
        middle = (low + high) / 2
        edges = np.cumsum(likely_differences(middle, spread, largest / ends, largest))[:-1]
        drawn = np.searchsorted(edges, uniform) - ends
        found = float(np.mean(sign_flip_p_values(drawn) <= ALPHA)) >= POWER
        low, high = (low, middle) if found else (middle, high)
    return None if high == largest else high


def likely_differences(
    mean: float, standard_deviation: float, step: float = 1.0, largest: float = LARGEST
) -> Array:
    """Return probabilities of all differences up to the largest that have a mean and SD [points].

    Those of largest entropy, p_k ~ exp(a k + b k²), say nothing but these two. A spread that differences of
    this mean cannot have, on their lattice, becomes the nearest that they can.

    >>> likely_differences(0.5, 0.5).round(3).tolist()  # 0 or 1, as often
    [0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0]
    """
    ends = round(largest / step)
    x = np.arange(-ends, ends + 1) / ends
    centre, part = mean / largest, mean / step - np.floor(mean / step)
    least, most = part * (1 - part) / ends**2, 1 - centre**2  # all at two neighbours; all at the two ends
    variance = np.clip((standard_deviation / largest) ** 2, 1.001 * least + 1e-4 / ends**2, 0.999 * most)
    wanted, moments = np.array([centre, variance + centre**2]), np.stack([x, x**2])

    def surplus(weights: Array) -> tuple[float, Array]:
        logits = weights @ moments
        return float(special.logsumexp(logits) - weights @ wanted), moments @ special.softmax(logits) - wanted

    found = optimize.minimize(surplus, np.zeros(2), jac=True, method="BFGS", options={"gtol": 1e-6})
    return np.asarray(special.softmax(found.x @ moments), dtype=np.float64)
