"""What is true in a planned detail rating, and the tests of its analysis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.binomial_tests import ALPHA
from evenlight.analysis.inference.exact_tests import sign_flip_p_values
from evenlight.analysis.plans.viewing_plan import PlannedTest
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.rating.rating_power import LARGEST, fewest_pairs, likely_differences
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError

UNIT = "rating points"
SIMILARITY = 0.5  # correlation of a person's ratings of the two versions: a choice, the paper has none


def published_difference() -> float:
    """Return the mean difference of Table 1, ours less baseline, over its four sequences [rating points].

    >>> round(published_difference(), 4)
    0.4575
    """
    return float(
        np.mean([_published(name, "ours_mean") - _published(name, "baseline_mean") for name in SEQUENCES])
    )


def published_spread() -> float:
    """Return the standard deviation of a person's difference that Table 1 suggests [rating points].

    Its standard errors, as of 17 people, give the standard deviation of ratings; that of differences is
    √(2 (1 - r)) of it, with r the correlation of a person's two ratings, which is not published.

    >>> round(published_spread(), 2)
    0.8
    """
    people = published("participants.viewing").number
    errors = [_published(name, f"{who}_sem") for name in SEQUENCES for who in ("ours", "baseline")]
    variance = people * float(np.mean(np.square(errors)))
    return math.sqrt(2 * (1 - SIMILARITY) * variance)


def _published(sequence: str, what: str) -> float:
    return float(published(f"detail_quality.{sequence}.{what}").number)


def _test(name: str, key: str, difference: float, level: float) -> PlannedTest:
    """Return a sign-flip test of a mean difference."""
    return PlannedTest(name, key, difference, UNIT, 0.0, level, fewest=fewest_pairs(level))


@dataclass(frozen=True, slots=True)
class RatingTruth:
    """What is true of the people of a planned rating.

    Attributes
    ----------
    difference, spread : float
        Mean rating of ours less that of the baseline, and the standard deviation of that difference between
        people, for one sequence [rating points].
    agreement, sequences : float, int
        Correlation of a person's differences in two sequences, and how many sequences there are.
    """

    difference: float = field(default_factory=published_difference)
    spread: float = field(default_factory=published_spread)
    agreement: float = 0.25
    sequences: int = 4

    def __post_init__(self) -> None:
        if not 0 < abs(self.difference) < LARGEST:
            raise InputError(
                f"difference must lie between 0 and {LARGEST} rating points, got {self.difference:g}"
            )
        # No lattice of whole numbers scatters less about this mean, and none from -4 to 4 more.
        part = self.difference % 1.0
        least, most = math.sqrt(part * (1 - part)), math.sqrt(LARGEST**2 - self.difference**2)
        if not least < self.spread < most:
            raise InputError(
                f"spread of whole differences with a mean of {self.difference:g} must lie between "
                f"{least:.2f} and {most:.2f} rating points, got {self.spread:g}"
            )
        if not 0 <= self.agreement < 1:
            raise InputError(f"agreement must lie between 0 and 1, got {self.agreement:g}")
        if not 1 <= self.sequences <= 100:
            raise InputError(f"sequences must lie between 1 and 100, got {self.sequences}")

    @property
    def in_words(self) -> str:
        """What is true, and where that comes from."""
        return (
            f"a mean difference of {self.difference:.3g} rating points, people's differences with a standard "
            f"deviation of {self.spread:.2g} in one sequence and a correlation of {self.agreement:g} between "
            "two"
        )

    @property
    def tests(self) -> tuple[PlannedTest, ...]:
        """A difference in one sequence, and of the mean over all."""
        one = _test("difference, one sequence", "one", self.difference, ALPHA)
        if self.sequences == 1:
            return (one,)
        of_all = f"one sequence of {self.sequences} (Holm's first)"
        mean_of = f"mean of {self.sequences} sequences"
        return (
            one,
            _test(f"difference, {of_all}", "one", self.difference, ALPHA / self.sequences),
            _test(f"difference, {mean_of}", "all", self.difference, ALPHA),
        )

    def p_values(
        self, effect: float, participants: int, runs: int, rng: np.random.Generator
    ) -> Mapping[str, Array]:
        """Return p values of simulated experiments, (runs,), by the key of the test."""
        drawn = self.differences(effect, participants, runs, rng)
        return {"one": sign_flip_p_values(drawn[:, :, 0]), "all": sign_flip_p_values(drawn.sum(axis=2))}

    def differences(
        self, effect: float, participants: int, runs: int, rng: np.random.Generator
    ) -> NDArray[np.int64]:
        """Return differences of simulated ratings, (runs, participants, sequences).

        They are whole numbers of the distribution of largest entropy with this mean and spread; those of one
        person go together by a normal copula.
        """
        edges = np.cumsum(likely_differences(effect, self.spread))[:-1]
        person = rng.standard_normal((runs, participants, 1))
        own = rng.standard_normal((runs, participants, self.sequences))
        normal = math.sqrt(self.agreement) * person + math.sqrt(1 - self.agreement) * own
        return np.asarray(np.searchsorted(edges, special.ndtr(normal)) - LARGEST, dtype=np.int64)
