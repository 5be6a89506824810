"""The rows of the table of results: every number that the analysis of the ratings shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.exact_paired_tests import ExactTest
from evenlight.analysis.inference.holm import holm
from evenlight.analysis.inference.paired_effects import Effect, mean_difference, within
from evenlight.analysis.rating.rating_cells import p_of
from evenlight.analysis.rating.rating_model_rows import model_rows, order_rows
from evenlight.analysis.rating.rating_pairs import VersionRatings
from evenlight.analysis.rating.rating_power import POWER
from evenlight.analysis.rating.rating_results import PairResult, RatingResults
from evenlight.analysis.rating.rating_rows import ADJUSTED_T, POINTS, SIGN_FLIP, PValues, Row, statistic
from evenlight.data_schema.statistic import Origin, Statistic
from evenlight.data_schema.viewing import HIGHEST_RATING, LOWEST_RATING


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
            row = Row("means", sequence, f"{what}, {version.value}", POINTS, method)
            yield statistic(row, effect, n, origin)
        for rating in range(LOWEST_RATING, HIGHEST_RATING + 1):
            row = Row(
                "distribution", sequence, f"ratings of {rating}, {version.value}", "1", "n: all ratings"
            )
            count = Effect(float(ratings.ratings.count(rating)))
            yield statistic(row, count, len(ratings.ratings), origin)


def _summary(ratings: VersionRatings) -> Iterator[tuple[str, str, Effect]]:
    """Return what is said of a version: what it is, how it was reckoned, the number."""
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
class Question:
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


QUESTIONS = (
    Question(
        "mean difference",
        POINTS,
        f"primary: {SIGN_FLIP}, Holm over the sequences; interval: {ADJUSTED_T}",
        lambda result: result.mean,
        lambda result: result.flip,
    ),
    Question(
        "mean difference, mid-p",
        POINTS,
        f"for comparison: {SIGN_FLIP} with mid-p (Lancaster 1961); interval: {ADJUSTED_T}",
        lambda result: result.mean,
        lambda result: result.flip_mid_p,
    ),
    Question(
        "rank-biserial correlation",
        "1",
        "for comparison: exact signed-rank test, zeros ranked; interval: U-statistic with two pseudo pairs",
        lambda result: result.rank_biserial,
        lambda result: result.ranks,
    ),
    Question(
        "probability of superiority",
        "1",
        "for comparison: exact sign test; interval: score (Tango 1998), ties count one half",
        lambda result: result.superiority,
        lambda result: result.signs,
    ),
)


def _pair_rows(results: RatingResults, origin: Origin) -> Iterator[Statistic]:
    """Return effects and tests of each sequence, with Holm over them, and of all together."""
    everything = results.shown
    for question in QUESTIONS:
        p_values = [p_of(question.test(result)) for result in everything]
        adjusted = (*holm(p_values[: len(results.pairs)]), None)[: len(everything)]
        for result, p_value, p_adjusted in zip(everything, p_values, adjusted, strict=True):
            what = f"{question.what}, ours less baseline"
            row = Row("differences", result.pairs.name, what, question.unit, question.method)
            effect = _cautioned(question.effect(result), result)
            yield statistic(row, effect, _n(result), origin, PValues(p_value, p_adjusted))
    for result in everything:
        yield from _untested_rows(result, origin)


def _untested_rows(result: PairResult, origin: Origin) -> Iterator[Statistic]:
    """Return what else there is to say of some differences."""
    group, dropped, n = result.pairs.name, result.ranks_dropped, _n(result)
    row = Row("differences", group, "Cohen's d_z, ours less baseline", "1",
              "mean over SD (n - 1) of the differences; interval: noncentral t")  # fmt: skip
    yield statistic(row, result.d_z, n, origin)
    row = Row("differences", group, "signed-rank sum, zeros dropped", "1",
              "for comparison: exact signed-rank test, zeros dropped (Wilcoxon); p not adjusted")  # fmt: skip
    effect = Effect(None, flag=result.caution) if dropped is None else Effect(dropped.statistic)
    yield statistic(row, _cautioned(effect, result), n, origin, PValues(p_of(dropped)))
    values = result.pairs.values
    for what, count in (("better", values > 0), ("alike", values == 0), ("worse", values < 0)):
        row = Row("differences", group, f"participants who rate ours {what}", "1", "count")
        yield statistic(row, Effect(float(count.sum())), n, origin)
    row = Row("sensitivity", group, "smallest mean difference that would mostly be found", POINTS,
              f"{SIGN_FLIP} at 5 %, power {POWER:.0%}, with the spread that was found")  # fmt: skip
    yield statistic(row, Effect(result.smallest, flag=result.why_no_smallest), n, origin)


def _n(result: PairResult) -> int:
    """Return the number of pairs."""
    return len(result.pairs.participant_ids)


def _cautioned(effect: Effect, result: PairResult) -> Effect:
    """Return an effect with what is to be minded of its test beside its own flag."""
    flags = dict.fromkeys(words for words in (effect.flag, result.caution) if words)
    return Effect(effect.value, effect.ci_low, effect.ci_high, "; ".join(flags))
