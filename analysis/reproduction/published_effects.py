"""What the paper says of the effects that viewers show, and what of it an assumed value reproduces."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from scipy import special

from evenlight.analysis.inference.binomial_tests import clopper_pearson
from evenlight.analysis.published import SEQUENCES, published
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, NOTHING_TO_SEE, TIME_RATIO

BRIGHTENED = "brightened"  # locations of a search at which ours gives more light
FACTOR = 2.0  # of the published size, within which an effect counts as of that size
COUNTS = 0.1  # of the published size; an effect below is too small to count


class Verdict(enum.Enum):
    """What of a published effect an assumed one has."""

    SIZE = "sign and size"  # the size within a factor
    SIGN = "sign"
    SMALL = "too small to count"
    OPPOSITE = "opposite sign"
    OPEN = "published sign not established"
    NEAR_HALF = "near one half"
    NOT_NEAR_HALF = "not near one half"


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

    def is_established(self, no_effect: float) -> bool:
        """Whether a sign is published whose interval, if it has one, excludes no effect."""
        if self.sign is None or self.interval is None:
            return self.sign is not None
        return not self.interval[0] <= no_effect <= self.interval[1]

    def verdict(self, value: float | None, no_effect: float) -> Verdict | None:
        """Return what of it an assumed value has; None where the paper says nothing.

        A size counts as the published one within a factor of 2, a chance as near one half within 0.05: the
        intervals of 17 people are too wide to tell.

        >>> PublishedEffect(0.5, sign=1).verdict(0.04, 0.0)
        <Verdict.SMALL: 'too small to count'>
        """
        if value is None or (self.value is None and self.sign is None):
            return None
        if self.sign is None:
            near = abs(value - no_effect) < NOTHING_TO_SEE
            return Verdict.NEAR_HALF if near else Verdict.NOT_NEAR_HALF
        if not self.is_established(no_effect):
            return Verdict.OPEN
        share = self._share(value, no_effect)
        if share is not None and abs(share) < COUNTS:
            return Verdict.SMALL
        if (value - no_effect) * self.sign <= 0:
            return Verdict.OPPOSITE
        return Verdict.SIZE if share is not None and 1 / FACTOR <= share <= FACTOR else Verdict.SIGN

    def verdict_words(self, value: float | None, no_effect: float) -> str | None:
        """Return the verdict for a cell, with the size where the sign alone agrees.

        >>> PublishedEffect(0.5, sign=1).verdict_words(0.1, 0.0)
        'sign, 20 % of the size'
        """
        found = self.verdict(value, no_effect)
        share = None if value is None else self._share(value, no_effect)
        if found is Verdict.SIGN and share is not None:
            return f"{found.value}, {100 * share:.0f} % of the size"
        return None if found is None else found.value

    def _share(self, value: float, no_effect: float) -> float | None:
        """Return an effect as a share of the published one; None where no size is published."""
        return None if self.value is None else (value - no_effect) / (self.value - no_effect)


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
