"""What is asked of a plan, and what is true of its people: the options of `evenlight plan`.

A field is an option: its description is the help of the command. Nothing here is slow to import.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, ClassVar

from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS, RampPlanRow, ViewingPlanRow
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.recordings.viewing import HIGHEST_RATING, LOWEST_RATING

PUBLISHED_DIFFERENCE = 0.4575  # Table 1, ours less baseline: mean of four sequences [rating points]
# Table 1's standard errors, as of 17 people; a person's two ratings correlate by 0.5 (a choice)
PUBLISHED_SPREAD = 0.7952
TRIALS = "--trials", (4, 2000)
BEYOND = f"above {MOST_PARTICIPANTS}"
HALF = 0.5  # the share of people who guess
Row = RampPlanRow | ViewingPlanRow
VIEWING_EFFORTS = {"quick": 500, "default": 2000}  # simulated experiments of each number of people


def _asked(doc: str, default: float | None, low: float | None, high: float | None, unit: str = "1") -> Any:
    return quantity(unit, doc, default=default, minimum=low, maximum=high)


def _count(doc: str, default: int) -> Any:
    return _asked(doc, default, 1, 100)


def _power() -> Any:
    return _asked("wanted statistical power", 0.8, 0.01, 0.999)


@dataclass(frozen=True, slots=True)
class RampQuestion:
    """What is asked of a calibration."""

    task, participants = "ramp", "5,10,20,40"  # numbers of people that are tried
    efforts: ClassVar = {"quick": 12, "default": 24, "thorough": 80}  # simulated people of each design
    precision: float = quantity(
        "1",
        "wanted half-width of the limit's 95 % pointwise band, as a share",
        default=0.1,
        above=0,
        maximum=2,
    )
    trials: str = described(
        "numbers of ramps at each luminance level to try, such as 20,40", default="20,30,40,60,100"
    )
    design: tuple[str, ...] = described(
        "design of the session: a preset or a toml file; otherwise four presets are compared",
        default=("paper", "yes_no_targeted", "recommended", "psi_marginal"),
    )
    display: str = described("display to calibrate: a preset or a toml file", default="varjo-xr3")
    analysis: str = described("pre-register the analysis of this earlier result of `fit`", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        whole_numbers(self.trials, *TRIALS)

    @property
    def trial_numbers(self) -> tuple[int, ...]:
        """How many ramps per level are tried, rising."""
        return whole_numbers(self.trials, *TRIALS)


@dataclass(frozen=True, slots=True)
class RatingTruth:
    """What is true of the people of a planned rating."""

    task, title, unit = "rating", "Detail rating", "rating points"
    participants = "10,17,25,40,60"
    efforts: ClassVar = VIEWING_EFFORTS
    difference: float = _asked(
        "the true mean difference of ratings", PUBLISHED_DIFFERENCE, -3.99, 3.99, "rating points"
    )
    spread: float = _asked(
        "standard deviation between people of that difference", PUBLISHED_SPREAD, None, None, "rating points"
    )
    agreement: float = _asked("correlation between one person's differences", 0.25, 0, 0.99)
    sequences: int = _count("how many sequences", 4)
    power: float = _power()

    def __post_init__(self) -> None:
        check_limits(self)
        # No lattice of whole numbers scatters less about this mean, and none from -4 to 4 more.
        part, largest = self.difference % 1.0, HIGHEST_RATING - LOWEST_RATING
        least, most = math.sqrt(part * (1 - part)), math.sqrt(largest**2 - self.difference**2)
        if not self.difference or not least < self.spread < most:
            raise ValueError(
                f"a difference must not be 0, and whole ones with a mean of {self.difference:g} have a "
                f"spread between {least:.2f} and {most:.2f} rating points, got {self.spread:g}"
            )


@dataclass(frozen=True, slots=True)
class ComparisonTruth:
    """What is true of the people of a planned comparison; a share of None is one at the margin."""

    task, title, unit = "comparison", "Artifact comparison", "share choosing ours"
    participants = "17,30,50,70,100,150"
    efforts: ClassVar = VIEWING_EFFORTS
    share: float | None = _asked("the true share of choices for the track (0.5 + margin)", None, 0.001, 0.999)
    margin: float = _asked("distance from 0.5 that counts as no difference", 0.15, 0.001, 0.499)
    spread: float = _asked(
        "standard deviation between people of the log-odds of choosing the track", 0.5, 0, 5
    )
    repetitions: int = _count("how often each sequence is shown", 1)
    sequences: int = _count("how many sequences", 4)
    power: float = _power()

    def __post_init__(self) -> None:
        check_limits(self)
        if self.share == HALF:
            raise ValueError("share must not be 0.5, which is no difference to be found")

    @property
    def true_share(self) -> float:
        """The share that is to be found to differ from one half."""
        return HALF + self.margin if self.share is None else self.share


@dataclass(frozen=True, slots=True)
class SearchTruth:
    """What is true of the people of a planned search, at places where ours is brighter, or dimmer."""

    task, title, unit = "search", "Ring search", "ratio of times"
    participants = "8,12,17,25"
    efforts: ClassVar = {"quick": 37, "default": 75, "thorough": 150}  # a fit of search times takes its time
    ratio: float = _asked("the true median time with the track, divided by the baseline's", 0.8, 0.1, 0.999)
    undetected: float = _asked("share of rings not found with the baseline", 0.1, 0, 0.9)
    margin: float = _asked("ratio of times that counts as slower", 1.25, 1.001, 10)
    spread: float = _asked("standard deviation between people of ln(ratio of times)", 0.15, 0, 2)
    locations: int = _count("places of rings where the track is brighter, and as many darker", 10)
    power: float = _power()

    def __post_init__(self) -> None:
        check_limits(self)


def whole_numbers(text: str, option: str, limits: tuple[int, int]) -> tuple[int, ...]:
    """Return the numbers of a list such as "5,10,20", each once, in order.

    >>> whole_numbers("20, 5,20", "--participants", (2, 100))
    (5, 20)
    """
    if not re.fullmatch(" *-?[0-9]{1,9} *(, *-?[0-9]{1,9} *)*", text):
        raise InputError(
            f"{option} takes whole numbers with commas between them, such as 5,10,20; got {text!r}"
        )
    numbers = tuple(sorted({int(part) for part in text.split(",")}))
    if not limits[0] <= numbers[0] <= numbers[-1] <= limits[1]:
        raise InputError(f"{option} takes numbers from {limits[0]} to {limits[1]}, got {text}")
    return numbers


def people_in_words(row: Row) -> str:
    """Return how many participants are needed, with what simulation leaves open: "33 (26 to 40)"."""
    low, needed, high = row.participants_needed_low, row.participants_needed, row.participants_needed_high
    if low is None:
        return "beyond what was tried" if isinstance(row, ViewingPlanRow) and row.runs else BEYOND
    return str(needed) if low == needed == high else f"{needed or BEYOND} ({low} to {high or BEYOND})"


Truth = RatingTruth | ComparisonTruth | SearchTruth
QUESTIONS = {kind.task: kind for kind in (RampQuestion, RatingTruth, ComparisonTruth, SearchTruth)}
