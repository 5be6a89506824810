"""All ratings of all people in one mixed model of version, place and sequence.

Ratings on few steps are ordered answers (cumulative link), those on many are numbers (linear): each step
costs a cut point, and beyond some ten the numbers of a scale are about as good as its order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
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
from evenlight.analysis.inference.lognormal_times import CensoredTimes, TimesFit, fit_lognormal_times
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.rating.rating_order import NO_PAIR, PERMUTATIONS
from evenlight.analysis.rating.rating_pairs import ALL, POINTS, Ratings, Sample
from evenlight.analysis.report import Section
from evenlight.analysis.report_prose import section
from evenlight.analysis.rows import flag, p, ratio_with_interval, table_of, with_interval
from evenlight.analysis.wording import in_words, of_track
from evenlight.data_schema.recordings.rating_scale import ONE_TO_FIVE, RatingScale
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

VERSION, PLACE = "version", "place"
NO_ESTIMATE, ONE_SEQUENCE = "the model gives no estimate", "one sequence: nothing that could differ"
MOST_CATEGORIES = 11  # ratings in use, as 0 to 10, up to which they are ordered answers (choice)


# Of many different ratings, and of few: what the model is, what its effects, and units of these and spreads.
LINEAR = "linear mixed model", "effect on the rating", POINTS, POINTS
ORDERED = "cumulative-link mixed model (logit)", "odds ratio of a higher rating", "1", "log-odds"
EXACT_NODES = 3  # of the linear model's quadrature: derivatives are polynomials of degree 4
Fit = OrdinalFit | TimesFit


class RatingFlag(Flag):
    """What a reader of an effect on ratings must know beside what the fit says."""

    ORDER_UNKNOWN = NO_PAIR


def model_ratings(ratings: Ratings, rng: np.random.Generator) -> Section:
    """Fit the model; add effects, spreads and interactions; return the section with the effects."""
    trials, rated, scale = ratings.data.trials, ratings.rated, ratings.data.scale
    linear, size = is_linear(trials), float(np.std([trial.rating for trial in trials]))
    method, effect_name, unit, spread_unit = LINEAR if linear else ORDERED
    change: Callable[[float], float] = size.__mul__ if linear else math.exp
    level, both = (
        f"{method}, participants differ in level",
        f"{method}, participants differ in level and in effect of the version",
    )
    fit, alike = rating_fits(trials, rated, scale)
    interaction, df = likelihood_ratio(trials, rated, fit, scale)
    if all(trial.place_in_pair is None for trial in trials):
        fit, alike = _without_place(fit), _without_place(alike)
    permuted, n = permuted_interaction([ratings.pairs[name] for name in rated], rng)
    add, named = (
        partial(ratings.rows.add, "model", ALL),
        {VERSION: "ours to baseline", PLACE: "shown second to first"},
    )
    for effect in (shown_effect(fit, effect) for effect in fit.effects):
        words = named.get(effect.name, f"{effect.name} to {rated[0]}")
        add(f"{effect_name}, {words}", unit, both, effect.shown(change, NO_ESTIMATE), fit.n_groups)
    same = shown_effect(alike, alike.effects[0]).shown(change, NO_ESTIMATE)
    words = f"{named[VERSION]}, the same for all participants"
    add(f"{effect_name}, {words}", unit, f"{level} only", same, fit.n_groups)
    for words, sd in (("level", fit.group_sd), ("effect of the version", fit.slope_sd)):
        what = f"standard deviation of the participants' {words}"
        value, why = shown_spread(fit, sd)
        value = value * size if linear and value is not None else value
        add(what, spread_unit, both, value, fit.n_groups, flag=why)
    method = f"F distribution, {df} effects, as in a normal model"
    add("version x sequence, likelihood ratio", "1", method, interaction, fit.n_groups)
    method = "permutation of each participant's differences over the sequences"
    add("version x sequence, variance of mean differences", "1", method, permuted, n)
    written = {f"{name} to {rated[0]}": f"{in_words(name)} to {in_words(rated[0])}" for name in rated}
    title = "Effects on the rating [rating points]" if linear else "Odds ratios of a higher rating"
    table = table_of(
        f"{title}, from {fit.n} ratings of {ratings.people}, with profile-likelihood "
        "confidence intervals (CI).",
        [
            (written.get(row.what, of_track(row.what)), row)
            for row in ratings.rows.of("model", f"{effect_name}, ")
        ],
        (with_interval if linear else partial(ratio_with_interval, most=fit.n**2), p, flag),
        ("effect" if linear else "odds ratio", "value", "95 % CI", "p", "remark"),
    )
    return section(
        "rating_model",
        (table,),
        flags=fit.flags,
        interaction=interaction,
        df=df,
        permuted=permuted,
        linear=linear,
    )


def is_linear(trials: Sequence[RatingTrial]) -> bool:
    """Return whether so many different ratings were given that they count as numbers."""
    return len({trial.rating for trial in trials}) > MOST_CATEGORIES


def rating_fits(
    trials: Sequence[RatingTrial], sequences: Sequence[str], scale: RatingScale = ONE_TO_FIVE
) -> tuple[Fit, Fit]:
    """Fit all ratings: each participant with an effect of the version, for inference; and one effect for all.

    The effects are those of version (ours to baseline), place (second to first) and sequences (to the first),
    in log-odds of a higher rating, or in standard deviations of the ratings where those are many.
    """
    own = _fit(ordinal_data(trials, sequences, 0, scale=scale), trials, (VERSION, PLACE))
    return own, _fit(ordinal_data(trials, sequences, scale=scale), trials, (VERSION,))


def _fit(data: OrdinalData, trials: Sequence[RatingTrial], profiled: tuple[str, ...]) -> Fit:
    """Fit the ordered model, or the linear one, of ratings in units of their standard deviation.

    The latter is the model of log-normal times e^rating, none of them censored.
    """
    if not is_linear(trials):
        return fit_ordinal(data, profiled)
    values = np.array([float(trial.rating) for trial in trials])
    design = np.column_stack([data.design, np.ones(values.size)])
    times, found = np.exp((values - values.mean()) / values.std()), np.ones(values.size, dtype=bool)
    made = CensoredTimes(times, found, design, (*data.names, "level"), data.groups, data.slope_column)
    fit = fit_lognormal_times(made, profiled=profiled, nodes=EXACT_NODES)
    return replace(fit, effects=fit.effects[:-1])


def ordinal_data(
    trials: Sequence[RatingTrial],
    sequences: Sequence[str],
    slope_column: int | None = None,
    interaction: bool = False,
    scale: RatingScale = ONE_TO_FIVE,
) -> OrdinalData:
    """Return ratings as the model takes them; slope column 0: the version's effect differs between people."""
    who = {name: number for number, name in enumerate(dict.fromkeys(t.participant_id for t in trials))}
    version = np.array([0.5 if t.version is Version.OURS else -0.5 for t in trials])
    place = np.array([0.0 if t.place_in_pair is None else t.place_in_pair - 1.5 for t in trials])
    dummies = [np.array([float(t.sequence == name) for t in trials]) for name in sequences[1:]]
    products = [version * (dummy - 1 / len(sequences)) for dummy in dummies] if interaction else []
    names = (VERSION, PLACE, *sequences[1:], *(f"{VERSION} x {s}" for s in sequences[1:] if interaction))
    used, responses = np.unique([float(t.rating) for t in trials], return_inverse=True)
    return OrdinalData(
        responses=responses.astype(np.int64),
        n_categories=max(int(scale.range / scale.unit) + 1 if scale.step else 2, used.size),
        design=np.column_stack([version, place, *dummies, *products]),
        names=names,
        groups=np.array([who[t.participant_id] for t in trials], dtype=np.int64),
        slope_column=slope_column,
    )


def _without_place(fit: Fit) -> Fit:
    """Return a fit that says of the effect of the place why it has none: nobody knows the order."""
    version, place, *others = fit.effects
    effects = (version, replace(place, flags=(RatingFlag.ORDER_UNKNOWN,)), *others)
    lost = any(FitFlag.NOT_ESTIMABLE in effect.flags for effect in effects)
    flags = tuple(own for own in fit.flags if lost or own is not FitFlag.NOT_ESTIMABLE)
    return replace(fit, effects=effects, flags=flags)


def likelihood_ratio(
    trials: Sequence[RatingTrial],
    sequences: Sequence[str],
    without: Fit,
    scale: RatingScale = ONE_TO_FIVE,
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
    full = _fit(ordinal_data(trials, sequences, 0, interaction=True, scale=scale), trials, ())
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


def _estimable(fit: Fit) -> int:
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
