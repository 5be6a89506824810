"""What follows of a ramp's values from the others and from the display, in files and tables alike."""

from __future__ import annotations

from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError

Values = dict[str, Any]  # of a ramp, by attributes of `RampTrial`; None where unknown
TOLERANCE = 0.02  # relative, of a measured luminance: about a luminance meter's accuracy (choice)


def with_rate(values: Values, where: str, display: Display, relative: bool = False) -> Values:
    """Return a ramp's values with screen, initial luminance, rate and direction.

    Parameters
    ----------
    values : dict
        By attribute: `screen`, `factor`, `initial_luminance`, `final_luminance` [cd/m^2], `rate`, `duration`
        [s] and `is_catch`, None where unknown; filled in.
    where : str
        Place of the row, for messages.
    display : Display
        What the ramp was shown on: white at full factor has its peak luminance.
    relative : bool, optional
        Whether the rate is one of the initial luminance [1/s], and not in cd/m^2/s.

    Raises
    ------
    InputError
        If something is missing, brighter than the display, or contradicts the rest.
    """
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
            f"{display.reflected_luminance:g} to {highest:g}; give the display of the ramps"
        )
    if expected is not None and abs(start - expected) > TOLERANCE * expected:
        raise InputError(
            f"{where}: initial_luminance is {start:g} cd/m^2, but white at factor {factor:g} has "
            f"{expected:g} on the display {display.name!r}; give the display of the ramps, or no factor"
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


def with_end(values: Values, where: str, display: Display) -> Values:
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
            f"shows {highest:g} at most; give the display of the ramps"
        )
    if end > highest:
        end, values["rate"] = highest, (highest - start) / seconds
    return values | {"final_luminance": end}


def merge_levels(rows: list[Values]) -> int:
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
