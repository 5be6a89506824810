"""Luminance ramps of another program's table: what follows from the luminances, and from the display."""

from __future__ import annotations

from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_request import RELATIVE_RATES
from evenlight.data_schema.importing.imported_order import Rows

Values = dict[str, Any]  # by our attributes
TOLERANCE = 0.02  # relative, of a measured luminance: about a luminance meter's accuracy (choice)


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
    own.rows = own.sound(own.rows, lambda row, each: _with_rate(each, place(row), display, relative))
    merged = _merge_levels([values for _, values in own.rows])
    own.rows = own.sound(own.rows, lambda row, each: _with_end(each, place(row), display))
    told += [f"{name}: from the display" for name in ("initial_luminance", "factor") if name not in given]
    told += [] if "screen" in given else ["screen: white"]
    told += [] if "rate" in given else ["rate: from initial and final luminance, and duration"]
    if merged:
        told.append(f"level: {merged} luminances within {TOLERANCE:.0%} of others are one with them")
    return told


def _with_rate(values: Values, where: str, display: Display, relative: bool) -> Values:
    values["screen"] = screen = values["screen"] or "white"
    start, end, factor = values["initial_luminance"], values["final_luminance"], values["factor"]
    expected = None  # it is known of white only
    if factor is not None and screen == "white":
        expected = factor * display.peak_luminance + display.reflected_luminance
    start = expected if start is None else start
    if start is None:
        raise InputError(f"{where}: no initial_luminance, and no factor of a white screen that tells it")
    highest = display.peak_luminance + display.reflected_luminance
    if not display.reflected_luminance < start <= highest * (1 + TOLERANCE):
        raise InputError(
            f"{where}: initial_luminance is {start:g} cd/m^2, but the display {display.name!r} shows "
            f"{display.reflected_luminance:g} to {highest:g}; give that of the ramps with --display"
        )
    if expected is not None and abs(start - expected) > TOLERANCE * expected:
        raise InputError(
            f"{where}: initial_luminance is {start:g} cd/m^2, but white at factor {factor:g} has "
            f"{expected:g} on the display {display.name!r}; give another, or leave it out (--column factor=)"
        )
    values["initial_luminance"] = min(start, highest)
    if values["duration"] is None:
        raise InputError(f"{where}: no duration; expected how long the ramp lasted")
    _complete_rate(values, start, end, where, relative)
    if "ramp_interval" in values and "procedure" not in values:
        values["procedure"] = "two_interval"
    return values


def _complete_rate(values: Values, start: float, end: float | None, where: str, relative: bool) -> None:
    rate = values["rate"] * start if relative and values["rate"] is not None else values["rate"]
    if values["is_catch"]:
        if rate:
            raise InputError(f"{where}: rate is {rate:g} cd/m^2/s, but is_catch says that nothing changed")
        rate, end = 0.0, None  # though a meter may have read two luminances
    if end is not None:
        steps = abs(end - start) / values["duration"]
        if rate is not None and abs(rate - steps) * values["duration"] > TOLERANCE * start:
            raise InputError(
                f"{where}: rate is {rate:g} cd/m^2/s, but {start:g} to {end:g} cd/m^2 in "
                f"{values['duration']:g} s is {steps:g}"
            )
        rate = steps if rate is None else rate
        way = "up" if end > start else "down"
        if rate and values.setdefault("direction", way) != way:
            raise InputError(
                f"{where}: direction is {values['direction']}, but {start:g} to {end:g} cd/m^2 is {way}"
            )
    if rate is None:
        raise InputError(f"{where}: no rate, and no final_luminance that it would follow from")
    values["rate"], values["is_catch"] = rate, rate == 0


def _with_end(values: Values, where: str, display: Display) -> Values:
    """Return a ramp's values with its factor, and the luminance at its end, which the display must reach."""
    highest = display.peak_luminance + display.reflected_luminance
    if values["factor"] is None:
        lit = values["initial_luminance"] - display.reflected_luminance
        values["factor"] = min(lit / display.peak_luminance, 1.0)
    way = 1.0 if values.get("direction") == "up" else -1.0
    start, seconds = values["initial_luminance"], values["duration"]
    end = start + way * values["rate"] * seconds
    if end > highest * (1 + TOLERANCE):
        raise InputError(
            f"{where}: the ramp ends at {end:g} cd/m^2, but the display {display.name!r} "
            f"shows {highest:g} at most; give that of the ramps with --display"
        )
    if end > highest:
        end, values["rate"] = highest, (highest - start) / seconds
    return values | {"final_luminance": end}


def _merge_levels(rows: list[Values]) -> int:
    """Give luminances that are one level their mean; return how many others there were.

    Those of one screen and factor are, if they differ by at most `TOLERANCE`.
    """
    key, levels = "initial_luminance", dict[tuple[str, float | None], list[list[Values]]]()
    for values in sorted(rows, key=lambda values: values[key]):
        own = levels.setdefault((values["screen"], values["factor"]), [])
        if not own or values[key] > own[-1][0][key] * (1 + TOLERANCE):
            own.append([])
        own[-1].append(values)
    merged = 0
    for level in (level for own in levels.values() for level in own):
        found = [values[key] for values in level]
        merged += len(set(found)) - 1
        for values in level:
            values[key] = found[0] if len(set(found)) == 1 else sum(found) / len(found)
    return merged
