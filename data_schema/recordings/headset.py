"""What a headset showed during a trial, and how it was worn: the log of its frames."""

from __future__ import annotations

import dataclasses

from evenlight.data_schema.quantities import as_in, count, described, one_line, quantity, record
from evenlight.data_schema.recordings.ramp import FrameLog, RampTrial


@record
class HeadsetLog:
    """The frames that a headset was given in one interval of a trial, as one line of `headset.jsonl`."""

    trial_index: int = as_in(RampTrial, "trial_index")
    attempt: int = as_in(FrameLog, "attempt")
    interval: int = as_in(FrameLog, "interval")
    display_times: tuple[float, ...] = quantity(
        "s", "when each frame appeared, as the runtime predicted, since the session began"
    )
    periods: tuple[float, ...] = quantity("s", "how long each was to last, as the runtime said", above=0.0)
    late_frames: tuple[int, ...] = count("refreshes that passed without a new frame before each")
    head_right: tuple[float, ...] = quantity(
        "m", "where the head was predicted to be at that time: to the right of where the interval began"
    )
    head_up: tuple[float, ...] = quantity("m", "the same, upwards")
    head_back: tuple[float, ...] = quantity("m", "the same, backwards")
    orientation_x: tuple[float, ...] = quantity(
        "1", "how the head was turned then: unit quaternion, part along the axis to the right"
    )
    orientation_y: tuple[float, ...] = quantity("1", "the same, along the axis upwards")
    orientation_z: tuple[float, ...] = quantity("1", "the same, along the axis backwards")
    orientation_real: tuple[float, ...] = quantity("1", "the same, its real part")
    visible: tuple[bool, ...] = described("whether the runtime showed what was drawn")
    focused: tuple[bool, ...] = described("whether the headset was worn, and nothing of the system in front")
    tracked: tuple[bool, ...] = described("whether the head's orientation was known")
    gaze_right: tuple[float, ...] = quantity(
        "1",
        "where the eyes looked, in the axes of the head's place: unit vector, part to the right; all parts "
        "are 0 where that was not known, and the lists empty if it never was",
        default=(),
    )
    gaze_up: tuple[float, ...] = quantity("1", "the same, upwards", default=())
    gaze_back: tuple[float, ...] = quantity("1", "the same, backwards", default=())

    def __post_init__(self) -> None:
        n = len(self.display_times)
        lists = [getattr(self, field.name) for field in dataclasses.fields(self)[4:]]
        gaze = lists[-3:] if any(lists[-3:]) else []
        if any(len(each) != n for each in (*lists[:-3], *gaze)):
            raise ValueError(f"the lists of a headset log must be equally long, got {n} display_times")

    def __repr__(self) -> str:
        return one_line(self, f"trial {self.trial_index}", self.display_times, late_frames=self.late_frames)
