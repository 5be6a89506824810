"""Detail rating as a session conducts it (Section 4.1 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.data_schema.ramp import TrialFlag
from evenlight.data_schema.rig import Rig
from evenlight.data_schema.viewing import LOWEST_RATING, RatingDesign, RatingTrial
from evenlight.experiments.fixed_order import FixedOrder
from evenlight.experiments.pages import Pages
from evenlight.experiments.session_minutes import viewing_minutes
from evenlight.experiments.stage import Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus, neutral_luminance
from evenlight.experiments.task import Conducted, Participant, TrialPlace
from evenlight.experiments.viewing_schedule import PlannedRating, rating_order, rating_practice
from evenlight.experiments.viewing_trials import (
    clip_log,
    noise_seed_of,
    require_room,
    shown_columns,
    stimulus_clip,
)


class RatingTask:
    """Each sequence in both versions; after each video, a rating from 1 to 5.

    Parameters
    ----------
    design : RatingDesign
        Which sequences, how often.
    stimuli : sequence of LoadedStimulus
        The sequences, with videos and tracks.
    session : (int, int)
        Seed, and the participant's place in the data set.
    rig : Rig
        What is pressed.
    """

    def __init__(
        self, design: RatingDesign, stimuli: Sequence[LoadedStimulus], session: tuple[int, int], rig: Rig
    ) -> None:
        self._design, self._session, self._rig = design, session, rig
        self._stimuli = {stimulus.name: stimulus for stimulus in stimuli}
        self._order = FixedOrder(rating_order(design, session[1]), design.repeat_flagged)
        self.neutral_luminance = neutral_luminance(stimuli)
        self.n_trials = self._order.n_trials
        self.trials_between_breaks = design.trials_between_breaks
        self.instructions = "instructions_rating"
        self.seconds = 0.0  # nobody is hurried

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        seconds = sum(stimulus.stimulus.duration for stimulus in self._stimuli.values())
        clips = 2 * self._design.repetitions * seconds
        practice = self._design.practice_trials * self._design.practice_duration
        pauses = self._design.adaptation_duration * (self.n_trials + self._design.practice_trials)
        return viewing_minutes(clips + practice + pauses, self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Refuse videos that are larger than the window."""
        require_room(self._stimuli.values(), stage)

    def practice(self) -> Sequence[PlannedRating]:
        """Return the trials for practice."""
        return rating_practice(self._design, *self._session)

    def next_trial(self) -> PlannedRating | None:
        """Return the video to be rated next, or None at the end."""
        return self._order.next_trial()

    def take(self, trial: RatingTrial) -> None:
        """Take an answered trial."""
        self._order.take(trial)

    def is_right(self, trial: RatingTrial) -> bool | None:
        """Return None: no rating is right or wrong."""
        return None

    def is_flagged(self, trial: RatingTrial) -> bool:
        """Return whether a trial is left out of the analysis."""
        return trial.flag is not TrialFlag.NONE

    def feedback(self, trial: RatingTrial, pages: Pages) -> str:
        """Return nothing: there is nothing to be told about a rating."""
        return ""

    def conduct(
        self, planned: PlannedRating, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> Conducted:
        """Show a video and ask for its rating."""
        stimulus, seed = self._stimuli[planned.sequence], noise_seed_of(self._session, place)
        clip = stimulus_clip(stimulus, planned.version, seed, planned.seconds)
        stage.prepare_clip(clip)
        stage.wait(self._design.adaptation_duration, self.neutral_luminance)
        shown = stage.play(clip)
        keys = self._rig.keys
        participant.see_trial(planned, place.trial_index)
        press = stage.ask(pages.text("question_rating", keys), keys.ratings, self.neutral_luminance)
        trial = RatingTrial(
            **planned.columns,
            **shown_columns(place, [shown], seed, self._design.max_dropped_share),
            mean_factor=stimulus.mean_factor(planned.version),
            rating=LOWEST_RATING + keys.ratings.index(press.name),
            response_time=press.time,
        )
        return Conducted(trial, (clip_log(place, 1, shown),))
