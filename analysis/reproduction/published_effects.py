"""What the paper says of the effects that viewers show, and what of it an assumed value reproduces."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy import special

from evenlight.analysis.inference.binomial_tests import clopper_pearson
from evenlight.analysis.published import SEQUENCES, published
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, NOTHING_TO_SEE, TIME_RATIO

NEAR, BOTH, NEITHER = "near one half", "sign and size", "neither"
BRIGHTENED = "brightened"  # locations of a search at which ours gives more light
FACTOR = 2.0  # of the published size, within which an effect counts as of that size


@dataclass(frozen=True, slots=True)
class PublishedEffect:
    """What the paper says of an effect.

    Attributes
    ----------
    value : float or None
        As printed, or the difference of what is printed.
    interval : (float, float) or None
        95 % interval that the printed numbers allow.
    sign : int or None
        On which side of "no effect" it is said to lie; None where it is said to be none, or nothing is said.
    """

    value: float | None = None
    interval: tuple[float, float] | None = None
    sign: int | None = None

    def verdict(self, value: float | None, no_effect: float) -> str | None:
        """Return what of it a value reproduces, in words; None where the paper says nothing.

        A size counts as the published one within a factor of 2, a chance as near one half within 0.05: the
        intervals of 17 people are too wide to tell.

        >>> PublishedEffect(0.5, sign=1).verdict(0.05, 0.0)
        'sign, 10 % of the size'
        """
        if value is None or (self.value is None and self.sign is None):
            return None
        if self.sign is None:
            return NEAR if abs(value - no_effect) < NOTHING_TO_SEE else "no, not near one half"
        if (value - no_effect) * self.sign <= 0:
            return NEITHER
        if self.value is None:
            return "sign"
        share = (value - no_effect) / (self.value - no_effect)
        return BOTH if 1 / FACTOR <= share <= FACTOR else f"sign, {100 * share:.0f} % of the size"


def published_effect(what: str, group: str) -> PublishedEffect:
    """Return what the paper says of an effect.

    Intervals are those of differences of independent means (Student's t; people who rate both versions alike
    would make it narrower), and of Clopper and Pearson.
    """
    if what == TIME_RATIO:
        return PublishedEffect(sign=-1 if group == BRIGHTENED else None)
    if group not in SEQUENCES:
        return PublishedEffect()
    key, people = f"detail_quality.{group}", int(published("participants.viewing").number)
    if what == CHOSEN:
        share = published(f"{key}.chosen_percent").number / 100
        return PublishedEffect(share, clopper_pearson(round(share * people), people))
    ours, baseline = (published(f"{key}.{version}_mean").number for version in ("ours", "baseline"))
    error = math.hypot(*(published(f"{key}.{version}_sem").number for version in ("ours", "baseline")))
    gain, half = ours - baseline, float(special.stdtrit(people - 1, 0.975)) * error
    return PublishedEffect(gain, (gain - half, gain + half), 1 if gain > 0 else -1)
