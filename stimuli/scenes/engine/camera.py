"""Where one looks from, how directions become pixels, and how mouse and keys turn the view on the spot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.stimuli.scenes.engine.scene import Floats, Scene, Vector, direction_of
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW, NARROWEST, WIDEST

NEAR, FAR = 0.05, 400.0  # [m] nothing nearer or farther is drawn
FAR_FOR_EYES = 200.0  # [m] the same, in a headset
EYE_HEIGHT = 1.65  # [m]
STEP = 10.0  # [deg] that a press of a key turns the view
TURNING = 0.25  # [s] that it takes
HIGHEST = 60.0  # [deg] altitude of a view that is turned, up and down
Edges = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Camera:
    """An eye in a scene.

    Attributes
    ----------
    position : (float, float, float)
        x east, y north, z up [m].
    azimuth, altitude : float
        Where it looks: clockwise from north, and up [degrees].
    field_of_view : float
        Horizontal, from edge to edge of the picture [degrees].
    focal_length : float or None
        Distance of the picture plane in pixels; if given, it rules instead of `field_of_view`.
    """

    position: Vector
    azimuth: float
    altitude: float = 0.0
    field_of_view: float = FIELD_OF_VIEW
    focal_length: float | None = None

    def __post_init__(self) -> None:
        if not np.isfinite([*self.position, self.azimuth]).all():
            raise ValueError(f"need a finite position and azimuth, got {self.position} and {self.azimuth:g}")
        if not -90 <= self.altitude <= 90:
            raise ValueError(f"need an altitude from -90 to 90 degrees, got {self.altitude:g}")
        if not NARROWEST <= self.field_of_view <= WIDEST:
            raise ValueError(
                f"need a field of view from {NARROWEST:g} to {WIDEST:g} degrees, got {self.field_of_view:g}"
            )
        if self.focal_length is not None and not self.focal_length > 0:
            raise ValueError(f"need a focal length above 0 pixels, got {self.focal_length:g}")

    def focal_pixels(self, width: int) -> float:
        """Return the distance of the picture plane for a picture of some width [pixels].

        >>> round(Camera((0.0, 0.0, 0.0), 0.0, field_of_view=90.0).focal_pixels(1280), 9)
        640.0
        """
        if self.focal_length is not None:
            return self.focal_length
        return width / 2 / math.tan(math.radians(self.field_of_view) / 2)

    def axes(self) -> Floats:
        """Return the unit vectors to the right, up and forward, as rows."""
        forward = direction_of(self.azimuth, self.altitude)
        right = direction_of(self.azimuth + 90, 0.0)
        return np.stack([right, np.cross(right, forward), forward])

    def matrix(self, size: tuple[int, int]) -> Floats:
        """Return the matrix from the scene to OpenGL's clip space, for columns, (4, 4)."""
        return _to_clip(self, size, FAR)

    def tangents(self, size: tuple[int, int]) -> Edges:
        """Return where the edges of the picture are: left, right, down, up, a unit ahead of the eye.

        >>> Camera((0.0, 0.0, 0.0), 0.0, focal_length=640.0).tangents((1280, 720))
        (-1.0, 1.0, -0.5625, 0.5625)
        """
        focal = self.focal_pixels(size[0])
        across, up = size[0] / 2 / focal, size[1] / 2 / focal
        return -across, across, -up, up


@dataclass(frozen=True, slots=True)
class EyeView:
    """What an eye in a headset sees of a scene: it may be turned in any way, and its axis off the middle.

    Attributes
    ----------
    position : (float, float, float)
        x east, y north, z up [m].
    right, up, forward : (float, float, float)
        Unit vectors, at right angles.
    edges : (float, float, float, float)
        Left, right, down and up edge of the picture, a unit ahead of the eye; left and down are negative
        where straight ahead is in the picture.
    """

    position: Vector
    right: Vector
    up: Vector
    forward: Vector
    edges: Edges

    def axes(self) -> Floats:
        """Return the unit vectors to the right, up and forward, as rows."""
        return np.array([self.right, self.up, self.forward])

    def tangents(self, size: tuple[int, int]) -> Edges:
        """Return where the edges of the picture are: left, right, down, up, a unit ahead of the eye."""
        return self.edges

    def matrix(self, size: tuple[int, int]) -> Floats:
        """Return the matrix from the scene to OpenGL's clip space, for columns, (4, 4)."""
        return _to_clip(self, size, FAR_FOR_EYES)


View = Camera | EyeView


def _to_clip(seen: View, size: tuple[int, int], far: float) -> Floats:
    left, right, down, up = seen.tangents(size)
    lens, view = np.zeros((4, 4)), np.eye(4)
    lens[0, 0], lens[0, 2] = 2 / (right - left), -(right + left) / (right - left)
    lens[1, 1], lens[1, 2] = 2 / (up - down), -(up + down) / (up - down)
    lens[2, 2], lens[2, 3] = (far + NEAR) / (far - NEAR), -2 * far * NEAR / (far - NEAR)
    lens[3, 2] = 1.0
    view[:3, :3] = seen.axes()
    view[:3, 3] = -seen.axes() @ seen.position
    return lens @ view


def sun_matrix(scene: Scene) -> Floats:
    """Return the matrix from the scene to the sun's picture, which is looked up for sharp shadows, (4, 4).

    It covers three corners of every patch: of one that reaches far beyond all others, such as the ground, the
    fourth corner may lie outside, and has no shadows.
    """
    assert scene.sun is not None
    ahead = -scene.sun.direction()
    right = direction_of(scene.sun.azimuth - 90, 0.0)
    axes = np.stack([right, np.cross(right, ahead), ahead])
    seen = scene.patches.corners.reshape(-1, 3) @ axes.T
    low, high = seen.min(axis=0) - 0.1, seen.max(axis=0) + 0.1
    matrix = np.eye(4)
    matrix[:3, :3] = axes * (2 / (high - low))[:, None]
    matrix[:3, 3] = -(high + low) / (high - low)
    return matrix


def focal_length_of(display: Display) -> float:
    """Return the focal length with which a display shows a scene at its true size [pixels].

    One pixel in the middle of the picture covers the angle that the display's `pixels_per_degree` says, so
    that what lies an angle off in the scene lies as far off on the visual field.

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> round(focal_length_of(lab) * math.tan(math.radians(1 / 60)), 3)
    1.0
    """
    return display.pixels_per_degree * 180.0 / math.pi


class LookingAround:
    """The direction of view of someone who turns on the spot.

    Parameters
    ----------
    altitude : float
        Of the first view [deg].
    field_of_view : float
        How far one may turn from the first azimuth, to each side [deg].
    pixels_per_degree : float
        Of the display; a movement of the mouse by some pixels turns the view by as many in its middle.

    >>> looking = LookingAround(altitude=0.0, field_of_view=15.0, pixels_per_degree=20.0)
    >>> looking.moved(right=40, up=-10)
    >>> looking.direction(now=0.0)
    (2.0, -0.5)
    >>> looking.turn(right=1, up=0, now=0.0)
    >>> looking.direction(now=0.125), looking.direction(now=0.25)
    ((7.0, -0.5), (12.0, -0.5))
    >>> looking.turn(right=1, up=0, now=1.0)  # as far as the field of view goes
    >>> looking.direction(now=2.0)
    (15.0, -0.5)
    """

    def __init__(self, altitude: float, field_of_view: float, pixels_per_degree: float) -> None:
        self._widest, self._pixels_per_degree = field_of_view, pixels_per_degree
        # A first view beyond the limits may be kept.
        self._lowest, self._highest = min(-HIGHEST, altitude), max(HIGHEST, altitude)
        self._azimuth, self._altitude = 0.0, altitude  # where the view will be when all turns are over
        # Turns by the keys: when each began [s], and by how much azimuth and altitude change [deg].
        self._turns: list[tuple[float, float, float]] = []

    def moved(self, right: float, up: float) -> None:
        """Turn the view at once, by a movement of the mouse [pixels]."""
        self._go(right / self._pixels_per_degree, up / self._pixels_per_degree)

    def turn(self, right: int, up: int, now: float) -> None:
        """Begin to turn the view by steps of `STEP`, to the right and up, at a time [s]."""
        self._turns.append((now, *self._go(right * STEP, up * STEP)))

    def direction(self, now: float) -> tuple[float, float]:
        """Return the direction of view at a time [s]: azimuth from the first one, and altitude [deg]."""
        self._turns = [turn for turn in self._turns if now - turn[0] < TURNING]
        left = [(1 - eased((now - begun) / TURNING), *change) for begun, *change in self._turns]
        azimuth = self._azimuth - sum(share * change for share, change, _ in left)
        altitude = self._altitude - sum(share * change for share, _, change in left)
        # A mouse that moves back while a turn lasts could leave the limits for a moment.
        return (
            min(max(azimuth, -self._widest), self._widest),
            min(max(altitude, self._lowest), self._highest),
        )

    def _go(self, right: float, up: float) -> tuple[float, float]:
        azimuth = min(max(self._azimuth + right, -self._widest), self._widest)
        altitude = min(max(self._altitude + up, self._lowest), self._highest)
        change = azimuth - self._azimuth, altitude - self._altitude
        self._azimuth, self._altitude = azimuth, altitude
        return change


def eased(share: float) -> float:
    """Return how much of a turn is done after a share of its time: slow at both ends.

    >>> eased(-0.1), eased(0.5), eased(1.0)
    (0.0, 0.5, 1.0)
    """
    share = min(max(share, 0.0), 1.0)
    return share * share * (3 - 2 * share)


def steps_to(azimuth: float, altitude: float, first_altitude: float = 0.0) -> tuple[int, int]:
    """Return how often the keys turn right and up until the view is nearest to a direction [deg].

    >>> steps_to(azimuth=-23.0, altitude=12.0)
    (-2, 1)
    """
    return round(azimuth / STEP), round((altitude - first_altitude) / STEP)
