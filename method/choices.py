"""The choices that the optimizer leaves to its user; apart from their use, so that commands load fast."""

from __future__ import annotations

import enum


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
    HIGHS = "highs"  # a sequence of linear programs, each solved by HiGHS
    CLARABEL = "clarabel"  # the same by Clarabel


class Device(enum.Enum):
    """What computes loss curves."""

    CPU = "cpu"  # the processor
    GPU = "gpu"  # the graphics processor, by compute shaders; software ones will do
    AUTO = "auto"  # a graphics processor that is more than software, if there is one; else the processor
