"""How heads and eyes are turned, and what they see, for tests that calculate by hand."""

import math

from evenlight.hardware.presentation.headset_views import EyeFov

WIDE = EyeFov(-math.pi / 4, math.pi / 4, math.pi / 4, -math.pi / 4)
OUTWARDS = EyeFov(math.radians(-50), math.radians(40), math.radians(35), math.radians(-45))


def turned(right: float = 0.0, up: float = 0.0) -> tuple[float, float, float, float]:
    """Return the quaternion x, y, z, w of a turn to the right, or of one up [deg]."""
    half = math.radians(right or up) / 2
    if right:
        return 0.0, -math.sin(half), 0.0, math.cos(half)
    return math.sin(half), 0.0, 0.0, math.cos(half)
