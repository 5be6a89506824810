"""The search in words: what came out, and how its numbers are written."""

from __future__ import annotations

import math
from collections.abc import Sequence

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.search.search_models import VERSION, SideEffect, effect_of
from evenlight.analysis.search.search_results import SearchResults
from evenlight.analysis.search.search_sides import ABOUT_EQUAL, Side
from evenlight.analysis.search.search_statistics import people_slope
from evenlight.analysis.wording import p_in_words

ALPHA = 0.05
MORE = 0.1  # light in the example of what the slope means


def lead_of(found: SearchResults) -> str:
    """Return what came out, in a few sentences."""
    table = found.table
    undetected = int((~table.found).sum())
    sentences = [
        f"{len(table.participants)} {who(found)} looked for a ring {table.times.size} times, at "
        f"{_counted(len(table.locations), 'location')}; {_counted(undetected, 'search', 'searches')} ended "
        "without success."
    ]
    overall = effect_of(found.models.overall, VERSION)
    if overall.estimate is None:
        return f"{sentences[0]} A ratio of search times cannot be given: {overall.flag}."
    sentences += [
        slope_words(people_slope(found.models.brightness), found.both),
        f"The time ratio, ours to baseline, over all locations is {ratio_text(overall)}"
        f"{f' ({overall.flag})' if overall.flag else ''}.",
        *(_side_words(side, found.slowing) for side in found.models.sides if side.side is not Side.ALIKE),
    ]
    alike = sum(side.locations for side in found.models.sides if side.side is Side.ALIKE)
    if alike:
        sentences.append(
            f"{_counted(alike, 'location')} of about equal brightness (within {100 * ABOUT_EQUAL:.0f} %) "
            f"{'is' if alike == 1 else 'are'} in neither side."
        )
    return " ".join(sentences)


def slope_words(slope: FixedEffect, both: FixedEffect | None = None) -> str:
    """Return how search times go with brightness, and in which direction.

    Parameters
    ----------
    slope : FixedEffect
        Change of ln(time) per unit of ln(brightness ratio), for people like these at these locations.
    both : FixedEffect, optional
        The same for people and locations like these.

    >>> print(slope_words(FixedEffect("", -0.5, 0.1, -0.7, -0.3, 0.0004, 16.0))[:80])
    More light saves time at these locations: with 10 % more light a search takes 0.
    >>> print(slope_words(FixedEffect("", None, None, None, None, None, flag="nothing was found")))
    How search times go with brightness is not known (nothing was found).
    """
    if slope.estimate is None or slope.p_value is None:
        return f"How search times go with brightness is not known ({slope.flag})."
    if slope.p_value > ALPHA:
        said = "That search times go with brightness is not shown"
    else:
        said = f"More light {'saves' if slope.estimate < 0 else 'costs'} time at these locations"
    share = math.exp(slope.estimate * math.log1p(MORE))
    ends, wider = _lighter_range(slope), None if both is None else _lighter_range(both)
    details = [
        *([f"95 % interval {ends}"] if ends else []),
        p_in_words(slope.p_value),
        *([f"for other locations like these, 95 % interval {wider}"] if wider else []),
        *([slope.flag] if slope.flag else []),
    ]
    return (
        f"{said}: with {100 * MORE:.0f} % more light a search takes {share:.2f} of the time "
        f"({'; '.join(details)})."
    )


def _lighter_range(slope: FixedEffect) -> str | None:
    """Return the interval of the ratio of times that some more light makes."""
    low, high = (None if end is None else end * math.log1p(MORE) for end in (slope.ci_low, slope.ci_high))
    return range_text((low, high), logarithms=True)


def _side_words(side: SideEffect, slowing: float) -> str:
    """Return what ours does on one side."""
    place = _counted(side.locations, "location")
    words = f"Where ours {'brightens' if side.side is Side.BRIGHTENED else 'dims'} ({place}) "
    if side.effect.estimate is None:
        return f"{words}it is not known how much faster or slower searches are ({side.effect.flag})."
    words += "the time ratio is "
    words += ratio_text(side.effect)
    if side.side is Side.DIMMED and side.slowing_p is not None:
        excluded = "is excluded" if side.slowing_p <= ALPHA else "is not excluded"
        words += f"; a slowing by {100 * slowing:.0f} % or more {excluded} ({p_in_words(side.slowing_p)})"
    return f"{words}."


def _counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun.

    >>> _counted(1, "search", "searches"), _counted(2, "location")
    ('1 search', '2 locations')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def who(found: SearchResults) -> str:
    """Return what the participants are called."""
    one = len(found.table.participants) == 1
    simulated = "simulated " if found.origin.value == "simulated" else ""
    return f"{simulated}participant{'' if one else 's'}"


def ratio_text(effect: FixedEffect) -> str:
    """Return an effect on ln(time) as a ratio with its interval.

    >>> ratio_text(FixedEffect("ours", 0.0, 0.1, -0.1, None, 1.0))
    '1.00 (95 % interval 0.90 to –)'
    """
    if effect.estimate is None:
        return "–"
    ends = range_text((effect.ci_low, effect.ci_high), logarithms=True)
    return f"{math.exp(effect.estimate):.2f}" + (f" (95 % interval {ends})" if ends else "")


def range_text(
    ends: tuple[float | None, float | None], logarithms: bool = False, digits: int = 2
) -> str | None:
    """Return an interval for a cell; an end without bound is a dash.

    >>> range_text((0.281, None)), range_text((None, None)), range_text((0.0, 0.0), logarithms=True)
    ('0.28 to –', None, '1.00 to 1.00')
    """
    if ends[0] is None and ends[1] is None:
        return None
    shown = [end if end is None or not logarithms else math.exp(end) for end in ends]
    return " to ".join("–" if end is None else f"{end:.{digits}f}" for end in shown)


def flags_of(flags: Sequence[str]) -> str:
    """Return remarks, each once.

    >>> flags_of(["a", "", "b", "a"])
    'a; b'
    """
    return "; ".join(dict.fromkeys(flag for flag in flags if flag))
