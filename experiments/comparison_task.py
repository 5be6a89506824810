"""Artifact comparison as a session conducts it (Section 4.3 of the paper)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from evenlight.data_schema.ramp import Response, TrialFlag
from evenlight.data_schema.rig import Rig
from evenlight.data_schema.viewing import ComparisonDesign, ComparisonTrial, Version
from evenlight.experiments.fixed_order import FixedOrder
from evenlight.experiments.pages import Pages
from evenlight.experiments.session_minutes import viewing_minutes
from evenlight.experiments.stage import Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus, neutral_luminance
from evenlight.experiments.task import Conducted, Participant, TrialPlace
from evenlight.experiments.viewing_schedule import PlannedComparison, comparison_order, comparison_practice
from evenlight.experiments.viewing_trials import (
    clip_log,
    noise_seed_of,
    require_room,
    shown_columns,
    stimulus_clip,
)


class ComparisonTask:
    """Both versions of a sequence one after the other, and the question in which the brightness changed.

    Parameters
    ----------
    design : ComparisonDesign
        Which sequences, how often.
    stimuli : sequence of LoadedStimulus
        The sequences, with videos and tracks.
    session : (int, int)
        Seed, and the participant's place in the data set.
    rig : Rig
        What is pressed.
    """

    def __init__(
        self, design: ComparisonDesign, stimuli: Sequence[LoadedStimulus], session: tuple[int, int], rig: Rig
    ) -> None:
        self._design, self._session, self._rig = design, session, rig
        self._stimuli = {stimulus.name: stimulus for stimulus in stimuli}
        self._order = FixedOrder(comparison_order(design, session[1]), design.repeat_flagged)
        self.neutral_luminance = neutral_luminance(stimuli)
        self.n_trials = self._order.n_trials
        self.trials_between_breaks = design.trials_between_breaks
        self.instructions = "instructions_comparison"
        self.seconds = 0.0  # nobody is hurried

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        seconds = sum(stimulus.stimulus.duration for stimulus in self._stimuli.values())
        practice = 2 * self._design.practice_trials * self._design.practice_duration
        pauses = 2 * self._design.adaptation_duration * (self.n_trials + self._design.practice_trials)
        return viewing_minutes(2 * self._design.repetitions * seconds + practice + pauses, self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Refuse videos that are larger than the window."""
        require_room(self._stimuli.values(), stage)

    def practice(self) -> Sequence[PlannedComparison]:
        """Return the trials for practice."""
        return comparison_practice(self._design, *self._session)

    def next_trial(self) -> PlannedComparison | None:
        """Return the comparison that comes next, or None at the end."""
        return self._order.next_trial()

    def take(self, trial: ComparisonTrial) -> None:
        """Take an answered trial."""
        self._order.take(trial)

    def is_right(self, trial: ComparisonTrial) -> bool | None:
        """Return whether the modulated version was told."""
        return trial.chose_ours

    def is_flagged(self, trial: ComparisonTrial) -> bool:
        """Return whether a trial is left out of the analysis."""
        return trial.flag is not TrialFlag.NONE

    def feedback(self, trial: ComparisonTrial, pages: Pages) -> str:
        """Return nothing: who is told which version it was learns to know it by other things than change."""
        return ""

    def conduct(
        self,
        planned: PlannedComparison,
        place: TrialPlace,
        stage: Stage,
        participant: Participant,
        pages: Pages,
    ) -> Conducted:
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
        return Conducted(trial, tuple(logs))
