"""The grid on which adaptive placement holds its beliefs: threshold, width, guess and lapse rate.

It is coarser than the grid of the fit, since it only has to say where to look next, between two trials.
Rates are counted in steps of a list of candidates, evenly spaced in ln(rate) from the lowest to the highest
rate of a design, so that answers pool by rate and one grid serves all levels and durations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.method.psychometric import THRESHOLD_PROBABILITY, WIDTH_LOGITS

CANDIDATES = 27  # over the default rates, a factor of 15, a step of 11 %
STEPS_BEYOND = 9  # nodes of the threshold below the lowest and above the highest candidate
WIDTHS = np.geomspace(0.5, 5.1, 7)  # of the rise, in ln(rate); the fit's prior within two standard deviations
WIDTH_MEDIAN, WIDTH_SPREAD = 1.6, 0.6  # the fit's prior (docs/decisions/threshold-definition.md)
GUESS_RATES = np.array([0.01, 0.03, 0.06, 0.1, 0.16, 0.25, 0.4, 0.6])  # dense where most people are
GUESS_PRIOR = (1.0, 10.0)  # Beta, the fit's
LAPSE_RATES = np.array([0.004, 0.015, 0.04, 0.08, 0.15])
LAPSE_PRIOR = (1.0, 30.0)  # Beta, the fit's; of two intervals half as many, as half of the misses are right
FALLOFF = 0.5  # of the threshold's prior beyond the candidates, in ln(rate): the fit's
TWO_INTERVAL_GUESS = 0.5  # one of two intervals by chance


@dataclass(frozen=True, slots=True)
class PlacementGrid:
    """Nodes, prior, and what every node says of the answer to every candidate; arrays are read-only.

    Attributes
    ----------
    step : float
        Between two candidates, in ln(rate).
    thresholds : array (n_threshold,)
        ln(threshold / rate of the first candidate).
    guess_rates : array (n_guess,)
        γ.
    prior : array (n_threshold, n_width, n_guess, n_lapse)
        Probability of each node before the first answer.
    success : array (CANDIDATES, n_threshold, n_width, n_guess, n_lapse)
        P("yes"), or P(correct) of two intervals.
    """

    step: float
    thresholds: NDArray[np.float64]
    guess_rates: NDArray[np.float64]
    prior: NDArray[np.float64]
    success: NDArray[np.float64]


@cache
def placement_grid(ratio: float, two_interval: bool) -> PlacementGrid:
    """Return the grid for a design whose highest rate is `ratio` times its lowest.

    >>> grid = placement_grid(15.0, two_interval=True)
    >>> grid.guess_rates.tolist(), round(float(grid.prior.sum()), 12)
    ([0.5], 1.0)
    """
    step = float(np.log(ratio)) / (CANDIDATES - 1)
    candidates = step * np.arange(CANDIDATES, dtype=np.float64)
    thresholds = step * np.arange(-STEPS_BEYOND, CANDIDATES + STEPS_BEYOND, dtype=np.float64)
    guess_rates = np.array([TWO_INTERVAL_GUESS]) if two_interval else GUESS_RATES
    outside = np.maximum(0.0, np.maximum(-thresholds, thresholds - candidates[-1])) / FALLOFF
    off_middle = np.log(WIDTHS / WIDTH_MEDIAN) / WIDTH_SPREAD
    prior = (
        np.exp(-0.5 * outside**2)[:, None, None, None]
        * np.exp(-0.5 * off_middle**2)[:, None, None]
        * _beta_masses(guess_rates, *GUESS_PRIOR)[:, None]
        * _beta_masses(LAPSE_RATES, LAPSE_PRIOR[0], LAPSE_PRIOR[1] * (2 if two_interval else 1))
    )
    success = _success(candidates, thresholds, guess_rates)
    grid = PlacementGrid(step, thresholds, guess_rates, prior / prior.sum(), success)
    for array in (grid.thresholds, grid.guess_rates, grid.prior, grid.success):
        array.flags.writeable = False
    return grid


def _beta_masses(nodes: NDArray[np.float64], a: float, b: float) -> NDArray[np.float64]:
    """Return the probability that a Beta density gives to the neighbourhood of each node."""
    edges = np.concatenate([[0.0], (nodes[1:] + nodes[:-1]) / 2, [1.0]])
    return np.asarray(np.diff(special.betainc(a, b, edges)))


def _success(
    candidates: NDArray[np.float64], thresholds: NDArray[np.float64], guess_rates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return ψ of `method.psychometric` for every candidate at every node."""
    guess, lapse = guess_rates[:, None], LAPSE_RATES
    at_threshold = np.log((THRESHOLD_PROBABILITY - guess) / (1 - THRESHOLD_PROBABILITY - lapse))
    distance = (candidates[:, None] - thresholds)[:, :, None] / WIDTHS
    logit = WIDTH_LOGITS * distance[..., None, None] + at_threshold
    return np.asarray(guess + (1 - guess - lapse) * special.expit(logit))
