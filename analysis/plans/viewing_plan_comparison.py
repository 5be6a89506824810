"""What is true in a planned artifact comparison, and the tests of its analysis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from evenlight.analysis.comparison.comparison_shares import equivalence_p, independent_error
from evenlight.analysis.inference.binomial_power import difference_power, equivalence_power
from evenlight.analysis.inference.binomial_tests import ALPHA, HALF
from evenlight.analysis.inference.exact_tests import sign_flip_p_values
from evenlight.analysis.plans.viewing_plan import Exact, PlannedTest
from evenlight.analysis.rating.rating_power import fewest_pairs
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError

UNIT = "share choosing ours"
NODES = 41  # of the normal distribution between participants


@dataclass(frozen=True, slots=True)
class ComparisonTruth:
    """What is true of the people of a planned comparison.

    Attributes
    ----------
    share : float or None
        Mean share of answers that choose ours; None for one at the margin.
    margin : float
        Within which a share counts as equivalent to 1/2.
    spread : float
        Standard deviation of the log-odds of choosing ours between participants.
    repetitions, sequences : int
        How often each sequence is compared, and how many there are.
    """

    share: float | None = None
    margin: float = 0.15
    spread: float = 0.5
    repetitions: int = 1
    sequences: int = 4

    def __post_init__(self) -> None:
        if self.share is not None and (not 0 < self.share < 1 or self.share == HALF):
            raise InputError(f"share must lie between 0 and 1 and not be 0.5, got {self.share:g}")
        if not 0 < self.margin < HALF:
            raise InputError(f"margin of a share must lie between 0 and 0.5, got {self.margin:g}")
        if not 0 <= self.spread <= 5:
            raise InputError(f"spread must lie between 0 and 5 (log-odds), got {self.spread:g}")
        for option, number in (("repetitions", self.repetitions), ("sequences", self.sequences)):
            if not 1 <= number <= 100:
                raise InputError(f"{option} must lie between 1 and 100, got {number}")

    @property
    def other_share(self) -> float:
        """The true share that is to be found to differ from one half."""
        return HALF + self.margin if self.share is None else self.share

    @property
    def in_words(self) -> str:
        """What is true, and where that comes from."""
        times = "once" if self.repetitions == 1 else f"{self.repetitions} times"
        return (
            f"a true share of {self.other_share:g} (to find a difference) or of 0.5 (to show one within "
            f"0.5 ± {self.margin:g}), people whose log-odds scatter by {self.spread:g}, "
            f"{self.sequences} sequences compared {times}"
        )

    @property
    def tests(self) -> tuple[PlannedTest, ...]:
        """A difference from one half and equivalence to it, of one sequence and of all."""
        edge = HALF + self.margin
        one, all_of = "one sequence", f"all {self.sequences} sequences"
        tests = [self._difference(f"difference, {one}", "one", ALPHA)]
        if self.sequences > 1:
            first = ALPHA / self.sequences
            tests.append(
                self._difference(f"difference, {one} of {self.sequences} (Holm's first)", "one", first)
            )
        tests.append(
            PlannedTest(
                f"equivalence, {one}", "one equal", HALF, UNIT, edge, ALPHA, self.margin,
                self._exact(lambda n: equivalence_power(n, HALF, self.margin)),
                self._exact(lambda n: equivalence_power(n, edge, self.margin)),
            )
        )  # fmt: skip
        if self.sequences > 1:
            tests += [
                PlannedTest(
                    f"difference, {all_of}",
                    "all",
                    self.other_share,
                    UNIT,
                    HALF,
                    ALPHA,
                    fewest=fewest_pairs(ALPHA),
                ),
                PlannedTest(f"equivalence, {all_of}", "all equal", HALF, UNIT, edge, ALPHA, self.margin),
            ]
        return tuple(tests)

    def _difference(self, name: str, key: str, level: float) -> PlannedTest:
        """Return a test of one sequence's difference from one half."""
        return PlannedTest(
            name, key, self.other_share, UNIT, HALF, level, None,
            self._exact(lambda n: difference_power(n, self.other_share, level)),
            self._exact(lambda n: difference_power(n, HALF, level)), fewest_pairs(level),
        )  # fmt: skip

    def _exact(self, power: Exact) -> Exact | None:
        """Return a power by enumeration, or None where several answers of one person are dependent."""
        return power if self.repetitions == 1 else None

    def p_values(
        self, effect: float, participants: int, runs: int, rng: np.random.Generator
    ) -> Mapping[str, Array]:
        """Return p values of simulated experiments, (runs,), by the key of the test.

        One person has the same share in every sequence.
        """
        middle = person_in_the_middle(effect, self.spread)
        share = special.expit(middle + self.spread * rng.standard_normal((runs, participants)))
        answers = (self.repetitions, self.sequences * self.repetitions)
        own = rng.binomial(self.repetitions, share)
        others = rng.binomial(answers[1] - answers[0], share)
        found: dict[str, Array] = {}
        for name, chosen, n in (("one", own, answers[0]), ("all", own + others, answers[1])):
            found[name] = sign_flip_p_values(2 * chosen - n)
            found[f"{name} equal"] = clustered_equivalence(chosen / n, n, self.margin)
        return found


def clustered_equivalence(shares: Array, answers: int, margin: float) -> Array:
    """Return p of the two one-sided t tests of `comparison_shares`, for many experiments at once.

    Parameters
    ----------
    shares, answers : array (runs, participants), int
        Share of each participant, and how many answers it is of.
    margin : float
        Within which a share counts as equivalent to 1/2.

    Returns
    -------
    array (runs,)
        1 where participants do not differ: that gives no standard error, and no test.
    """
    people, share = shares.shape[1], shares.mean(axis=1)
    scatter = shares.std(axis=1, ddof=1) / math.sqrt(people)
    flat = scatter < 1e-12
    error = np.where(flat, 1.0, np.maximum(scatter, independent_error(share, people * answers)))
    return np.where(flat, 1.0, equivalence_p(share - HALF, error, people, margin))


def person_in_the_middle(share: float, spread: float) -> float:
    """Return the log-odds of a person in the middle, if the mean share of all people is `share`.

    >>> round(person_in_the_middle(0.75, 0.0), 9) == round(float(np.log(3)), 9)
    True
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    weights = weights / weights.sum()

    def surplus(middle: float) -> float:
        return float(weights @ special.expit(middle + spread * nodes)) - share

    return 0.0 if share == HALF else float(optimize.brentq(surplus, -40.0, 40.0))
