"""The page of a benchmark: what was measured on which machine, as a document with tables and pictures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from benchmarks.chart import duration
from benchmarks.measured import SubjectResults
from benchmarks.records import BenchmarkClaim, BenchmarkGrowth, BenchmarkPoint, Role

VERDICT = {True: "met", False: "**missed**", None: "not measured"}
PREFACE = (
    "Written by `evenlight bench all`; every figure on this page is from one run of it. Times are "
    "medians of as many runs as the tables say, the approaches of a task taken in turn, so that what else "
    "the machine does falls on all alike; ratios are medians over the turns. A first turn, which compiles "
    "and fills caches, does not count, unless a line says that there was none. What takes too long to "
    "repeat was timed once: its number of runs is 1. Peers run with their own defaults unless a line says "
    "otherwise. Of tasks that differ only in the size of the frame the largest is shown; the others, and "
    "quartiles, are in the CSV files. *Ours* is the default solver."
)
SIZE = re.compile(r"\d+ x \d+")
# What an approach is called beside its name: the default is bold, and a variant needs no word.
ROLES = {Role.REFERENCE: " (reference)", Role.PEER: " (peer)", Role.CITED: " (cited)"}


def page(machine: Mapping[str, str], subjects: Sequence[SubjectResults], quick: bool, pictures: str) -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    machine : mapping of str to str
        What it ran on.
    subjects : sequence of SubjectResults
        What was measured.
    quick : bool
        Whether it was a short run.
    pictures : str
        Where the pictures lie, as a path from the page.
    """
    rough = ["*A quick run: small sizes, each run timed once; its figures are rough.*", ""] if quick else []
    where = "; ".join(f"{name}: {value}" for name, value in machine.items())
    lines = ["# Speed against error", "", PREFACE, "", *rough, f"Machine: {where}.", ""]
    claims = [c for subject in subjects for c in subject.claims]
    if claims:
        lines += ["## Targets", "", *_claims(claims), ""]
    for subject in subjects:
        lines += [*_subject(subject, pictures), ""]
    return "\n".join(lines).rstrip() + "\n"


def _subject(subject: SubjectResults, pictures: str) -> list[str]:
    """Return the part of one subject."""
    lines = [f"## {subject.title}", "", subject.lead, ""]
    for chart in subject.charts:
        lines += [f"![{chart.title}]({pictures}bench-{chart.name}.png)", ""]
    # The last of the same name is kept: sizes grow.
    shown = {SIZE.sub("", p.task): p.task for p in subject.points}
    for task in shown.values():
        lines += [f"### {_capital(task)}", "", *_points([p for p in subject.points if p.task == task]), ""]
    if subject.growth:
        lines += ["### Growth with size", "", *_growth(subject.growth), ""]
    lines += [f"- {note}" for note in subject.notes]
    lines += [f"- Not measured here, {what}: {why}" for what, why in subject.refused.items()]
    return lines


def _claims(claims: Iterable[BenchmarkClaim]) -> list[str]:
    """Return the table of targets."""
    rows = (
        (c.claim, _number(c.target, c.unit), _number(c.measured, c.unit), VERDICT[c.met], c.note)
        for c in claims
    )
    return _table(("what", "at most", "measured", "", "how"), rows)


def _points(points: Sequence[BenchmarkPoint]) -> list[str]:
    """Return the table of one task; columns that hold nothing are left out."""
    sizes = len({p.size for p in points}) > 1
    columns = {
        "approach": [_named(p) for p in points],
        points[0].size_of: [str(p.size) if sizes else "" for p in points],
        "time": [duration(p.time) for p in points],
        "runs": [str(p.repeats) if p.repeats else "" for p in points],
        "ratio": ["" if p.ratio is None else f"{p.ratio:.3g}" for p in points],
        "error": ["" if p.error is None else f"{p.error:.2g}" for p in points],
        "memory": ["" if p.peak_memory is None else f"{p.peak_memory:.0f} MiB" for p in points],
        "note": [p.note for p in points],
    }
    filled = {name: cells for name, cells in columns.items() if any(cells)}
    table = _table(tuple(filled), zip(*filled.values(), strict=True))
    errors = dict.fromkeys(p.error_of for p in points if p.error is not None)
    return [*table, *(["", f"Error: {'; '.join(errors)}."] if errors else [])]


def _named(point: BenchmarkPoint) -> str:
    if point.role is Role.DEFAULT:
        return f"**{point.approach}**"
    return point.approach + ROLES.get(point.role, "")


def _growth(rows: Iterable[BenchmarkGrowth]) -> list[str]:
    """Return the table of exponents."""
    cells = (
        (
            g.task,
            g.approach,
            f"{g.smallest} to {g.largest} {g.size_of}",
            f"{g.exponent:.2f}",
            "" if g.exponent_low is None else f"{g.exponent_low:.2f} to {g.exponent_high:.2f}",
        )
        for g in rows
    )
    return _table(("task", "approach", "sizes", "exponent", "95 % confidence interval"), cells)


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a table of Markdown."""
    body = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    return [
        f"| {' | '.join(columns)} |",
        f"|{'---|' * len(columns)}",
        *(f"| {' | '.join(row)} |" for row in body),
    ]


def _number(value: float | None, unit: str) -> str:
    """Return a measured figure with its unit."""
    if value is None:
        return "–"
    return f"{value:.3g} {unit}".rstrip() if unit != "1" else f"{value:.3g}"


def _capital(words: str) -> str:
    """Return words that begin with a capital letter."""
    return words[:1].upper() + words[1:]
