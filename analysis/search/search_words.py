"""The search in words: what came out, and how its numbers are written."""

from __future__ import annotations

import math

import numpy as np

from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.report_prose import prose
from evenlight.analysis.search.search_models import VERSION, effect_of
from evenlight.analysis.search.search_results import SearchResults
from evenlight.analysis.search.search_statistics import people_slope
from evenlight.analysis.search.search_trials import ABOUT_EQUAL, BrightnessEffect, SearchTable
from evenlight.analysis.wording import p_in_words

ALPHA = 0.05
MORE = 0.1  # light in the example of what the slope means


def lead_of(found: SearchResults, confound: str = "") -> str:
    """Return what came out, in a few sentences, and whether it may be the order of the versions."""
    table, models = found.table, found.models
    return prose(
        "search_lead",
        table=table,
        people=len(table.participants),
        who=who(found),
        undetected=np.count_nonzero(~table.found),
        overall=effect_of(models.overall, VERSION),
        slope=slope_words(people_slope(models.brightness), found.both),
        sides=[side for side in models.sides if side.side is not BrightnessEffect.ALIKE],
        alike=sum(side.locations for side in models.sides if side.side is BrightnessEffect.ALIKE),
        about_equal=ABOUT_EQUAL,
        slowing=found.slowing,
        confound=confound,
        alpha=ALPHA,
        ratio=ratio_text,
        counted=_counted,
    )[0]


def design_of(table: SearchTable) -> str:
    """Return how often people looked for a ring, in which version: as designed, or the searches in each."""
    cells = np.stack([table.participant, table.location, table.ours])
    people, places = len(table.participants), len(table.locations)
    if table.times.size == np.unique(cells, axis=1).shape[1] == 2 * people * places:
        return "Each person looked once for a ring at each location in each version."
    both = sum(place.in_both for place in table.locations)
    ours = int(np.count_nonzero(table.ours))
    return (
        f"There are {_counted(ours, 'search', 'searches')} in ours and {table.times.size - ours} in the "
        f"baseline; {both} of {_counted(places, 'location')} {'was' if both == 1 else 'were'} seen in both "
        "versions."
    )


def slope_words(slope: FixedEffect, both: FixedEffect | None = None) -> str:
    """Return how search times depend on brightness, and in which direction.

    Parameters
    ----------
    slope : FixedEffect
        Change of ln(time) per unit of ln(brightness ratio), for people like these at these locations.
    both : FixedEffect, optional
        The same for people and locations like these.

    >>> print(slope_words(FixedEffect("", -0.5, 0.1, -0.7, -0.3, 0.0004, 16.0))[:80])
    More light saves time at these locations: with 10 % more light a search takes 0.
    >>> print(slope_words(FixedEffect("", None, None, None, None, None, flag="nothing was found")))
    How search times depend on brightness is not known (nothing was found).
    """
    details = []
    if slope.p_value is not None:
        ends, wider = _lighter_range(slope), None if both is None else _lighter_range(both)
        details += [f"95 % confidence interval {ends}"] if ends else []
        details.append(p_in_words(slope.p_value))
        details += [f"for other locations like these, 95 % confidence interval {wider}"] if wider else []
        details += [slope.flag] if slope.flag else []
    share = math.exp((slope.estimate or 0.0) * math.log1p(MORE))
    return prose("search_slope", slope=slope, share=share, details=details, more=MORE, alpha=ALPHA)[0]


def _lighter_range(slope: FixedEffect) -> str | None:
    """Return the interval of the ratio of times that some more light makes."""
    low, high = (None if end is None else end * math.log1p(MORE) for end in (slope.ci_low, slope.ci_high))
    return range_text((low, high), logarithms=True)


def _counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun.

    >>> _counted(1, "search", "searches"), _counted(2, "location")
    ('1 search', '2 locations')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def who(found: SearchResults) -> str:
    """Return what the participants are called."""
    return f"{'simulated ' * found.simulated}participant{'s' * (len(found.table.participants) != 1)}"


def ratio_text(effect: FixedEffect) -> str:
    """Return an effect on ln(time) as a ratio with its interval.

    >>> ratio_text(FixedEffect("ours", 0.0, 0.1, -0.1, None, 1.0))
    '1.00 (95 % confidence interval 0.90 to –)'
    """
    if effect.estimate is None:
        return "–"
    ends = range_text((effect.ci_low, effect.ci_high), logarithms=True)
    return f"{math.exp(effect.estimate):.2f}" + (f" (95 % confidence interval {ends})" if ends else "")


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
