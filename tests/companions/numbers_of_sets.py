"""How many data sets a claim on chance draws: few in `make test`, many in `make studies`."""

from typing import Any

import pytest
from scipy import stats


def few_and_many(few: int, many: int) -> list[Any]:
    """Parameters of a test: the second is one of `make studies`."""
    return [few, pytest.param(many, marks=pytest.mark.study)]


def counts_at(rate: float, sets: int) -> tuple[float, float]:
    """Shares of so many sets between which a true rate lies in 999 of 1000 studies."""
    low, high = stats.binom.interval(0.999, sets, rate)
    return float(low) / sets, float(high) / sets
