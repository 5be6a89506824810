"""The Landolt ring of ISO 8596: gap and stroke are a fifth of the diameter; the gap's sides are parallel.

And its light, that of its surroundings, brighter or darker by its contrast. Decision
(docs/decisions/landolt-rings.md): a ring's contrast is that of the light that the display emits. The
surroundings are what lies between the ring's edge and twice its radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, linear_channels

GAPS_IN_DIAMETER = 5  # ISO 8596
SMALLEST_GAP = 2.0  # [pixels] with less, the sides of the gap share pixels and its direction is a guess
LARGEST_GAP = 600.0  # [arcmin]
LEVELS_16 = 65535
INNER, OUTER = GAPS_IN_DIAMETER / 2, float(GAPS_IN_DIAMETER)  # radii of the surroundings [gaps]
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Ring:
    """A Landolt ring somewhere on the visual field.

    Attributes
    ----------
    azimuth, altitude : float
        Direction of its centre in the scene: clockwise from north, and up [deg].
    gap : float
        Width of its gap, and of its stroke [arcmin].
    contrast : float
        Weber contrast against the luminance around it; negative for a dark ring.
    orientation : int
        Where the gap is, counter-clockwise from the right [deg].
    """

    azimuth: float
    altitude: float
    gap: float
    contrast: float
    orientation: int

    def __post_init__(self) -> None:
        if not (math.isfinite(self.azimuth) and -90 <= self.altitude <= 90):
            raise ValueError(
                f"a ring needs a finite azimuth and an altitude from -90 to 90 deg, got {self.azimuth:g} and "
                f"{self.altitude:g}"
            )
        if not 0 < self.gap <= LARGEST_GAP:
            raise ValueError(f"a ring's gap must be above 0 and at most 600 arcmin, got {self.gap:g}")
        if not (math.isfinite(self.contrast) and self.contrast >= -1 and self.contrast != 0):
            raise ValueError(f"a ring's contrast must be -1 or more and not 0, got {self.contrast:g}")
        if self.orientation not in ORIENTATIONS:
            raise ValueError(
                f"a ring's orientation must be one of {', '.join(map(str, ORIENTATIONS))} deg, got "
                f"{self.orientation}"
            )

    @property
    def diameter(self) -> float:
        """Outer diameter: five gaps [arcmin]."""
        return GAPS_IN_DIAMETER * self.gap

    @property
    def gap_on_plane(self) -> float:
        """Width of the gap on the plane that touches the unit sphere at the ring's centre.

        The ring is flat, as on a chart that faces the eye, so that its fifths are equal there, and their
        angles nearly so: five gaps of 10 arcmin span 0.002 % less than five times that, of 60 arcmin 0.06 %.
        """
        return 2 * math.tan(math.radians(self.gap / 60) / 2)


def covered(points: ArrayLike, orientation: float) -> NDArray[np.bool_]:
    """Return which points a ring covers.

    Parameters
    ----------
    points : array_like, (..., 2)
        To the right and up from the ring's centre, on its plane, in gaps.
    orientation : float
        Where its gap is, counter-clockwise from the right [deg].

    Returns
    -------
    array of bool, (...)
        Points between an inner radius of 1.5 gaps and an outer one of 2.5 are on the ring, if not in the gap:
        a strip as wide as the stroke from the centre outwards, so that its sides are parallel.

    >>> covered([[2.0, 0.0], [2.0, 0.51], [-2.0, 0.0], [0.0, 1.4], [0.0, 2.6]], orientation=0).tolist()
    [False, True, True, False, False]
    """
    x, y = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
    turn = math.radians(orientation)
    along = x * math.cos(turn) + y * math.sin(turn)
    beside = y * math.cos(turn) - x * math.sin(turn)
    outer = GAPS_IN_DIAMETER / 2
    radius = np.hypot(x, y)
    in_gap = (along > 0) & (np.abs(beside) < 0.5)
    return np.asarray((radius <= outer) & (radius >= outer - 1) & ~in_gap)


def gap_pixels(ring: Ring, pixels_per_degree: float) -> float:
    """Return how wide a ring's gap is in the middle of a display's picture [pixels].

    >>> gap_pixels(Ring(0.0, 0.0, gap=10.0, contrast=-0.3, orientation=90), pixels_per_degree=24.0)
    4.0
    """
    return ring.gap / 60 * pixels_per_degree


def require_drawable(ring: Ring, display: Display) -> None:
    """Refuse a ring whose gap is under 2 pixels on a display.

    >>> coarse = Display("coarse", 100.0, 0.0, 2.2, pixels_per_degree=10.0)
    >>> require_drawable(Ring(0.0, 0.0, gap=12.0, contrast=-0.3, orientation=90), coarse)
    """
    pixels = gap_pixels(ring, display.pixels_per_degree)
    if pixels < SMALLEST_GAP * (1 - 1e-9):
        smallest = SMALLEST_GAP / display.pixels_per_degree * 60
        # Upwards: the size that the message names must be accepted.
        smallest = math.ceil(smallest * 100 - 1e-6) / 100
        raise InputError(
            f"ring_gap_arcmin: a gap of {ring.gap:g} arcmin is {pixels:.2f} pixels on the display "
            f"{display.name!r} of {display.pixels_per_degree:g} pixels per degree, and must be 2 or more: "
            f"give {smallest:g} arcmin or more"
        )


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
    seen_from : (float, float, float)
        Where it lies in the direction and has the size that `ring` says [m].
    distance : float
        How far it is from there [m]; one that is infinitely far looks the same from everywhere.
    """

    ring: Ring
    surroundings: Surroundings
    light: tuple[float, float, float]
    seen_from: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = math.inf


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
