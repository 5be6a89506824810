"""Detail rating as a session conducts it (Section 4.1 of the paper)."""

from __future__ import annotations

from typing import Any

from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.viewing import LOWEST_RATING, RatingDesign, RatingTrial, Version
from evenlight.experiments.chance import drawn_row, williams_row
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.viewing.viewing_task import (
    ClipTask,
    pairs_in_order,
    planned_clips,
    practice_sequences,
)


class RatingTask(ClipTask):
    """Each sequence in both versions; after each video, a rating from 1 to 5.

    Parameters
    ----------
    setting : SessionSetting
        Design, stimuli, session and rig.
    """

    def __init__(self, setting: SessionSetting) -> None:
        design: Any = setting.manifest.design
        order = rating_order(design, setting.session[1])
        super().__init__(setting, order, rating_practice(design, *setting.session))

    def answers(self, keys: Keys) -> dict[str, int]:
        """Return the rating that each key gives."""
        return {key: LOWEST_RATING + place for place, key in enumerate(keys.ratings)}

    def row(self, planned: PlannedTrial, answer: int, columns: dict[str, Any]) -> RatingTrial:
        """Return the record of a rated video."""
        mean_factor = self.stimuli[planned.sequence].mean_factor(planned.version)
        return RatingTrial(**planned.columns, **columns, mean_factor=mean_factor, rating=answer)


def rating_order(design: RatingDesign, order_index: int) -> tuple[PlannedTrial, ...]:
    """Return the trials of a participant: a block for each repetition.

    Sequences, or all versions of them where they are not together, stand in the order of a Williams square
    whose rows are drawn. Which version comes first is drawn too: ours in half of the sequences, for half of
    the participants and of the repetitions (docs/decisions/order-of-trials.md).

    Parameters
    ----------
    design : RatingDesign
        Which sequences, how often.
    order_index : int
        The participant's place in the data set.

    >>> order = rating_order(RatingDesign(sequences=("gym", "library")), 0)
    >>> sorted((trial.sequence, trial.version.value) for trial in order)
    [('gym', 'baseline'), ('gym', 'ours'), ('library', 'baseline'), ('library', 'ours')]
    """
    trials: list[PlannedTrial] = []
    for repetition, ordered in enumerate(pairs_in_order(design, order_index), start=1):
        pairs = [(sequence, version) for sequence, versions in ordered for version in versions]
        if not design.versions_together:
            every = [(sequence, version) for sequence in design.sequences for version in Version]
            row = drawn_row(len(every), order_index, design.order_seed, repetition)
            pairs = [every[k] for k in williams_row(len(every), row)]
        seen: set[str] = set()
        for sequence, version in pairs:
            place = 2 if sequence in seen else 1
            seen.add(sequence)
            trials.append(_planned(sequence, version, repetition, place, repetition))
    return tuple(trials)


def rating_practice(design: RatingDesign, seed: int, order_index: int) -> tuple[PlannedTrial, ...]:
    """Return excerpts for practice, of sequences drawn at random, the two versions in turn."""
    chosen = practice_sequences(design.sequences, design.practice_trials, seed, order_index)
    versions, seconds = tuple(Version), design.practice_duration
    return tuple(
        _planned(sequence, versions[(k + order_index) % 2], 1, 1 + k % 2, 0, seconds)
        for k, sequence in enumerate(chosen)
    )


def _planned(
    sequence: str, version: Version, repetition: int, place: int, block: int, seconds: float | None = None
) -> PlannedTrial:
    """Return a video to be rated: which rating of it, from 1, and 1 if its version is shown first, else 2."""
    return planned_clips(
        (version,), seconds, sequence=sequence, version=version, repetition=repetition, place_in_pair=place,
        block=block,
    )  # fmt: skip
