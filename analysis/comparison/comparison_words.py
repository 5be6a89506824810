"""The artifact comparison in words: what came out, and how its numbers are written."""

from __future__ import annotations

from collections.abc import Sequence

from scipy import special

from evenlight.analysis.comparison.comparison_limits import AnswerLimits
from evenlight.analysis.comparison.comparison_results import Comparison
from evenlight.analysis.comparison.comparison_shares import ShareEstimate
from evenlight.analysis.inference.binomial_tests import ALPHA, Interval
from evenlight.analysis.wording import listed, p_in_words, spaced


def lead_of(found: Comparison, limits: Sequence[AnswerLimits]) -> str:
    """Return what came out, in two sentences or three."""
    choices = found.pooled.choices
    who = "simulated participant" if found.data.simulated else "participant"
    interval = found.pooled.interval
    ends = f"; 95 % interval {percent(interval[0])} to {percent(interval[1])}" if interval else ""
    sentences = [
        f"{found.people} {who}{'s' if found.people > 1 else ''} took the modulated version for the one that "
        f"changed in {int(choices.chosen.sum())} of {choices.total} comparisons ({percent(choices.share)}"
        f"{ends})."
    ]
    different = [spaced(s.name) for s in found.sequences if s.p_holm is not None and s.p_holm <= ALPHA]
    equal = [
        spaced(s.name)
        for s in found.sequences
        if s.equivalence_holm is not None and s.equivalence_holm <= ALPHA
    ]
    if different:
        sentences.append(f"The answers differ from a coin's in {listed(different)}.")
    elif found.pooled.p_value <= ALPHA:
        sentences.append(f"Over all that differs from one half ({p_in_words(found.pooled.p_value)}).")
    elif found.contradictory and found.differences:
        sentences.append(
            f"The sequences differ ({p_in_words(found.differences.p_value)}): a share of them all tells of "
            "none."
        )
    if found.order.flag:
        sentences.append(f"But {found.order.flag}.")
    elif found.pooled.equivalence_p is not None and found.pooled.equivalent and not found.contradictory:
        p = p_in_words(found.pooled.equivalence_p)
        sentences.append(
            f"Averaged over the sequences, a share beyond 0.5 ± {found.margin:g} is excluded (two one-sided "
            f"tests, {p}); what holds on average need not hold of each."
        )
    if equal:
        each = ", each by itself" if len(equal) > 1 else ""
        sentences.append(f"The share of {listed(equal)} lies within 0.5 ± {found.margin:g}{each}.")
    elif not different:
        sentences.append(_what_they_cannot(limits[0]))
    return " ".join(sentences)


def _what_they_cannot(own: AnswerLimits) -> str:
    """Return what the number of answers to a sequence rules out."""
    none = "No single sequence is shown to differ from a coin's 50 %, and none to agree with it"
    if own.margin_ever <= own.margin:
        return f"{none}."
    return (
        f"{none}: {own.answers} answers cannot show a share within 0.5 ± {own.margin:g}, however they fall "
        f"(at best ± {own.margin_ever:.2f})."
    )


def share_of_log_odds(log_odds: float) -> float:
    """Return the share of some log-odds.

    >>> share_of_log_odds(0.0)
    0.5
    """
    return float(special.expit(log_odds))


def count_of(share: ShareEstimate) -> str:
    """Return a share as "9 of 17"."""
    return f"{int(share.choices.chosen.sum())} of {share.choices.total}"


def range_of(ends: Interval | None) -> str | None:
    """Return an interval for a cell.

    >>> range_of((0.281, 0.7725))
    '0.28 to 0.77'
    """
    return None if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}"


def percent(share: float) -> str:
    """Return a share in percent.

    >>> percent(0.5294)
    '53 %'
    """
    return f"{100 * share:.0f} %"


def number_of_answers(answers: int | None) -> str:
    """Return a number of answers, or that there would be too many."""
    return "more than 10 000" if answers is None else str(answers)
