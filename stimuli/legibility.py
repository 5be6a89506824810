"""The luminance of text on a field: readable on dark grounds and bright ones."""

from __future__ import annotations

from evenlight.data_schema.display import Display
from evenlight.data_schema.rig import Actuator
from evenlight.stimuli.ramp import reachable_luminances

READABLE_RATIO = 7.0  # of the luminances of ground and text, at least: W3C, WCAG 2.1, criterion 1.4.6
DARK_TEXT = 25.0  # ratio of dark text where the display has it
BRIGHT_TEXT = 10.0  # of bright text: more would glare on a dark ground


def ink_on(ground: float, display: Display) -> float:
    """Return the luminance of text on a ground [cd/m^2]: darker, or brighter where the ground is near black.

    Parameters
    ----------
    ground : float
        L of the ground, reflected light included [cd/m^2].
    display : Display
        The display, whose black and white are the limits.

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> ink_on(50.0, lab), ink_on(0.25, lab)
    (2.0, 2.5)
    """
    darkest, brightest = reachable_luminances(1.0, display, Actuator.PIXELS)
    darker, brighter = max(darkest, ground / DARK_TEXT), min(brightest, ground * BRIGHT_TEXT)
    readable = ground >= READABLE_RATIO * darker
    return darker if readable or ground / darker >= brighter / ground else brighter
