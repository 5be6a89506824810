"""Each person's two searches of a location, one in each version: found in which, and in which first.

The two are a pair: the same person, the same room, both versions. That needs no model of times. Of the exact
test of detections (McNemar, 1947) only pairs count in which one of the two was found; of the Cox model
stratified by person and location only those in which it is known which was found first: its partial
likelihood is that of a logistic regression on who comes first (Holt & Prentice, 1974). Searches that took
equally long say nothing about it, as their order is unknown (Kalbfleisch & Prentice, 1973); the
approximations of Breslow and Efron would count each for both sides, as if more were known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from evenlight.analysis.inference.exact_intervals import joined, shared_interval
from evenlight.analysis.search.search_trials import SearchTable
from evenlight.data_schema.arrays import Array

ONE_PERSON = "one participant: the interval and p are for this person's searches alone"


@dataclass(frozen=True, slots=True)
class SearchPairs:
    """Pairs of searches of one person at one location.

    Attributes
    ----------
    participant, location : array (m,) of int
        Who, and where.
    found_ours, found_baseline : array (m,) of bool
        Whether the ring was found.
    first : array (m,) of int
        1 where ours was found first, -1 where the baseline, 0 where it is not known.
    tied : array (m,) of bool
        Where both were found after the same time.
    later : array (m,)
        1 where ours was seen at the later visit, -1 at the earlier one, 0 in the same.
    unpaired : int
        Searches that have no partner.
    """

    participant: NDArray[np.int64]
    location: NDArray[np.int64]
    found_ours: NDArray[np.bool_]
    found_baseline: NDArray[np.bool_]
    first: NDArray[np.int64]
    tied: NDArray[np.bool_]
    later: Array
    unpaired: int

    def at(self, chosen: NDArray[np.bool_]) -> SearchPairs:
        """Return some of the pairs."""
        return SearchPairs(
            self.participant[chosen], self.location[chosen], self.found_ours[chosen],
            self.found_baseline[chosen], self.first[chosen], self.tied[chosen], self.later[chosen],
            self.unpaired,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Detections:
    """Pairs in which the versions differ in whether the ring was found.

    Attributes
    ----------
    n, only_ours, only_baseline : int
        SearchPairs, and those in which it was found in one of the versions alone.
    difference, ci_low, ci_high : float
        Share found in ours minus that in the baseline, with a 95 % confidence interval.
    p_value : float
        Of the exact test, two-sided.
    """

    n: int
    only_ours: int
    only_baseline: int
    difference: float
    ci_low: float
    ci_high: float
    p_value: float


@dataclass(frozen=True, slots=True)
class HazardRatio:
    """How many times as readily a ring is found in ours as in the baseline, at any moment.

    Attributes
    ----------
    ln_ratio, standard_error, ci_low, ci_high : float or None
        Logarithm of the ratio; above 0 where ours is found sooner. None where `flag` says why.
    p_value : float or None
        Two-sided, by the same Student's t as the interval.
    ours_first, baseline_first, tied, unknown : int
        SearchPairs: by which was found first, both after the same time, neither known.
    participants : int
        Who have a pair that is told from.
    flag : str
        What is to be said; empty for nothing.
    """

    ln_ratio: float | None
    standard_error: float | None
    ci_low: float | None
    ci_high: float | None
    p_value: float | None
    ours_first: int
    baseline_first: int
    tied: int
    unknown: int
    participants: int
    flag: str


def matched_pairs(table: SearchTable) -> SearchPairs:
    """Return each session's two searches of a location side by side."""
    key = table.session * len(table.locations) + table.location
    order = np.lexsort((table.ours, key))
    both = np.flatnonzero(key[order][1:] == key[order][:-1])  # each version is there once at most
    base, ours = order[both], order[both + 1]
    ours_first = table.found[ours] & _before(table, ours, base)
    base_first = table.found[base] & _before(table, base, ours)
    return SearchPairs(
        participant=table.participant[ours],
        location=table.location[ours],
        found_ours=table.found[ours],
        found_baseline=table.found[base],
        first=ours_first.astype(np.int64) - base_first.astype(np.int64),
        tied=table.found[ours] & table.found[base] & (table.times[ours] == table.times[base]),
        later=np.sign(table.visit[ours] - table.visit[base]),
        unpaired=table.times.size - 2 * both.size,
    )


def _before(table: SearchTable, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether one ended before the other; found at the last moment is before undetected."""
    sooner = table.times[one] < table.times[other]
    last_moment = (table.times[one] == table.times[other]) & ~table.found[other]
    return np.asarray(sooner | last_moment, dtype=np.bool_)


def detections(pairs: SearchPairs) -> Detections:
    """Return the exact test of McNemar, and the difference of the shares found.

    The interval of Bonett and Price is joined with that of the test, so that it holds 0 where the test does
    not reject it. Pairs must be of different people.

    Parameters
    ----------
    pairs : SearchPairs
        At least one.
    """
    n = pairs.first.size
    ours = int(np.count_nonzero(pairs.found_ours & ~pairs.found_baseline))
    baseline = int(np.count_nonzero(pairs.found_baseline & ~pairs.found_ours))
    low, high = joined(shared_interval(ours, baseline, n), difference_interval(n, ours, baseline))
    return Detections(n, ours, baseline, (ours - baseline) / n, low, high, mcnemar_p(ours, baseline))


def difference_error(n: int, one: int, other: int) -> float:
    """Return the standard error of a difference of paired shares, were the pairs independent.

    That of Bonett and Price (2012): one pair is added to either kind of discordant ones, as few of them tell
    little of how many there might be.

    >>> round(difference_error(17, 3, 3), 4)  # √8 / 19
    0.1489
    """
    a, b = (one + 1) / (n + 2), (other + 1) / (n + 2)
    return math.sqrt((a + b - (a - b) ** 2) / (n + 2))


def mcnemar_p(one: int, other: int) -> float:
    """Return the two-sided probability of as uneven a division of discordant pairs, were either as likely.

    >>> mcnemar_p(0, 5)  # twice 1/32
    0.0625
    """
    return float(stats.binomtest(one, one + other, 0.5).pvalue) if one + other else 1.0


def difference_interval(n: int, one: int, other: int, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of a difference of paired shares after Bonett and Price (2012).

    It is Wald's with one pair added to either kind of discordant ones; without, 17 pairs cover too little.

    >>> [round(end, 3) for end in difference_interval(17, 3, 3)]  # 1.96 √8 / 19
    [-0.292, 0.292]
    """
    a, b = (one + 1) / (n + 2), (other + 1) / (n + 2)
    half = float(special.ndtri(0.5 + level / 2)) * difference_error(n, one, other)
    return max(a - b - half, -1.0), min(a - b + half, 1.0)


def hazard_ratio(pairs: SearchPairs) -> HazardRatio:
    """Return the hazard ratio of the Cox model stratified by person and location, ours over baseline.

    The later visit is a covariate, where it can be told apart from the version. The standard error is the
    larger one of two: that of a sandwich over participants, which takes a person's pairs together, and that
    of independent pairs, as people may be more alike by chance than coins are. Interval and p are Student's t
    with one degree of freedom less than there are participants.
    """
    known = pairs.at(pairs.first != 0)
    ours = int(np.count_nonzero(known.first > 0))
    counts = (ours, known.first.size - ours, int(np.count_nonzero(pairs.tied)))
    people = int(np.unique(known.participant).size)
    rest = (*counts, pairs.first.size - sum(counts), people)
    if min(counts[:2]) == 0:
        return HazardRatio(None, None, None, None, None, *rest, flag=_separated(counts[0], counts[1]))
    ln_ratio, error = _fitted(known, people)
    df = people - 1 if people > 1 else math.inf
    half = float(stats.t.ppf(0.975, df)) * error
    p_value = float(2 * stats.t.sf(abs(ln_ratio) / error, df))
    flag = ONE_PERSON if people == 1 else ""
    return HazardRatio(ln_ratio, error, ln_ratio - half, ln_ratio + half, p_value, *rest, flag=flag)


def _separated(ours: int, baseline: int) -> str:
    """Return why there is no hazard ratio."""
    if ours + baseline == 0:
        return "in no pair is it known which version was found first"
    version = "ours" if ours else "the baseline"
    return f"separated: {version} was found first in all {ours + baseline} pairs; the ratio has no bound"


def _fitted(pairs: SearchPairs, people: int) -> tuple[float, float]:
    """Return the logarithm of the hazard ratio and its standard error."""
    from statsmodels.discrete.discrete_model import Logit  # a second to import

    design = np.ones((pairs.first.size, 1))
    if _visits_tell(pairs):
        design = np.column_stack([design, pairs.later])
    fit = Logit(pairs.first > 0, design).fit(disp=False)
    errors = [float(fit.bse[0])]
    if people > 1:
        groups = np.unique(pairs.participant, return_inverse=True)[1]
        clustered = Logit(pairs.first > 0, design).fit(
            disp=False, cov_type="cluster", cov_kwds={"groups": groups}
        )
        errors.append(float(clustered.bse[0]))
    return float(fit.params[0]), max(errors)


def _visits_tell(pairs: SearchPairs) -> bool:
    """Return whether each order of the versions has both outcomes: else its effect is not finite."""
    outcomes = [np.unique(pairs.first[pairs.later == order]).size for order in (-1, 1)]
    return min(outcomes) == 2
