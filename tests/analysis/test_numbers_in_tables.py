"""Numbers as tables show them: ratios no further than the data can hold, a line for every row."""

import pytest

from evenlight.analysis.report import Cell
from evenlight.analysis.rows import number, ratio_with_interval, table_of
from evenlight.data_schema.analysis_results import Origin, Statistic


def ratio(value: float | None, low: float | None, high: float | None) -> Statistic:
    flag = "" if value else "no estimate"
    return Statistic("t", "all", "ratio", value, "1", Origin.RECORDED, low, high, flag=flag)


@pytest.mark.parametrize(
    ("row", "cells"),
    [(ratio(1.2, 0.5, 3.0), ("1.20", "0.50 to 3.00")),
     (ratio(1.2, 0.18, 1e11), ("1.20", "above 0.18, no upper bound")),
     (ratio(1.2, 1e-9, 3.0), ("1.20", "below 3.00, no lower bound")),
     (ratio(1.2, 1e-9, 1e11), ("1.20", "not bounded")),
     (ratio(1e9, 2.0, None), ("not bounded", "above 2.00, no upper bound")),
     (ratio(1e-9, None, 2.0), ("not bounded", "below 2.00, no lower bound")),
     (ratio(1e9, None, None), ("not bounded", None)),
     (ratio(None, None, None), (None, None)),
     (None, (None, None))],
)  # fmt: skip
def test_no_ratio_and_no_end_lies_beyond_what_the_data_can_hold(
    row: Statistic | None, cells: tuple[Cell, Cell]
) -> None:
    assert ratio_with_interval(row, 100.0) == cells


def test_rows_whose_words_are_alike_have_a_line_each() -> None:
    rows = [("Gym", ratio(1.0, None, None)), ("Gym", ratio(2.0, None, None))]
    assert table_of("Two.", rows, (number,), ("", "ratio")).rows == (("Gym", "1.00"), ("Gym", "2.00"))
