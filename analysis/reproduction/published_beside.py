"""The paper's numbers beside ours: what agreement can show, and how often they agree.

Many of our numbers are made with published ones: budgets, power model, rate limit, gains. Some follow from
them, and then cannot but agree (docs/decisions/what-agreement-shows.md).
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator
from dataclasses import replace

from evenlight.analysis.report import Cell, KeyFigure, Table
from evenlight.analysis.wording import in_words, of_track
from evenlight.data_schema.analysis_results import Origin, Statistic

DIFFERENCE = "mean difference, ours less baseline"
CHOSEN = "ours chosen"
RATINGS = tuple(f"{what}, {of}" for of in ("baseline", "ours") for what in ("mean rating", "standard error"))
LAG = "integral of |static - dynamic response| over time: per pixel"  # what the paper integrates
LAG_RATIO = "lag of the cones, without a rate limit over within it"
SD = "SD over time of contrast loss"
SD_RATIO = "SD of the controller / SD of constant dimming"
SLOPE = "slope at threshold"
POWER = "average power"
PRINTED = (Origin.PUBLISHED, Origin.AUTHORS)


class Dependence(enum.Enum):
    """How far published numbers make ours, so that agreement would show nothing."""

    INDEPENDENT = "independent"  # none went into it
    PARTLY = "partly determined"  # some went into it, and leave it open
    CIRCULAR = "circular"  # they, or choices that were made to meet them, make it


RATERS = "the raters' loss model and cut points"
# What is printed (or how it begins): half a unit of its last digit, None where the two are not comparable in
# size; how far published numbers make ours, and by what.
COMPARED = {
    SLOPE: (0.01, Dependence.CIRCULAR, "participants were drawn around the published curve"),
    DIFFERENCE: (0.01, Dependence.CIRCULAR, RATERS),
    "mean rating": (None, Dependence.CIRCULAR, RATERS),
    "standard error": (None, Dependence.CIRCULAR, RATERS),
    CHOSEN: (0.005, Dependence.CIRCULAR, "the observers' thresholds and masking"),
    LAG_RATIO: (0.0005, Dependence.PARTLY, "budgets"),
    "average difference": (None, Dependence.PARTLY, "budgets"),
    POWER: (0.0005, Dependence.CIRCULAR, "budgets and power model"),
    SD_RATIO: (0.045, Dependence.PARTLY, "gains"),
    SD: (None, Dependence.PARTLY, "gains"),
}
OURS = {SLOPE: "rate limit", "average difference": LAG}  # where ours has another name
IN_PERCENT = (CHOSEN, SD)  # shares that are shown so


def _entry(what: str) -> tuple[float | None, Dependence, str]:
    return COMPARED[what if what in COMPARED else what.partition(", ")[0]]


def mark(what: str, origin: Origin, *, drawn: bool) -> tuple[Dependence, str]:
    """Return how far published numbers make a number of ours, and by what.

    Parameters
    ----------
    what, origin : str, Origin
        The printed number that it is held against (of `COMPARED`); where ours is from.
    drawn : bool
        Whether the rate limit is that of participants drawn around the published one.

    >>> mark(CHOSEN, Origin.RECORDED, drawn=True)[0].value, mark(LAG_RATIO, Origin.COMPUTED, drawn=True)[1]
    ('independent', 'budgets and rate limit')
    """
    _, dependence, because = _entry(what)
    if origin is Origin.RECORDED:
        read = what.startswith(POWER)
        return Dependence.INDEPENDENT, "an instrument was read" if read else "people answered"
    return dependence, f"{because} and rate limit" if dependence is Dependence.PARTLY and drawn else because


def marked(row: Statistic, *, drawn: bool, beside: str = "") -> Statistic:
    """Return a number of ours whose flag says how far published ones make it.

    `beside` is the printed number that it is held against, where its own name is another.
    """
    dependence, because = mark(beside or row.what, row.origin, drawn=drawn)
    made = "" if dependence is Dependence.INDEPENDENT else f"{dependence.value}: {because}"
    return replace(row, flag="; ".join(filter(None, (made, row.flag))))


def pairs(rows: Iterable[Statistic]) -> Iterator[tuple[Statistic, Statistic]]:
    """Yield each printed number with ours, where there is one: computed, or measured as well."""
    every = list(rows)
    for theirs in (row for row in every if row.origin in PRINTED):
        name, comma, of = theirs.what.partition(", ")
        if theirs.what in COMPARED:
            name, comma, of = theirs.what, "", ""
        elif name not in COMPARED:
            continue
        what = f"{OURS.get(name, name)}{comma}{of}"
        own = [row for row in every if (row.group, row.what) == (theirs.group, what)]
        first = {row.origin: row for row in reversed(own) if row.origin not in PRINTED}
        yield from ((theirs, ours) for ours in reversed(first.values()))


def meets(theirs: Statistic, ours: Statistic) -> bool:
    """Return whether ours meets a printed number: within our 95 % interval, or within its rounding."""
    step = _entry(theirs.what)[0]
    if theirs.value is None or ours.value is None or step is None:
        return False
    if ours.ci_low is not None and ours.ci_high is not None and ours.ci_low <= theirs.value <= ours.ci_high:
        return True
    return abs(ours.value - theirs.value) <= step


def beside_table(caption: str, rows: Iterable[Statistic], *, drawn: bool) -> Table:
    """Return a table of printed numbers with ours beside them, each with its mark."""
    lines: list[tuple[Cell, ...]] = []
    for theirs, ours in pairs(rows):
        dependence, because = mark(theirs.what, ours.origin, drawn=drawn)
        comparable = _entry(theirs.what)[0] is not None
        met = ("yes" if meets(theirs, ours) else "no") if comparable else None
        low, high = (_shown(ours, end) for end in (ours.ci_low, ours.ci_high))
        ends = f"{low} to {high}" if low and high else None
        unit = {"1": "", theirs.unit: ""}.get(ours.unit, f" {ours.unit}")
        own = _shown(ours, ours.value)
        shown = _shown(theirs, theirs.value), own and f"{own}{unit}", ends
        what = f"{of_track(theirs.what)} [{'%' if theirs.what.startswith(IN_PERCENT) else theirs.unit}]"
        of, what = (words.replace("^2", "²") for words in (in_words(theirs.group), what))
        lines.append((of, what, *shown, ours.origin.value, dependence.value, because, met))
    names = ("of", "what", "published", "here", "95 % interval", "origin", "it is", "by", "met")
    return Table(caption, names, tuple(lines))


def _shown(row: Statistic, value: float | None) -> str | None:
    if value is None:
        return None
    return f"{(100 if row.what.startswith(IN_PERCENT) else 1) * value:.3g}"


def key_figures(parts: Iterable[Iterable[Statistic]], *, drawn: bool) -> tuple[KeyFigure, ...]:
    """Return how many published numbers ours meet, and of how many that shows anything."""
    every = (pair for rows in parts for pair in pairs(rows))
    found = [pair for pair in every if _entry(pair[0].what)[0] is not None]
    marks = [mark(theirs.what, ours.origin, drawn=drawn)[0] for theirs, ours in found]
    met = [own for own, pair in zip(marks, found, strict=True) if meets(*pair)]
    counted = {kind: (met.count(kind), marks.count(kind)) for kind in Dependence}
    words = [f"{k} of {n} {kind.value}" for kind, (k, n) in counted.items() if n]
    return (
        KeyFigure(
            f"{len(met)} of {len(found)}",
            "published numbers met, within our 95 % interval or their rounding",
            ", ".join(words),
        ),
        KeyFigure(
            f"{counted[Dependence.INDEPENDENT][1]} of {len(found)}",
            "of these are independent of what is published",
            "agreement of the others shows little or nothing",
        ),
    )
