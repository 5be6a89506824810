"""How the rows of the ratings' results are made, and the words that they share."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.analysis.inference.paired_effects import LEVEL, Effect
from evenlight.data_schema.statistic import Origin, Statistic

POINTS = "rating points"
ADJUSTED_T = "Student's t with two pseudo pairs (after Agresti & Min 2005)"
SIGN_FLIP = "exact sign-flip test of the mean difference"


@dataclass(frozen=True, slots=True)
class Row:
    """What a row of results is about.

    Attributes
    ----------
    table, group, what : str
        As in `Statistic`.
    unit : str
        As in `Statistic`.
    method : str
        As in `Statistic`.
    """

    table: str
    group: str
    what: str
    unit: str
    method: str


@dataclass(frozen=True, slots=True)
class PValues:
    """A test's p, raw and adjusted."""

    p_value: float | None = None
    p_adjusted: float | None = None


NO_TEST = PValues()


def statistic(row: Row, effect: Effect, n: int, origin: Origin, tested: PValues = NO_TEST) -> Statistic:
    """Return a row with its numbers."""
    bounded = effect.ci_low is not None or effect.ci_high is not None
    return Statistic(
        row.table,
        row.group,
        row.what,
        effect.value,
        row.unit,
        origin,
        effect.ci_low,
        effect.ci_high,
        LEVEL if bounded else None,
        tested.p_value,
        tested.p_adjusted,
        n,
        row.method,
        effect.flag,
    )
