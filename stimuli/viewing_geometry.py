"""How a scene is seen through a display at its true size."""

from __future__ import annotations

import math

from evenlight.data_schema.display import Display


def focal_length_of(display: Display) -> float:
    """Return the focal length with which a display shows a scene at its true size [pixels].

    One pixel in the middle of the picture covers the angle that the display's `pixels_per_degree` says, so
    that what lies an angle off in the scene lies as far off on the visual field.

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> round(focal_length_of(lab) * math.tan(math.radians(1 / 60)), 3)
    1.0
    """
    return display.pixels_per_degree * 180.0 / math.pi
