"""The interval of a share of trials of the same people, which go together: by people, not by trials."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.binomial_tests import Interval, clopper_pearson

PSEUDO_PERSON = 0.02  # by coverage: docs/decisions/inference-levels.md


def clustered_interval(successes: NDArray[np.int64], trials: NDArray[np.int64]) -> Interval:
    """Return the 95 % interval of Clopper and Pearson at the effective number of trials.

    Where all trials have the same outcome nothing tells how alike those of a person are: each person counts
    as one trial. That is the worst case, as "nobody ever" is never likelier than (1 - p)^people.
    Coverage: docs/decisions/inference-levels.md.

    Parameters
    ----------
    successes, trials : array of int, (people,)
        How often each of at least two people had success, of how many trials (at least 1).

    >>> round(clustered_interval(np.array([0, 0]), np.array([21, 21]))[1], 3)  # (1 - p)^2 = 2.5 %
    0.842
    """
    count, n = int(successes.sum()), int(trials.sum())
    effective = trials.size if count in (0, n) else effective_number(successes, trials)
    return clopper_pearson(count / n * effective, effective)


def effective_number(successes: NDArray[np.int64], trials: NDArray[np.int64]) -> float:
    """Return how many independent trials would tell a share as well as those of at least two people.

    Their number is divided by how much more the people's counts scatter than counts of a coin would, and
    reduced for the few people that tell it (Korn & Graubard 1998). Few people, or few with the rarer outcome,
    can be alike by chance. Hence two pseudo people among them, each a fiftieth of a person: one with
    successes alone, one without any.

    >>> effective_number(np.array([2, 0]), np.array([2, 2])) < 2  # each always the same: two trials at most
    True
    """
    people, n = trials.size, int(trials.sum())
    pseudo = PSEUDO_PERSON * n / people  # trials of either pseudo person
    share = (float(successes.sum()) + pseudo) / (n + 2 * pseudo)
    excess = successes - share * trials
    squares = float(excess @ excess) + pseudo * n / people * ((1 - share) ** 2 + share**2)
    weight = people + 2 * PSEUDO_PERSON
    variance = weight / (weight - 1) * squares / (n + 2 * pseudo) ** 2
    fewer = special.stdtrit(n - 1, 0.975) / special.stdtrit(people - 1, 0.975)
    return float(min(share * (1 - share) / variance * fewer**2, n))
