"""Luminance ramps of another program's table: what follows from the luminances, and from the display."""

from __future__ import annotations

from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.importing.import_mapping import RELATIVE_RATES, ImportMapping
from evenlight.data_schema.importing.source_tables import Row, SourceTable

TOLERANCE = 0.02  # relative, of a measured luminance: about a luminance meter's accuracy (choice)


def complete_ramps(
    rows: list[tuple[Row, dict[str, Any]]], table: SourceTable, taken: ImportMapping, display: Display | None
) -> list[str]:
    """Fill in what follows of ramps, and return it in words.

    White at full factor has the display's peak luminance, and its factor is the share of that. Luminances of
    one screen and factor that differ by at most `TOLERANCE` are one level, at their mean.

    Parameters
    ----------
    rows : list of (Row, dict)
        Line of each, and its values by our attributes, which are filled in.
    table : SourceTable
        Where they come from, for messages.
    taken : ImportMapping
        What the table has; a rate may be relative to the initial luminance.
    display : Display or None
        What the ramps were shown on.

    Raises
    ------
    InputError
        Without a display, or if a row is brighter than it, or rate and luminances contradict each other.
    """
    if display is None:
        raise InputError(
            f"{table.path}: ramps need --display, a preset's name or a file: a rate limit holds for the "
            "display on which its ramps were shown, and for no other"
        )
    given, relative = taken.given, taken.units.get("rate") in RELATIVE_RATES
    for line, values in rows:
        _complete(values, table.place(line), display, relative)
    merged = _merge_levels([values for _, values in rows])
    highest = display.peak_luminance + display.reflected_luminance
    for line, values in rows:
        if values["factor"] is None:
            lit = values["initial_luminance"] - display.reflected_luminance
            values["factor"] = min(lit / display.peak_luminance, 1.0)
        way = 1.0 if values.get("direction") == "up" else -1.0
        start, seconds = values["initial_luminance"], values["duration"]
        end = start + way * values["rate"] * seconds
        if end > highest * (1 + TOLERANCE):
            raise InputError(
                f"{table.place(line)}: the ramp ends at {end:g} cd/m^2, but the display {display.name!r} "
                f"shows {highest:g} at most; give that of the ramps with --display"
            )
        if end > highest:
            end, values["rate"] = highest, (highest - start) / seconds
        values["final_luminance"] = end
    follows = [f"{name}: from the display" for name in ("initial_luminance", "factor") if name not in given]
    follows += [] if "screen" in given else ["screen: white"]
    follows += [] if "rate" in given else ["rate: from initial and final luminance, and duration"]
    if merged:
        follows.append(f"level: {merged} luminances within {TOLERANCE:.0%} of others are one with them")
    return follows


def _complete(values: dict[str, Any], where: str, display: Display, relative_rate: bool) -> None:
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
    _complete_rate(values, start, end, where, relative_rate)
    if "ramp_interval" in values and "procedure" not in values:
        values["procedure"] = "two_interval"


def _complete_rate(
    values: dict[str, Any], start: float, end: float | None, where: str, relative: bool
) -> None:
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
        if "direction" not in values and rate:
            values["direction"] = "up" if end > start else "down"
    if rate is None:
        raise InputError(f"{where}: no rate, and no final_luminance that it would follow from")
    values["rate"], values["is_catch"] = rate, rate == 0


def _merge_levels(rows: list[dict[str, Any]]) -> int:
    """Give luminances that are one level their mean; return how many others there were."""
    key, levels = "initial_luminance", dict[tuple[str, float | None], list[list[dict[str, Any]]]]()
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
