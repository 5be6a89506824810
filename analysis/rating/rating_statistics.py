"""The rows of the table of results: every number that the analysis of the ratings shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.cumulative_link import shown_spread
from evenlight.analysis.inference.exact_tests import ExactTest, holm
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.paired_effects import LEVEL, Effect, mean_difference, within
from evenlight.analysis.rating.rating_model import InteractionTest, RatingModel
from evenlight.analysis.rating.rating_order import PERMUTATIONS, OrderEffects
from evenlight.analysis.rating.rating_pairs import VersionRatings
from evenlight.analysis.rating.rating_power import POWER
from evenlight.analysis.rating.rating_results import PairResult, RatingResults
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING

POINTS = "rating points"
ADJUSTED_T = "Student's t with two pseudo pairs (after Agresti & Min 2005)"
SIGN_FLIP = "exact sign-flip test of the mean difference"
MAY_DISAGREE = "another method than that of p: they may disagree"


@dataclass(frozen=True, slots=True)
class StatisticRow:
    """What a row of results is about.

    Attributes
    ----------
    table, group, what, unit, method : str
        As in `Statistic`.
    """

    table: str
    group: str
    what: str
    unit: str
    method: str


def statistic(
    row: StatisticRow,
    effect: Effect,
    n: int,
    origin: Origin,
    p_value: float | None = None,
    p_adjusted: float | None = None,
) -> Statistic:
    """Return a row with its numbers."""
    bounded = effect.ci_low is not None or effect.ci_high is not None
    return Statistic(
        row.table, row.group, row.what, effect.value, row.unit, origin, effect.ci_low, effect.ci_high,
        LEVEL if bounded else None, p_value, p_adjusted, n, row.method, effect.flag,
    )  # fmt: skip


def rating_statistics(results: RatingResults) -> tuple[Statistic, ...]:
    """Return every number of the analysis."""
    origin = Origin.SIMULATED if results.simulated else Origin.RECORDED
    return (
        *_version_rows(results, origin),
        *_pair_rows(results, origin),
        *model_rows(results.model, results.permuted, results.rated, origin),
        *order_rows(results.order, origin),
    )


def mean_of(ratings: VersionRatings) -> Effect:
    """Return the mean over participants, with the interval of a mean difference from their median."""
    values = ratings.values
    if not values.size:
        return Effect(None, flag="nobody has rated it")
    median = float(np.sort(values)[(values.size - 1) // 2])
    about = mean_difference(values - median, ratings.step)
    flag = about.flag.replace("pair", "rating").replace("differences", "ratings")
    shifted = [None if x is None else median + x for x in (about.ci_low, about.ci_high)]
    return within(Effect(float(values.mean()), shifted[0], shifted[1], flag), LOWEST_RATING, HIGHEST_RATING)


def standard_error(ratings: VersionRatings, ddof: int) -> float | None:
    """Return the standard error of the mean by an SD with n - ddof; None with fewer than two participants."""
    values = ratings.values
    return float(values.std(ddof=ddof) / math.sqrt(values.size)) if values.size > 1 else None


def _version_rows(results: RatingResults, origin: Origin) -> Iterator[Statistic]:
    """Return mean, spread, median and distribution of each version."""
    for (sequence, version), ratings in results.versions.items():
        n = len(ratings.means)
        for what, method, effect in _summary(ratings):
            row = StatisticRow("means", sequence, f"{what}, {version.value}", POINTS, method)
            yield statistic(row, effect, n, origin)
        for rating in range(LOWEST_RATING, HIGHEST_RATING + 1):
            row = StatisticRow(
                "distribution", sequence, f"ratings of {rating}, {version.value}", "1", "n: all ratings"
            )
            count = Effect(float(ratings.ratings.count(rating)))
            yield statistic(row, count, len(ratings.ratings), origin)


def _summary(ratings: VersionRatings) -> Iterator[tuple[str, str, Effect]]:
    """Return the numbers of a version: what each is, how it was computed, the number itself."""
    yield "mean rating", f"mean over participants; interval: {ADJUSTED_T}", mean_of(ratings)
    if not ratings.means:
        return
    values = ratings.values
    one = "" if values.size > 1 else "one participant: no spread"
    spread = float(values.std(ddof=1)) if values.size > 1 else None
    yield "standard error", "SD with n - 1, over the root of n", Effect(standard_error(ratings, 1), flag=one)
    yield (
        "standard error, population SD",
        "SD with n, over the root of n",
        Effect(standard_error(ratings, 0), flag=one),
    )
    yield "standard deviation", "with n - 1", Effect(spread, flag=one)
    yield "median rating", "over participants", Effect(float(np.median(values)))


@dataclass(frozen=True, slots=True)
class TestedEffect:
    """An effect of the differences and the test that goes with it.

    Attributes
    ----------
    what, unit, method : str
        Of its rows.
    effect, test : callable
        What answers it, of a result.
    """

    what: str
    unit: str
    method: str
    effect: Callable[[PairResult], Effect]
    test: Callable[[PairResult], ExactTest | None]


TESTED_EFFECTS = (
    TestedEffect(
        "mean difference",
        POINTS,
        f"primary: {SIGN_FLIP}, Holm over the sequences; interval: what it does not reject, joined with "
        f"{ADJUSTED_T}",
        lambda result: result.mean,
        lambda result: result.flip,
    ),
    TestedEffect(
        "mean difference, mid-p",
        POINTS,
        f"for comparison: {SIGN_FLIP} with mid-p (Lancaster 1961)",
        lambda result: Effect(result.mean.value, flag=result.mean.flag),
        lambda result: result.flip_mid_p,
    ),
    TestedEffect(
        "signed-rank sum",
        "1",
        "for comparison: exact signed-rank test, zeros ranked (Pratt)",
        lambda result: Effect(None if result.ranks is None else result.ranks.statistic),
        lambda result: result.ranks,
    ),
    TestedEffect(
        "probability of superiority",
        "1",
        "for comparison: exact sign test; interval: what it does not reject, joined with the score interval "
        "(Tango 1998); ties count one half",
        lambda result: result.superiority,
        lambda result: result.signs,
    ),
)


def _pair_rows(results: RatingResults, origin: Origin) -> Iterator[Statistic]:
    """Return effects and tests of each sequence, with Holm over them, and of all together."""
    everything = results.shown
    for tested in TESTED_EFFECTS:
        p_values = [_p_of(tested.test(result)) for result in everything]
        adjusted = (*holm(p_values[: len(results.pairs)]), None)[: len(everything)]
        for result, p_value, p_adjusted in zip(everything, p_values, adjusted, strict=True):
            what = f"{tested.what}, ours less baseline"
            row = StatisticRow("differences", result.pairs.name, what, tested.unit, tested.method)
            effect = _cautioned(tested.effect(result), result)
            yield statistic(row, effect, _n(result), origin, p_value, p_adjusted)
    for result in everything:
        yield from _untested_rows(result, origin)


def _untested_rows(result: PairResult, origin: Origin) -> Iterator[Statistic]:
    """Return what else there is to say of some differences."""
    group, dropped, n = result.pairs.name, result.ranks_dropped, _n(result)
    row = StatisticRow("differences", group, "Cohen's d_z, ours less baseline", "1",
              "mean over SD (n - 1) of the differences; interval: noncentral t")  # fmt: skip
    yield statistic(row, result.d_z, n, origin)
    row = StatisticRow("differences", group, "rank-biserial correlation, ours less baseline", "1",
              "signed ranks over all ranks; interval: U-statistic with two pseudo pairs")  # fmt: skip
    yield statistic(row, result.rank_biserial, n, origin)
    row = StatisticRow("differences", group, "signed-rank sum, zeros dropped", "1",
              "for comparison: exact signed-rank test, zeros dropped (Wilcoxon); p not adjusted")  # fmt: skip
    effect = Effect(None, flag=result.caution) if dropped is None else Effect(dropped.statistic)
    yield statistic(row, _cautioned(effect, result), n, origin, _p_of(dropped))
    values = result.pairs.values
    for what, count in (("better", values > 0), ("alike", values == 0), ("worse", values < 0)):
        row = StatisticRow("differences", group, f"participants who rate ours {what}", "1", "count")
        yield statistic(row, Effect(float(count.sum())), n, origin)
    row = StatisticRow("sensitivity", group, "smallest mean difference that would mostly be found", POINTS,
              f"{SIGN_FLIP} at 5 %, power {POWER:.0%}, with the spread that was found")  # fmt: skip
    yield statistic(row, Effect(result.smallest, flag=result.why_no_smallest), n, origin)


def _p_of(test: ExactTest | None) -> float | None:
    """Return the p value of a test, if there is one."""
    return None if test is None else test.p_value


def _n(result: PairResult) -> int:
    """Return the number of pairs."""
    return len(result.pairs.participant_ids)


def _cautioned(effect: Effect, result: PairResult) -> Effect:
    """Return an effect with the caution about its test beside its own flag."""
    flags = dict.fromkeys(words for words in (effect.flag, result.caution) if words)
    return Effect(effect.value, effect.ci_low, effect.ci_high, "; ".join(flags))


def model_rows(
    model: RatingModel, permuted: InteractionTest, sequences: Sequence[str], origin: Origin
) -> Iterator[Statistic]:
    """Return odds ratios, spread of participants, and interactions."""
    people = model.fit.n_groups
    between = "cumulative-link mixed model (logit), participants differ in level and in effect of the version"
    wanted = [("ours to baseline", model.version), ("shown second to first", model.place)]
    wanted += [(f"{effect.name} to {sequences[0]}", effect) for effect in model.sequences]
    for what, effect in wanted:
        row = StatisticRow("model", "all", f"odds ratio of a higher rating, {what}", "1", between)
        yield statistic(row, odds_ratio(effect), people, origin, effect.p_value)
    what = "odds ratio of a higher rating, ours to baseline, the same for all participants"
    row = StatisticRow(
        "model", "all", what, "1", "cumulative-link mixed model (logit), participants differ in level only"
    )
    alike = model.version_alike
    yield statistic(row, odds_ratio(alike), people, origin, alike.p_value)
    spreads = {
        "of the participants' level": model.fit.group_sd,
        "of the participants' effect of the version": model.fit.slope_sd,
    }
    for what, sd in spreads.items():
        row = StatisticRow("model", "all", f"standard deviation {what}", "log-odds", between)
        shown, flag = shown_spread(model.fit, sd)
        yield statistic(row, Effect(shown, flag=flag), people, origin)
    df = model.interaction.df
    yield _interaction_row(
        "likelihood ratio", f"F distribution, {df} effects, as in a normal model", model.interaction, origin
    )
    method = "permutation of each participant's differences over the sequences"
    yield _interaction_row("variance of mean differences", method, permuted, origin)


def odds_ratio(effect: FixedEffect) -> Effect:
    """Return an effect in log-odds as an odds ratio."""

    def ratio(value: float | None) -> float | None:
        return None if value is None else math.exp(value)

    value = ratio(effect.estimate)
    flag = effect.flag or ("" if value is not None else "the model gives no estimate")
    return Effect(value, ratio(effect.ci_low), ratio(effect.ci_high), flag)


def _interaction_row(what: str, method: str, test: InteractionTest, origin: Origin) -> Statistic:
    """Return the row of an interaction."""
    row = StatisticRow("model", "all", f"version x sequence, {what}", "1", method)
    return statistic(row, Effect(test.statistic, flag=test.flag), test.n, origin, test.p_value)


def order_rows(order: OrderEffects, origin: Origin) -> Iterator[Statistic]:
    """Return the effects of the order."""
    within = (
        f"beside people and sequences; {PERMUTATIONS} permutations of the orders among participants; "
        f"interval: {ADJUSTED_T} ({MAY_DISAGREE})"
    )
    wanted = {
        "shown second less shown first": order.place,
        "mean of both versions, ours first less ours second": order.carry_over,
    }
    for what, test in wanted.items():
        row = StatisticRow("order", "all", what, POINTS, within)
        yield statistic(row, test.effect, test.n, origin, test.p_value)
    adjusted = holm([test.p_value for test in order.by_sequence.values()])
    between = (
        "exact permutation test between the two orders; interval: Welch's t with pseudo answers "
        f"({MAY_DISAGREE})"
    )
    for (name, test), p_adjusted in zip(order.by_sequence.items(), adjusted, strict=True):
        row = StatisticRow("order", name, "ours less baseline, ours first less ours second", POINTS, between)
        yield statistic(row, test.effect, test.n, origin, test.p_value, p_adjusted)
