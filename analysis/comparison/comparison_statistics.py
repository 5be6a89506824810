"""The rows of the artifact comparison: every number of its tables and figures, and those behind them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import special

from evenlight.analysis.comparison.comparison_chance import PERMUTATIONS
from evenlight.analysis.comparison.comparison_figure import (
    MARGIN_NUMBERS,
    SHARES,
    likely_margin,
    numbers_shown,
    share_rows,
)
from evenlight.analysis.comparison.comparison_results import LEANING, METHOD, PREFERENCE, ComparisonResults
from evenlight.analysis.comparison.comparison_shares import ONE_WAY, ShareEstimate
from evenlight.analysis.inference.binomial_power import difference_power, smallest_margin_ever
from evenlight.analysis.inference.binomial_tests import LEVEL
from evenlight.analysis.inference.cumulative_link import shown_effect, shown_spread
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.wording import listed, spaced
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic

NO_ANSWER = "nobody compared it"
DIFFERENT = "the sequences differ from one half or from each other: a share of them all tells of none"
DEPENDENT = "answers of one person are not independent"
CONSISTENCY = "sum of squared scores over what guessing gives; exact, one-sided"
DIFFERENCES = f"largest share less smallest; {PERMUTATIONS} permutations within participants (Cochran's Q)"


def statistics_of(found: ComparisonResults) -> tuple[Statistic, ...]:
    """Return the rows of a comparison."""
    origin = Origin.SIMULATED if found.data.simulated else Origin.RECORDED
    rows: list[Statistic] = []
    for own in found.sequences:
        if own.estimate is None:
            rows.append(_missing(own.name, origin))
        else:
            rows += _share_rows(own.name, own.estimate, own.p_holm, own.equivalence_holm, origin)
    pooled = found.pooled
    if found.contradictory:
        flags = dict.fromkeys(words for words in (pooled.flag, DIFFERENT) if words)
        pooled = dataclasses.replace(pooled, flag="; ".join(flags))
    rows += _share_rows("all", pooled, None, None, origin)
    rows += [_mid_p_row(found, origin), _first_row(found, origin)]
    return (*rows, *_model_rows(found, origin), *_chance_rows(found, origin))


def _missing(group: str, origin: Origin) -> Statistic:
    """Return the row of a sequence that nobody compared."""
    return Statistic("shares", group, "ours chosen", None, "1", origin, n=0, flag=NO_ANSWER)


def _share_rows(
    group: str, share: ShareEstimate, p_holm: float | None, equal_holm: float | None, origin: Origin
) -> list[Statistic]:
    """Return the rows of one share: itself, its equivalence to one half, and the odds for that."""
    n, value = share.sample, share.choices.share
    low, high = share.interval or (None, None)
    near, far = share.narrow or (None, None)
    margin, exact = share.margin, share.exact
    binomial = exact or share.method == ONE_WAY
    test = "exact binomial" if binomial else "Student's t over participants"
    rows = [
        Statistic("shares", group, "ours chosen", value, "1", origin, low, high, LEVEL if share.interval else
                  None, share.p_value, p_holm, n, share.method, share.flag),
        Statistic("equivalence", group, f"share within 0.5 ± {margin:g}", value, "1", origin, near,
                  far, 0.9 if share.narrow else None, share.equivalence_p, equal_holm, n,
                  f"two one-sided tests, {test}", share.flag),
        Statistic("equivalence", group, "smallest margin shown at 5 %", share.smallest_margin, "1", origin,
                  n=n, method="farther end of the 90 % interval", flag=share.flag),
    ]  # fmt: skip
    if exact is not None:
        ends = exact.mid_p
        rows.append(
            Statistic("shares", group, "ours chosen, mid-p interval", value, "1", origin,
                      ends[0], ends[1], LEVEL, None, None, n, "holds the true share so often on average",
                      share.flag)
        )  # fmt: skip
    why = "" if exact else DEPENDENT
    odds = (exact.bayes_factor, exact.bayes_factor_within, exact.posterior_within) if exact else (None,) * 3
    within = f"0.5 ± {margin:g}"
    names = ("Bayes factor for 0.5", f"Bayes factor for {within}", f"probability of {within}")
    ways = ("against any share (uniform)", "against outside; uniform in each", "uniform prior")
    rows += [
        Statistic("bayes", group, what, number, "1", origin, n=n, method=how, flag=why or share.flag)
        for what, number, how in zip(names, odds, ways, strict=True)
    ]
    return rows


def _mid_p_row(found: ComparisonResults, origin: Origin) -> Statistic:
    """Return the mid-p of all answers: the exact test is strict where few sums are possible."""
    choices = found.pooled.choices
    return Statistic(
        "shares", "all", "ours chosen, mid-p of the sign-flip test", choices.share, "1", origin,
        p_value=sign_flip_test(choices.scores, mid_p=True).p_value, n=found.pooled.sample,
        method="sums as extreme as that found count one half", flag=found.pooled.flag,
    )  # fmt: skip


def _first_row(found: ComparisonResults, origin: Origin) -> Statistic:
    """Return how often the first of the two was chosen."""
    first = found.first
    if first is None:
        return Statistic(
            "order", "all", "first of the two chosen", None, "1", origin, n=0, flag=found.order.flag
        )
    low, high = first.interval or (None, None)
    return Statistic(
        "order", "all", "first of the two chosen", first.choices.share, "1", origin, low, high,
        LEVEL if first.interval else None, first.p_value, None, first.sample, first.method, first.flag,
    )  # fmt: skip


def _model_rows(found: ComparisonResults, origin: Origin) -> tuple[Statistic, ...]:
    """Return what the mixed model says: shares of a person in the middle, and how people differ."""
    fit = found.model
    effects = [(PREFERENCE, fit.intercept), *((LEANING, effect) for effect in fit.effects)]
    rows = [_effect_row(what, shown_effect(fit, effect), found, origin) for what, effect in effects if effect]
    if found.order.constant:
        rows.append(
            Statistic("model", "all", LEANING, None, "1", origin, n=fit.n_groups, method=METHOD,
                      flag=found.order.flag)
        )  # fmt: skip
    spread, why = shown_spread(fit, fit.group_sd)
    rows.append(
        Statistic("model", "all", "SD of the preference between participants", spread, "log-odds", origin,
                  n=fit.n_groups, method=METHOD, flag=why)
    )  # fmt: skip
    return tuple(rows)


def _effect_row(what: str, effect: FixedEffect, found: ComparisonResults, origin: Origin) -> Statistic:
    """Return an effect of the model, as a share instead of its log-odds."""
    value, low, high = (
        None if number is None else float(special.expit(number))
        for number in (effect.estimate, effect.ci_low, effect.ci_high)
    )
    said = [] if effect.estimate is None else [flag.value for flag in found.model.flags]
    order = found.order.flag if what == PREFERENCE else ""
    flag = "; ".join(dict.fromkeys(words for words in (effect.flag, *said, order) if words))
    ends = low is not None or high is not None
    return Statistic(
        "model", "all", what, value, "1", origin, low, high, LEVEL if ends else None, effect.p_value, None,
        found.model.n_groups, METHOD, flag,
    )  # fmt: skip


def _chance_rows(found: ComparisonResults, origin: Origin) -> tuple[Statistic, ...]:
    """Return what else guessing would give."""
    people, consistency, differences = found.people, found.consistency, found.differences
    uneven = [own for own in found.sequences if own.order.flag]
    orders = (
        f"ours came nearly always in one interval in {listed([spaced(s.name) for s in uneven])}"
        if uneven
        else ""
    )
    return (
        Statistic("guessing", "all", "agreement of people with themselves",
                  consistency.ratio if consistency else None, "1", origin,
                  p_value=consistency.p_value if consistency else None, n=people, method=CONSISTENCY,
                  flag="" if consistency else "nobody answered twice"),
        Statistic("guessing", "all", "difference between sequences",
                  differences.spread if differences else None, "1", origin,
                  p_value=differences.p_value if differences else None, n=people, method=DIFFERENCES,
                  flag=orders if differences else "nobody compared two sequences"),
    )  # fmt: skip


def share_points(found: ComparisonResults) -> tuple[PlottedPoint, ...]:
    """Return what the figure of shares draws."""
    origin = Origin.SIMULATED if found.data.simulated else Origin.RECORDED
    points = []
    for row in share_rows(found):
        own = row.estimate
        low, high = (own.interval if own and own.interval else None) or (None, None)
        points.append(
            PlottedPoint("shares", "ours chosen", row.name, None, own.choices.share if own else None,
                         "sequence", "1", "share of answers", "1", origin, low, high,
                         own.sample if own else 0)
        )  # fmt: skip
    return tuple(points)


def power_points(answers: Sequence[int]) -> tuple[PlottedPoint, ...]:
    """Return what the figure of power draws."""
    numbers = numbers_shown(answers)
    power = tuple(
        PlottedPoint("power", f"n = {n}", "", float(share), float(chance), "true share", "1",
                     "share of experiments that find it", "1", Origin.COMPUTED, n=n)
        for n in numbers
        for share, chance in zip(SHARES, difference_power(n, SHARES), strict=True)
    )  # fmt: skip
    margins = tuple(
        PlottedPoint("margin", series, "", float(n), margin_of(int(n)), "answers", "1", "margin about 0.5",
                     "1", Origin.COMPUTED, n=int(n))
        for series, margin_of in (("at best", smallest_margin_ever), ("80 % power", likely_margin))
        for n in np.unique([*MARGIN_NUMBERS, numbers[0]])
    )  # fmt: skip
    return (*power, *margins)
