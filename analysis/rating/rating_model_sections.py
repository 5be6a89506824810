"""The sections on the model of all ratings, and on the order of the versions."""

from __future__ import annotations

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.rating.rating_cells import effect_cells
from evenlight.analysis.rating.rating_model_rows import odds_ratio
from evenlight.analysis.rating.rating_order_contrasts import ContrastTest
from evenlight.analysis.rating.rating_results import RatingResults
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words, p_in_words, p_text


def model_section(results: RatingResults) -> Section:
    """Return the cumulative-link mixed model and the interactions."""
    model = results.model
    first = in_words(results.rated[0])
    wanted = [("ours to baseline", model.version), ("shown second to shown first", model.place)]
    wanted += [(f"{in_words(effect.name)} to {first}", effect) for effect in model.sequences]
    wanted += [("ours to baseline, the same for all participants", model.version_alike)]
    table = Table(
        f"Odds ratios of a higher rating, from {model.fit.n} ratings of {results.people}.",
        ("odds ratio", "value", "95 % interval", "p", "mind"),
        tuple(_odds_row(what, effect) for what, effect in wanted),
    )
    text = (
        "A cumulative-link mixed model takes the ratings as ordered answers, not as numbers; participants "
        "differ in how high they rate, and in what the version does to them. An odds ratio is that of a "
        "given rating or a higher one. The last row, for comparison, takes the version to do the "
        "same to everybody: where it does not, that p is too small.",
        _interaction_in_words(results),
    )
    notes = tuple(f"The model: {flag.value}." for flag in model.fit.flags)
    return Section("All ratings in one model", text, (table,), (), notes, results.simulated)


def _odds_row(what: str, effect: FixedEffect) -> tuple[Cell, ...]:
    """Return a row of odds ratios."""
    return (what, *effect_cells(odds_ratio(effect)), p_text(effect.p_value), effect.flag or "–")


def _interaction_in_words(results: RatingResults) -> str:
    """Return whether the version's effect depends on the sequence."""
    ratio, permuted = results.model.interaction, results.permuted
    words = []
    if ratio.p_value is not None:
        words.append(
            f"likelihood ratio {ratio.statistic:.1f} for {ratio.df} effects, {p_in_words(ratio.p_value)}"
        )
    if permuted.p_value is not None:
        words.append(f"permutation within participants, {p_in_words(permuted.p_value)}")
    if not words:
        return f"Whether the effect depends on the sequence cannot be told: {ratio.flag or permuted.flag}."
    if ratio.p_value is None:
        words.append(f"by the likelihood ratio it cannot be told ({ratio.flag})")
    return f"Does the effect of the version depend on the sequence? {'; '.join(words)}."


def order_section(results: RatingResults) -> Section:
    """Return what the order does."""
    order = results.order
    rows = [
        _order_row("shown second less shown first", order.place),
        _order_row("mean of both versions, ours first less ours second", order.carry_over),
    ]
    rows += [
        _order_row(f"{in_words(name)}: difference with ours first less that with ours second", test)
        for name, test in order.by_sequence.items()
    ]
    text = (
        "If the version shown second were rated higher for that alone, the difference between the versions "
        "would depend on their order: the first row, and each sequence by itself. If the version seen first "
        "coloured the rating of the other, their mean would: the second row. The first two rows are "
        "contrasts within participants, who see some sequences in one order and some in the other; what the "
        "versions do in one sequence only is taken off, and the orders are permuted among participants.",
    )
    table = Table(
        "Effects of the order [rating points] with exact tests. The p of single sequences are not adjusted "
        "here; adjusted ones stand beside them among the numbers of this analysis.",
        ("effect", "value", "95 % interval", "p", "n", "mind"),
        tuple(rows),
    )
    return Section("The order of the versions", text, (table,), (), (), results.simulated)


def _order_row(what: str, test: ContrastTest) -> tuple[Cell, ...]:
    """Return a row of effects of the order."""
    return (what, *effect_cells(test.effect), p_text(test.p_value), test.n, test.effect.flag or "–")
