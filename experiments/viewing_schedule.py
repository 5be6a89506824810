"""The order of the trials of detail rating and artifact comparison, counterbalanced over participants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.viewing import ComparisonDesign, RatingDesign, Version
from evenlight.experiments.counterbalancing import williams_row
from evenlight.experiments.keyed_chance import Purpose, generator_for


@dataclass(frozen=True, slots=True)
class PlannedRating:
    """A video to be rated.

    Attributes
    ----------
    sequence : str
        Which.
    version : Version
        How it is dimmed.
    repetition : int
        Which rating of this version, from 1.
    place_in_pair : int
        1 if this version is shown before the other, else 2.
    block : int
        Of the session, from 1; 0 for practice.
    practice : bool
        Whether it is practice.
    seconds : float or None
        How much of it is shown, from its beginning [s]; None for all.
    """

    sequence: str
    version: Version
    repetition: int
    place_in_pair: int
    block: int = 1
    practice: bool = False
    seconds: float | None = None

    @property
    def columns(self) -> dict[str, Any]:
        """What of its row is known before it is shown."""
        names = ("sequence", "version", "repetition", "place_in_pair", "block", "practice")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, slots=True)
class PlannedComparison:
    """The two versions of a sequence, to be compared.

    Attributes
    ----------
    sequence : str
        Which.
    repetition : int
        Which comparison of this sequence, from 1.
    ours_interval : int
        Which of the two is the modulated version, 1 or 2.
    block, practice, seconds
        As in `PlannedRating`.
    """

    sequence: str
    repetition: int
    ours_interval: int
    block: int = 1
    practice: bool = False
    seconds: float | None = None

    @property
    def versions(self) -> tuple[Version, Version]:
        """The two versions, in the order in which they are shown."""
        order = (Version.OURS, Version.BASELINE)
        return order if self.ours_interval == 1 else (order[1], order[0])

    @property
    def columns(self) -> dict[str, Any]:
        """What of its row is known before it is shown."""
        names = ("sequence", "repetition", "ours_interval", "block", "practice")
        return {name: getattr(self, name) for name in names}


def rating_order(design: RatingDesign, order_index: int) -> tuple[PlannedRating, ...]:
    """Return the trials of a participant: a block for each repetition.

    Sequences, or all versions of them where they are not together, stand in the order of a Williams square.
    Which version comes first alternates from sequence to sequence, from participant to participant, from one
    round of the square to the next, and from repetition to repetition.

    Parameters
    ----------
    design : RatingDesign
        Which sequences, how often.
    order_index : int
        The participant's place in the data set.

    >>> order = rating_order(RatingDesign(sequences=("gym", "library")), 0)
    >>> [(trial.sequence, trial.version.value) for trial in order]
    [('gym', 'ours'), ('gym', 'baseline'), ('library', 'baseline'), ('library', 'ours')]
    """
    trials: list[PlannedRating] = []
    for repetition in range(1, design.repetitions + 1):
        pairs = [
            (sequence, version)
            for sequence in _sequences_in_order(design.sequences, order_index)
            for version in _versions(design.sequences, sequence, order_index, repetition)
        ]
        if not design.versions_together:
            every = [(sequence, version) for sequence in design.sequences for version in Version]
            pairs = [every[k] for k in williams_row(len(every), order_index + repetition - 1)]
        seen: set[str] = set()
        for sequence, version in pairs:
            place = 2 if sequence in seen else 1
            seen.add(sequence)
            trials.append(PlannedRating(sequence, version, repetition, place, block=repetition))
    return tuple(trials)


def comparison_order(design: ComparisonDesign, order_index: int) -> tuple[PlannedComparison, ...]:
    """Return the trials of a participant, ordered as those of `rating_order`.

    >>> design = ComparisonDesign(sequences=("gym", "library"))
    >>> [(trial.sequence, trial.ours_interval) for trial in comparison_order(design, 0)]
    [('gym', 1), ('library', 2)]
    """
    return tuple(
        PlannedComparison(
            sequence,
            repetition,
            1 + _versions(design.sequences, sequence, order_index, repetition).index(Version.OURS),
            block=repetition,
        )
        for repetition in range(1, design.repetitions + 1)
        for sequence in _sequences_in_order(design.sequences, order_index)
    )


def rating_practice(design: RatingDesign, seed: int, order_index: int) -> tuple[PlannedRating, ...]:
    """Return excerpts for practice, of sequences drawn at random, the two versions in turn."""
    chosen = _excerpts(design.sequences, design.practice_trials, seed, order_index)
    versions = tuple(Version)
    return tuple(
        PlannedRating(
            sequence, versions[(k + order_index) % 2], 1, 1 + k % 2, 0, True, design.practice_duration
        )
        for k, sequence in enumerate(chosen)
    )


def comparison_practice(
    design: ComparisonDesign, seed: int, order_index: int
) -> tuple[PlannedComparison, ...]:
    """Return excerpts for practice, of random sequences; the modulated one comes first and second in turn."""
    chosen = _excerpts(design.sequences, design.practice_trials, seed, order_index)
    return tuple(
        PlannedComparison(sequence, 1, 1 + (k + order_index) % 2, 0, True, design.practice_duration)
        for k, sequence in enumerate(chosen)
    )


def _sequences_in_order(sequences: tuple[str, ...], order_index: int) -> list[str]:
    """Return the sequences in the order of a participant."""
    return [sequences[k] for k in williams_row(len(sequences), order_index)]


def _versions(
    sequences: tuple[str, ...], sequence: str, order_index: int, repetition: int
) -> tuple[Version, Version]:
    """Return the two versions of a sequence in the order in which a participant sees them."""
    # After so many participants the rows of the Williams square repeat: from then on, the other way round.
    rows = len(sequences) * (1 + len(sequences) % 2)
    rounds = order_index // rows
    ours_first = (sequences.index(sequence) + order_index + rounds + repetition - 1) % 2 == 0
    return (Version.OURS, Version.BASELINE) if ours_first else (Version.BASELINE, Version.OURS)


def _excerpts(sequences: tuple[str, ...], n: int, seed: int, order_index: int) -> list[str]:
    """Return the sequences of practice: each once before any comes twice."""
    chance = generator_for(seed, order_index, Purpose.EXCERPTS)
    order = [int(k) for _ in range(-(-n // len(sequences))) for k in chance.permutation(len(sequences))]
    return [sequences[k] for k in order[:n]]
