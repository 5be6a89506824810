"""The choices that a user of analysis and optimizer has; apart from their use, so that commands load fast."""

from __future__ import annotations

import enum
import os
from dataclasses import dataclass


class LimitCurve(enum.Enum):
    """Which curve of a fitted rate limit is obeyed."""

    FITTED = "fitted"  # the fitted curve
    SAFE = "safe"  # the lower edge of its band


class ModulatedLuminance(enum.Enum):
    """Whose luminance the rate limit is about."""

    FRAME_MEAN = "frame_mean"  # of each frame: what the eye gets on average
    WHITE_FIELD = "white_field"  # of a white screen, as in the calibration: content-independent


class SolverName(enum.Enum):
    """Which solver."""

    SPLITTING = "splitting"  # the default: any length, with a certificate
    SLSQP = "slsqp"  # the paper's, for short clips


class ObjectiveName(enum.Enum):
    """What an optimization minimizes."""

    SPREAD = "spread"  # the mean absolute pairwise difference of contrast loss: the paper's
    SPREAD_AND_MEAN = "spread+mean"  # that and the mean loss, with a weight
    MINIMAX = "minimax"  # the largest loss of any frame that counts


class Resolution(enum.Enum):
    """On what of a frame the online controller measures contrast loss."""

    FULL = "full"  # every pixel
    STRIPS = "strips"  # every band; where one has many pixels, of each eight strips of rows one, in turn
    HALF = "half"  # strips of a picture of half the pixels each way; the finest band does not count
    QUARTER = "quarter"  # the same of a quarter, without the two finest


class Device(enum.Enum):
    """What computes loss curves."""

    CPU = "cpu"  # the processor
    GPU = "gpu"  # the graphics processor, by compute shaders; software renderers too
    AUTO = "auto"  # a graphics processor that is more than software, if there is one; else the processor


@dataclass(frozen=True, slots=True)
class AnalysisEffort:
    """On how many cores a video is analysed, or on the graphics processor."""

    # how many frames are analysed at a time, each on a core of its own, beside the decoding of those that
    # follow; 0 for one on each core. The result is the same, byte for byte.
    jobs: int = 1
    device: Device = Device.CPU

    def __post_init__(self) -> None:
        if self.jobs < 0:
            raise ValueError(f"jobs must be 0 (all cores) or more, got {self.jobs}")

    @property
    def threads(self) -> int:
        """How many threads analyse frames."""
        if self.jobs > 0:
            return self.jobs
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


# Share of the gain to give up for a calmer track, unless asked otherwise; 0 is the paper's exact problem
# (docs/decisions/calm-tracks.md).
DEFAULT_CALM = 0.05
ONE_CORE = AnalysisEffort()
