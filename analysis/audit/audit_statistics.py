"""The rows of the audit: every number in it follows from published ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from evenlight.analysis.wording import p_text
from evenlight.data_schema.statistic import Origin, Statistic

ALL = "all"


def row(table: str, group: str, what: str, value: float | None, unit: str = "1", **more: Any) -> Statistic:
    """Return a row of the audit; a pure number, unless `unit` says otherwise."""
    return Statistic(table, group, what, value, unit, Origin.PUBLISHED, **more)


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


class Rows:
    """The rows of the audit, found by table, group and words: what a text says is what the table has."""

    def __init__(self, statistics: Sequence[Statistic]) -> None:
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
