"""All ratings of all people in one model: the cumulative-link mixed model of version, sequence and place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from evenlight.analysis.inference.cumulative_link import (
    FitFlag,
    OrdinalData,
    OrdinalFit,
    fit_ordinal,
    no_ratio,
    shown_effect,
)
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.rating.rating_order import NO_PAIR
from evenlight.analysis.rating.rating_pairs import PairedRatings
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING, RatingTrial, Version

VERSION, PLACE = "version", "place"
PERMUTATIONS = 9999


@dataclass(frozen=True, slots=True)
class InteractionTest:
    """Whether what the version does differs between the sequences.

    Attributes
    ----------
    statistic : float or None
        Likelihood ratio of models with and without the interaction, or a mean square; None without one.
    df : int
        How many effects the likelihood ratio tests at once; 0 for the permutation test.
    p_value : float or None
        None without a test; `flag` says why.
    n : int
        Participants.
    flag : str
        Why there is none, or what to mind.
    """

    statistic: float | None
    df: int
    p_value: float | None
    n: int
    flag: str = ""


@dataclass(frozen=True, slots=True)
class RatingModel:
    """What the model says.

    Attributes
    ----------
    fit : OrdinalFit
        Each participant with their own level and their own effect of the version: for inference.
    alike : OrdinalFit
        The same with one effect of the version for all participants: beside it.
    interaction : InteractionTest
        Of version and sequence, by the likelihood ratio.
    """

    fit: OrdinalFit
    alike: OrdinalFit
    interaction: InteractionTest

    @property
    def version(self) -> FixedEffect:
        """The effect of the version: log-odds of a higher rating, ours against baseline."""
        return shown_effect(self.fit, self.fit.effects[0])

    @property
    def place(self) -> FixedEffect:
        """The effect of the place: log-odds of a higher rating, shown second against shown first."""
        return shown_effect(self.fit, self.fit.effects[1])

    @property
    def sequences(self) -> tuple[FixedEffect, ...]:
        """The effects of the sequences against the first."""
        return tuple(shown_effect(self.fit, effect) for effect in self.fit.effects[2:])

    @property
    def version_alike(self) -> FixedEffect:
        """The effect of the version, the same for all participants."""
        return shown_effect(self.alike, self.alike.effects[0])


def rating_model(trials: Sequence[RatingTrial], sequences: Sequence[str]) -> RatingModel:
    """Fit the model to all ratings, also those without a counterpart in the other version.

    Parameters
    ----------
    trials : sequence of RatingTrial
        All that count.
    sequences : sequence of str
        Names; the first is what the others are compared with.
    """
    fit = fit_ordinal(ordinal_data(trials, sequences, slope_column=0), profiled=(VERSION, PLACE))
    alike = fit_ordinal(ordinal_data(trials, sequences), profiled=(VERSION,))
    interaction = _interaction(trials, sequences, fit)
    if all(trial.place_in_pair is None for trial in trials):
        fit, alike = _without_place(fit), _without_place(alike)
    return RatingModel(fit, alike, interaction)


def _without_place(fit: OrdinalFit) -> OrdinalFit:
    """Return a fit that says of the effect of the place why it has none: nobody knows the order."""
    version, place, *others = fit.effects
    effects = (version, replace(place, flag=NO_PAIR), *others)
    lost = any(effect.flag == FitFlag.NOT_ESTIMABLE.value for effect in effects)
    flags = tuple(flag for flag in fit.flags if lost or flag is not FitFlag.NOT_ESTIMABLE)
    return replace(fit, effects=effects, flags=flags)


def ordinal_data(
    trials: Sequence[RatingTrial],
    sequences: Sequence[str],
    slope_column: int | None = None,
    interaction: bool = False,
) -> OrdinalData:
    """Return ratings as the cumulative-link mixed model takes them.

    Parameters
    ----------
    trials : sequence of RatingTrial
        All that count.
    sequences : sequence of str
        Names.
    slope_column : int, optional
        0 for an effect of the version that differs between participants.
    interaction : bool
        Whether the version has another effect in each sequence.
    """
    who = {name: number for number, name in enumerate(dict.fromkeys(t.participant_id for t in trials))}
    version = np.array([0.5 if t.version is Version.OURS else -0.5 for t in trials])
    place = np.array([0.0 if t.place_in_pair is None else t.place_in_pair - 1.5 for t in trials])
    dummies = [np.array([float(t.sequence == name) for t in trials]) for name in sequences[1:]]
    products = [version * (dummy - 1 / len(sequences)) for dummy in dummies] if interaction else []
    names = (VERSION, PLACE, *sequences[1:], *(f"{VERSION} x {s}" for s in sequences[1:] if interaction))
    return OrdinalData(
        responses=np.array([t.rating - LOWEST_RATING for t in trials], dtype=np.int64),
        n_categories=HIGHEST_RATING - LOWEST_RATING + 1,
        design=np.column_stack([version, place, *dummies, *products]),
        names=names,
        groups=np.array([who[t.participant_id] for t in trials], dtype=np.int64),
        slope_column=slope_column,
    )


def _interaction(
    trials: Sequence[RatingTrial], sequences: Sequence[str], without: OrdinalFit
) -> InteractionTest:
    """Return the likelihood-ratio test of version x sequence, against the model without it."""
    n = without.n_groups
    if len(sequences) < 2:
        return InteractionTest(None, 0, None, n, "one sequence: nothing that could differ")
    data = ordinal_data(trials, sequences, slope_column=0, interaction=True)
    with_products = fit_ordinal(data, profiled=())
    df = _estimable(with_products) - _estimable(without)
    why = no_ratio(without) or no_ratio(with_products) or (FitFlag.NOT_ESTIMABLE.value if df < 1 else "")
    if why or without.log_likelihood is None or with_products.log_likelihood is None:
        return InteractionTest(None, max(df, 0), None, n, why)
    ratio = max(2 * (with_products.log_likelihood - without.log_likelihood), 0.0)
    left = without.n - n - _estimable(with_products)
    if left < 1:
        return InteractionTest(None, df, None, n, "too few ratings for a test")
    flags = "; ".join(flag.value for flag in with_products.flags)
    return InteractionTest(ratio, df, few_sample_p(ratio, df, without.n, left), n, flags)


def few_sample_p(ratio: float, df: int, n: int, left: int) -> float:
    """Return the p value of a likelihood ratio by the F distribution.

    In a normal model of n answers with `left` degrees of freedom LR = n ln(1 + df F / left), exactly (Cox &
    Hinkley 1974, section 9.3). For 17 participants with 8 ratings each chi-squared rejects in 8 to 11 % of
    experiments without an interaction, this in 3 to 6 % (docs/decisions/rating-inference.md).

    Parameters
    ----------
    ratio : float
        Twice the difference of the log-likelihoods.
    df : int
        Effects that are tested.
    n, left : int
        Answers, and what is left of them without participants and effects.

    >>> round(few_sample_p(7.815, 3, 10**9, 10**9), 3)  # the 5 % point of chi-squared
    0.05
    """
    return float(special.fdtrc(df, left, left / df * np.expm1(min(ratio / n, 500.0))))


def _estimable(fit: OrdinalFit) -> int:
    """Return how many effects of a fit the data tell apart."""
    return sum(effect.flag != FitFlag.NOT_ESTIMABLE.value for effect in fit.effects)


def permuted_interaction(
    pairs: Sequence[PairedRatings], rng: np.random.Generator, permutations: int = PERMUTATIONS
) -> InteractionTest:
    """Test whether the versions' difference depends on the sequence, by permuting it within participants.

    If it does not, each participant's differences could as well belong to the sequences in any other order.
    The statistic is the variance of the sequences' mean differences; p counts the data among the permutations
    (Edgington 1969), so that its level holds whatever their number. It needs no model of the ratings.

    Parameters
    ----------
    pairs : sequence of PairedRatings
        Of each sequence; participants with all of them are used.
    rng : Generator
        Draws the permutations.
    permutations : int
        How many.
    """
    complete = [who for who in pairs[0].participant_ids if all(who in p.participant_ids for p in pairs)]
    if len(pairs) < 2 or not complete:
        why = "one sequence: nothing that could differ" if len(pairs) < 2 else "nobody rated all sequences"
        return InteractionTest(None, 0, None, len(complete), why)
    table = np.array(
        [[float(p.differences[p.participant_ids.index(who)]) for p in pairs] for who in complete]
    )
    if not np.ptp(table, axis=1).any():
        why = "nobody's difference changes with the sequence: nothing to permute"
        return InteractionTest(0.0, 0, 1.0, len(complete), why)
    tiled = np.broadcast_to(table, (permutations, *table.shape))
    drawn = np.asarray(rng.permuted(tiled, axis=2)).mean(axis=1).var(axis=1)
    found = float(table.mean(axis=0).var())
    at_least = int(np.sum(drawn >= found * (1 - 1e-9)))
    return InteractionTest(found, 0, (1 + at_least) / (1 + permutations), len(complete))
