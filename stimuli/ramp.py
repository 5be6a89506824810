"""The ramp of Section 3.4: luminance over time, and which ramps a display reaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.method.contrast.luminance import dimmed_luminance, displayed_luminance

ROUNDING = 1e-9  # relative, of a luminance that was computed


def ramp_luminance(
    times: ArrayLike, initial: float, final: float, adaptation: float, duration: float
) -> NDArray[np.float64]:
    """Return the luminance L of a field that is constant, changes linearly, and is constant again.

    Parameters
    ----------
    times : array_like, any shape
        Since the first frame [s].
    initial, final : float
        L before and after the ramp [cd/m^2].
    adaptation, duration : float
        Of the constant part before the ramp, and of the ramp [s].

    Returns
    -------
    array, same shape
        L [cd/m^2].

    >>> ramp_luminance([0, 1, 3.5, 6, 7], 100.0, 90.0, adaptation=1.0, duration=5.0).tolist()
    [100.0, 100.0, 95.0, 90.0, 90.0]
    """
    share = np.clip((np.asarray(times, dtype=np.float64) - adaptation) / duration, 0.0, 1.0)
    return np.asarray(initial + share * (final - initial))


def frame_count(seconds: float, refresh_rate: float) -> int:
    """Return how many frames of a display last some seconds: the nearest number, and at least one.

    >>> frame_count(7.0, 60.0), frame_count(0.001, 60.0)
    (420, 1)
    """
    return max(1, round(seconds * refresh_rate))


def reachable_luminances(
    pixel_value: float, display: Display, actuator: Actuator, smallest_factor: float = 0.0
) -> tuple[float, float]:
    """Return the lowest and the highest luminance L that a uniform field reaches.

    Pixels reach from black to white at full backlight. A backlight reaches from its smallest factor to 1,
    times what the pixels let through.

    Parameters
    ----------
    pixel_value : float
        L' of the field, in [0, 1]; where pixels make the brightness it does not matter.
    display : Display
        The display.
    actuator : Actuator
        What makes the brightness.
    smallest_factor : float, optional
        Smallest brightness factor b of the backlight.

    Returns
    -------
    darkest, brightest : float
        L, reflected light included [cd/m^2].

    >>> lab = Display("lab", 100.0, 0.1, 2.0, pixels_per_degree=60.0, reflected_luminance=1.0)
    >>> reachable_luminances(0.5, lab, Actuator.PIXELS)
    (1.1, 101.0)
    >>> reachable_luminances(1.0, lab, Actuator.BACKLIGHT, smallest_factor=0.05)
    (6.0, 101.0)
    """
    if actuator is Actuator.PIXELS:
        darkest, brightest = displayed_luminance([0.0, 1.0], display).tolist()
        return darkest, brightest
    emitted = displayed_luminance(pixel_value, display) - display.reflected_luminance
    darkest, brightest = dimmed_luminance(emitted, [smallest_factor, 1.0], display).tolist()
    return darkest, brightest


def require_reachable(
    initial: float,
    final: float,
    pixel_value: float,
    display: Display,
    actuator: Actuator,
    *,
    smallest_factor: float = 0.0,
) -> None:
    """Refuse a ramp that the display would cut off, for it would stop short and be another ramp.

    Parameters
    ----------
    initial, final : float
        L before and after the ramp [cd/m^2].
    pixel_value, display, actuator, smallest_factor
        As `reachable_luminances` takes them.

    Raises
    ------
    InputError
        If it begins or ends beyond what is reached.
    """
    limits = reachable_luminances(pixel_value, display, actuator, smallest_factor)
    what = "pixels" if actuator is Actuator.PIXELS else f"backlight at pixel value {pixel_value:g}"
    slack = ROUNDING * limits[1]
    for luminance, word in ((initial, "begin"), (final, "end")):
        for limit, beyond, side, remedy in (
            (limits[0], luminance < limits[0] - slack, "darkest", "slower rates or higher factors"),
            (limits[1], luminance > limits[1] + slack, "brightest", "slower rates or lower factors"),
        ):
            if beyond:
                raise InputError(
                    f"the ramp from {initial:.4g} to {final:.4g} cd/m^2 would {word} beyond "
                    f"{limit:.4g} cd/m^2, the {side} that {display.name!r} reaches by its {what}; "
                    f"take {remedy} in the design"
                )
