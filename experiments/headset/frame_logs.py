"""The frames of a trial in a headset, as records."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from evenlight.data_schema.recordings.headset import HeadsetLog
from evenlight.experiments.sessions.task import TrialPlace
from evenlight.experiments.stage import Stage
from evenlight.hardware.presentation.headset_window import ShownFrame

POSE_DECIMALS = 6  # [m], and of a quaternion: a micrometre, a ten-thousandth of a degree
TIME_DECIMALS = 9  # [s] as runtimes count


def headset_logs(
    place: TrialPlace, stage: Stage, since_beginning: Callable[[float], float]
) -> list[HeadsetLog]:
    """Return what a headset showed in each interval since a stage was last asked; none outside a headset.

    Parameters
    ----------
    place, stage : TrialPlace, Stage
        Which trial, and where it was shown.
    since_beginning : callable
        Returns a time on the stage's clock as the time since the session began [s].
    """
    seen = enumerate(stage.seen_in_headset(), start=1)
    return [_log(place, number, frames, since_beginning) for number, frames in seen]


def _log(
    place: TrialPlace, interval: int, frames: Sequence[ShownFrame], since: Callable[[float], float]
) -> HeadsetLog:
    right, up, back = _columns([frame.head.position for frame in frames], 3)
    x, y, z, w = _columns([frame.head.orientation for frame in frames], 4)
    known = any(frame.gaze for frame in frames)
    gaze = _columns([frame.gaze or (0.0, 0.0, 0.0) for frame in frames if known], 3)
    return HeadsetLog(
        trial_index=place.trial_index,
        attempt=place.attempt,
        interval=interval,
        display_times=tuple(round(since(frame.display_time), TIME_DECIMALS) for frame in frames),
        periods=tuple(round(frame.period, TIME_DECIMALS) for frame in frames),
        late_frames=tuple(frame.late for frame in frames),
        head_right=right,
        head_up=up,
        head_back=back,
        orientation_x=x,
        orientation_y=y,
        orientation_z=z,
        orientation_real=w,
        visible=tuple(frame.visible for frame in frames),
        focused=tuple(frame.focused for frame in frames),
        tracked=tuple(frame.tracked for frame in frames),
        gaze_right=gaze[0],
        gaze_up=gaze[1],
        gaze_back=gaze[2],
    )


def _columns(rows: Sequence[Sequence[float]], count: int) -> list[tuple[float, ...]]:
    """Return the columns of some rows, of `count` numbers each."""
    return [tuple(round(float(row[k]), POSE_DECIMALS) for row in rows) for k in range(count)]
