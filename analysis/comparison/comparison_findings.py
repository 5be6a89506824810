"""What the artifact comparison found: first lines, figures, sections (Section 4.3 of the paper)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evenlight.analysis.comparison import comparison_results as results
from evenlight.analysis.comparison.comparison_figure import power_figure, shares_figure
from evenlight.analysis.comparison.comparison_results import ALL, CHOSEN, FIRST, Comparison, compare
from evenlight.analysis.inference.binomial_tests import ALPHA, DEFAULT_MARGIN
from evenlight.analysis.integrity.gate import confounded_order
from evenlight.analysis.report import Cell, KeyFigure, Picture, Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import flag, interval, number, p, p_with_holm, table_of, with_interval
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few, in_words, listed, p_in_words, people_noun, percent, spaced
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.recordings.viewing import ComparisonTrial

FEWEST = 6  # people; fewer bound no share
Limits = Mapping[str, float | None]


def comparison_findings(
    data: TaskData[ComparisonTrial], seed: int = 1, margin: float = DEFAULT_MARGIN
) -> Analysis:
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
    numbers = found.answers_per_sequence
    limits = [results.add_limits(found.rows, n, margin) for n in dict.fromkeys(numbers)]
    shares, power = shares_figure(found), power_figure(numbers[0], margin)
    return Analysis(
        name="comparison",
        lead=lead_of(found, limits[0]),
        rows=tuple(found.rows),
        drawings=(shares, power),
        sections=(
            shares_section(found, shares.picture),
            pooled_section(found),
            limits_section(found, limits, power.picture),
        ),
        warnings=(*data.warnings, *warnings_of(found)),
        key_figures=key_figures_of(found, limits[0]),
    )


def lead_of(found: Comparison, limits: Limits) -> str:
    """Return what came out, in two sentences or three."""
    different, equal = ([spaced(s) for s in found.beyond_chance(t)] for t in ("shares", "equivalence"))
    values = {"found": found, "pooled": found.pooled, "own": limits, "alpha": ALPHA}
    values["confound"] = confounded_order(found.data)  # the gate says it
    differences = found.guessing(results.DIFFERENCE)
    return " ".join(
        prose("comparison_lead", **values, differences=differences, different=different, equal=equal)
    )


def key_figures_of(found: Comparison, limits: Limits) -> tuple[KeyFigure, ...]:
    """Return what came out, how sure it is, and what the order does or what is wrong."""
    share, find = found.pooled.difference, found.rows.find
    sure = [] if share.p_value is None else [p_in_words(share.p_value)]
    if share.ci_low is not None and share.ci_high is not None and found.people >= FEWEST:
        sure.insert(0, f"95 % CI {100 * share.ci_low:.0f} to {percent(share.ci_high, 0)}")
    figures = [KeyFigure(percent(found.pooled.choices.share), "of answers chose the track", ", ".join(sure))]
    if len(found.shares) > 1:
        words = f"{len(found.beyond_chance('shares'))} of {len(found.shares)}"
        figures.append(KeyFigure(words, "sequences differ from a coin's 50 %", "exact tests, Holm"))
    reach = limits["share_found"]
    mostly = "too few to find any share" if reach is None else f"usually find a share of {percent(reach, 0)}"
    who = people_noun(found.people, found.data.simulated)
    figures.append(KeyFigure(f"{found.people}", who, mostly))
    first = find("order", ALL, FIRST)
    if found.order.flag:
        figures.append(KeyFigure("Caution", found.order.flag, warns=True))
    elif first and first.value is not None and first.p_value is not None:
        figures.append(
            KeyFigure(percent(first.value), "chose the first of the two", p_in_words(first.p_value))
        )
    return tuple(figures)


def warnings_of(found: Comparison) -> list[str]:
    """Return which answers are missing, and where ours came nearly always in one interval."""
    trials = found.data.trials
    people = sorted({trial.participant_id for trial in trials})
    cells = {(trial.participant_id, trial.sequence) for trial in trials}
    said = found.rows.separated()
    for name in found.shares:
        if missing := [who for who in people if (who, name) not in cells]:
            n = f"{len(missing)} of {len(people)}"
            said.append(f"comparison of {spaced(name)}: no answer of {n} participants ({first_few(missing)})")
    if confounded_order(found.data):  # the gate has said it
        return said
    over_all = [f"over all sequences {found.order.flag}"] if found.order.flag else []
    flags = {name: order.flag for name, order in found.orders.items() if not order.unknown}
    return [*said, *over_all, *(f"comparison of {spaced(name)}: {why}" for name, why in flags.items() if why)]


def shares_section(found: Comparison, picture: Picture) -> Section:
    """Return what was chosen, with intervals, tests and equivalence."""
    shares = [share for share in found.shares.values() if share is not None]
    all_equal = len(shares) > 1 and all(share.equivalent for share in shares)
    return section(
        "comparison_shares",
        (_share_table(found), _equality_table(found)),
        (picture,),
        simulated=found.data.simulated,
        found=found,
        independent=all(share.choices.one_each for share in shares),
        largest_p=max(share.equivalence.p_value or 0.0 for share in shares) if all_equal else None,
    )


def _names(found: Comparison) -> dict[str, str]:
    return {name: "All answers" if name == ALL else in_words(name) for name in found.listed}


def _share_table(found: Comparison) -> Table:
    def chosen(row: Statistic | None) -> tuple[Cell]:
        share = found.listed[row.group] if row else None
        return (share.choices.count if share else None,)

    def ours_first(row: Statistic | None) -> tuple[Cell]:
        order = found.orders.get(row.group) if row else None
        return (order.ours_first if order and order.trials else None,)

    return found.rows.view(
        "How often the track's version was taken for the one that changed, with 95 % confidence intervals. "
        "“The track first”: trials in which it came first.",
        _names(found),
        [("shares", CHOSEN, show) for show in (chosen, with_interval, p_with_holm, ours_first, flag)],
        ("sequence", "the track chosen", "share", "95 % CI", "p", "p (Holm)", "the track first", "remark"),
    )


def _equality_table(found: Comparison) -> Table:
    within = found.within
    return found.rows.view(
        f"Is the share equivalent to one half? p: two one-sided tests of {within}, which the 90 % confidence "
        "interval decides; smallest margin: the smallest that these answers show at 5 %. Bayes "
        f"factors above 1 favour one half (against any other share, uniform), or {within} (against what lies "
        "outside). They and the posterior probability need independent answers.",
        _names(found),
        [
            ("equivalence", f"share within {within}", lambda row: (interval(row),)),
            ("equivalence", f"share within {within}", p_with_holm),
            ("equivalence", results.SMALLEST_MARGIN, number),
            *(("bayes", what, lambda row: (row.value if row else None,)) for what in found.odds),
        ],
        (
            *("sequence", "90 % CI", "p", "p (Holm)", "smallest margin"),
            *("BF for 0.5", f"BF for {within}", f"probability of {within}"),
        ),
    )


def pooled_section(found: Comparison) -> Section:
    """Return what all answers together show: the model, the order, and guessing."""
    count = (found.first.choices.count if found.first else None,)
    table = table_of(
        "Bias to an interval, whichever version it held.",
        [(FIRST, found.rows.find("order", ALL, FIRST))],
        (lambda _: count, with_interval, p, flag),
        ("", "count", "share", "95 % CI", "p", "remark"),
    )
    return section(
        "comparison_pooled",
        (table,),
        simulated=found.data.simulated,
        found=found,
        effect=found.rows.find("model", ALL, results.PREFERENCE),
        consistency=found.guessing(results.AGREEMENT),
        differences=found.guessing(results.DIFFERENCE),
        share=lambda end: "–" if end is None else f"{100 * end:.0f} %",
        alpha=ALPHA,
    )


def limits_section(found: Comparison, limits: Sequence[Limits], picture: Picture) -> Section:
    """Return what so many answers can and cannot show."""
    groups = [f"{own['answers']} answers" for own in limits]
    values = {(row.group, row.what): row.value for row in found.rows.of("limits")}
    whats = dict.fromkeys(what for _, what in values)
    table = Table(
        f"What {listed([str(own['answers']) for own in limits])} answers can show about a share; the margin "
        f"is {found.margin:g}. Exact, over all outcomes.",
        ("", *groups),
        tuple((what, *(values[group, what] for group in groups)) for what in whats),
    )
    own, power = {**limits[0], "margin": found.margin}, results.POWER
    return section("comparison_limits", (table,), (picture,), own=own, power=power)
