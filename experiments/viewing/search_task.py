"""The Landolt-ring search as a session conducts it (Section 4.2 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchDesign, SearchTrial, ViewLog
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import ConductedTrial, Participant, SessionSetting, TrialPlace
from evenlight.experiments.stage import SearchResult, SearchView, Stage
from evenlight.experiments.viewing.search_schedule import (
    PlannedSearch,
    search_order,
    search_points,
    search_practice,
)
from evenlight.experiments.viewing.viewing_task import (
    ViewingTask,
    noise_seed_of,
    shown_columns,
    viewing_minutes,
)
from evenlight.stimuli.rings.landolt import gap_pixels
from evenlight.stimuli.rings.ring_light import shown_contrast

TYPICAL_SHARE = 0.5  # of the time limit that a search takes, for the estimate on the page of consent


class SearchTask(ViewingTask[PlannedSearch]):
    """Each keypoint once in each version: look around, press when the ring is found, say where its gap is.

    Parameters
    ----------
    setting : SessionSetting
        Design, brightness tracks of its paths, session, rig, and the display that everything's size follows.
    """

    instructions = "instructions_search"

    def __init__(self, setting: SessionSetting) -> None:
        self._design: SearchDesign = setting.manifest.design  # type: ignore[assignment] # the manifest checks it
        self._display = setting.display
        self._points = search_points(self._design, setting.stimuli, self._display, setting.rig.actuator)
        super().__init__(setting, search_order(self._design, self._points, *setting.session))
        self.seconds = self._design.time_limit

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

    def is_right(self, trial: SearchTrial) -> bool | None:
        """Return whether the ring was found and its gap identified correctly."""
        return trial.correct

    def feedback(self, trial: SearchTrial, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice."""
        name = "feedback_right" if trial.correct else "feedback_wrong"
        truth = "truth_gap" if trial.found else "truth_not_found"
        direction = pages.text(f"direction_{trial.ring_orientation}", self._rig.keys)
        return pages.text(name, self._rig.keys, truth=pages.text(truth, self._rig.keys, direction=direction))

    def conduct(
        self, planned: PlannedSearch, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
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
        return ConductedTrial(trial, (_view_log(place, searched),))

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


def _view_log(place: TrialPlace, searched: SearchResult) -> ViewLog:
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
