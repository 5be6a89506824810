"""The share of answers that chose the modulated version: counts, interval, exact test, equivalence to 1/2.

Where everybody answered once, the answers are independent and their number is binomial. Where they answered
more often, participants are the sample: answers of one person are correlated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from evenlight.analysis.inference.binomial_tests import (
    ALPHA,
    HALF,
    BinomialInference,
    Interval,
    clopper_pearson,
    infer_share,
)
from evenlight.analysis.inference.clustered_shares import clustered_interval
from evenlight.analysis.inference.exact_intervals import joined, sign_flip_interval
from evenlight.analysis.inference.exact_tests import sign_flip_test
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.ramp import Response
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
OURS_FIRST = 1  # interval


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
    def total(self) -> int:
        """All answers."""
        return int(self.answers.sum())

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
    """Return how often each participant chose something.

    Parameters
    ----------
    trials : iterable of ComparisonTrial
        Whose answers count.
    chosen : callable, optional
        Whether a trial's answer is what is counted; the modulated version, if none is given.
    """
    is_chosen = chosen or (lambda trial: trial.chose_ours)
    counts: dict[str, list[int]] = {}
    for trial in trials:
        own = counts.setdefault(trial.participant_id, [0, 0])
        own[0] += is_chosen(trial)
        own[1] += 1
    who = tuple(sorted(counts))
    table = np.array([counts[name] for name in who], dtype=np.int64).reshape(-1, 2)
    return Choices(who, table[:, 0], table[:, 1])


def chose_first(trial: ComparisonTrial) -> bool:
    """Return whether the first of the two videos was chosen, whichever it was."""
    return trial.response is Response.FIRST


def sequences_in(data: TaskData[ComparisonTrial]) -> tuple[str, ...]:
    """Return the sequences that were designed or answered, in the order of the design."""
    return tuple(dict.fromkeys((*data.designed_sequences, *(trial.sequence for trial in data.trials))))


@dataclass(frozen=True, slots=True)
class ShareEstimate:
    """A share of answers, and what it says about people.

    Attributes
    ----------
    choices : Choices
        The answers.
    interval, narrow : (float, float) or None
        Confidence intervals, 95 % and 90 %; the second decides on equivalence at 5 %. None if missing.
    p_value : float
        Of the two-sided test of one half.
    margin : float
        Distance from one half within which a share counts as equivalent to it.
    equivalence_p : float or None
        Of the two one-sided tests; None without an interval.
    method, flag : str
        How it was computed, and what is wrong with it.
    exact : BinomialInference or None
        Of independent answers; None where a participant answered twice.
    """

    choices: Choices
    interval: Interval | None
    narrow: Interval | None
    p_value: float
    margin: float
    equivalence_p: float | None
    method: str
    flag: str
    exact: BinomialInference | None

    @property
    def smallest_margin(self) -> float | None:
        """The margin above which the answers show equivalence at 5 %."""
        return None if self.narrow is None else max(HALF - self.narrow[0], self.narrow[1] - HALF)

    @property
    def sample(self) -> int:
        """How large the sample is: participants, as answers of one person are not independent."""
        return len(self.choices.participants)

    @property
    def equivalent(self) -> bool:
        """Whether equivalence is shown at 5 %."""
        return self.equivalence_p is not None and self.equivalence_p <= ALPHA


def estimate_share(choices: Choices, margin: float) -> ShareEstimate:
    """Return the share of answers, with what it says about people.

    Parameters
    ----------
    choices : Choices
        At least one answer.
    margin : float
        Within which a share counts as equivalent to one half.
    """
    alone = ONE_PERSON if len(choices.participants) == 1 else ""
    if choices.one_each:
        found = infer_share(int(choices.chosen.sum()), choices.total, margin)
        return ShareEstimate(
            choices=choices,
            interval=found.clopper_pearson,
            narrow=clopper_pearson(found.chosen, found.answers, 1 - 2 * ALPHA),
            p_value=found.p_value,
            margin=margin,
            equivalence_p=found.equivalence_p,
            method=EXACT,
            flag=alone,
            exact=found,
        )
    p_value = sign_flip_test(choices.scores).p_value
    scatter = standard_error(choices)
    if scatter is None:
        return ShareEstimate(choices, None, None, p_value, margin, None, CLUSTERED, alone, None)
    error = max(scatter, float(independent_error(choices.share, choices.total)))
    if error == 0:
        return _all_one_way(choices, margin, p_value)
    exact = sign_flip_interval(choices.chosen, choices.answers, HALF)
    inside = max(0.0, exact[0]), min(1.0, exact[1])
    return ShareEstimate(
        choices=choices,
        interval=joined(inside, clustered_interval(choices.chosen, choices.answers), HALF),
        narrow=_narrow_interval(choices, error),
        p_value=p_value,
        margin=margin,
        equivalence_p=float(equivalence_p(choices.share - HALF, error, len(choices.participants), margin)),
        method=CLUSTERED,
        flag=TOO_FEW if math.isinf(exact[0]) else "",
        exact=None,
    )


def standard_error(choices: Choices) -> float | None:
    """Return the standard error of a share by how participants scatter about it; None of a single one.

    That of a ratio of sums (Cochran 1977, section 6.4), with P - 1 in the variance; where all answered
    equally often it is that of the mean of their shares.

    >>> two = Choices(("01", "02"), np.array([1, 3]), np.array([4, 4]))
    >>> standard_error(two)  # shares 0.25 and 0.75: SD sqrt(1/8), over sqrt(2)
    0.25
    """
    people = len(choices.participants)
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


def _narrow_interval(choices: Choices, error: float) -> Interval:
    """Return the 90 % interval of Student's t, within [0, 1], which decides equivalence."""
    half = float(special.stdtrit(len(choices.participants) - 1, 1 - ALPHA)) * error
    return max(0.0, choices.share - half), min(1.0, choices.share + half)


def equivalence_p(distance: ArrayLike, error: ArrayLike, people: int, margin: float) -> Array:
    """Return the larger p of two one-sided t tests (Schuirmann 1987).

    Parameters
    ----------
    distance, error : array_like
        Of a share from one half, and its standard error.
    people : int
        Participants.
    margin : float
        Within which a share counts as equivalent to one half.
    """
    nearest = margin - np.abs(np.asarray(distance, dtype=np.float64))
    t = nearest / np.asarray(error, dtype=np.float64)
    return np.asarray(special.stdtr(people - 1, -t))


def _all_one_way(choices: Choices, margin: float, p_value: float) -> ShareEstimate:
    """Return the share of answers that were all the same: each participant counts as one answer.

    Answers that go together entirely are the worst case; the exact test of them is the sign-flip test's.
    """
    people = len(choices.participants)
    found = infer_share(round(choices.share) * people, people, margin)
    narrow = clopper_pearson(found.chosen, people, 1 - 2 * ALPHA)
    ends, equal = found.clopper_pearson, found.equivalence_p
    return ShareEstimate(choices, ends, narrow, p_value, margin, equal, ONE_WAY, ALL_ONE_WAY, None)
