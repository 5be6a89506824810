"""Adaptive placement: where to look next for a participant's thresholds, given the answers so far.

The next ramp is placed around the 75 % point, or where most is learnt. The grid of beliefs is coarser than
that of the fit, since it only has to say where to look next, between two trials. Rates are counted in steps
of a list of candidates, evenly spaced in ln(rate) from the lowest to the highest rate of a design, so that
answers pool by rate and one grid serves all levels and durations.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.data_schema.recordings.ramp import Placement
from evenlight.method.psychometric import WIDTH_LOGITS, threshold_logit

JITTER_STEPS = 3  # at most, either way, around the 75 % point; see docs/decisions/placement.md
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


class AdaptivePlacement:
    """What is believed of one participant's thresholds, and where to look next; no file, no clock, no chance.

    Each condition (a level at one direction and duration) has a threshold, a width and a lapse rate of its
    own; the guess rate is the participant's, and catch trials inform it for all conditions.

    Parameters
    ----------
    placement : Placement
        Which rule: `TARGETED` or `PSI_MARGINAL`.
    grid : PlacementGrid
        Nodes and candidates.

    >>> adaptive = AdaptivePlacement(Placement.TARGETED, placement_grid(15.0, two_interval=False))
    >>> first = adaptive.candidate("level", jitter=0.5)
    >>> adaptive.take("level", first, success=True)
    >>> adaptive.candidate("level", jitter=0.5) < first  # seen: the next ramp is slower
    True
    """

    def __init__(self, placement: Placement, grid: PlacementGrid) -> None:
        self._placement = placement
        self._grid = grid
        self._likelihoods: dict[Hashable, NDArray[np.float64]] = {}
        self._catch_likelihood = np.ones(grid.guess_rates.size)

    def candidate(self, condition: Hashable, jitter: float) -> int:
        """Return which candidate to show next.

        Parameters
        ----------
        condition : hashable
            Where.
        jitter : float
            Chance, in [0, 1): where within the jitter around the 75 % point; `PSI_MARGINAL` takes no notice.
        """
        posterior = self.posterior(condition)
        if self._placement is Placement.PSI_MARGINAL:
            return int(np.argmin(expected_entropy(posterior, self._grid)))
        middle = float(self._grid.thresholds @ posterior.sum(axis=(1, 2, 3))) / self._grid.step
        wanted = middle + JITTER_STEPS * (2 * jitter - 1)
        return int(np.clip(round(wanted), 0, CANDIDATES - 1))

    def take(self, condition: Hashable, candidate: int, success: bool) -> None:
        """Learn from an answer to a ramp."""
        self.learn(condition, self._grid.success[candidate], success)

    def learn(self, condition: Hashable, chances: NDArray[np.float64], success: bool) -> None:
        """Learn from an answer to a ramp of any rate, whose success has these chances at the grid's nodes."""
        known = self._likelihoods.get(condition, np.ones(chances.shape))
        known = known * (chances if success else 1 - chances)
        self._likelihoods[condition] = known / known.max()

    def take_catch(self, yes: bool) -> None:
        """Learn from an answer to a trial without change."""
        guess = self._grid.guess_rates
        known = self._catch_likelihood * (guess if yes else 1 - guess)
        self._catch_likelihood = known / known.max()

    def posterior(self, condition: Hashable) -> NDArray[np.float64]:
        """Return the probability of each node of the grid, given all answers."""
        masses = self._grid.prior * self._catch_likelihood[:, None]
        if condition in self._likelihoods:
            masses = masses * self._likelihoods[condition]
        return np.asarray(masses / masses.sum())


def expected_entropy(posterior: NDArray[np.float64], grid: PlacementGrid) -> NDArray[np.float64]:
    """Return the entropy of ln(threshold) to be expected after showing each candidate (Prins 2013).

    Width, guess and lapse rate are summed over before the entropy is taken: an answer that only tells about
    them is worth nothing.

    Parameters
    ----------
    posterior : array (n_threshold, n_width, n_guess, n_lapse)
        Probability of each node.
    grid : PlacementGrid
        Nodes and candidates.

    Returns
    -------
    array (CANDIDATES,)
        Entropy [nat].
    """
    n = grid.thresholds.size
    before = posterior.reshape(n, -1)
    yes = np.einsum("tk,ctk->ct", before, grid.success.reshape(CANDIDATES, n, -1))
    no = before.sum(axis=1) - yes
    # Entropy of p / s weighed with s, s the sum of p: sum(-p ln p) + s ln s; special.entr is -p ln p.
    return np.asarray(sum(special.entr(p).sum(axis=1) - special.entr(p.sum(axis=1)) for p in (yes, no)))


@dataclass(frozen=True, slots=True)
class PlacementGrid:
    """Nodes, prior, and what every node says of the answer to every candidate; arrays are read-only."""

    step: float  # between two candidates, in ln(rate)
    thresholds: NDArray[np.float64]  # (n_threshold,): ln(threshold / rate of the first candidate)
    guess_rates: NDArray[np.float64]  # (n_guess,): γ
    # (n_threshold, n_width, n_guess, n_lapse): probability of each node before the first answer
    prior: NDArray[np.float64]
    # (CANDIDATES, n_threshold, n_width, n_guess, n_lapse): P("yes"), or P(correct) of two intervals
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
    success = success_chances(candidates, thresholds, guess_rates)
    grid = PlacementGrid(step, thresholds, guess_rates, prior / prior.sum(), success)
    for array in (grid.thresholds, grid.guess_rates, grid.prior, grid.success):
        array.flags.writeable = False
    return grid


def _beta_masses(nodes: NDArray[np.float64], a: float, b: float) -> NDArray[np.float64]:
    """Return the probability that a Beta density gives to the neighbourhood of each node."""
    edges = np.concatenate([[0.0], (nodes[1:] + nodes[:-1]) / 2, [1.0]])
    return np.asarray(np.diff(special.betainc(a, b, edges)))


def success_chances(
    candidates: NDArray[np.float64], thresholds: NDArray[np.float64], guess_rates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return ψ of `method.psychometric` for every candidate at every node."""
    guess, lapse = guess_rates[:, None], LAPSE_RATES
    distance = (candidates[:, None] - thresholds)[:, :, None] / WIDTHS
    logit = WIDTH_LOGITS * distance[..., None, None] + threshold_logit(guess)
    return np.asarray(guess + (1 - guess - lapse) * special.expit(logit))
