"""Sides of the search: locations that ours brightens or dims, and those where it hardly does either."""

from __future__ import annotations

import enum
import math

ABOUT_EQUAL = 0.05  # factors that differ by at most so much are about equal (choice): neither gain nor loss


class Side(enum.Enum):
    """What the modulation does to the brightness of a location, against constant dimming."""

    BRIGHTENED = "brightened"
    ALIKE = "about equal"
    DIMMED = "dimmed"


def side_of(ln_ratio: float) -> Side:
    """Return the side of a location.

    Parameters
    ----------
    ln_ratio : float
        ln(factor of ours / of the baseline).

    >>> [side_of(math.log(ratio)).value for ratio in (1.06, 1.04, 0.96, 0.94)]
    ['brightened', 'about equal', 'about equal', 'dimmed']
    """
    if ln_ratio > math.log1p(ABOUT_EQUAL):
        return Side.BRIGHTENED
    return Side.DIMMED if ln_ratio < math.log1p(-ABOUT_EQUAL) else Side.ALIKE
