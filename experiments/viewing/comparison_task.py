"""Artifact comparison as a session conducts it (Section 4.3 of the paper)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.viewing import ComparisonDesign, ComparisonTrial, Version
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import ConductedTrial, Participant, SessionSetting, TrialPlace
from evenlight.experiments.stage import Stage
from evenlight.experiments.viewing.viewing_task import (
    ViewingTask,
    clip_log,
    noise_seed_of,
    practice_sequences,
    sequences_in_order,
    shown_columns,
    stimulus_clip,
    versions_in_order,
)


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


class ComparisonTask(ViewingTask[PlannedComparison]):
    """Both versions of a sequence one after the other, and the question in which the brightness changed.

    Practice has no feedback: it would teach participants to tell the versions by other things than change.

    Parameters
    ----------
    setting : SessionSetting
        Design, stimuli, session and rig.
    """

    instructions = "instructions_comparison"

    def __init__(self, setting: SessionSetting) -> None:
        self._design: ComparisonDesign = setting.manifest.design  # type: ignore[assignment] # the manifest checks
        super().__init__(setting, comparison_order(self._design, setting.session[1]))

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        return self._clip_minutes(self._design, clips_per_trial=2)

    def practice(self) -> Sequence[PlannedComparison]:
        """Return the trials for practice."""
        return comparison_practice(self._design, *self._session)

    def is_right(self, trial: ComparisonTrial) -> bool | None:
        """Return whether the modulated version was identified."""
        return trial.chose_ours

    def conduct(
        self,
        planned: PlannedComparison,
        place: TrialPlace,
        stage: Stage,
        participant: Participant,
        pages: Pages,
    ) -> ConductedTrial:
        """Show the two versions, and ask in which of them the brightness changed."""
        stimulus, seed = self._stimuli[planned.sequence], noise_seed_of(self._session, place)
        shown = []
        for number, version in enumerate(planned.versions, start=1):
            clip = stimulus_clip(stimulus, version, seed + number - 1, planned.seconds)
            clip = dataclasses.replace(clip, label=str(number))
            stage.prepare_clip(clip)
            stage.wait(self._design.adaptation_duration, self.neutral_luminance)
            shown.append(stage.play(clip))
        keys = self._rig.keys
        answers = {keys.first: Response.FIRST, keys.second: Response.SECOND}
        participant.see_trial(planned, place.trial_index)
        question = pages.text("question_comparison", keys)
        press = stage.ask(question, list(answers), self.neutral_luminance)
        trial = ComparisonTrial(
            **planned.columns,
            **shown_columns(place, shown, seed, self._design.max_dropped_share),
            mean_factor=stimulus.mean_factor(Version.OURS),
            baseline_factor=stimulus.mean_factor(Version.BASELINE),
            response=answers[press.name],
            response_time=press.time,
        )
        logs = (clip_log(place, number, part) for number, part in enumerate(shown, start=1))
        return ConductedTrial(trial, tuple(logs))


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
            1 + versions_in_order(design.sequences, sequence, order_index, repetition).index(Version.OURS),
            block=repetition,
        )
        for repetition in range(1, design.repetitions + 1)
        for sequence in sequences_in_order(design.sequences, order_index)
    )


def comparison_practice(
    design: ComparisonDesign, seed: int, order_index: int
) -> tuple[PlannedComparison, ...]:
    """Return excerpts for practice, of random sequences; the modulated one comes first and second in turn."""
    chosen = practice_sequences(design.sequences, design.practice_trials, seed, order_index)
    return tuple(
        PlannedComparison(sequence, 1, 1 + (k + order_index) % 2, 0, True, design.practice_duration)
        for k, sequence in enumerate(chosen)
    )
