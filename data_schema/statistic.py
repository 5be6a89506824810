"""The rows of result tables: statistics with intervals and where they come from, and points of figures."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity


class Origin(enum.Enum):
    """Where a number comes from."""

    PUBLISHED = "published"  # printed in the paper, or follows from what is printed
    SIMULATED = "simulated"  # from answers of simulated participants
    RECORDED = "recorded"  # from answers of people, or from readings of an instrument
    COMPUTED = "computed"  # by the model, from a video or a scene: nobody was asked


@dataclass(frozen=True, slots=True)
class Statistic:
    """One number of a result: a row of a table of results.

    Attributes
    ----------
    table : str
        Which table of the results it belongs to, e.g. "means".
    group : str
        What it is about within the table: a sequence, a place, "all".
    what : str
        What it is, in words.
    value : float or None
        The number; None where the data do not give it (`flag` says why).
    unit : str
        Its unit; "1" for a pure number.
    origin : Origin
        Where it comes from.
    ci_low, ci_high : float or None
        Interval; None for none, or for an end that has no bound (`flag` says so).
    interval : float or None
        Share of such intervals that hold the true value, e.g. 0.95; None without an interval.
    p_value, p_adjusted : float or None
        Of the test that `method` names, by itself and adjusted for the number of tests.
    n : int or None
        How many participants, or trials where `method` says so, it rests on.
    method : str
        How it was reckoned.
    flag : str
        Why it should be looked at, or is missing; empty for nothing.
    """

    table: str = described("which table of the results it belongs to")
    group: str = described("what it is about within the table: a sequence, a place, all")
    what: str = described("what it is, in words")
    value: float | None = quantity("1", "the number; empty where the data do not give it")
    unit: str = described("unit of value and interval; 1 for a pure number")
    origin: Origin = described("where it comes from")
    ci_low: float | None = quantity("1", "lower end of the interval; empty for none", default=None)
    ci_high: float | None = quantity("1", "upper end of the interval; empty for none", default=None)
    interval: float | None = quantity(
        "1", "share of such intervals that hold the true value", above=0.0, maximum=1.0, default=None
    )
    p_value: float | None = quantity("1", "of the test in `method`", minimum=0.0, maximum=1.0, default=None)
    p_adjusted: float | None = quantity(
        "1", "adjusted for the number of tests", minimum=0.0, maximum=1.0, default=None
    )
    n: int | None = quantity("1", "participants, or what `method` says", minimum=0, default=None)
    method: str = described("how it was reckoned", default="")
    flag: str = described("why it should be looked at, or is missing", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        if self.value is None and not self.flag:
            raise ValueError(f"{self.what!r} has no value, and no flag that says why")


@dataclass(frozen=True, slots=True)
class PlottedPoint:
    """One point, bar or step of a figure: a row of the table beside it.

    Attributes
    ----------
    panel, series : str
        Part of the figure, and what is drawn in it.
    label : str
        Place on an axis of categories; empty on an axis of numbers.
    x, y : float or None
        Where it lies; x is None on an axis of categories, y where there is nothing to draw.
    x_quantity, x_unit, y_quantity, y_unit : str
        What the axes are.
    low, high : float or None
        Ends of the bar or band of uncertainty; None for none.
    n : int or None
        How many participants, trials or frames it rests on.
    origin : Origin
        Where it comes from.
    """

    panel: str = described("part of the figure")
    series: str = described("what is drawn in it")
    label: str = described("place on an axis of categories; empty on an axis of numbers")
    x: float | None = quantity("1", "place on an axis of numbers, in x_unit")
    y: float | None = quantity("1", "in y_unit; empty where there is nothing to draw")
    x_quantity: str = described("what the horizontal axis is")
    x_unit: str = described("its unit")
    y_quantity: str = described("what the vertical axis is")
    y_unit: str = described("its unit")
    origin: Origin = described("where it comes from")
    low: float | None = quantity("1", "lower end of the bar or band of uncertainty", default=None)
    high: float | None = quantity("1", "upper end of it", default=None)
    n: int | None = quantity("1", "participants, trials or frames it rests on", minimum=0, default=None)

    def __post_init__(self) -> None:
        check_limits(self)
