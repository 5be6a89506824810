"""The ramp experiment as a session conducts it (Section 3.4 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import (
    FrameLog,
    Procedure,
    RampDesign,
    RampTrial,
    Response,
    TrialFlag,
    session_minutes,
)
from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_plan import PlannedRamp, ramp_levels
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import ConductedTrial, Participant, SessionSetting, TrialPlace
from evenlight.experiments.stage import RampInterval, ShownInterval, Stage
from evenlight.stimuli.ramp import reachable_luminances

LARGEST_SEED = 2**31
LARGEST_STEP = 1.5  # either way, between an interval and a gap: far more than the change at any threshold


def ramp_task(setting: SessionSetting) -> RampTask:
    """Return the ramp experiment in a setting."""
    return RampTask(
        setting.manifest.design,  # type: ignore[arg-type] # the manifest checks that it is the task's
        setting.display,
        *setting.session,
        setting.rig,
        smallest_factor=setting.smallest_factor,
    )


class RampTask:
    """The ramp experiment: a schedule of ramps, shown on a stage.

    Parameters
    ----------
    design : RampDesign
        Which ramps.
    display : Display
        What they are shown on.
    seed : int
        Of order, placement and dithering noise.
    order_index : int
        Row of the counterbalanced order of blocks.
    rig : Rig
        What is pressed, and what makes the brightness.
    smallest_factor : float, optional
        Of the rig's backlight.

    Raises
    ------
    InputError
        If the rig would cut off a ramp of the design.
    """

    def __init__(
        self,
        design: RampDesign,
        display: Display,
        seed: int,
        order_index: int,
        rig: Rig,
        *,
        smallest_factor: float = 0.0,
    ) -> None:
        self.design = design
        self._keys, self._rig, self._display = rig.keys, rig, display
        self._smallest_factor = smallest_factor
        self._session = (seed, order_index)
        self._schedule = RampSchedule(
            design, display, seed, order_index, rig.actuator, smallest_factor=smallest_factor
        )
        levels = [level.luminance for level in ramp_levels(design, display)]
        self.neutral_luminance = float(np.exp(np.mean(np.log(levels))))
        self.n_trials = self._schedule.n_trials
        self.trials_between_breaks = design.trials_between_breaks
        self.instructions = f"instructions_{design.procedure.value}"
        self.seconds = 0.0  # no trial has a time limit

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        return session_minutes(self.design, self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Prepare nothing: ramps are drawn as they go."""

    def practice(self) -> Sequence[PlannedRamp]:
        """Return the trials for practice."""
        return self._schedule.practice()

    def next_trial(self) -> PlannedRamp | None:
        """Return the ramp to be shown next, or None at the end."""
        return self._schedule.next_trial()

    def take(self, trial: RampTrial) -> None:
        """Take an answered trial."""
        self._schedule.take(trial)

    def is_right(self, trial: RampTrial) -> bool:
        """Return whether a change was detected, or none reported where there was none."""
        return trial.success != trial.is_catch

    def is_flagged(self, trial: RampTrial) -> bool:
        """Return whether a trial is left out of the analysis."""
        return trial.flag is not TrialFlag.NONE

    def feedback(self, trial: RampTrial, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice."""
        if trial.procedure is Procedure.TWO_INTERVAL:
            truth = "truth_first" if trial.ramp_interval == 1 else "truth_second"
        else:
            truth = "truth_no_change" if trial.is_catch else "truth_change"
        name = "feedback_right" if self.is_right(trial) else "feedback_wrong"
        return pages.text(name, self._keys, truth=pages.text(truth, self._keys))

    def conduct(
        self, planned: PlannedRamp, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Show a ramp, in one of two intervals if the design has two, and ask about it."""
        chance = generator_for(*self._session, Purpose.NOISE, place.trial_index)
        noise_seed = int(chance.integers(LARGEST_SEED))
        # The level of the trial, not a neutral one: a jump right before a ramp would be adapted to during it.
        stage.wait(self.design.pause_duration, planned.level.luminance)
        intervals = self._intervals(planned, noise_seed)
        gaps = self._gaps(planned, place, intervals) if len(intervals) > 1 else []
        shown = []
        for number, interval in enumerate(intervals):
            for luminance in gaps[number] if gaps else ():
                stage.wait(self.design.interval_gap / 2, luminance)
            shown.append(stage.show_ramp(interval))
        answers = self._answers()
        question = pages.text(f"question_{self.design.procedure.value}", self._keys)
        ground = gaps[-1][0] if gaps else intervals[-1].final_luminance
        stage.wait(self.design.interval_gap if gaps else 0.0, ground)
        participant.see_trial(planned, place.trial_index)
        press = stage.ask(question, list(answers), ground)
        logs = tuple(_frame_log(place, number, part) for number, part in enumerate(shown, start=1))
        answer = {"response": answers[press.name], "response_time": press.time, "noise_seed": noise_seed}
        return ConductedTrial(self._row(planned, place, shown, logs, answer), logs)

    def _gaps(
        self, planned: PlannedRamp, place: TrialPlace, intervals: list[RampInterval]
    ) -> list[tuple[float, float]]:
        """Return the two luminances before, between and after two intervals [cd/m^2].

        How far the luminance steps where an interval ends, and where one begins, is drawn at random and does
        not depend on whether the interval changed (docs/decisions/two-interval-task.md).
        """
        level = planned.level
        reached = reachable_luminances(
            level.pixel_value, self._display, self._rig.actuator, self._smallest_factor
        )
        ends = (level.luminance, planned.final_luminance)
        darkest = max(reached[0] / min(ends), 1 / LARGEST_STEP)
        brightest = max(darkest, min(reached[1] / max(ends), LARGEST_STEP))
        chance = generator_for(*self._session, Purpose.GAPS, place.trial_index)
        steps = np.exp(chance.uniform(np.log(darkest), np.log(brightest), (3, 2))).tolist()
        before = [level.luminance, *(interval.final_luminance for interval in intervals)]
        return [(last * out, level.luminance * into) for last, (out, into) in zip(before, steps, strict=True)]

    def _answers(self) -> dict[str, Response]:
        """Return what each key means."""
        keys = self._keys
        if self.design.procedure is Procedure.TWO_INTERVAL:
            return {keys.first: Response.FIRST, keys.second: Response.SECOND}
        return {keys.yes: Response.YES, keys.no: Response.NO}

    def _intervals(self, planned: PlannedRamp, noise_seed: int) -> list[RampInterval]:
        """Return what is shown: the ramp, or the ramp and a constant field in the planned order."""
        two = planned.ramp_interval is not None
        count = 2 if two else 1
        return [
            RampInterval(
                initial_luminance=planned.level.luminance,
                final_luminance=(
                    planned.final_luminance
                    if planned.ramp_interval in (None, number)
                    else planned.level.luminance
                ),
                pixel_value=planned.level.pixel_value,
                adaptation=self.design.adaptation_duration,
                duration=planned.duration,
                hold=self.design.hold_duration,
                noise_seed=noise_seed + number - 1,
                label=str(number) if two else "",
            )
            for number in range(1, count + 1)
        ]

    def _row(
        self,
        planned: PlannedRamp,
        place: TrialPlace,
        shown: list[ShownInterval],
        logs: Sequence[FrameLog],
        answer: dict[str, Any],
    ) -> RampTrial:
        """Return the row of an answered trial."""
        ramp = shown[(planned.ramp_interval or 1) - 1]
        probes = ramp.probe_luminance
        dropped = sum(part.frames_dropped for part in shown)
        too_many = dropped > self.design.max_dropped_frames
        return RampTrial(
            participant_id=place.participant_id,
            session_id=place.session_id,
            trial_index=place.trial_index,
            simulated=place.simulated,
            attempt=place.attempt,
            onset=shown[0].onset,
            n_frames=sum(len(part.flip_times) for part in shown),
            frames_dropped=dropped,
            drawn_initial_luminance=probes[0] if probes else None,
            drawn_final_luminance=probes[-1] if probes else None,
            largest_luminance_error=max(log.largest_error for log in logs) if probes else None,
            flag=TrialFlag.DROPPED_FRAMES if too_many else TrialFlag.NONE,
            **planned.columns,
            **answer,
        )


def _frame_log(place: TrialPlace, interval: int, shown: ShownInterval) -> FrameLog:
    """Return what the display showed of an interval, as a record."""
    return FrameLog(
        trial_index=place.trial_index,
        attempt=place.attempt,
        interval=interval,
        flip_times=shown.flip_times,
        intended_luminance=shown.intended_luminance,
        probe_frames=shown.probe_frames,
        probe_luminance=shown.probe_luminance,
        backlight_factors=shown.backlight_factors,
    )
