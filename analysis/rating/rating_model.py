"""All ratings of all people in one model: the cumulative-link mixed model of version, place and sequence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import special

from evenlight.analysis.inference.cumulative_link import (
    OrdinalData,
    OrdinalFit,
    fit_ordinal,
    no_ratio,
    shown_effect,
    shown_spread,
)
from evenlight.analysis.inference.fixed_effects import FitFlag, Flag, flags_in_words
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.rating.rating_order import NO_PAIR, PERMUTATIONS
from evenlight.analysis.rating.rating_pairs import ALL, Ratings, Sample
from evenlight.analysis.report import Section
from evenlight.analysis.report_prose import section
from evenlight.analysis.rows import flag, p, ratio_with_interval, table_of
from evenlight.analysis.wording import in_words, of_track
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING, RatingTrial, Version

VERSION, PLACE = "version", "place"
NO_ESTIMATE, ONE_SEQUENCE = "the model gives no estimate", "one sequence: nothing that could differ"
ODDS = "odds ratio of a higher rating, "
MODEL = "cumulative-link mixed model (logit), participants differ in level"


class RatingFlag(Flag):
    """What a reader of an effect on ratings must know beside what the fit says."""

    ORDER_UNKNOWN = NO_PAIR


def model_ratings(ratings: Ratings, rng: np.random.Generator) -> Section:
    """Fit the model; add odds ratios, spreads and interactions; return the section with the odds ratios."""
    trials, rated = ratings.data.trials, ratings.rated
    fit, alike = rating_fits(trials, rated)
    interaction, df = likelihood_ratio(trials, rated, fit)
    if all(trial.place_in_pair is None for trial in trials):
        fit, alike = _without_place(fit), _without_place(alike)
    permuted, n = permuted_interaction([ratings.pairs[name] for name in rated], rng)
    add, both = partial(ratings.rows.add, "model", ALL), f"{MODEL} and in effect of the version"
    named = {VERSION: "ours to baseline", PLACE: "shown second to first"}
    for effect in (shown_effect(fit, effect) for effect in fit.effects):
        words = named.get(effect.name, f"{effect.name} to {rated[0]}")
        add(f"{ODDS}{words}", "1", both, effect.shown(math.exp, NO_ESTIMATE), fit.n_groups)
    same = shown_effect(alike, alike.effects[0]).shown(math.exp, NO_ESTIMATE)
    words = f"{named[VERSION]}, the same for all participants"
    add(f"{ODDS}{words}", "1", f"{MODEL} only", same, fit.n_groups)
    for words, sd in (("level", fit.group_sd), ("effect of the version", fit.slope_sd)):
        what = f"standard deviation of the participants' {words}"
        value, why = shown_spread(fit, sd)
        add(what, "log-odds", both, value, fit.n_groups, flag=why)
    method = f"F distribution, {df} effects, as in a normal model"
    add("version x sequence, likelihood ratio", "1", method, interaction, fit.n_groups)
    method = "permutation of each participant's differences over the sequences"
    add("version x sequence, variance of mean differences", "1", method, permuted, n)
    written = {f"{name} to {rated[0]}": f"{in_words(name)} to {in_words(rated[0])}" for name in rated}
    table = table_of(
        f"Odds ratios of a higher rating, from {fit.n} ratings of {ratings.people}, with profile-likelihood "
        "confidence intervals (CI).",
        [(written.get(row.what, of_track(row.what)), row) for row in ratings.rows.of("model", ODDS)],
        (partial(ratio_with_interval, most=fit.n**2), p, flag),
        ("odds ratio", "value", "95 % CI", "p", "remark"),
    )
    return section(
        "rating_model", (table,), flags=fit.flags, interaction=interaction, df=df, permuted=permuted
    )


def rating_fits(trials: Sequence[RatingTrial], sequences: Sequence[str]) -> tuple[OrdinalFit, OrdinalFit]:
    """Fit all ratings: each participant with an effect of the version, for inference; and one effect for all.

    The effects are those of version (ours to baseline), place (second to first) and sequences (to the first).
    """
    own = fit_ordinal(ordinal_data(trials, sequences, slope_column=0), profiled=(VERSION, PLACE))
    return own, fit_ordinal(ordinal_data(trials, sequences), profiled=(VERSION,))


def ordinal_data(
    trials: Sequence[RatingTrial],
    sequences: Sequence[str],
    slope_column: int | None = None,
    interaction: bool = False,
) -> OrdinalData:
    """Return ratings as the model takes them; slope column 0: the version's effect differs between people."""
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


def _without_place(fit: OrdinalFit) -> OrdinalFit:
    """Return a fit that says of the effect of the place why it has none: nobody knows the order."""
    version, place, *others = fit.effects
    effects = (version, replace(place, flags=(RatingFlag.ORDER_UNKNOWN,)), *others)
    lost = any(FitFlag.NOT_ESTIMABLE in effect.flags for effect in effects)
    flags = tuple(own for own in fit.flags if lost or own is not FitFlag.NOT_ESTIMABLE)
    return replace(fit, effects=effects, flags=flags)


def likelihood_ratio(
    trials: Sequence[RatingTrial], sequences: Sequence[str], without: OrdinalFit
) -> tuple[Effect, int]:
    """Test version x sequence against a fit of the same trials without it.

    Returns
    -------
    Effect
        The likelihood ratio and its p; a flag says why there is none, or what to mind.
    int
        How many effects it tests at once.
    """
    if len(sequences) < 2:
        return Effect(None, flag=ONE_SEQUENCE), 0
    full = fit_ordinal(ordinal_data(trials, sequences, slope_column=0, interaction=True), profiled=())
    df = _estimable(full) - _estimable(without)
    why = no_ratio(without) or no_ratio(full) or (FitFlag.NOT_ESTIMABLE.value if df < 1 else "")
    if why or without.log_likelihood is None or full.log_likelihood is None:
        return Effect(None, flag=why), max(df, 0)
    ratio = max(2 * (full.log_likelihood - without.log_likelihood), 0.0)
    left = without.n - without.n_groups - _estimable(full)
    if left < 1:
        return Effect(None, flag="too few ratings for a test"), df
    return Effect(
        ratio, flag=flags_in_words(full.flags), p_value=few_sample_p(ratio, df, without.n, left)
    ), df


def _estimable(fit: OrdinalFit) -> int:
    return sum(FitFlag.NOT_ESTIMABLE not in effect.flags for effect in fit.effects)


def few_sample_p(ratio: float, df: int, n: int, left: int) -> float:
    """Return the p value of a likelihood ratio by the F distribution.

    In a normal model of n answers with `left` degrees of freedom LR = n ln(1 + df F / left), exactly (Cox &
    Hinkley 1974, section 9.3). For 17 participants with 8 ratings each chi-squared rejects in 8 to 11 % of
    experiments without an interaction, this in 3 to 6 % (docs/decisions/rating-inference.md).

    >>> round(few_sample_p(7.815, 3, 10**9, 10**9), 3)  # the 5 % point of chi-squared
    0.05
    """
    return float(special.fdtrc(df, left, left / df * np.expm1(min(ratio / n, 500.0))))


def permuted_interaction(
    pairs: Sequence[Sample], rng: np.random.Generator, permutations: int = PERMUTATIONS
) -> tuple[Effect, int]:
    """Test whether the versions' difference depends on the sequence, by permuting it within participants.

    If it does not, each participant's differences could as well belong to the sequences in any other order.
    The statistic is the variance of the sequences' mean differences; p counts the data among the permutations
    (Edgington 1969), so that its level holds whatever their number. Only who has all sequences counts: the
    number that is returned.
    """
    complete = [who for who in pairs[0].of if all(who in pair.of for pair in pairs)]
    n = len(complete)
    if len(pairs) < 2 or not complete:
        return Effect(None, flag=ONE_SEQUENCE if len(pairs) < 2 else "nobody rated all sequences"), n
    table = np.array([[float(pair.of[who]) for pair in pairs] for who in complete])
    if not np.ptp(table, axis=1).any():
        why = "nobody's difference changes with the sequence: nothing to permute"
        return Effect(0.0, flag=why, p_value=1.0), n
    tiled = np.broadcast_to(table, (permutations, *table.shape))
    drawn = np.asarray(rng.permuted(tiled, axis=2)).mean(axis=1).var(axis=1)
    found = float(table.mean(axis=0).var())
    at_least = int(np.sum(drawn >= found * (1 - 1e-9)))
    return Effect(found, p_value=(1 + at_least) / (1 + permutations)), n
