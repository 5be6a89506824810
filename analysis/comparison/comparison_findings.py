"""What the artifact comparison found: rows, figures and words (Section 4.3 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scipy import special

from evenlight.analysis.comparison.comparison_figure import power_figure, shares_figure
from evenlight.analysis.comparison.comparison_limits import POWER, AnswerLimits, answer_limits, limit_rows
from evenlight.analysis.comparison.comparison_results import ComparisonResults, SequenceShare, compare
from evenlight.analysis.comparison.comparison_shares import ShareEstimate
from evenlight.analysis.comparison.comparison_statistics import power_points, share_points, statistics_of
from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.inference.binomial_tests import ALPHA, DEFAULT_MARGIN, Interval
from evenlight.analysis.inference.cumulative_link import shown_effect
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import in_words, listed, p_text, spaced
from evenlight.data_schema.recordings.viewing import ComparisonTrial


def comparison_findings(
    data: TaskData[ComparisonTrial], seed: int = 1, margin: float = DEFAULT_MARGIN
) -> Findings:
    """Return what an artifact comparison found.

    Parameters
    ----------
    data : TaskData of ComparisonTrial
        The answers: one of each participant for each sequence, as in the paper, or more.
    seed : int
        Of the permutations.
    margin : float
        Within which a share counts as equivalent to one half, in (0, 1/2).

    Raises
    ------
    InputError
        If there is no answer, or no such margin.
    """
    found = compare(data, seed, margin)
    numbers = answers_per_sequence(found)
    limits = [answer_limits(n, margin) for n in dict.fromkeys(numbers)]
    shares = Drawing(
        "comparison_shares",
        png_bytes(shares_figure(found)),
        "Share of answers that took the modulated version for the one whose brightness changed, with 95 % "
        f"confidence intervals; {found.people} participants. The band is 0.5 ± {margin:g}.",
        share_points(found),
    )
    power = Drawing(
        "comparison_power",
        png_bytes(power_figure(numbers, margin)),
        f"What {numbers[0]} answers and more can show: how often a true share is found to differ from one "
        "half, and the smallest margin about one half that can be shown at all.",
        power_points(numbers),
    )
    return Findings(
        name="comparison",
        lead=lead_of(found, limits),
        statistics=(*statistics_of(found), *(row for own in limits for row in limit_rows(own))),
        drawings=(shares, power),
        sections=(
            shares_section(found, shares.picture),
            pooled_section(found),
            limits_section(limits, power.picture),
        ),
        warnings=found.warnings,
    )


def answers_per_sequence(found: ComparisonResults) -> list[int]:
    """Return how many people answered about each sequence, the commonest number first.

    One answer of each is what counts as independent, however often they were asked.
    """
    numbers = [len(own.estimate.choices.participants) for own in found.sequences if own.estimate is not None]
    return sorted(numbers, key=lambda n: (-numbers.count(n), -n))


def lead_of(found: ComparisonResults, limits: Sequence[AnswerLimits]) -> str:
    """Return what came out, in two sentences or three."""
    own = found.sequences
    different = [spaced(s.name) for s in own if s.p_holm is not None and s.p_holm <= ALPHA]
    equal = [spaced(s.name) for s in own if s.equivalence_holm is not None and s.equivalence_holm <= ALPHA]
    values = {"found": found, "pooled": found.pooled, "own": limits[0], "alpha": ALPHA}
    return " ".join(prose("comparison_lead", **values, different=different, equal=equal))


def shares_section(found: ComparisonResults, picture: Picture) -> Section:
    """Return what was chosen, with intervals, tests and equivalence."""
    shares = [own.estimate for own in found.sequences if own.estimate is not None]
    all_equal = len(shares) > 1 and all(share.equivalent for share in shares)
    text = section(
        "comparison_shares",
        (_share_table(found), _equality_table(found)),
        (picture,),
        found=found,
        independent=all(share.exact for share in shares),
        largest_p=max(share.equivalence_p or 0.0 for share in shares) if all_equal else None,
    )
    return replace(text, simulated=found.data.simulated)


def _rows(found: ComparisonResults) -> list[tuple[str, ShareEstimate | None, SequenceShare | None]]:
    """Return what the tables list: the sequences, then all answers."""
    rows: list[tuple[str, ShareEstimate | None, SequenceShare | None]]
    rows = [(in_words(own.name), own.estimate, own) for own in found.sequences]
    return [*rows, ("All answers", found.pooled, None)] if len(rows) > 1 else rows


def _share_table(found: ComparisonResults) -> Table:
    """Return shares, intervals and tests."""
    rows: list[tuple[Cell, ...]] = []
    for name, share, own in _rows(found):
        if share is None:
            rows.append((name, None, None, None, None, None, None, "no answer"))
            continue
        holm = own.p_holm if own else None
        first = own.order.ours_first if own and own.order.trials else None
        rows.append((name, *_share_cells(share), p_text(holm), first, share.flag))
    return Table(
        "How often the modulated version was taken for the one that changed, with 95 % confidence intervals. "
        "“Ours first”: trials in which it came first.",
        ("sequence", "ours chosen", "share", "95 % CI", "p", "p (Holm)", "ours first", "remark"),
        tuple(rows),
    )


def _share_cells(share: ShareEstimate) -> tuple[Cell, ...]:
    """Return the cells of a share: its counts as "9 of 17", itself, its interval, p."""
    count = f"{int(share.choices.chosen.sum())} of {share.choices.total}"
    return count, f"{share.choices.share:.2f}", _range(share.interval), p_text(share.p_value)


def _range(ends: Interval | None) -> str | None:
    """Return an interval for a cell."""
    return None if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}"


def _equality_table(found: ComparisonResults) -> Table:
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
        holm = p_text(own.equivalence_holm if own else None)
        rows.append((name, _range(share.narrow), p_text(share.equivalence_p), holm, margin, *odds))
    within = f"0.5 ± {found.margin:g}"
    return Table(
        f"Is the share equivalent to one half? p: two one-sided tests of {within}, which the 90 % confidence "
        "interval decides; smallest margin: the smallest that these answers show at 5 %. Bayes "
        f"factors above 1 favour one half (against any other share, uniform), or {within} (against what lies "
        "outside). They and the posterior probability need independent answers.",
        ("sequence", "90 % CI", "p", "p (Holm)", "smallest margin", "BF for 0.5", f"BF for {within}",
         f"probability of {within}"),
        tuple(rows),
    )  # fmt: skip


def pooled_section(found: ComparisonResults) -> Section:
    """Return what all answers together show: the model, the order, and guessing."""
    fitted, first = found.model.intercept, found.first
    columns = ("", "count", "share", "95 % CI", "p", "remark")
    cells = (*_share_cells(first), first.flag) if first else (*[None] * 4, found.order.flag)
    row = ("first of the two chosen", *cells)
    text = section(
        "comparison_pooled",
        (Table("Bias to an interval, whichever version it held.", columns, (row,)),),
        found=found,
        effect=None if fitted is None else shown_effect(found.model, fitted),
        share=lambda end: "–" if end is None else f"{100 * special.expit(end):.0f} %",
        alpha=ALPHA,
    )
    return replace(text, simulated=found.data.simulated)


def limits_section(limits: Sequence[AnswerLimits], picture: Picture) -> Section:
    """Return what so many answers can and cannot show."""
    return section("comparison_limits", (_limits_table(limits),), (picture,), own=limits[0], power=POWER)


def _limits_table(limits: Sequence[AnswerLimits]) -> Table:
    """Return what each number of answers can show, a row for each question."""
    names = listed([str(own.answers) for own in limits])
    questions = zip(*(limit_rows(own) for own in limits), strict=True)
    return Table(
        f"What {names} answers can show about a share; the margin is {limits[0].margin:g}. Exact, over all "
        "outcomes.",
        ("", *(f"{own.answers} answers" for own in limits)),
        tuple((rows[0].what, *(row.value for row in rows)) for rows in questions),
    )
