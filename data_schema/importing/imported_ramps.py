"""Luminance ramps of another program's table: what follows from the luminances, and from the display."""

from __future__ import annotations

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_request import RELATIVE_RATES
from evenlight.data_schema.importing.imported_order import Rows
from evenlight.data_schema.recordings.ramp_values import TOLERANCE, merge_levels, with_end, with_rate


def complete_ramps(own: Rows) -> list[str]:
    """Give ramps what follows from others of their values and from the display; return it in words.

    White at full factor has the display's peak luminance, and its factor is the share of that; a rate may be
    relative to the initial luminance, and its sign the direction; levels that are nearly one become one.

    Raises
    ------
    InputError
        If no display is known; if many are brighter than it, or their rates contradict their luminances.
    """
    display, relative = own.taken.display, own.taken.units.get("rate") in RELATIVE_RATES
    place, given, told = own.table.place, own.taken.given, list[str]()
    if display is None:
        raise InputError(
            f"{own.table.path}: ramps need --display, a preset's name or a file: a rate limit holds for "
            "the display on which its ramps were shown, and for no other"
        )
    if any((values["rate"] or 0.0) < 0 for _, values in own.rows):
        told.append("direction: by the sign of the rate")
        for values in (values for _, values in own.rows if values["rate"]):
            values["direction"] = "up" if values["rate"] > 0 else "down"
            values["rate"] = abs(values["rate"])
    own.rows = own.sound(own.rows, lambda row, each: with_rate(each, place(row), display, relative))
    merged = merge_levels([values for _, values in own.rows])
    own.rows = own.sound(own.rows, lambda row, each: with_end(each, place(row), display))
    told += [f"{name}: from the display" for name in ("initial_luminance", "factor") if name not in given]
    told += [] if "screen" in given else ["screen: white"]
    told += [] if "rate" in given else ["rate: from initial and final luminance, and duration"]
    if merged:
        told.append(f"level: {merged} luminances within {TOLERANCE:.0%} of others are one with them")
    return told
