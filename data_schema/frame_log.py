"""What the display showed in each interval of a trial, frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, quantity


@dataclass(frozen=True, slots=True)
class FrameLog:
    """What the display showed in one interval of a trial, as one line of `frames.jsonl`.

    Attributes
    ----------
    trial_index, attempt : int
        Which trial.
    interval : int
        1, or 2 for the second interval of a trial.
    flip_times : tuple of float
        When each frame appeared, since the first of the interval [s].
    intended_luminance : tuple of float
        What each frame was to show [cd/m^2].
    probe_frames : tuple of int
        Frames that were read back from the window.
    probe_luminance : tuple of float
        Their mean luminance [cd/m^2].
    backlight_factors : tuple of float
        What the backlight reported for each frame; empty where pixels make the brightness.
    """

    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    attempt: int = quantity("1", "above 1 if it was shown before and interrupted", minimum=1)
    interval: int = quantity("1", "of the trial", minimum=1, maximum=2)
    flip_times: tuple[float, ...] = quantity("s", "of each frame, since the first", minimum=0.0)
    intended_luminance: tuple[float, ...] = quantity("cd/m^2", "of each frame", minimum=0.0)
    probe_frames: tuple[int, ...] = quantity("1", "frames read back from the window", minimum=0, default=())
    probe_luminance: tuple[float, ...] = quantity("cd/m^2", "their mean", minimum=0.0, default=())
    backlight_factors: tuple[float, ...] = quantity(
        "1", "as the backlight reported; empty where pixels make the brightness", minimum=0.0, default=()
    )

    def __post_init__(self) -> None:
        check_limits(self)
        n = len(self.flip_times)
        if len(self.intended_luminance) != n or len(self.backlight_factors) not in (0, n):
            raise ValueError(f"the lists of a frame log must be equally long, got {n} flip_times")
        if len(self.probe_frames) != len(self.probe_luminance):
            raise ValueError("probe_frames and probe_luminance_cd_m2 must be equally long")
        if any(later < earlier for earlier, later in zip(self.flip_times, self.flip_times[1:], strict=False)):
            raise ValueError("flip_times_s must not fall")

    @property
    def largest_error(self) -> float:
        """Largest difference of read-back and intended mean luminance [cd/m^2]; 0 without a probe."""
        pairs = zip(self.probe_frames, self.probe_luminance, strict=True)
        return max((math.fabs(self.intended_luminance[k] - L) for k, L in pairs), default=0.0)
