"""What so many ratings can show: the smallest mean difference that the exact test would mostly find.

Not "observed power", which only says the p value once more (Hoenig & Heisey 2001): of the data the spread
alone is taken, and the question is how large a difference would have to be among people who differ so much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from evenlight.analysis.inference.exact_tests import sign_flip_p_values
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING

ALPHA = 0.05
POWER = 0.8
MOST_DRAWS, FEWEST_DRAWS, DRAWN_PAIRS = 1000, 300, 20_000  # of simulated experiments
RESOLUTION = 0.01  # of the difference [rating points]
LARGEST = HIGHEST_RATING - LOWEST_RATING  # difference of two ratings
FINEST_STEP = 0.25  # of means that are drawn: finer ones only cost time


@dataclass(frozen=True, slots=True)
class DifferenceSpread:
    """How differences scatter.

    Attributes
    ----------
    n : int
        Pairs.
    standard_deviation : float
        Of the differences [rating points].
    step : float
        Between the differences that there are: 1 for single ratings [rating points].
    """

    n: int
    standard_deviation: float
    step: float = 1.0


def fewest_pairs(level: float = ALPHA) -> int:
    """Return how many pairs a sign-flip test takes to reject at all: the smallest p of n is 2 / 2^n.

    >>> fewest_pairs(0.05), fewest_pairs(0.05 / 4)
    (6, 8)
    """
    return 1 + math.ceil(-math.log2(level))


def smallest_difference(spread: DifferenceSpread, rng: np.random.Generator) -> float | None:
    """Return the smallest mean difference that the exact sign-flip test finds at 5 % with a power of 80 %.

    Parameters
    ----------
    spread : DifferenceSpread
        Of the differences.
    rng : Generator
        Draws the experiments, the same ones for every difference that is tried. The power of 17 pairs is
        known to ± 0.025, the difference to about 4 %.

    Returns
    -------
    float or None
        In rating points; None where so few pairs never give p <= 0.05, where no difference is large enough,
        or without a spread: that of the lattice of whole ratings would take its place.
    """
    if spread.n < fewest_pairs() or not spread.standard_deviation > 0:
        return None
    draws = int(np.clip(DRAWN_PAIRS // spread.n, FEWEST_DRAWS, MOST_DRAWS))
    uniform = rng.random((draws, spread.n))
    low, high = 0.0, float(LARGEST)
    while high - low > RESOLUTION:
        middle = (low + high) / 2
        low, high = (low, middle) if _power(middle, spread, uniform) >= POWER else (middle, high)
    return None if high == LARGEST else high


def _power(mean: float, spread: DifferenceSpread, uniform: Array) -> float:
    """Return the share of experiments in which a mean difference is found."""
    step = max(spread.step, FINEST_STEP)
    edges = np.cumsum(likely_differences(mean, spread.standard_deviation, step))[:-1]
    drawn = np.searchsorted(edges, uniform) - round(LARGEST / step)
    return float(np.mean(sign_flip_p_values(drawn) <= ALPHA))


def likely_differences(mean: float, standard_deviation: float, step: float = 1.0) -> Array:
    """Return probabilities of the differences -4 to 4 that have a mean and standard deviation.

    Those of largest entropy, p_k ~ exp(a k + b k²), say nothing but these two. A spread that differences of
    this mean cannot have, on their lattice, becomes the nearest that they can.

    Parameters
    ----------
    mean, standard_deviation : float
        [rating points].
    step : float
        Between two neighbouring differences [rating points].

    >>> likely_differences(0.5, 0.5).round(3).tolist()  # 0 or 1, as often
    [0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0]
    """
    ends = round(LARGEST / step)
    x = np.arange(-ends, ends + 1) / ends
    centre, part = mean / LARGEST, mean / step - np.floor(mean / step)
    least, most = part * (1 - part) / ends**2, 1 - centre**2  # all at two neighbours; all at the two ends
    variance = np.clip((standard_deviation / LARGEST) ** 2, 1.001 * least + 1e-4 / ends**2, 0.999 * most)
    wanted = np.array([centre, variance + centre**2])
    moments = np.stack([x, x**2])

    def surplus(weights: Array) -> tuple[float, Array]:
        logits = weights @ moments
        expected = moments @ special.softmax(logits)
        return float(special.logsumexp(logits) - weights @ wanted), expected - wanted

    found = optimize.minimize(surplus, np.zeros(2), jac=True, method="BFGS", options={"gtol": 1e-6})
    return np.asarray(special.softmax(found.x @ moments), dtype=np.float64)
