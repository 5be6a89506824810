"""Searches without a model of times: each person's two of a location, and shares of all.

The two are a pair: the same person, the same room, both versions. Of repeated searches the first in one
version and the first in the other are one, and so on. Of the exact test of detections (McNemar,
1947) only pairs count in which one of the two was found; of the Cox model stratified by person and location
only those in which it is known which was found first: its partial likelihood is that of a logistic regression
on who comes first (Holt & Prentice, 1974). Searches that took equally long say nothing about it, as their
order is unknown (Kalbfleisch & Prentice, 1973); the approximations of Breslow and Efron would count each for
both sides, as if more were known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.binomial_tests import Interval, clustered_interval, exact_p
from evenlight.analysis.inference.exact_intervals import joined, shared_interval
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.fixed_effects import FixedEffect, Flag, student_effect
from evenlight.analysis.inference.paired_effects import Effect, within
from evenlight.analysis.search.search_trials import SearchTable
from evenlight.data_schema.arrays import Array, Integers, Mask

NONE_DIFFERS = "in no pair was the ring found in one version alone: the data give no interval"
STEPS = 45  # of time in the curves of the share found


class SearchFlag(Flag):
    """What a reader of an effect on searches must know, beside what a fit says."""

    ONE_PERSON = "one participant: interval and p are for this person's searches alone"
    ONE_PERSON_ONLY = "one participant: nothing is said of other people"
    NOT_BOTH = "no location was searched in both versions: there is no ratio"
    FACTORS_UNKNOWN = "the brightness factors of the versions are unknown"
    NO_FIRST = "in no pair is it known which version was found first"
    OURS_FIRST = "separated: the track was found first in all pairs; the ratio has no bound"
    BASELINE_FIRST = "separated: the baseline was found first in all pairs; the ratio has no bound"


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

    participant: Integers
    location: Integers
    found_ours: Mask
    found_baseline: Mask
    first: Integers
    tied: Mask
    later: Array
    unpaired: int

    @property
    def more(self) -> Integers:
        """1 where the ring was found in ours alone, -1 where in the baseline alone."""
        return self.found_ours.astype(np.int64) - self.found_baseline

    @property
    def discordant(self) -> tuple[int, int]:
        """Pairs in which the ring was found in ours alone, and in the baseline alone."""
        return int(np.count_nonzero(self.more > 0)), int(np.count_nonzero(self.more < 0))

    @property
    def counts(self) -> Mapping[str, int]:
        """How many pairs there are of each kind, by which was found first."""
        ours, baseline, tied = (
            int(np.count_nonzero(own)) for own in (self.first > 0, self.first < 0, self.tied)
        )
        return {
            "ours found first": ours,
            "baseline found first": baseline,
            "both after the same time (left out)": tied,
            "neither known to be first (left out)": self.first.size - ours - baseline - tied,
        }

    def at(self, chosen: Mask) -> SearchPairs:
        """Return some of the pairs."""
        names = (name for name in self.__slots__ if name != "unpaired")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def sums(self, scores: Integers | Array) -> Array:
        """Return the sum of scores of each person."""
        people = np.unique(self.participant, return_inverse=True)[1]
        return np.asarray(np.bincount(people, weights=scores), dtype=np.float64)


def matched_pairs(table: SearchTable) -> SearchPairs:
    """Return each session's two searches of a location side by side, repetition by repetition."""
    key = table.session * len(table.locations) + table.location
    key = key * (int(table.repetition.max(initial=0)) + 1) + table.repetition
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


def _before(table: SearchTable, one: NDArray[np.intp], other: NDArray[np.intp]) -> Mask:
    """Return whether one ended before the other; found at the last moment is before undetected."""
    sooner = table.times[one] < table.times[other]
    last_moment = (table.times[one] == table.times[other]) & ~table.found[other]
    return np.asarray(sooner | last_moment, dtype=np.bool_)


# --- found in which version ---------------------------------------------------------------------------------


def detections(pairs: SearchPairs) -> Effect:
    """Return the share found in ours minus that in the baseline, with the exact test of McNemar.

    The interval of Bonett and Price is joined with that of the test, so that it holds 0 where the test does
    not reject it. Pairs, at least one, must be of different people.
    """
    n, ours, baseline = pairs.first.size, *pairs.discordant
    low, high = joined(shared_interval(ours, baseline, n), difference_interval(n, ours, baseline))
    return Effect((ours - baseline) / n, low, high, p_value=mcnemar_p(ours, baseline))


def mcnemar_p(one: int, other: int) -> float:
    """Return the two-sided probability of as uneven a division of discordant pairs, were either as likely.

    >>> mcnemar_p(0, 5)  # twice 1/32
    0.0625
    """
    return exact_p(one, one + other) if one + other else 1.0


def _bonett_price(n: int, one: int, other: int) -> tuple[float, float]:
    """Return middle and standard error of a difference of paired shares (Bonett & Price 2012).

    One pair is added to either kind of discordant ones, as few of them tell little of how many there might
    be: Wald's interval without them covers too little at 17 pairs.
    """
    a, b = (one + 1) / (n + 2), (other + 1) / (n + 2)
    return a - b, math.sqrt((a + b - (a - b) ** 2) / (n + 2))


def difference_interval(n: int, one: int, other: int) -> Interval:
    """Return the 95 % interval of a difference of paired shares after Bonett and Price (2012).

    >>> [round(end, 3) for end in difference_interval(17, 3, 3)]  # 1.96 √8 / 19
    [-0.292, 0.292]
    """
    middle, error = _bonett_price(n, one, other)
    half = float(special.ndtri(0.975)) * error
    return max(middle - half, -1.0), min(middle + half, 1.0)


def detection_change(pairs: SearchPairs) -> Effect:
    """Return the share of rings found in ours less that in the baseline, with Student's t over people.

    The standard error is the larger one of that over people and that of independent pairs: few people, or few
    pairs that differ, scatter less by chance than they would again.
    """
    more, n = pairs.more.astype(np.float64), pairs.first.size
    difference = float(more.mean())
    count = np.unique(pairs.participant).size
    flag = SearchFlag.ONE_PERSON_ONLY.value if count == 1 else "" if more.any() else NONE_DIFFERS
    if flag:
        return Effect(difference, flag=flag)
    over_people = error_over_people(more - difference, pairs.participant)
    error = max(over_people or 0.0, _bonett_price(n, *pairs.discordant)[1])
    found = student_effect("rings found", difference, error, count - 1).shown(lambda x: x)
    return within(found, -1.0, 1.0)


def error_over_people(excess: Array, people: Integers) -> float | None:
    """Return the standard error of a mean over people, from each value less the mean; None of one person."""
    sums = np.bincount(np.unique(people, return_inverse=True)[1], weights=excess)
    if sums.size == 1:
        return None
    return math.sqrt(sums.size / (sums.size - 1) * float(sums @ sums)) / excess.size


def exchanged(pairs: SearchPairs, scores: Integers) -> Effect:
    """Return the sum of some scores, with the exact p of the persons' sums; without p for one person.

    If it does not matter which version is which, each person's sum is as likely to have the other sign. Of
    `first` it is the permutation test of the stratified log-rank statistic, with whole persons exchanged.
    """
    sums = pairs.sums(scores)
    if sums.size == 1:
        return Effect(float(sums[0]), flag=SearchFlag.ONE_PERSON_ONLY.value)
    return Effect(float(sums.sum()), p_value=sign_flip_test(sums).p_value)


# --- found first --------------------------------------------------------------------------------------------


def hazard_ratio(pairs: SearchPairs) -> FixedEffect:
    """Return ln of how many times as readily a ring is found in ours as in the baseline, at any moment.

    It is that of the Cox model stratified by person and location. The later visit is a covariate, where it
    can be told apart from the version. The standard error is the larger one of two: that of a sandwich over
    participants, which takes a person's pairs together, and that of independent pairs, as people may be more
    alike by chance than coins are. Interval and p are Student's t with one degree of freedom less than there
    are participants.
    """
    known = pairs.at(pairs.first != 0)
    people = int(np.unique(known.participant).size)
    if np.unique(known.first).size < 2:
        return FixedEffect("ours", flags=(_separated(known),))
    if people == 1:
        return student_effect("ours", *_fitted(known, people), math.inf, (SearchFlag.ONE_PERSON,))
    return student_effect("ours", *_fitted(known, people), people - 1)


def _separated(known: SearchPairs) -> SearchFlag:
    if not known.first.size:
        return SearchFlag.NO_FIRST
    return SearchFlag.OURS_FIRST if known.first[0] > 0 else SearchFlag.BASELINE_FIRST


def _fitted(pairs: SearchPairs, people: int) -> tuple[float, float]:
    """Return the logarithm of the hazard ratio and its standard error."""
    from statsmodels.discrete.discrete_model import Logit  # a second to import

    design = np.ones((pairs.first.size, 1))
    if _visits_tell(pairs):
        design = np.column_stack([design, pairs.later])
    model = Logit(pairs.first > 0, design)
    fit = model.fit(disp=False)
    errors = [float(fit.bse[0])]
    if people > 1:
        groups = np.unique(pairs.participant, return_inverse=True)[1]
        clustered = model.fit(disp=False, cov_type="cluster", cov_kwds={"groups": groups})
        errors.append(float(clustered.bse[0]))
    return float(fit.params[0]), max(errors)


def _visits_tell(pairs: SearchPairs) -> bool:
    """Return whether each order of the versions has both outcomes: else its effect is not finite."""
    outcomes = [np.unique(pairs.first[pairs.later == order]).size for order in (-1, 1)]
    return min(outcomes) == 2


# --- shares of searches -------------------------------------------------------------------------------------


def clustered_share(successes: Mask, people: Integers) -> Effect:
    """Return a share with an interval by people, whose trials are alike (`clustered_interval`).

    Parameters
    ----------
    successes : array (n,) of bool
        Of each trial.
    people : array (n,) of int
        Whose it was.
    """
    n, count = successes.size, int(np.count_nonzero(successes))
    if n == 0:
        return Effect(None, flag="nothing was found")
    groups = np.unique(people, return_inverse=True)[1]
    if groups.max() == 0:
        return Effect(count / n, flag=SearchFlag.ONE_PERSON_ONLY.value)
    chosen = np.bincount(groups[successes], minlength=groups.max() + 1)
    return Effect(count / n, *clustered_interval(chosen, np.bincount(groups)))


def found_over_time(own: SearchTable, limit: float) -> tuple[Array, Array]:
    """Return times [s] and the shares found until then, with their pointwise 95 % band over people.

    Up to the shortest limit every search is watched: nothing is censored, and one minus the Kaplan-Meier
    curve is the share itself, whose band can respect that a person's searches are alike.

    Parameters
    ----------
    own : SearchTable
        Searches in one version, at least one.
    limit : float
        The shortest time limit of all searches [s].

    Returns
    -------
    array (k,), array (3, k)
        Times, and share, lower and upper end; the ends are nan for one person.
    """
    times = np.linspace(0.0, limit, STEPS + 1)
    shares = [clustered_share(own.found & (own.times <= time), own.participant) for time in times]
    bands = np.array([(share.value, share.ci_low, share.ci_high) for share in shares], dtype=np.float64).T
    bands[1:, 0] *= 0.0  # at time 0 nothing can be found; nan stays
    return times, bands
