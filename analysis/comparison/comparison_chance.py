"""What else guessing would give: people as consistent as guessers, sequences that differ no more than chance.

A mean share of one half does not mean that nobody saw a difference: some may see it and call the one version
changed, others the other. People who answer several times then agree with themselves more than guessers do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.comparison.comparison_shares import Choices
from evenlight.data_schema.recordings.viewing import ComparisonTrial

PERMUTATIONS = 9999


@dataclass(frozen=True, slots=True)
class Consistency:
    """How much participants agree with themselves, against guessing.

    Attributes
    ----------
    ratio : float
        Sum of the squared scores over what guessing gives on the average: 1 by guessing, up to the number of
        answers of each if everybody always gives the same one.
    p_value : float
        Probability of so much or more if everybody guessed (exact).
    """

    ratio: float
    p_value: float


@dataclass(frozen=True, slots=True)
class SequenceDifferences:
    """How much the shares of the sequences differ.

    Attributes
    ----------
    spread : float
        Largest share minus smallest.
    p_value : float
        Of a permutation test: each participant's answers, shuffled among that participant's trials.
    """

    spread: float
    p_value: float


def consistency_of(choices: Choices) -> Consistency | None:
    """Return how consistent participants are, or None where nobody answered twice.

    The score of a guesser with n answers is 2 Binomial(n, 1/2) - n, of variance n; the squares are added up,
    and so are their probabilities over all outcomes.

    >>> always = Choices(("01",), np.array([3]), np.array([3]))
    >>> consistency_of(always)  # 3² / 3; 2 of 2³ outcomes
    Consistency(ratio=3.0, p_value=0.25)
    """
    if choices.total == 0 or choices.one_each:
        return None
    got = int(np.sum(choices.scores**2))
    distribution = np.ones(1)
    for answers in choices.answers.tolist():
        distribution = np.convolve(distribution, _squared_score(answers))
    return Consistency(got / choices.total, min(1.0, float(distribution[got:].sum())))


def _squared_score(answers: int) -> NDArray[np.float64]:
    """Return the distribution of a guesser's squared score, by its value from 0 to n²."""
    chances = np.zeros(answers**2 + 1)
    chosen = np.arange(answers + 1)
    np.add.at(chances, (2 * chosen - answers) ** 2, special.binom(answers, chosen) / 2.0**answers)
    return chances


def sequence_differences(
    trials: Sequence[ComparisonTrial], sequences: Sequence[str], rng: np.random.Generator
) -> SequenceDifferences | None:
    """Return how much sequences differ, or None where nobody compared two of them.

    The statistic is Cochran's (1950), the sum over the sequences of (chosen - expected)², with each
    participant's own share as what is expected; it may have gaps and repetitions. People may differ in their
    shares, and do not have to guess.

    Parameters
    ----------
    trials : sequence of ComparisonTrial
        All of them.
    sequences : sequence of str
        Names of those that are compared; each with a trial at least.
    rng : numpy.random.Generator
        Of the permutations.
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
    return SequenceDifferences(float(np.ptp(shares)), (1 + as_large) / (1 + PERMUTATIONS))
