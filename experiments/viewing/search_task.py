"""The Landolt-ring search as a session conducts it (Section 4.2 of the paper)."""

from __future__ import annotations

from typing import Any

from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchTrial, ViewLog
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import (
    ConductedTrial,
    Participant,
    SessionSetting,
    Task,
    TrialPlace,
    shown_columns,
    shown_log,
)
from evenlight.experiments.stage import SearchView, Stage
from evenlight.experiments.stimulus_folder import neutral_luminance
from evenlight.experiments.viewing.search_observer import SearchAnswer
from evenlight.experiments.viewing.search_schedule import (
    search_order,
    search_points,
    search_practice,
)
from evenlight.experiments.viewing.viewing_task import viewing_minutes
from evenlight.stimuli.rings.landolt import gap_pixels, shown_contrast

TYPICAL_SHARE = 0.5  # of the time limit that a search takes, for the estimate on the page of consent


class SearchTask(Task):
    """Each keypoint once in each version: look around, press when the ring is found, say where its gap is.

    Parameters
    ----------
    setting : SessionSetting
        Design, brightness tracks of its paths, session, rig, and the display that everything's size follows.
    """

    def __init__(self, setting: SessionSetting) -> None:
        design: Any = setting.manifest.design
        self._display = setting.display
        self._points = search_points(design, setting.stimuli, self._display, setting.rig.actuator)
        order = search_order(design, self._points, *setting.session)
        practice = search_practice(design, self._points, *setting.session)
        super().__init__(setting, order, practice, neutral_luminance=neutral_luminance(setting.stimuli))
        self.seconds = design.time_limit

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        each = TYPICAL_SHARE * self.design.time_limit + self.design.adaptation_duration
        return viewing_minutes(each * (self.n_trials + self.design.practice_trials), self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Build the scenes, light and all; the first time that takes a while."""
        for scene in sorted({point.scene for point in self._points}):
            stage.prepare_scene(scene)

    def is_right(self, trial: SearchTrial) -> bool | None:
        """Return whether the ring was found and its gap identified correctly."""
        return trial.correct

    def feedback(self, trial: SearchTrial, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice."""
        name = "feedback_right" if trial.correct else "feedback_wrong"
        truth = "truth_gap" if trial.found else "truth_not_found"
        direction = pages.text(f"direction_{trial.ring_orientation}", self.rig.keys)
        return pages.text(name, self.rig.keys, truth=pages.text(truth, self.rig.keys, direction=direction))

    def key_answers(self) -> dict[str, object]:
        """Return the answer that each key gives: a ring was found, or where its gap is [deg]."""
        keys = self.rig.keys
        return {keys.found: "found", **dict(zip(keys.orientations, ORIENTATIONS, strict=True))}

    def conduct(
        self, planned: PlannedTrial, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Let a scene be searched; if the ring is found, ask where its gap is."""
        seed, keys = self.noise_seed(place), self.rig.keys
        stage.wait(self.design.adaptation_duration, self.neutral_luminance)
        participant.begin_search(planned, place.trial_index)
        searched = stage.search(self._view(planned, seed))
        reported, response_time = None, None
        if searched.found_after is not None:
            participant.see_trial(planned, place.trial_index)
            question = pages.text("question_orientation", keys)
            press = stage.ask(question, keys.orientations, self.neutral_luminance)
            reported, response_time = ORIENTATIONS[keys.orientations.index(press.name)], press.time
        columns = shown_columns(place, [searched], seed, self.design.max_dropped_share)
        if place.attempt > 1:
            columns["flag"] = TrialFlag.SEEN_BEFORE
        columns |= {"background_luminance": searched.background_luminance, "response_time": response_time}
        trial = self.row(planned, SearchAnswer(searched.found_after, reported), columns)
        return ConductedTrial(trial, (shown_log(ViewLog, place, 1, searched),))

    def row(self, planned: PlannedTrial, answer: SearchAnswer, columns: dict[str, Any]) -> SearchTrial:
        """Return the record of a search; `background_luminance` is among the columns."""
        return SearchTrial(
            **planned.columns,
            **columns,
            shown_contrast=shown_contrast(
                planned.ring.contrast,
                columns["background_luminance"],
                planned.factor,
                self._display,
                by_pixels=self.rig.actuator is Actuator.PIXELS,
            ),
            gap_pixels=gap_pixels(planned.ring, self._display.pixels_per_degree),
            time_limit=self.design.time_limit,
            found=answer.found_after is not None,
            search_time=self.design.time_limit if answer.found_after is None else answer.found_after,
            reported_orientation=answer.orientation,
        )

    def _view(self, planned: PlannedTrial, noise_seed: int) -> SearchView:
        return SearchView(
            scene=planned.scene,
            camera=planned.camera,
            ring=planned.ring,
            factor=planned.factor,
            time_limit=self.design.time_limit,
            field_of_view=self.design.field_of_view,
            noise_seed=noise_seed,
        )
