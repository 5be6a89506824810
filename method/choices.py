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
