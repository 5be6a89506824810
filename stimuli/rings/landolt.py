"""The Landolt ring of ISO 8596: gap and stroke are a fifth of the diameter; the gap's sides are parallel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import ORIENTATIONS

GAPS_IN_DIAMETER = 5  # ISO 8596
SMALLEST_GAP = 2.0  # [pixels] with less, the sides of the gap share pixels and its direction is a guess
LARGEST_GAP = 600.0  # [arcmin]


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
