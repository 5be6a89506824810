"""A ramp of either task, and a threshold: a test changes what it is about."""

from dataclasses import replace
from typing import Any

from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampTrial, Response
from evenlight.data_schema.threshold import Threshold, ThresholdFlag

RAMP = RampTrial("01", "01", 0, "white", 1.0, 100.0, 90.0, 2.0, 5.0, False, Response.YES, None, True)
CHOICE = replace(RAMP, response=Response.FIRST, procedure=Procedure.TWO_INTERVAL, ramp_interval=1)
THRESHOLD = Threshold(
    participant_id="01", screen="white", factor=0.5, luminance=50.0, threshold=1.5, ci_low=1.2, ci_high=1.9,
    standard_error_ln=0.1, width=1.6, guess_rate=0.05, lapse_rate=0.02, false_alarm_rate=0.05, n_trials=48,
    n_catch=120, flag=ThresholdFlag.NONE,
)  # fmt: skip


def ramp_of(luminance: float, rate: float, trial: RampTrial = RAMP, **changed: Any) -> RampTrial:
    """Return a ramp from a luminance [cd/m²] at a rate [cd/m²/s], in the trial's direction; 0 is a catch."""
    up = changed.get("direction", trial.direction) is Direction.UP
    change = (1 if up else -1) * rate * changed.get("duration", trial.duration)
    changed = {"factor": min(luminance / 100, 1.0), "is_catch": rate == 0} | changed
    return replace(
        trial, initial_luminance=luminance, final_luminance=luminance + change, rate=rate, **changed
    )


def answer_of(task: Procedure, success: bool, ramp_interval: int | None = 1) -> Response:
    """Return "yes" or "no"; of two intervals the one with the ramp, or the other."""
    if task is Procedure.YES_NO:
        return Response.YES if success else Response.NO
    return Response.FIRST if (ramp_interval == 1) == success else Response.SECOND
