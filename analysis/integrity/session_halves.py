"""Whether the two halves of a session differ, in the answers to the same items in the same versions.

The answers less the mean of all to that item and version are exchanged at random between the halves of a
session. The sum over the later half then has a known mean and variance (sampling without replacement), and is
compared with the normal distribution. Adaptive ramps cannot be exchanged, as what is shown depends on the
answers before: of ramps it is the drift of the thresholds that says whether a session changed
(`calibration/psychometric/thresholds.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from evenlight.analysis.integrity.answers import Answers
from evenlight.analysis.integrity.concern import LEVEL, Concern, ConcernKind
from evenlight.analysis.wording import first_few, p_in_words
from evenlight.data_schema.arrays import Array, Integers, Mask

SEVERAL = 8  # sessions from which on the common part of what practice does can be taken out
Half = tuple[str, float, float, float]  # whose; excess, weight, variance of `_halves`
NO_VARIANCE = 1e-12  # what rounding leaves of none
WORDS = {
    "rating": "the ratings of the later half are {0:.2g} points {1}",
    "comparison": "ours is chosen {0:.0%} {2} in the later half",
    "search": "searches of the later half take {3:.2f} times as long",
}


def half_concerns(answers: Answers) -> tuple[Concern, ...]:
    """Return which sessions have halves that differ, and whether all have.

    People search faster where they have been before: what is common to all searchers is taken out, and it is
    for the analysis, whose model has it.
    """
    known = ~np.isnan(answers.answer) & answers.timed
    session, later = answers.session[known], answers.later[known]
    if not session.size or answers.task == "ramp":
        return ()
    left = _left_over(answers, known)
    halves = _halves(left, later, session)
    if answers.task != "search":
        everybody = [("over all sessions ", *np.sum(halves[1], axis=0))] if len(halves[0]) > 1 else []
        return (*_concern(answers, _by_session(answers, halves)), *_concern(answers, everybody))
    if len(halves[0]) < SEVERAL:
        return ()
    common = float(np.median(halves[1][:, 0] / halves[1][:, 1]))
    return _concern(answers, _by_session(answers, _halves(left - common * later, later, session)))


def _by_session(answers: Answers, halves: tuple[Integers, Array]) -> list[Half]:
    """Return the halves of each session, with its name."""
    named = zip(*halves, strict=True)
    return [(f"in session {'/'.join(answers.sessions[k])} ", *sums) for k, sums in named]


def _concern(answers: Answers, halves: Sequence[Half]) -> tuple[Concern, ...]:
    """Return which halves differ, at the level over their number."""
    words = []
    for name, excess, weight, variance in halves:
        p = float(2 * special.ndtr(-abs(excess) / math.sqrt(variance)))
        if p < LEVEL / len(halves):
            words.append(f"{name}{_change(answers.task, excess / weight)} ({p_in_words(p)})")
    return (Concern(ConcernKind.HALVES, first_few(words, 3)),) if words else ()


def _left_over(answers: Answers, known: Mask) -> Array:
    """Return the answers less the mean of all to the same item in the same version."""
    answer = answers.answer[known]
    version = np.nan_to_num(answers.ours[known], nan=2.0).astype(np.int64)
    cell = answers.item[known] * 3 + version
    mean = np.bincount(cell, weights=answer) / np.maximum(np.bincount(cell), 1)
    left: Array = answer - mean[cell]
    return left


def _halves(values: Array, later: Mask, session: Integers) -> tuple[Integers, Array]:
    """Return the later half of each session against the earlier one, where chance could make them differ.

    Returns
    -------
    array (k,), array (k, 3)
        Which sessions; of each the sum of the later half less its mean by chance, what divides that to give
        the difference of the halves, and its variance by chance.
    """
    n = np.maximum(np.bincount(session), 1).astype(np.float64)
    m = np.bincount(session, weights=later)
    mean = np.bincount(session, weights=values) / n
    spread = np.bincount(session, weights=(values - mean[session]) ** 2) / n
    share = m * (n - m)
    excess = np.bincount(session, weights=values * later) - m * mean
    sums = np.stack([excess, share / n, share / np.maximum(n - 1, 1) * spread], axis=1)
    tested = np.flatnonzero(sums[:, 2] > NO_VARIANCE)
    return tested, sums[tested]


def _change(task: str, difference: float) -> str:
    """Return what the later half does, in words.

    >>> _change("rating", -0.5)
    'the ratings of the later half are 0.5 points lower'
    """
    size, up = abs(difference), difference > 0
    words = WORDS.get(task, "the answers of the later half are {0:.2g} {1}")
    return words.format(size, "higher" if up else "lower", "more often" if up else "less often",
                        math.exp(difference) if task == "search" else 0.0)  # fmt: skip
