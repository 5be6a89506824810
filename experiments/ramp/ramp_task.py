"""The ramp experiment as a session conducts it (Section 3.4 of the paper)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from evenlight.data_schema.recordings.ramp import (
    FrameLog,
    IntervalGap,
    Procedure,
    RampDesign,
    RampTrial,
    Response,
    TrialFlag,
    session_minutes,
)
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_plan import ramp_levels
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.sessions.dropped_frames import CHECK_SECONDS, FrameDemand, require_few_drops
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import (
    ConductedTrial,
    Participant,
    PracticeRule,
    SessionSetting,
    Task,
    TrialPlace,
    shown_columns,
    shown_log,
)
from evenlight.experiments.stage import RampInterval, ShownInterval, Stage
from evenlight.method.contrast.luminance import displayed_luminance
from evenlight.stimuli.fixation_mark import mark_contrast
from evenlight.stimuli.ramp import frame_count, reachable_luminances

LARGEST_STEP = 1.5  # either way, between an interval and a gap: far more than the change at any threshold


class RampTask(Task):
    """The ramp experiment: a schedule of ramps, shown on a stage.

    Parameters
    ----------
    setting : SessionSetting
        Design, display, session and rig.

    Raises
    ------
    InputError
        If the rig would cut off a ramp of the design.
    """

    design: RampDesign

    def __init__(self, setting: SessionSetting) -> None:
        design: Any = setting.design
        levels = [level.luminance for level in ramp_levels(design, setting.display)]
        self._schedule = RampSchedule(
            design,
            setting.display,
            *setting.session,
            setting.rig.actuator,
            smallest_factor=setting.smallest_factor,
        )
        neutral = float(np.exp(np.mean(np.log(levels))))
        super().__init__(setting, self._schedule, neutral_luminance=neutral)
        if design.practice_correct:
            self.practice_rule = PracticeRule(design.practice_trials, design.practice_correct)
        steps = design.interval_gap_kind is IntervalGap.RANDOM_STEPS
        self._steady = design.procedure is Procedure.TWO_INTERVAL and not steps
        stepping = "_steps" if design.procedure is Procedure.TWO_INTERVAL and steps else ""
        self.instructions = f"instructions_{design.procedure.value}{stepping}"

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        return session_minutes(self.design, self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Try the fastest ramp, and refuse a display that drops too many of its frames."""
        if self.setting.manifest.simulated:
            return
        design, rate = self.design, self.rig.refresh_rate
        whole = self._intervals(self._schedule.fastest(), noise_seed=0)[0]
        seconds = min(whole.duration, CHECK_SECONDS)
        change = seconds / whole.duration * (whole.final_luminance - whole.initial_luminance)
        interval = dataclasses.replace(
            whole,
            final_luminance=whole.initial_luminance + change,
            adaptation=0.0,
            duration=seconds,
            hold=CHECK_SECONDS - seconds,
        )
        times = 2 if design.procedure is Procedure.TWO_INTERVAL else 1
        around = design.adaptation_duration + design.hold_duration
        counts = (times * frame_count(around + duration, rate) for duration in design.ramp_durations)
        trials = tuple((count, design.max_dropped_frames) for count in counts)

        def show() -> ShownInterval:
            stage.wait(design.pause_duration, interval.initial_luminance)
            return stage.show_ramp(interval)

        require_few_drops(show, FrameDemand(trials, "max_dropped_frames"), rate)

    def practice(self) -> Sequence[PlannedTrial]:
        """Return the trials for practice: of one round, or of all that a criterion allows."""
        rounds = self.design.practice_rounds if self.practice_rule else 1
        return [ramp for number in range(rounds) for ramp in self._schedule.practice(number)]

    def is_right(self, trial: RampTrial) -> bool:
        """Return whether a change was detected, or none reported where there was none."""
        return trial.success != trial.is_catch

    def feedback(self, trial: RampTrial, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice."""
        if trial.procedure is Procedure.TWO_INTERVAL:
            truth = "truth_first" if trial.ramp_interval == 1 else "truth_second"
        else:
            truth = "truth_no_change" if trial.is_catch else "truth_change"
        name = "feedback_right" if self.is_right(trial) else "feedback_wrong"
        return pages.text(name, self.rig.keys, truth=pages.text(truth, self.rig.keys))

    def key_answers(self) -> dict[str, Response]:
        """Return the answer that each key gives."""
        keys = self.rig.keys
        if self.design.procedure is Procedure.TWO_INTERVAL:
            return {keys.first: Response.FIRST, keys.second: Response.SECOND}
        return {keys.yes: Response.YES, keys.no: Response.NO}

    def conduct(
        self, planned: PlannedTrial, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Show a ramp, in one of two intervals if the design has two, and ask about it."""
        noise_seed = self.noise_seed(place)
        # The level of the trial, not a neutral one: a jump right before a ramp would be adapted to during it.
        stage.wait(self.design.pause_duration, planned.level.luminance)
        intervals = self._intervals(planned, noise_seed)
        gaps = self._gaps(planned, place, intervals) if len(intervals) > 1 else []
        # By the backlight where intervals are: nothing may change but what is meant to.
        pixel_value = planned.level.pixel_value if self._steady else None
        shown = []
        for number, interval in enumerate(intervals):
            for luminance in gaps[number] if gaps else ():
                stage.wait(self.design.interval_gap / len(gaps[number]), luminance, pixel_value)
            shown.append(stage.show_ramp(interval))
        answers = self.key_answers()
        question = pages.text(f"question_{self.design.procedure.value}", self.rig.keys)
        ground = gaps[-1][0] if gaps else intervals[-1].final_luminance
        stage.wait(self.design.interval_gap if gaps else 0.0, ground, pixel_value)
        participant.see_trial(planned, place.trial_index)
        press = stage.ask(question, list(answers), ground)
        logs = tuple(shown_log(FrameLog, place, number, part) for number, part in enumerate(shown, start=1))
        columns = shown_columns(place, shown, noise_seed, max_dropped_share=1.0)
        if columns["frames_dropped"] > self.design.max_dropped_frames:
            columns["flag"] = TrialFlag.DROPPED_FRAMES
        ramp = shown[(planned.ramp_interval or 1) - 1]
        if probes := ramp.probe_luminance:
            columns |= {
                "drawn_initial_luminance": probes[0],
                "drawn_final_luminance": probes[-1],
                "largest_luminance_error": max(log.largest_error for log in logs),
            }
        trial = self.row(planned, answers[press.name], columns | {"response_time": press.time})
        return ConductedTrial(trial, logs)

    def row(self, planned: PlannedTrial, answer: Response, columns: dict[str, Any]) -> RampTrial:
        """Return the record of an answered ramp."""
        return ramp_row(planned, answer, columns)

    def _gaps(
        self, planned: PlannedTrial, place: TrialPlace, intervals: list[RampInterval]
    ) -> list[tuple[float, ...]]:
        """Return the luminances before, between and after two intervals [cd/m^2].

        They are those at which the intervals begin and end, so that nothing steps; or how far the luminance
        steps where an interval ends, and where one begins, is drawn at random. Neither depends on which
        interval changed (docs/decisions/yes-no-task.md).
        """
        level = planned.level
        if self._steady:
            return [(level.luminance,), *((interval.final_luminance,) for interval in intervals)]
        reached = reachable_luminances(
            level.pixel_value, self.setting.display, self.rig.actuator, self.setting.smallest_factor
        )
        ends = (level.luminance, planned.final_luminance)
        darkest = max(reached[0] / min(ends), 1 / LARGEST_STEP)
        brightest = max(darkest, min(reached[1] / max(ends), LARGEST_STEP))
        chance = generator_for(*self.setting.session, Purpose.GAPS, place.trial_index)
        steps = np.exp(chance.uniform(np.log(darkest), np.log(brightest), (3, 2))).tolist()
        before = [level.luminance, *(interval.final_luminance for interval in intervals)]
        return [(last * out, level.luminance * into) for last, (out, into) in zip(before, steps, strict=True)]

    def _intervals(self, planned: PlannedTrial, noise_seed: int) -> list[RampInterval]:
        """Return what is shown: the ramp, or the ramp and a constant field in the planned order.

        With a steady gap a constant field after the ramp has the luminance at which the ramp ended.
        """
        level, end = planned.level.luminance, planned.final_luminance
        ends: list[tuple[float, float]] = [(level, end)]
        if planned.ramp_interval is not None:
            constant = end if self._steady and planned.ramp_interval == 1 else level
            ends.insert(2 - planned.ramp_interval, (constant, constant))
        return [
            RampInterval(
                initial_luminance=initial,
                final_luminance=final,
                pixel_value=planned.level.pixel_value,
                adaptation=self.design.adaptation_duration,
                duration=planned.duration,
                hold=self.design.hold_duration,
                noise_seed=noise_seed + number - 1,
                label=str(number) if len(ends) > 1 else "",
                mark_contrast=self._mark_contrast(planned),
            )
            for number, (initial, final) in enumerate(ends, start=1)
        ]

    def _mark_contrast(self, planned: PlannedTrial) -> float:
        """Return the contrast of the mark in all intervals of a trial; 0 for none."""
        if not self.design.fixation_mark:
            return 0.0
        drawn = min(planned.level.luminance, planned.final_luminance)
        if self.rig.actuator is Actuator.BACKLIGHT:  # pixels draw the screen at full brightness
            drawn = float(displayed_luminance(planned.level.pixel_value, self.setting.display))
        return mark_contrast(drawn, self.setting.display)


def ramp_row(planned: PlannedTrial, answer: Response, columns: dict[str, Any]) -> RampTrial:
    """Return the record of an answered ramp; the columns are those of `Task.row`."""
    return RampTrial(**planned.columns, **columns, response=answer)
