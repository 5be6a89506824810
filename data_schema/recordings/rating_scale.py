"""The scale of ratings: which numbers can be given, as a session says it or as the ratings show."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.quantities import quantity, record

COMMON = ((0, 1), (1, 5), (1, 7), (1, 9), (0, 10), (0, 100))  # the first that holds all; 0 to 1 has decimals
STEPS = (1.0, 0.5, 0.25, 0.1, 0.05, 0.01, 0.001)  # of which the first that holds all; else any number
FEW = 0.05  # share of ratings that are likelier typed wrongly than of a longer scale (choice)


def exact(rating: float) -> Fraction:
    """Return a rating as the decimal number that it was written as.

    >>> exact(53.7), exact(4)
    (Fraction(537, 10), Fraction(4, 1))
    """
    return Fraction(str(rating))


@record
class RatingScale:
    """Which numbers a rating can be."""

    lowest: float = quantity("1", "lowest rating", minimum=-1e9, maximum=1e9, default=1.0)
    highest: float = quantity("1", "highest rating", minimum=-1e9, maximum=1e9, default=5.0)
    step: float = quantity("1", "from one rating to the next; 0 for any number", minimum=0.0, default=1.0)

    def __post_init__(self) -> None:
        if not self.lowest < self.highest or (self.step and self.range / exact(self.step) % 1):
            raise ValueError(f"a scale must rise from its lowest to its highest in whole steps, got {self}")

    def __str__(self) -> str:
        steps = f" in steps of {self.step:g}" if self.step else ", any number"
        return f"{self.lowest:g} to {self.highest:g}{' in whole points' if self.step == 1 else steps}"

    @property
    def range(self) -> Fraction:
        """The largest difference of two ratings."""
        return exact(self.highest) - exact(self.lowest)

    @property
    def unit(self) -> Fraction:
        """What differences are multiples of; 1 if any number may be given."""
        return exact(self.step or 1.0)

    def refusal(self, rating: float) -> str:
        """Return what is wrong with a rating that the scale does not have; empty for one that it has.

        >>> RatingScale().refusal(4), RatingScale(1, 7).refusal(9)
        ('', 'rating must be on the scale of 1 to 7 in whole points, got 9')
        """
        between = self.step and (exact(rating) - exact(self.lowest)) / self.unit % 1
        wrong = between or not self.lowest <= rating <= self.highest
        return f"rating must be on the scale of {self}, got {rating:g}" if wrong else ""


ONE_TO_FIVE = RatingScale()  # in whole points: that of the paper, and of our own sessions


def scale_of(
    given: Sequence[tuple[str, float]], asked: str = "", option: str = "--scale"
) -> tuple[RatingScale, str]:
    """Return the scale of ratings, each with its place, and what is to be said of it.

    `InputError` as `scale_for` raises, and if a rating is not on it; the message names the place, or the
    `option` to ask with.
    """
    scale = scale_for(given, asked, option)
    if wrong := next((f"{place}: {why}" for place, x in given if (why := scale.refusal(x))), ""):
        raise InputError(wrong)
    return scale, f"scale: {scale}" + f", seen from the data; {option} says otherwise" * (not asked)


def scale_for(given: Sequence[tuple[str, float]], asked: str = "", option: str = "--scale") -> RatingScale:
    """Return the scale of ratings, each with its place; one that is asked for need not hold them all.

    It is the one asked for, as `1..7`, `0..100` or `1..5:0.5` (the ratings tell a step that is not), or else
    the smallest usual one that holds all ratings. `InputError` if that is written otherwise, or the ratings
    leave it open: few lie outside a shorter one, or some outside all.
    """
    number, ratings = r"(-?\d+(?:\.\d+)?)", [rating for _, rating in given]
    told = re.fullmatch(rf"{number}\.\.{number}(?::{number})?", asked)
    if asked and not told:
        problem = "expected LOWEST..HIGHEST or LOWEST..HIGHEST:STEP, as 1..7, 0..100 or 1..5:0.5"
        raise InputError(f"{option}: {problem}, got {asked!r}")
    lowest, highest = (float(told[1]), float(told[2])) if told else _seen_range(given, option)
    above = [exact(x) - exact(lowest) for x in (highest, *ratings) if lowest <= x <= highest]
    seen = next((step for step in STEPS if not any(each % exact(step) for each in above)), 0.0)
    try:
        return RatingScale(lowest, highest, float(told[3]) if told and told[3] else seen)
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None


def _seen_range(given: Sequence[tuple[str, float]], option: str) -> tuple[float, float]:
    for lowest, highest in COMMON if any(rating % 1 for _, rating in given) else COMMON[1:]:
        beyond = [(place, rating) for place, rating in given if not lowest <= rating <= highest]
        if not beyond:
            return float(lowest), float(highest)
        if len(beyond) <= FEW * len(given):
            place, odd = beyond[0]
            many = f"{len(beyond)} of {len(given)} ratings {'is' if len(beyond) == 1 else 'are'}"
            mark = f"a mark for no rating (--missing {odd:g}), " * (option[0] == "-" and not 0 <= odd <= 10)
            raise InputError(
                f"{place}: rating {odd:g}: {many} not from {lowest} to {highest}: {mark}typed wrongly "
                f"({option} {lowest}..{highest}), or on a longer scale ({option} says which)?"
            )
    ratings = [rating for _, rating in given]
    place, odd = beyond[0]
    raise InputError(
        f"{place}: rating {odd:g}: ratings from {min(ratings):g} to {max(ratings):g} are on no usual scale; "
        f"say theirs with {option}, such as -3..3"
    )
