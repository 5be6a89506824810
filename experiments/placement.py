"""Where the next ramp is placed, from the answers so far: around the 75 % point, or where most is learnt."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.data_schema.ramp import Placement
from evenlight.experiments.placement_grid import CANDIDATES, PlacementGrid

JITTER_STEPS = 3  # at most, either way, around the 75 % point; see docs/decisions/placement.md


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

    >>> from evenlight.experiments.placement_grid import placement_grid
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
        chance = self._grid.success[candidate]
        known = self._likelihoods.get(condition, np.ones(chance.shape))
        known = known * (chance if success else 1 - chance)
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
