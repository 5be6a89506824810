"""What light a ring has: that of its surroundings, brighter or darker by its contrast.

Decision (docs/decisions/landolt-rings.md): a ring's contrast is that of the light that the display emits. The
surroundings are what lies between the ring's edge and twice its radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, linear_channels
from evenlight.stimuli.rings.landolt import GAPS_IN_DIAMETER, Ring

LEVELS_16 = 65535
INNER, OUTER = GAPS_IN_DIAMETER / 2, float(GAPS_IN_DIAMETER)  # radii of the surroundings [gaps]
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The light around a ring's place, as the display emits it at full brightness.

    Attributes
    ----------
    light : (float, float, float)
        Mean of each channel, weighed to luminance by `LUMINANCE_WEIGHTS` [cd/m^2].
    variation : float
        Standard deviation of the luminance over its mean.
    """

    light: tuple[float, float, float]
    variation: float

    @property
    def luminance(self) -> float:
        """Mean luminance I [cd/m^2]."""
        return float(np.dot(self.light, LUMINANCE_WEIGHTS))


@dataclass(frozen=True, slots=True)
class PaintedRing:
    """A ring with the light that it has in a scene.

    Attributes
    ----------
    ring : Ring
        Where it is, how large, how turned.
    surroundings : Surroundings
        What is around it.
    light : (float, float, float)
        Of the ring, each channel, as the display emits it at full brightness [cd/m^2].
    """

    ring: Ring
    surroundings: Surroundings
    light: tuple[float, float, float]


def surroundings_of(
    pixel_values: NDArray[np.uint16], focal_length: float, ring: Ring, display: Display
) -> Surroundings:
    """Return the light around a ring's place in a picture that has this place in its middle.

    Parameters
    ----------
    pixel_values : array of uint16, (height, width, 3)
        The picture, without the ring, over the 16-bit range.
    focal_length : float
        Its distance from the eye [pixels].
    ring : Ring
        How large the ring is.
    display : Display
        What shows it.

    >>> ring = Ring(0.0, 0.0, gap=60.0, contrast=-0.3, orientation=0)
    >>> lab = Display("lab", 100.0, 0.0, 1.0, pixels_per_degree=2.0)
    >>> grey = np.full((30, 30, 3), 32767, np.uint16)
    >>> round(surroundings_of(grey, 120.0, ring, lab).luminance, 2)
    50.0
    """
    height, width, _ = pixel_values.shape
    x = (np.arange(width) + 0.5 - width / 2)[np.newaxis, :]
    y = (np.arange(height) + 0.5 - height / 2)[:, np.newaxis]
    radius = np.hypot(x, y) / focal_length / ring.gap_on_plane
    around = emitted_channels(pixel_values[(radius > INNER) & (radius < OUTER)], display)
    luminance = around @ np.array(LUMINANCE_WEIGHTS)
    red, green, blue = around.mean(axis=0).tolist()
    return Surroundings((red, green, blue), float(luminance.std() / max(luminance.mean(), ROUNDING)))


def painted(ring: Ring, surroundings: Surroundings, display: Display) -> PaintedRing:
    """Return a ring with its light: (1 + contrast) times that around it, of the same colour.

    Where a channel of this colour is out of the display's reach, the colour is made paler, at the same
    luminance, by as much as is needed.

    Raises
    ------
    InputError
        If the display does not reach the luminance itself.

    >>> lab = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
    >>> ring = Ring(0.0, 0.0, gap=10.0, contrast=0.5, orientation=0)
    >>> painted(ring, Surroundings((20.0, 10.0, 4.0), 0.0), lab).light
    (30.0, 15.0, 6.0)
    """
    low, high = display.black_level, display.peak_luminance
    around = surroundings.luminance
    wanted = (1 + ring.contrast) * around
    if not low * (1 - ROUNDING) - ROUNDING <= wanted <= high * (1 + ROUNDING):
        # Inwards, in hundredths: the contrasts that the message names must be accepted.
        least = math.ceil((low / around - 1) * 100) / 100
        most = math.floor((high / around - 1) * 100) / 100
        raise InputError(
            f"ring_contrast: {ring.contrast:g} against {around:.3g} cd/m^2 would be {wanted:.3g} cd/m^2, and "
            f"the display {display.name!r} emits {low:g} to {high:g}: give a contrast from {least:g} to "
            f"{most:g}"
        )
    light = (1 + ring.contrast) * np.array(surroundings.light)
    excess = light - wanted
    # The share of the colour that may stay: each channel is to be between low and high.
    room = np.where(excess > 0, high - wanted, wanted - low)
    kept = np.min(room / np.maximum(np.abs(excess), ROUNDING), initial=1.0)
    red, green, blue = (wanted + max(float(kept), 0.0) * excess).tolist()
    return PaintedRing(ring, surroundings, (red, green, blue))


def reachable_light(emitted: ArrayLike, factor: float, display: Display) -> NDArray[np.float64]:
    """Return the light I that pixels seem to have where they make the brightness b: no less than black / b.

    What b · I would be darker than the display's black is drawn as black (docs/decisions/dimmed-playback.md).

    Parameters
    ----------
    emitted : array_like, any shape
        I, luminance emitted at b = 1 [cd/m^2].
    factor : float
        Brightness factor b.
    display : Display
        Its black.

    >>> lab = Display("lab", 100.0, 0.5, 2.2, pixels_per_degree=60.0)
    >>> reachable_light([1.0, 4.0], 0.25, lab).tolist()
    [2.0, 4.0]
    """
    return np.maximum(np.asarray(emitted, dtype=np.float64), display.black_level / factor)


def shown_contrast(
    contrast: float, background_luminance: float, factor: float, display: Display, *, by_pixels: bool
) -> float:
    """Return the Weber contrast of a ring as it leaves the display: dimmed, and nothing below its black.

    It is that of the light the display emits: light that it reflects is left out. Ring and surroundings count
    by their luminance, as greys; where they are coloured, single channels may reach black before that.

    Parameters
    ----------
    contrast : float
        Weber contrast that the ring is to have.
    background_luminance : float
        Mean luminance I around it at full brightness [cd/m^2].
    factor : float
        Brightness factor b.
    display : Display
        Its black.
    by_pixels : bool
        Whether pixels make the brightness; a backlight dims the black along with everything else.

    >>> lab = Display("lab", 100.0, 0.5, 2.2, pixels_per_degree=60.0)
    >>> shown_contrast(-0.75, 4.0, 0.25, lab, by_pixels=True)
    -0.5
    >>> shown_contrast(-0.75, 4.0, 0.25, lab, by_pixels=False)
    -0.75
    """
    if not by_pixels:
        return contrast
    light = np.array([1 + contrast, 1.0]) * background_luminance
    ring, around = reachable_light(light, factor, display).tolist()
    # Where neither is at its floor the contrast is the one asked for, to the last digit.
    return contrast if [ring, around] == light.tolist() else ring / around - 1


def emitted_channels(pixel_values: NDArray[np.uint16], display: Display) -> NDArray[np.float64]:
    """Return what each channel adds to the luminance emitted, before it is weighed, (..., 3) [cd/m^2]."""
    black = display.black_level
    return linear_channels(pixel_values, display.gamma) * (display.peak_luminance - black) + black


def levels_of(light: tuple[float, float, float], display: Display) -> tuple[int, int, int]:
    """Return the pixel values, over the 16-bit range, that make a display emit some light.

    >>> levels_of((0.0, 50.0, 100.0), Display("lab", 100.0, 0.0, 1.0, pixels_per_degree=60.0))
    (0, 32768, 65535)
    """
    black = display.black_level
    linear = (np.array(light) - black) / (display.peak_luminance - black)
    red, green, blue = np.rint(np.clip(linear, 0, 1) ** (1 / display.gamma) * LEVELS_16).astype(int).tolist()
    return red, green, blue
