"""The Landolt-ring search as a session conducts it (Section 4.2 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.data_schema.display import Display
from evenlight.data_schema.ramp import TrialFlag
from evenlight.data_schema.rig import Actuator, Rig
from evenlight.data_schema.search import ORIENTATIONS, SearchDesign, SearchTrial, ViewLog
from evenlight.experiments.fixed_order import FixedOrder
from evenlight.experiments.pages import Pages
from evenlight.experiments.search_schedule import PlannedSearch, search_order, search_points, search_practice
from evenlight.experiments.session_minutes import viewing_minutes
from evenlight.experiments.stage import Searched, SearchView, Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus, neutral_luminance
from evenlight.experiments.task import Conducted, Participant, TrialPlace
from evenlight.experiments.viewing_trials import noise_seed_of, shown_columns
from evenlight.stimuli.landolt import gap_pixels
from evenlight.stimuli.ring_light import shown_contrast

TYPICAL_SHARE = 0.5  # of the time limit that a search takes, for the estimate on the page of consent


class SearchTask:
    """Each keypoint once in each version: look around, press when the ring is found, say where its gap is.

    Parameters
    ----------
    design : SearchDesign
        Which keypoints, which rings.
    stimuli : sequence of LoadedStimulus
        The brightness tracks of its paths.
    session : (int, int)
        Seed, and the participant's place in the data set.
    rig : Rig
        What is pressed.
    display : Display
        Whose resolution everything's size follows.
    """

    def __init__(
        self,
        design: SearchDesign,
        stimuli: Sequence[LoadedStimulus],
        session: tuple[int, int],
        rig: Rig,
        display: Display,
    ) -> None:
        self._design, self._session, self._rig, self._display = design, session, rig, display
        self._points = search_points(design, stimuli, display, rig.actuator)
        order = search_order(design, self._points, *session)
        self._order = FixedOrder(order, design.repeat_flagged)
        self.neutral_luminance = neutral_luminance(stimuli)
        self.n_trials = self._order.n_trials
        self.trials_between_breaks = design.trials_between_breaks
        self.instructions = "instructions_search"
        self.seconds = design.time_limit

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        each = TYPICAL_SHARE * self._design.time_limit + self._design.adaptation_duration
        return viewing_minutes(each * (self.n_trials + self._design.practice_trials), self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Build the scenes, light and all; the first time that takes a while."""
        for scene in sorted({point.scene for point in self._points}):
            stage.prepare_scene(scene)

    def practice(self) -> Sequence[PlannedSearch]:
        """Return the trials for practice."""
        return search_practice(self._design, self._points, *self._session)

    def next_trial(self) -> PlannedSearch | None:
        """Return the search that comes next, or None at the end."""
        return self._order.next_trial()

    def take(self, trial: SearchTrial) -> None:
        """Take an answered trial."""
        self._order.take(trial)

    def is_right(self, trial: SearchTrial) -> bool | None:
        """Return whether the ring was found and its gap told rightly."""
        return trial.correct

    def is_flagged(self, trial: SearchTrial) -> bool:
        """Return whether a trial is left out of the analysis."""
        return trial.flag is not TrialFlag.NONE

    def feedback(self, trial: SearchTrial, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice."""
        name = "feedback_right" if trial.correct else "feedback_wrong"
        truth = "truth_gap" if trial.found else "truth_not_found"
        direction = pages.text(f"direction_{trial.ring_orientation}", self._rig.keys)
        return pages.text(name, self._rig.keys, truth=pages.text(truth, self._rig.keys, direction=direction))

    def conduct(
        self, planned: PlannedSearch, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> Conducted:
        """Let a scene be searched; if the ring is found, ask where its gap is."""
        seed, keys = noise_seed_of(self._session, place), self._rig.keys
        stage.wait(self._design.adaptation_duration, self.neutral_luminance)
        participant.begin_search(planned, place.trial_index)
        searched = stage.search(self._view(planned, seed))
        reported, response_time = None, None
        if searched.found_after is not None:
            participant.see_trial(planned, place.trial_index)
            question = pages.text("question_orientation", keys)
            press = stage.ask(question, keys.orientations, self.neutral_luminance)
            reported, response_time = ORIENTATIONS[keys.orientations.index(press.name)], press.time
        columns = shown_columns(place, [searched], seed, self._design.max_dropped_share)
        if place.attempt > 1:
            columns["flag"] = TrialFlag.SEEN_BEFORE
        trial = SearchTrial(
            **planned.columns,
            **columns,
            shown_contrast=shown_contrast(
                planned.ring.contrast,
                searched.background_luminance,
                planned.factor,
                self._display,
                by_pixels=self._rig.actuator is Actuator.PIXELS,
            ),
            background_luminance=searched.background_luminance,
            gap_pixels=gap_pixels(planned.ring, self._display.pixels_per_degree),
            time_limit=self._design.time_limit,
            found=searched.found_after is not None,
            search_time=self._design.time_limit if searched.found_after is None else searched.found_after,
            reported_orientation=reported,
            response_time=response_time,
        )
        return Conducted(trial, (_view_log(place, searched),))

    def _view(self, planned: PlannedSearch, noise_seed: int) -> SearchView:
        """Return what is shown."""
        return SearchView(
            scene=planned.scene,
            camera=planned.camera,
            ring=planned.ring,
            factor=planned.factor,
            time_limit=self._design.time_limit,
            field_of_view=self._design.field_of_view,
            noise_seed=noise_seed,
        )


def _view_log(place: TrialPlace, searched: Searched) -> ViewLog:
    """Return where a participant looked, as a record."""
    return ViewLog(
        trial_index=place.trial_index,
        attempt=place.attempt,
        interval=1,
        flip_times=searched.flip_times,
        azimuths=searched.azimuths,
        altitudes=searched.altitudes,
        backlight_factors=searched.backlight_factors,
    )
