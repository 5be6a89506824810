"""The sections of a report on the artifact comparison: what was chosen, and what that can and cannot show."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.comparison.comparison_limits import POWER, AnswerLimits
from evenlight.analysis.comparison.comparison_results import Comparison, SequenceShare
from evenlight.analysis.comparison.comparison_shares import ShareEstimate
from evenlight.analysis.comparison.comparison_words import (
    count_of,
    number_of_answers,
    percent,
    range_of,
    share_of_log_odds,
)
from evenlight.analysis.inference.binomial_tests import ALPHA
from evenlight.analysis.inference.fit_cautions import shown_effect
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.wording import in_words, listed, p_in_words, p_text

NOT_ONE_HALF = (
    "What a share of 50 % does not mean. It does not mean that nobody saw the brightness move: people who "
    "see it and call our version changed, and as many who see it and call the other one changed, come to "
    "50 % as well. It does not mean that a difference was looked for with any chance to find it: few answers "
    "come to about 50 % often, even where the true share is far from it. And the baseline is no still "
    "picture: its content changes its luminance too, so that 50 % says as much about how well that hides a "
    "modulation as about the modulation."
)


def shares_section(found: Comparison, picture: Picture) -> Section:
    """Return what was chosen, with intervals, tests and equivalence."""
    text = [
        "Each answer says in which of two versions of a sequence the brightness changed. The share that took "
        "the modulated one has a 95 % interval; p is that of the exact test of one half, also adjusted for "
        "the number of sequences (Holm). Equivalence is a claim of its own, with a test of its own: that the "
        f"share lies within 0.5 ± {found.margin:g}. What is not found to differ is not thereby shown to be "
        "equal."
    ]
    shares = [own.estimate for own in found.sequences if own.estimate is not None]
    if not all(share.exact for share in shares):
        text.append(
            "Some people answered several times about the same sequence. Answers of one person go together, "
            "so that people, not answers, are the sample: sign-flip test over participants, Student's t."
        )
    if len(shares) > 1 and all(share.equivalent for share in shares):
        largest = max(share.equivalence_p or 0.0 for share in shares)
        text.append(
            f"Every sequence is equivalent to one half; for all at once {p_in_words(largest)}, the largest."
        )
    tables = (_share_table(found), _equality_table(found))
    return Section("Artifact comparison", tuple(text), tables, (picture,), (), found.data.simulated)


def _rows(found: Comparison) -> list[tuple[str, ShareEstimate | None, SequenceShare | None]]:
    """Return what the tables list: the sequences, then all answers."""
    rows: list[tuple[str, ShareEstimate | None, SequenceShare | None]]
    rows = [(in_words(own.name), own.estimate, own) for own in found.sequences]
    return [*rows, ("All answers", found.pooled, None)] if len(rows) > 1 else rows


def _share_table(found: Comparison) -> Table:
    """Return shares, intervals and tests."""
    rows: list[tuple[Cell, ...]] = []
    for name, share, own in _rows(found):
        if share is None:
            rows.append((name, None, None, None, None, None, None, "no answer"))
            continue
        holm, first = (own.p_holm, own.order.ours_first) if own else (None, None)
        rows.append(
            (name, count_of(share), f"{share.choices.share:.2f}", range_of(share.interval),
             p_text(share.p_value), p_text(holm), first, share.flag)
        )  # fmt: skip
    return Table(
        "How often the modulated version was taken for the one that changed. “Ours first”: trials in which "
        "it came first.",
        ("sequence", "ours chosen", "share", "95 % interval", "p", "p (Holm)", "ours first", "remark"),
        tuple(rows),
    )


def _equality_table(found: Comparison) -> Table:
    """Return equivalence tests and Bayes factors."""
    rows: list[tuple[Cell, ...]] = []
    for name, share, own in _rows(found):
        if share is None:
            rows.append((name, *[None] * 7))
            continue
        exact = share.exact
        odds: tuple[Cell, ...] = (None, None, None)
        if exact is not None:
            odds = (exact.bayes_factor, exact.bayes_factor_within, exact.posterior_within)
        margin = None if share.smallest_margin is None else f"{share.smallest_margin:.2f}"
        rows.append(
            (name, range_of(share.narrow), p_text(share.equivalence_p),
             p_text(own.equivalence_holm if own else None), margin, *odds)
        )  # fmt: skip
    within = f"0.5 ± {found.margin:g}"
    return Table(
        f"Is the share equivalent to one half? p: two one-sided tests of {within}; smallest margin: the "
        "smallest that these answers show at 5 %. Bayes factors above 1 speak for one half (against any "
        f"other share, uniform), or for {within} (against what lies outside); they need independent answers.",
        ("sequence", "90 % interval", "p", "p (Holm)", "smallest margin", "BF for 0.5", f"BF for {within}",
         f"probability of {within}"),
        tuple(rows),
    )  # fmt: skip


def pooled_section(found: Comparison) -> Section:
    """Return what all answers together show: the model, the order, and guessing."""
    text = [
        "All answers together come from people who answered several times. Over participants the sign-flip "
        f"test of one half gives {p_in_words(found.pooled.p_value)}; {_model_words(found)}. "
        f"{_order_words(found)}"
    ]
    if found.consistency is not None:
        more = "more" if found.consistency.p_value <= ALPHA else "no more"
        text.append(
            f"People agree with themselves {more} than guessers would ({found.consistency.ratio:.2f} times "
            f"as much, {p_in_words(found.consistency.p_value)}): if some saw the difference and took it the "
            "one way, others the other, this would rise above 1 while the share stays at one half."
        )
    if found.differences is not None:
        text.append(
            f"The shares of the sequences lie up to {percent(found.differences.spread)} apart; as much or "
            f"more comes by chance with {p_in_words(found.differences.p_value)}."
        )
    first = found.first
    row = ("first of the two chosen", count_of(first), f"{first.choices.share:.2f}", range_of(first.interval),
           p_text(first.p_value), first.flag)  # fmt: skip
    columns = ("", "count", "share", "95 % interval", "p", "remark")
    table = Table("Leaning to an interval, whichever version it held.", columns, (row,))
    return Section("All comparisons together", tuple(text), (table,), (), (), found.data.simulated)


def _model_words(found: Comparison) -> str:
    """Return what the mixed model says, or why it says nothing."""
    fitted = found.model.intercept
    if fitted is None:
        return "no mixed logistic model was fitted"
    effect = shown_effect(found.model, fitted)
    if effect.estimate is None:
        return f"the mixed logistic model gives no number ({effect.flag})"
    ends = [effect.ci_low, effect.ci_high]
    low, high = ("–" if end is None else percent(share_of_log_odds(end)) for end in ends)
    return (
        "the mixed logistic model puts the share of a person in the middle at "
        f"{percent(share_of_log_odds(effect.estimate))} (95 % interval {low} to {high}; "
        f"{'no p' if effect.p_value is None else p_in_words(effect.p_value)})"
    )


def _order_words(found: Comparison) -> str:
    """Return whether the model tells the choice of ours from a leaning to an interval."""
    if found.order.flag:
        return f"{found.order.flag.capitalize()}; nor does the model tell them apart."
    return "The model sets apart a leaning to one of the two intervals."


def limits_section(limits: Sequence[AnswerLimits], picture: Picture) -> Section:
    """Return what so many answers can and cannot show."""
    own = limits[0]
    found = "no share" if own.share_found is None else f"a share of {percent(own.share_found)} or more"
    text = (
        f"With {own.answers} independent answers, one from each of {own.answers} people, the exact test "
        f"finds {found} in {percent(POWER)} of experiments, and a share of 75 %, the threshold of a "
        f"two-interval calibration, in {percent(own.threshold_power)}. Even answers divided as evenly as can "
        f"be show no more than 0.5 ± {own.margin_ever:.2f}. To show a true 50 % to lie within 0.5 ± "
        f"{own.margin:g} in {percent(POWER)} of experiments takes "
        f"{number_of_answers(own.answers_equivalent)} answers; to find a share at that margin, "
        f"{number_of_answers(own.answers_different)}.",
        NOT_ONE_HALF,
    )
    return Section("What so many answers can show", text, (_limits_table(limits),), (picture,))


def _limits_table(limits: Sequence[AnswerLimits]) -> Table:
    """Return what each number of answers can show, a row for each question."""
    names = listed([str(own.answers) for own in limits])
    questions: tuple[tuple[str, list[Cell]], ...] = (
        ("answers for one version from which on p < 0.05", [own.fewest_different for own in limits]),
        ("type I error of the exact test", [own.type_i_error for own in limits]),
        ("smallest share above one half found with 80 % power", [own.share_found for own in limits]),
        ("power for a share of 0.75", [own.threshold_power for own in limits]),
        ("smallest margin about one half that they could show", [own.margin_ever for own in limits]),
        ("power to show a true one half within the margin", [own.equivalence_power for own in limits]),
        ("answers that show it with 80 % power", [own.answers_equivalent for own in limits]),
        (
            "answers that find a share at the margin with 80 % power",
            [own.answers_different for own in limits],
        ),
        ("lowest coverage of the 95 % interval, shares 0.2 to 0.8", [own.coverage[0] for own in limits]),
        ("highest coverage, shares 0.2 to 0.8", [own.coverage[1] for own in limits]),
    )
    return Table(
        f"What {names} answers can show about a share; the margin is {limits[0].margin:g}. Exact, over all "
        "outcomes.",
        ("", *(f"{own.answers} answers" for own in limits)),
        tuple((question, *cells) for question, cells in questions),
    )
