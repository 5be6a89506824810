"""The sections of a report on detail ratings: what came out in words, and the tables behind it."""

from __future__ import annotations

from evenlight.analysis.rating.rating_cells import effect_cells, interval_cell, number_cell, p_of, two_digits
from evenlight.analysis.rating.rating_model_sections import model_section, order_section
from evenlight.analysis.rating.rating_pairs import ALL, incomplete
from evenlight.analysis.rating.rating_power import ALPHA, POWER
from evenlight.analysis.rating.rating_results import PairResult, RatingResults
from evenlight.analysis.rating.rating_statistics import mean_of, standard_error
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.wording import in_words, listed, p_text, spaced
from evenlight.data_schema.viewing import HIGHEST_RATING, LOWEST_RATING, Version


def rating_sections(results: RatingResults, picture: Picture) -> tuple[Section, ...]:
    """Return the sections, in the order in which they are read."""
    return (
        Section(
            "Detail ratings", (), (_ratings_table(results),), (picture,), _notes(results), results.simulated
        ),
        Section(
            "Ours against the baseline",
            (_found_in_words(results), _shows_in_words(results)),
            (_effects_table(results), _tests_table(results)),
            simulated=results.simulated,
        ),
        model_section(results),
        order_section(results),
    )


def _ratings_table(results: RatingResults) -> Table:
    """Return the paper's table, with both standard errors and all ratings."""
    rows: list[tuple[Cell, ...]] = []
    for name in results.sequences:
        for version in (Version.BASELINE, Version.OURS):
            ratings = results.versions[name, version]
            mean = mean_of(ratings)
            errors = [number_cell(standard_error(ratings, ddof)) for ddof in (1, 0)]
            counts = [ratings.ratings.count(k) for k in range(LOWEST_RATING, HIGHEST_RATING + 1)]
            row = (in_words(name), version.value, number_cell(mean.value), *errors, interval_cell(mean))
            rows.append((*row, *counts, len(ratings.means)))
    given = tuple(f"“{k}”" for k in range(LOWEST_RATING, HIGHEST_RATING + 1))
    return Table(
        "Ratings of each version: mean over n participants, and how many ratings of 1 to 5 were given. The "
        "standard error of the mean (SEM) is the SD over the root of n; the SD has n - 1 below it, or n "
        "(population SD).",
        ("sequence", "version", "mean", "SEM", "SEM, population SD", "95 % interval", *given, "n"),
        tuple(rows),
    )


def _notes(results: RatingResults) -> tuple[str, ...]:
    """Return who always gave the same rating, and who lacks one."""
    notes = []
    if results.alike:
        who = ", ".join(f"{name} (always {rating})" for name, rating in results.alike.items())
        notes.append(f"Always the same rating: participant {who}. Such answers can show no difference.")
    unrated = [spaced(name) for name in results.sequences if name not in results.rated]
    if unrated:
        notes.append(f"Nobody rated {listed(unrated)}: Holm's adjustment counts the other sequences only.")
    lacking = incomplete([result.pairs for result in results.pairs if result.pairs.name in results.rated])
    if lacking:
        notes.append(
            f"Not both versions of every sequence: participant {', '.join(lacking)}. They leave the pairs "
            "that lack one, and stay in the model of all ratings."
        )
    return tuple(notes)


def _name(result: PairResult) -> str:
    """Return what a row is about."""
    return "all (participants' means)" if result.pairs.name == ALL else in_words(result.pairs.name)


def _effects_table(results: RatingResults) -> Table:
    """Return the effect sizes with their intervals."""
    rows = tuple(
        (
            _name(result),
            *effect_cells(result.mean),
            *effect_cells(result.superiority),
            *effect_cells(result.rank_biserial),
            *effect_cells(result.d_z),
        )
        for result in results.shown
    )
    return Table(
        "Effect sizes, ours less baseline, with 95 % intervals: mean difference [rating points]; probability "
        "that a participant rates ours higher, ties counting one half (0.5: no effect); matched-pairs "
        "rank-biserial correlation; Cohen's d_z.",
        ("sequence", "mean", "95 %", "superiority", "95 %", "rank-biserial", "95 %", "d_z", "95 %"),
        rows,
    )


def _tests_table(results: RatingResults) -> Table:
    """Return the exact tests, and what they could find."""
    rows = tuple(
        (
            _name(result),
            p_text(p_of(result.flip)),
            p_text(adjusted),
            p_text(p_of(result.flip_mid_p)),
            p_text(p_of(result.ranks)),
            p_text(p_of(result.signs)),
            f"{0 if result.flip is None else result.flip.n_different} of {len(result.pairs.participant_ids)}",
            two_digits(result.smallest),
            result.caution or "–",
        )
        for result, adjusted in zip(results.shown, (*results.adjusted, None), strict=False)
    )
    columns = (
        "sequence",
        "p",
        "Holm",
        "mid-p",
        "p, ranks",
        "p, signs",
        "pairs that differ",
        "findable",
        "mind",
    )
    return Table(
        "Primary: exact p of the mean difference (sign flips) of each sequence, adjusted for their number "
        "(Holm). For comparison: its mid-p, the signed ranks (zeros ranked, Pratt) and the signs. What is "
        "written of all sequences together is one test more, not adjusted. Findable: the smallest mean "
        "difference [rating points] that so many pairs, with this spread, show at 5 % with a power of "
        f"{POWER:.0%}.",
        columns,
        rows,
    )


def _found_in_words(results: RatingResults) -> str:
    """Return which sequences differ."""
    found = [
        in_words(result.pairs.name)
        for result, p in zip(results.pairs, results.adjusted, strict=True)
        if p is not None and p <= ALPHA
    ]
    if found:
        return f"The ratings differ beyond chance (exact test, Holm, 5 %) for: {', '.join(found)}."
    return "For no sequence do the ratings differ beyond chance (exact test, Holm, 5 %)."


def _shows_in_words(results: RatingResults) -> str:
    """Return what so many ratings can show."""
    limits = [result.smallest for result in results.pairs if result.smallest is not None]
    if not limits:
        return (
            "Of no sequence can it be said which difference would mostly be found: "
            + "; ".join(dict.fromkeys(result.why_no_smallest for result in results.pairs))
            + "."
        )
    low, high = min(limits), max(limits)
    ends = [two_digits(low), two_digits(high)]
    reach = " to ".join(dict.fromkeys(end for end in ends if end))
    text = f"Of one sequence, so many ratings mostly show a mean difference of {reach} rating points or more"
    overall = results.overall.smallest
    if len(results.pairs) > 1 and overall is not None:
        text += f"; over all sequences together one of {two_digits(overall)}"
    return f"{text}. A large p does not rule out a smaller one: the intervals say what is ruled out."
