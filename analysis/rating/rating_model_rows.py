"""The rows of the model of all ratings, and of what the order does."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from evenlight.analysis.inference.fit_cautions import shown_spread
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.holm import holm
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.rating.rating_model import InteractionTest, RatingModel
from evenlight.analysis.rating.rating_order import OrderEffects
from evenlight.analysis.rating.rating_order_contrasts import PERMUTATIONS
from evenlight.analysis.rating.rating_rows import ADJUSTED_T, POINTS, PValues, Row, statistic
from evenlight.data_schema.statistic import Origin, Statistic


def model_rows(
    model: RatingModel, permuted: InteractionTest, sequences: Sequence[str], origin: Origin
) -> Iterator[Statistic]:
    """Return odds ratios, spread of participants, and interactions."""
    people = model.fit.n_groups
    between = "cumulative-link mixed model (logit), participants differ in level and in effect of the version"
    wanted = [("ours to baseline", model.version), ("shown second to first", model.place)]
    wanted += [(f"{effect.name} to {sequences[0]}", effect) for effect in model.sequences]
    for what, effect in wanted:
        row = Row("model", "all", f"odds ratio of a higher rating, {what}", "1", between)
        yield statistic(row, odds_ratio(effect), people, origin, PValues(effect.p_value))
    what = "odds ratio of a higher rating, ours to baseline, the same for all participants"
    row = Row(
        "model", "all", what, "1", "cumulative-link mixed model (logit), participants differ in level only"
    )
    alike = model.version_alike
    yield statistic(row, odds_ratio(alike), people, origin, PValues(alike.p_value))
    spreads = {
        "of the participants' level": model.fit.group_sd,
        "of the participants' effect of the version": model.fit.slope_sd,
    }
    for what, sd in spreads.items():
        row = Row("model", "all", f"standard deviation {what}", "log-odds", between)
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
    row = Row("model", "all", f"version x sequence, {what}", "1", method)
    return statistic(row, Effect(test.statistic, flag=test.flag), test.n, origin, PValues(test.p_value))


def order_rows(order: OrderEffects, origin: Origin) -> Iterator[Statistic]:
    """Return the effects of the order."""
    within = (
        f"beside people and sequences; {PERMUTATIONS} permutations of the orders among participants; "
        f"interval: {ADJUSTED_T}"
    )
    wanted = {
        "shown second less shown first": order.place,
        "mean of both versions, ours first less ours second": order.carry_over,
    }
    for what, test in wanted.items():
        row = Row("order", "all", what, POINTS, within)
        yield statistic(row, test.effect, test.n, origin, PValues(test.p_value))
    adjusted = holm([test.p_value for test in order.by_sequence.values()])
    between = "exact permutation test between the two orders; interval: Welch's t with pseudo answers"
    for (name, test), p_adjusted in zip(order.by_sequence.items(), adjusted, strict=True):
        row = Row("order", name, "ours less baseline, ours first less ours second", POINTS, between)
        yield statistic(row, test.effect, test.n, origin, PValues(test.p_value, p_adjusted))
