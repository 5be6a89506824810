"""Ratings of the two versions of a sequence by the same people, as pairs.

A participant's ratings of a version are averaged if there are several; the pair is the unit, because answers
of one person are not independent. Who lacks one of the versions is left out of the pair, and named.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

ALL = "all"  # in place of a sequence's name


@dataclass(frozen=True, slots=True)
class PairedRatings:
    """What the same people answered to both versions.

    Attributes
    ----------
    name : str
        The sequence, or "all".
    participant_ids : tuple of str, (n,)
        Who has rated both.
    differences : tuple of Fraction, (n,)
        Ours less baseline [rating points].
    left_out : tuple of str
        Who has rated one version only.
    """

    name: str
    participant_ids: tuple[str, ...]
    differences: tuple[Fraction, ...]
    left_out: tuple[str, ...] = ()

    @property
    def values(self) -> Array:
        """The differences as numbers [rating points]."""
        return np.array([float(difference) for difference in self.differences])

    @property
    def step(self) -> float:
        """The smallest difference that these means of whole ratings can show [rating points]."""
        return 1 / common_denominator(self.differences)

    @property
    def scores(self) -> NDArray[np.int64]:
        """The differences in steps: whole numbers, as exact tests need them."""
        return whole_scores(self.differences)


@dataclass(frozen=True, slots=True)
class VersionRatings:
    """All ratings of one version of a sequence.

    Attributes
    ----------
    sequence : str
        Which.
    version : Version
        Which.
    ratings : tuple of int
        Every rating.
    means : tuple of Fraction, (n,)
        Of each participant.
    """

    sequence: str
    version: Version
    ratings: tuple[int, ...]
    means: tuple[Fraction, ...]

    @property
    def values(self) -> Array:
        """The participants' means as numbers."""
        return np.array([float(mean) for mean in self.means])

    @property
    def step(self) -> float:
        """The smallest difference between two such means [rating points]."""
        return 1 / common_denominator(self.means)


def common_denominator(values: Iterable[Fraction]) -> int:
    """Return the least common denominator.

    >>> common_denominator([Fraction(1, 2), Fraction(1, 3), Fraction(2)])
    6
    """
    return math.lcm(*(value.denominator for value in values))


def whole_scores(values: Sequence[Fraction]) -> NDArray[np.int64]:
    """Return fractions as multiples of one over their common denominator."""
    denominator = common_denominator(values)
    return np.array([int(value * denominator) for value in values], dtype=np.int64)


def sequences_in(data: TaskData[RatingTrial]) -> tuple[str, ...]:
    """Return the names of the sequences that were designed or rated, in the order of the designs."""
    rated = sorted({trial.sequence for trial in data.trials})
    return tuple(dict.fromkeys((*data.designed_sequences, *rated)))


def version_ratings(trials: Sequence[RatingTrial], sequence: str, version: Version) -> VersionRatings:
    """Return all ratings of a version of a sequence."""
    own = [trial for trial in trials if trial.sequence == sequence and trial.version is version]
    return VersionRatings(
        sequence, version, tuple(trial.rating for trial in own), tuple(_means(own).values())
    )


def paired_ratings(trials: Sequence[RatingTrial], sequence: str) -> PairedRatings:
    """Return the pairs of a sequence."""
    means = {
        version: _means(t for t in trials if t.sequence == sequence and t.version is version)
        for version in Version
    }
    ours, baseline = means[Version.OURS], means[Version.BASELINE]
    both = [who for who in ours if who in baseline]
    lacking = [who for who in (*ours, *baseline) if not (who in ours and who in baseline)]
    return PairedRatings(
        sequence, tuple(both), tuple(ours[who] - baseline[who] for who in both), tuple(sorted(lacking))
    )


def over_sequences(pairs: Sequence[PairedRatings]) -> PairedRatings:
    """Return each participant's mean difference over the sequences of which they have rated both versions."""
    own: dict[str, list[Fraction]] = {}
    for pair in pairs:
        for who, difference in zip(pair.participant_ids, pair.differences, strict=True):
            own.setdefault(who, []).append(difference)
    lacking = {who for pair in pairs for who in pair.left_out} - set(own)
    means = tuple(sum(values, Fraction(0)) / len(values) for values in own.values())
    return PairedRatings(ALL, tuple(own), means, tuple(sorted(lacking)))


def incomplete(pairs: Sequence[PairedRatings]) -> tuple[str, ...]:
    """Return who has not rated both versions of all sequences."""
    everybody = {who for pair in pairs for who in (*pair.participant_ids, *pair.left_out)}
    return tuple(sorted(who for who in everybody if any(who not in p.participant_ids for p in pairs)))


def _means(trials: Iterable[RatingTrial]) -> dict[str, Fraction]:
    """Return the mean rating of each participant."""
    own: dict[str, list[int]] = {}
    for trial in trials:
        own.setdefault(trial.participant_id, []).append(trial.rating)
    return {who: Fraction(sum(given), len(given)) for who, given in own.items()}
