"""The share of answers that chose the modulated version: interval, exact test, equivalence to 1/2, guessing.

Where everybody answered once, the answers are independent and their number is binomial. Where they answered
more often, participants are the sample: answers of one person are correlated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from evenlight.analysis.inference import binomial_tests as binomial
from evenlight.analysis.inference.binomial_tests import ALPHA, HALF, LEVEL, clustered_interval
from evenlight.analysis.inference.exact_intervals import joined, sign_flip_interval
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.viewing import ComparisonTrial

EXACT = "two-sided exact binomial test of 0.5; interval of Clopper and Pearson"
CLUSTERED = (
    "n: participants, whose answers go together: exact sign-flip test; interval: shares that it does not "
    "reject, joined with Clopper and Pearson's at the effective number of answers (Korn & Graubard 1998)"
)
ONE_WAY = "n: participants, each counted as one answer: exact binomial test, interval of Clopper and Pearson"
ONE_PERSON = "one participant: says nothing about other people"
TOO_FEW = "fewer than 6 participants: the exact test rejects no share"
ALL_ONE_WAY = "every answer was the same: exact interval with participants as the sample"
PERMUTATIONS = 9999


@dataclass(frozen=True, slots=True)
class Choices:
    """How often each participant chose one of two things.

    Attributes
    ----------
    participants : tuple of str
        Who, in order; only those with an answer.
    chosen, answers : array of int, (participants,)
        How often it was chosen, of how many answers.
    """

    participants: tuple[str, ...]
    chosen: NDArray[np.int64]
    answers: NDArray[np.int64]

    @property
    def scores(self) -> NDArray[np.int64]:
        """How much more often it was chosen than the other, (participants,): 0 on the average by guessing."""
        return np.asarray(2 * self.chosen - self.answers)

    @property
    def people(self) -> int:
        """How many participants: the sample, as answers of one person are not independent."""
        return len(self.participants)

    @property
    def total(self) -> int:
        """All answers."""
        return int(self.answers.sum())

    @property
    def count(self) -> str:
        """How often it was chosen, as "9 of 17"."""
        return f"{int(self.chosen.sum())} of {self.total}"

    @property
    def share(self) -> float:
        """Share of all answers."""
        return float(self.chosen.sum() / self.answers.sum())

    @property
    def one_each(self) -> bool:
        """Whether nobody answered twice, so that the answers are independent."""
        return bool((self.answers == 1).all())


def count_choices(
    trials: Iterable[ComparisonTrial], chosen: Callable[[ComparisonTrial], bool] | None = None
) -> Choices:
    """Return how often each participant chose something; the modulated version, if nothing else is said."""
    is_chosen = chosen or (lambda trial: trial.chose_ours)
    counts: dict[str, list[int]] = {}
    for trial in trials:
        own = counts.setdefault(trial.participant_id, [0, 0])
        own[0] += is_chosen(trial)
        own[1] += 1
    who = tuple(sorted(counts))
    table = np.array([counts[name] for name in who], dtype=np.int64).reshape(-1, 2)
    return Choices(who, table[:, 0], table[:, 1])


@dataclass(frozen=True, slots=True)
class ShareEstimate:
    """A share of answers, and what it says about people.

    Attributes
    ----------
    choices : Choices
        The answers.
    difference : Effect
        The share with its 95 % confidence interval, and p of the two-sided test of one half.
    equivalence : Effect
        The share with its 90 % interval, which decides on equivalence at 5 %, and p of the two one-sided
        tests; neither without an interval.
    method : str
        How it was computed.
    """

    choices: Choices
    difference: Effect
    equivalence: Effect
    method: str

    @property
    def smallest_margin(self) -> float | None:
        """The margin above which the answers show equivalence at 5 %."""
        low, high = self.equivalence.ci_low, self.equivalence.ci_high
        return None if low is None or high is None else max(HALF - low, high - HALF)

    @property
    def equivalent(self) -> bool:
        """Whether equivalence is shown at 5 %."""
        return self.equivalence.p_value is not None and self.equivalence.p_value <= ALPHA

    def flagged(self, words: str) -> ShareEstimate:
        """Return it with more to note."""
        flag = joined_flags(self.difference.flag, words)
        return replace(
            self,
            difference=replace(self.difference, flag=flag),
            equivalence=replace(self.equivalence, flag=flag),
        )


def joined_flags(*flags: str) -> str:
    """Return what there is to note, each once.

    >>> joined_flags("few", "", "uneven", "few")
    'few; uneven'
    """
    return "; ".join(dict.fromkeys(words for words in flags if words))


def estimate_share(choices: Choices, margin: float) -> ShareEstimate:
    """Return the share of at least one answer, with what it says about people; margin: of equivalence."""
    people, share = choices.people, choices.share
    alone = ONE_PERSON if people == 1 else ""
    if choices.one_each:
        chosen = int(choices.chosen.sum())
        return ShareEstimate(choices, *_of_independent(chosen, choices.total, margin, alone), EXACT)
    p_value, scatter = sign_flip_test(choices.scores).p_value, standard_error(choices)
    if scatter is None:
        untold = Effect(share, flag=alone)
        return ShareEstimate(choices, replace(untold, p_value=p_value), untold, CLUSTERED)
    error = max(scatter, float(independent_error(share, choices.total)))
    if error == 0:
        # Answers that go together entirely are the worst case: each participant counts as one answer, and the
        # exact test of them is the sign-flip test's.
        difference, equal = _of_independent(round(share) * people, people, margin, ALL_ONE_WAY)
        return ShareEstimate(choices, replace(difference, p_value=p_value), equal, ONE_WAY)
    exact = sign_flip_interval(choices.chosen, choices.answers, HALF)
    few = TOO_FEW if math.isinf(exact[0]) else ""
    clustered = clustered_interval(choices.chosen, choices.answers)
    ends = joined((max(0.0, exact[0]), min(1.0, exact[1])), clustered, HALF)
    half = float(special.stdtrit(people - 1, 1 - ALPHA)) * error
    p_equal = float(equivalence_p(share - HALF, error, people, margin))
    narrow = Effect(share, max(0.0, share - half), min(1.0, share + half), few, p_equal)
    return ShareEstimate(choices, Effect(share, *ends, few, p_value), narrow, CLUSTERED)


def _of_independent(chosen: int, answers: int, margin: float, flag: str) -> tuple[Effect, Effect]:
    """Return the share with the exact test of one half, and with that of equivalence."""
    ends, narrow = (binomial.clopper_pearson(chosen, answers, level) for level in (LEVEL, 1 - 2 * ALPHA))
    p_value, equal = binomial.exact_p(chosen, answers), binomial.equivalence_p(chosen, answers, margin)
    share = chosen / answers
    return Effect(share, *ends, flag, p_value), Effect(share, *narrow, flag, equal)


def standard_error(choices: Choices) -> float | None:
    """Return the standard error of a share by how participants scatter about it; None of a single one.

    That of a ratio of sums (Cochran 1977, section 6.4), with P - 1 in the variance; where all answered
    equally often it is that of the mean of their shares.

    >>> two = Choices(("01", "02"), np.array([1, 3]), np.array([4, 4]))
    >>> standard_error(two)  # shares 0.25 and 0.75: SD sqrt(1/8), over sqrt(2)
    0.25
    """
    people = choices.people
    if people < 2:
        return None
    residuals = choices.chosen - choices.share * choices.answers
    return math.sqrt(people / (people - 1) * float(np.sum(residuals**2))) / choices.total


def independent_error(share: ArrayLike, answers: int) -> Array:
    """Return the standard error of a share of independent answers.

    Participants scatter less than that where sequences differ, and everybody says the same of each: that
    tells of these sequences, and not of how well the share is known.
    """
    shares = np.asarray(share, dtype=np.float64)
    return np.asarray(np.sqrt(shares * (1 - shares) / answers))


def equivalence_p(distance: ArrayLike, error: ArrayLike, people: int, margin: float) -> Array:
    """Return the larger p of two one-sided t tests (Schuirmann 1987) of a share's distance from one half."""
    nearest = margin - np.abs(np.asarray(distance, dtype=np.float64))
    t = nearest / np.asarray(error, dtype=np.float64)
    return np.asarray(special.stdtr(people - 1, -t))


# A mean share of one half does not mean that nobody saw a difference: some may see it and call the one
# version changed, others the other. Who answers several times then agrees more with themselves than guessers.


def consistency_of(choices: Choices) -> tuple[float, float] | None:
    """Return how much participants agree with themselves, and its exact p; None where nobody answered twice.

    That is the sum of their squared scores over what guessing gives on the average: 1 by guessing, up to the
    number of answers of each if everybody always gives the same one. The score of a guesser with n answers is
    2 Binomial(n, 1/2) - n, of variance n.

    >>> always = Choices(("01",), np.array([3]), np.array([3]))
    >>> consistency_of(always)  # 3² / 3; 2 of 2³ outcomes
    (3.0, 0.25)
    """
    if choices.total == 0 or choices.one_each:
        return None
    got = int(np.sum(choices.scores**2))
    distribution = np.ones(1)
    for answers in choices.answers.tolist():
        chances, chosen = np.zeros(answers**2 + 1), np.arange(answers + 1)
        np.add.at(chances, (2 * chosen - answers) ** 2, special.binom(answers, chosen) / 2.0**answers)
        distribution = np.convolve(distribution, chances)
    return got / choices.total, min(1.0, float(distribution[got:].sum()))


def sequence_differences(
    trials: Sequence[ComparisonTrial], sequences: Sequence[str], rng: np.random.Generator
) -> tuple[float, float] | None:
    """Return the largest share less the smallest, and its p; None where nobody compared two sequences.

    The statistic is Cochran's (1950), the sum over the sequences of (chosen - expected)², with each
    participant's own share as what is expected; each participant's answers are shuffled among their trials.
    There may be gaps and repetitions. People may differ in their shares, and do not have to guess.
    """
    place = {name: k for k, name in enumerate(sequences)}
    sums = np.zeros((PERMUTATIONS + 1, len(sequences)))
    expected, answers = np.zeros(len(sequences)), np.zeros(len(sequences))
    comparable = False
    for who in sorted({trial.participant_id for trial in trials}):
        own = [trial for trial in trials if trial.participant_id == who]
        columns = np.array([place[trial.sequence] for trial in own])
        chosen = np.array([trial.chose_ours for trial in own], dtype=np.float64)
        comparable |= len(set(columns.tolist())) > 1
        shuffled = rng.permuted(np.tile(chosen, (PERMUTATIONS, 1)), axis=1)
        np.add.at(sums.T, columns, np.vstack([chosen, shuffled]).T)
        np.add.at(expected, columns, chosen.mean())
        np.add.at(answers, columns, 1)
    if not comparable:
        return None
    statistic = np.sum((sums - expected) ** 2, axis=1)
    as_large = int(np.sum(statistic[1:] >= statistic[0] - 1e-9))
    shares = sums[0] / answers
    return float(np.ptp(shares)), (1 + as_large) / (1 + PERMUTATIONS)
