"""The frames of a trial in a headset, as records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

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
    known = any(frame.gaze for frame in frames)
    columns: dict[str, Any] = {
        **_columns("head_right head_up head_back", [frame.head.position for frame in frames]),
        **_columns(
            "orientation_x orientation_y orientation_z orientation_real",
            [frame.head.orientation for frame in frames],
        ),
        **_columns("gaze_right gaze_up gaze_back", [each.gaze or (0, 0, 0) for each in frames if known]),
        **{name: tuple(getattr(each, name) for each in frames) for name in ("visible", "focused", "tracked")},
    }
    return HeadsetLog(
        trial_index=place.trial_index,
        attempt=place.attempt,
        interval=interval,
        display_times=tuple(round(since(frame.display_time), TIME_DECIMALS) for frame in frames),
        periods=tuple(round(frame.period, TIME_DECIMALS) for frame in frames),
        late_frames=tuple(frame.late for frame in frames),
        **columns,
    )


def _columns(names: str, rows: Sequence[Sequence[float]]) -> dict[str, tuple[float, ...]]:
    columns = enumerate(names.split())
    return {name: tuple(round(float(row[k]), POSE_DECIMALS) for row in rows) for k, name in columns}
