"""The rows of the audit: numbers that are printed, or follow from such; its text reads them here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import published
from evenlight.analysis.report import Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.wording import p_text
from evenlight.data_schema.analysis_results import Origin, Statistic

ALL = "all"


def row(table: str, group: str, what: str, value: float | None, unit: str = "1", **more: Any) -> Statistic:
    """Return a row of the audit: computed and a pure number, unless `origin` and `unit` say otherwise."""
    return Statistic(table, group, what, value, unit, **{"origin": Origin.COMPUTED, **more})


class AuditRows:
    """The rows of the audit, found by table, group and words: what a text says is what the table has."""

    def __init__(self, statistics: Sequence[Statistic]) -> None:
        self.statistics = tuple(statistics)
        self._rows = {(s.table, s.group, s.what): s for s in statistics}

    def of(self, table: str, group: str, what: str) -> Statistic:
        """Return a row."""
        return self._rows[(table, group, what)]

    def number(self, table: str, group: str, what: str) -> float:
        """Return the number of a row that has one."""
        value = self.of(table, group, what).value
        assert value is not None
        return value

    def ends(self, table: str, group: str, test: str) -> tuple[float, float]:
        """Return the smallest and the largest p of a test."""
        low, high = (self.number(table, group, f"{end} p of the {test}") for end in ("smallest", "largest"))
        return low, high


def audit_section(
    template: str, rows: AuditRows, tables: Sequence[Table], drawings: Sequence[Drawing] = (), **values: Any
) -> Section:
    """Return a section from its template in `prose/audit/`, which looks its numbers up by itself."""
    pictures = [drawing.picture for drawing in drawings]
    return section(
        f"audit/{template}", tables, pictures, number=rows.number, row=rows.of, published=published, **values
    )


def between(low: str, high: str) -> str:
    """Return a range in words; one number where both ends are written alike.

    >>> between("0.1", "0.2"), between("1", "1")
    ('0.1 to 0.2', '1')
    """
    return low if low == high else f"{low} to {high}"


def p_between(low: float | None, high: float | None) -> str:
    """Return a range of p in words.

    >>> p_between(0.00012, 0.0216)
    '< 0.001 to 0.022'
    """
    return between(p_text(low) or "", p_text(high) or "")
