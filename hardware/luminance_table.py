"""Readings that were made elsewhere: the table of a photometer's own software, as readings of a sweep.

The table is CSV, with a decimal point. Its columns are

- `pixel_value`: L' of the uniform screen, from 0 to 1 (an 8-bit code divided by 255),
- `luminance_cd_m2`: what the meter showed; u where it showed that it was too dark for it,
- `factor`, optional: brightness factor b of the white screen; empty in the sweep of pixel values.

Several readings of a level are several rows, in the order in which they were made.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.display import HIGHEST_LUMINANCE
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.sweep import LuminanceReading, ReadingStatus, SweepPhase
from evenlight.data_schema.storage.tables import csv_rows, number_in

COLUMNS = ("pixel_value", "luminance_cd_m2", "factor")
UNDER_RANGE = "u"


@dataclass(frozen=True, slots=True)
class TableRow:
    """One reading of the table."""

    line: int  # of the file
    pixel_value: float  # L' that was shown
    factor: float | None  # brightness factor b of the white screen; None at full brightness
    luminance: float | None  # what the meter showed [cd/m^2]; None where it was too dark for it


def luminance_readings_from_csv(path: Path) -> list[LuminanceReading]:
    """Return the readings of a table as those of a sweep, in its order; they carry no times.

    Raises
    ------
    InputError
        If it is no table of readings.
    """
    repeats: Counter[tuple[float, float | None]] = Counter()
    readings = []
    for index, row in enumerate(read_table(path)):
        level = (row.pixel_value, row.factor)
        repeats[level] += 1
        readings.append(
            LuminanceReading(
                index=index,
                phase=SweepPhase.SWEEP,
                repeat=repeats[level],
                pixel_value=row.pixel_value,
                factor=row.factor,
                achieved_factor=1.0 if row.factor is None else row.factor,
                luminance=row.luminance,
                status=ReadingStatus.UNDER_RANGE if row.luminance is None else ReadingStatus.OK,
                meter_status=f"line {row.line}",
                begun=0.0,
                ended=0.0,
            )
        )
    return readings


def read_table(path: Path) -> list[TableRow]:
    """Return the rows of a table of readings.

    Raises
    ------
    InputError
        If it is none, or a cell is no such quantity.
    """
    rows = []
    for line, (pixel_value, luminance, factor) in csv_rows(
        path, COLUMNS, "a table of luminance readings", optional=("factor",)
    ):
        where = f"{path}, line {line}: "
        row = TableRow(
            line,
            _number(pixel_value, f"{where}pixel_value", 0.0, 1.0),
            _number(factor, f"{where}factor", 0.0, 1.0) if factor.strip() else None,
            None
            if luminance.strip().lower() == UNDER_RANGE
            else _number(luminance, f"{where}luminance_cd_m2", 0.0, HIGHEST_LUMINANCE),
        )
        if row.factor == 0:
            raise InputError(f"{where}factor must be above 0")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: has no readings")
    return rows


def _number(cell: str, what: str, lowest: float, highest: float) -> float:
    try:
        number = number_in(cell, what)
    except InputError:
        number = math.nan
    if not lowest <= number <= highest:
        raise InputError(f"{what} must be a number from {lowest:g} to {highest:g}, got {cell!r}")
    return number
