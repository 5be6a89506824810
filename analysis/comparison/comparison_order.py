"""Whether ours came first as often as second: if not, its share is also that of an interval."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from evenlight.analysis.comparison.comparison_counts import OURS_FIRST
from evenlight.data_schema.viewing import ComparisonTrial

RARE = 0.2  # share of the rarer order below which the order counts as nearly constant: 3 of 17


@dataclass(frozen=True, slots=True)
class Order:
    """How often ours came first.

    Attributes
    ----------
    ours_first, trials : int
        How often, of how many.
    """

    ours_first: int
    trials: int

    @property
    def constant(self) -> bool:
        """Whether ours came always in the same interval."""
        return self.trials > 0 and self.ours_first in (0, self.trials)

    @property
    def flag(self) -> str:
        """What the order makes of a share; empty where both orders are frequent enough."""
        rarer = min(self.ours_first, self.trials - self.ours_first)
        if rarer >= RARE * self.trials:
            return ""
        where = "first" if self.ours_first > rarer else "second"
        cause = "cannot be told" if self.constant else "can hardly be told"
        return (
            f"ours came {where} in {self.trials - rarer} of {self.trials} trials: its choice {cause} from a "
            "leaning to that interval"
        )


def order_of(trials: Iterable[ComparisonTrial]) -> Order:
    """Return how often ours came first."""
    intervals = [trial.ours_interval for trial in trials]
    return Order(sum(interval == OURS_FIRST for interval in intervals), len(intervals))
