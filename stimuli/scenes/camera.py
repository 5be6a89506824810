"""Where one looks from, and how directions become pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from evenlight.stimuli.scenes.scene import Floats, Vector, direction_of

NEAR, FAR = 0.05, 400.0  # [m] nothing nearer or farther is drawn
FIELD_OF_VIEW = 90.0  # [degrees] horizontal, about that of one eye in a headset
EYE_HEIGHT = 1.65  # [m]


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
        if not 1 <= self.field_of_view <= 170:
            raise ValueError(f"need a field of view from 1 to 170 degrees, got {self.field_of_view:g}")
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

    def project(self, points: ArrayLike, size: tuple[int, int]) -> Floats:
        """Return where points appear, (n, 2): pixels from the upper left corner, x right, y down.

        Parameters
        ----------
        points : array_like, (n, 3)
            In the scene [m]; what lies behind the eye becomes nan.
        size : (int, int)
            Width and height of the picture [pixels]. The middle of the first pixel is at (0.5, 0.5).

        >>> Camera((0.0, 0.0, 0.0), 0.0).project([[1.0, 2.0, 0.0]], (1280, 720)).round(6).tolist()
        [[960.0, 360.0]]
        """
        right, up, ahead = ((np.asarray(points, dtype=float) - self.position) @ self.axes().T).T
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(ahead > 0, self.focal_pixels(size[0]) / ahead, np.nan)
        return np.stack([size[0] / 2 + scale * right, size[1] / 2 - scale * up], axis=1)

    def matrix(self, size: tuple[int, int]) -> Floats:
        """Return the matrix from the scene to OpenGL's clip space, for columns, (4, 4)."""
        focal = self.focal_pixels(size[0])
        view = np.eye(4)
        view[:3, :3] = self.axes()
        view[:3, 3] = -self.axes() @ self.position
        lens = np.zeros((4, 4))
        lens[0, 0], lens[1, 1] = 2 * focal / size[0], 2 * focal / size[1]
        lens[2, 2], lens[2, 3] = (FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
        lens[3, 2] = 1.0
        return lens @ view
