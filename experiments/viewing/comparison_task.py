"""Artifact comparison as a session conducts it (Section 4.3 of the paper)."""

from __future__ import annotations

from typing import Any

from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.viewing import ComparisonDesign, ComparisonTrial, Version
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.viewing.viewing_task import (
    ClipTask,
    pairs_in_order,
    planned_clips,
    practice_sequences,
)


class ComparisonTask(ClipTask):
    """Both versions of a sequence one after the other, and the question in which the brightness changed.

    Practice has no feedback: it would teach participants to tell the versions by other things than change.

    Parameters
    ----------
    setting : SessionSetting
        Design, stimuli, session and rig.
    """

    def __init__(self, setting: SessionSetting) -> None:
        design: Any = setting.manifest.design
        order = comparison_order(design, setting.session[1])
        super().__init__(setting, order, comparison_practice(design, *setting.session))

    def answers(self, keys: Keys) -> dict[str, Response]:
        """Return the answer that each key gives."""
        return {keys.first: Response.FIRST, keys.second: Response.SECOND}

    def row(self, planned: PlannedTrial, answer: Response, columns: dict[str, Any]) -> ComparisonTrial:
        """Return the record of a comparison."""
        stimulus = self.stimuli[planned.sequence]
        return ComparisonTrial(
            **planned.columns,
            **columns,
            mean_factor=stimulus.mean_factor(Version.OURS),
            baseline_factor=stimulus.mean_factor(Version.BASELINE),
            response=answer,
        )

    def is_right(self, trial: ComparisonTrial) -> bool | None:
        """Return whether the modulated version was identified."""
        return trial.chose_ours


def comparison_order(design: ComparisonDesign, order_index: int) -> tuple[PlannedTrial, ...]:
    """Return the trials of a participant, ordered as those of `rating_order`.

    >>> design = ComparisonDesign(sequences=("gym", "library"))
    >>> sorted(trial.ours_interval for trial in comparison_order(design, 0))
    [1, 2]
    """
    return tuple(
        _planned(sequence, versions, repetition)
        for repetition, ordered in enumerate(pairs_in_order(design, order_index), start=1)
        for sequence, versions in ordered
    )


def comparison_practice(design: ComparisonDesign, seed: int, order_index: int) -> tuple[PlannedTrial, ...]:
    """Return excerpts for practice, of random sequences; the modulated one comes first and second in turn."""
    chosen = practice_sequences(design.sequences, design.practice_trials, seed, order_index)
    both = (Version.OURS, Version.BASELINE)
    return tuple(
        _planned(sequence, both[:: -1 if (k + order_index) % 2 else 1], 0, design.practice_duration)
        for k, sequence in enumerate(chosen)
    )


def _planned(
    sequence: str, versions: tuple[Version, ...], block: int, seconds: float | None = None
) -> PlannedTrial:
    """Return the two versions of a sequence, to be compared."""
    return planned_clips(
        versions, seconds, sequence=sequence, repetition=max(block, 1),
        ours_interval=1 + versions.index(Version.OURS), block=block,
    )  # fmt: skip
