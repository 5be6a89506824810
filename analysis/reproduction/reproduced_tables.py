"""The table of detail quality and artifacts (the paper's Table 1), published numbers beside our own."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.findings import Findings
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.wording import in_words, p_text
from evenlight.data_schema.statistic import Origin, Statistic

TABLE = "detail_quality"
DIFFERENCE = "mean difference, ours less baseline"
VERSIONS = ("baseline", "ours")


def find(rows: Sequence[Statistic], group: str, what: str) -> Statistic | None:
    """Return the first row of a group that says a thing; None if there is none."""
    return next((row for row in rows if (row.group, row.what) == (group, what)), None)


def detail_quality_findings(rating: Findings, comparison: Findings) -> Findings:
    """Return mean ratings with standard errors, and how often ours was chosen, sequence by sequence.

    Parameters
    ----------
    rating, comparison : Findings
        Of the two experiments.
    """
    own = [*rating.statistics, *comparison.statistics]
    groups = dict.fromkeys(row.group for row in own if row.what in (DIFFERENCE, "ours chosen"))
    names = [name for name in groups if name != "all" and not name.startswith("all ")]
    rows = [row for name in SEQUENCES for row in _published_rows(name)]
    for name in names:
        for what in (*_ratings(), DIFFERENCE, "ours chosen"):
            row = find(own, name, what)
            rows += [row] if row is not None else []
    simulated = any(row.origin is Origin.SIMULATED for row in rows)
    shown = [name for name in SEQUENCES if name in names] + [n for n in names if n not in SEQUENCES]
    lines = [line for name in shown for line in _lines(rows, name)]
    lead = f"{rating.lead} {comparison.lead}"
    columns = (
        "sequence", "origin", "constant: mean", "SEM", "ours: mean", "SEM",
        "ours - constant", "95 % interval", "p, exact", "Holm", "ours chosen [%]", "95 % interval",
    )  # fmt: skip
    caption = (
        "Ratings of details from 1 to 5 as mean and standard error (SD with n - 1), their difference, and "
        "how often ours was chosen as the version whose brightness changes. The paper prints no test and no "
        "interval; `evenlight audit` says which ones its numbers allow."
    )
    section = Section(
        "Detail quality and artifacts (Table 1)", (lead,), (Table(caption, columns, tuple(lines)),),
        simulated=simulated,
    )  # fmt: skip
    return Findings(TABLE, lead, tuple(rows), (), (section,))


def _ratings() -> tuple[str, ...]:
    """Return the names of the rows of a version's ratings."""
    return tuple(f"{what}, {version}" for version in VERSIONS for what in ("mean rating", "standard error"))


def _published_rows(name: str) -> list[Statistic]:
    """Return what Table 1 prints of a sequence."""
    rows = []
    for version in VERSIONS:
        for what, key in (("mean rating", "mean"), ("standard error", "sem")):
            value = published(f"{TABLE}.{name}.{version}_{key}")
            rows.append(_published(name, f"{what}, {version}", value.number, "rating points", value.place))
    chosen = published(f"{TABLE}.{name}.chosen_percent")
    rows.append(_published(name, "ours chosen", chosen.number / 100, "1", chosen.place))
    return rows


def _published(group: str, what: str, value: float, unit: str, place: str) -> Statistic:
    """Return the row of a printed number."""
    n = int(published("participants.viewing").number)
    return Statistic(TABLE, group, what, value, unit, Origin.PUBLISHED, n=n, method=place)


def _lines(rows: Sequence[Statistic], name: str) -> list[tuple[Cell, ...]]:
    """Return the lines of a sequence: as printed, then ours."""
    lines = []
    for origin in (Origin.PUBLISHED, Origin.SIMULATED, Origin.RECORDED):
        own = [row for row in rows if row.group == name and row.origin is origin]
        if own:
            lines.append((in_words(name), origin.value, *_cells(own, name)))
    return lines


def _cells(rows: Sequence[Statistic], name: str) -> tuple[Cell, ...]:
    """Return the numbers of a line."""
    means = [_two_places(find(rows, name, what)) for what in _ratings()]
    difference, chosen = find(rows, name, DIFFERENCE), find(rows, name, "ours chosen")
    if difference is None and None not in means:
        apart: tuple[Cell, ...] = (f"{float(means[2] or 0) - float(means[0] or 0):+.2f}", None, None, None)
    else:
        apart = (
            None if difference is None or difference.value is None else f"{difference.value:+.2f}",
            interval_in_words(difference),
            p_text(difference.p_value if difference else None),
            p_text(difference.p_adjusted if difference else None),
        )
    share = None if chosen is None or chosen.value is None else f"{100 * chosen.value:.0f}"
    return (*means, *apart, share, interval_in_words(chosen, 100))


def _two_places(row: Statistic | None) -> str | None:
    """Return a rating with two places, as the paper prints it."""
    return None if row is None or row.value is None else f"{row.value:.2f}"


def interval_in_words(row: Statistic | None, times: float = 1.0) -> str | None:
    """Return an interval as "low to high"; an end without bound as a dash; None without an interval.

    >>> interval_in_words(Statistic("t", "g", "w", 0.5, "1", Origin.RECORDED, 0.25, 0.75, 0.95), 100)
    '25 to 75'
    """
    if row is None or row.interval is None:
        return None
    ends = ("–" if end is None else _short(times * end) for end in (row.ci_low, row.ci_high))
    return " to ".join(ends)


def _short(value: float) -> str:
    """Return a number with two places, or as a whole one from 10 on."""
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2f}"
