"""Where the panel of text and the surfaces of videos lie, and which of their points a pixel of an eye shows.

A matrix for each eye and frame takes a pixel (x, y, 1) of the eye's picture, counted to the right and down
from its upper left corner, with the middle of the first pixel at 0.5. For a plane it gives (s, t, w): where w
is above 0, the pixel shows what is s/w to the right and t/w down in the picture on the plane. For a sphere it
gives a direction. Axes are OpenXR's: x right, y up, z backwards [m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evenlight.hardware.presentation.headset_views import EyePose, Pose, rotation
from evenlight.stimuli.scenes.engine.scene import Floats

PANEL_DISTANCE = 1.5  # [m] ahead of the head: where most headsets' optics are sharp, or near it
PANEL_WIDTH = 50.0  # [deg] seen from the middle between the eyes
SCREEN_DISTANCE = 3.0  # [m] of a flat screen from where the head was when straight ahead was set
HERE = Pose()  # where the head was when straight ahead was set


@dataclass(frozen=True, slots=True)
class FlatScreen:
    """A screen that stands straight ahead of where the head was when that was set.

    Attributes
    ----------
    field_of_view : float
        Its width, seen from there, below 180 [deg].
    side_by_side : bool
        Whether the left half of the video is for the left eye, and the right one for the right; each half
        fills the screen, with square pixels.
    """

    field_of_view: float = 60.0
    side_by_side: bool = False

    def matrix(self, eye: EyePose, eye_size: tuple[int, int], size: tuple[int, int]) -> Floats:
        """Return the matrix of an eye, for a picture of some width and height [pixels]."""
        return plane_matrix(eye, eye_size, HERE, (SCREEN_DISTANCE, self.field_of_view), size)


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere around the head, infinitely far, with an equirectangular video on it.

    Attributes
    ----------
    span : float
        How wide the video is: all around, 360, or the half that is ahead, 180 [deg]; it is 180 high.
    side_by_side : bool
        Whether the left half of the video is for the left eye, and the right one for the right.
    """

    span: float = 360.0
    side_by_side: bool = False

    def matrix(self, eye: EyePose, eye_size: tuple[int, int], _: tuple[int, int]) -> Floats:
        """Return the matrix of an eye."""
        return direction_matrix(eye, eye_size)


Surface = FlatScreen | Sphere


def panel_matrix(eye: EyePose, eye_size: tuple[int, int], head: Pose, size: tuple[int, int]) -> Floats:
    """Return the matrix of an eye for the panel of text, which moves with the head.

    Parameters
    ----------
    eye : EyePose
        Where the eye is, and what it sees.
    eye_size : (int, int)
        Width and height of its picture [pixels].
    head : Pose
        Where the head is.
    size : (int, int)
        Width and height of the panel's picture [pixels].
    """
    return plane_matrix(eye, eye_size, head, (PANEL_DISTANCE, PANEL_WIDTH), size)


def plane_matrix(
    eye: EyePose, eye_size: tuple[int, int], at: Pose, place: tuple[float, float], size: tuple[int, int]
) -> Floats:
    """Return the matrix from pixels of an eye to a picture on a plane, (3, 3); zeros where it is not seen.

    Parameters
    ----------
    eye, eye_size : EyePose, (int, int)
        The eye, and width and height of its picture [pixels].
    at : Pose
        Straight ahead of which the middle of the plane lies, at a right angle to the view.
    place : (float, float)
        Distance of the plane [m], and its width as seen from `at` [deg].
    size : (int, int)
        Width and height of the picture on it, with square pixels.

    A screen 90 degrees wide fills the picture of an eye that sees as much.

    >>> from evenlight.hardware.presentation.headset_views import EyeFov
    >>> fov = EyeFov(*np.radians([-45.0, 45.0, 45.0, -45.0]))
    >>> matrix = plane_matrix(EyePose(Pose(), fov), (200, 200), Pose(), (1.5, 90.0), (100, 100))
    >>> (matrix / matrix[2, 2] @ (200.0, 100.0, 1.0)).round(9).tolist()  # the middle of the right edge
    [100.0, 50.0, 1.0]
    """
    distance, width = place
    pixel = 2 * distance * math.tan(math.radians(width) / 2) / size[0]  # [m]
    turned = rotation(at)
    right, up, back = turned.T
    middle = np.asarray(at.position) - distance * back
    corner = middle - right * pixel * size[0] / 2 + up * pixel * size[1] / 2
    to_corner = corner - np.asarray(eye.pose.position)
    if back @ to_corner >= 0:  # the eye is in the plane, or behind it
        return np.zeros((3, 3))
    # A ray meets the plane where to_corner + s * right - t * up is a multiple of it.
    basis = np.stack([right * pixel, -up * pixel, to_corner], axis=1)
    return np.asarray(np.linalg.solve(basis, direction_matrix(eye, eye_size)))


def direction_matrix(eye: EyePose, size: tuple[int, int]) -> Floats:
    """Return the matrix from pixels of an eye's picture to directions of their rays, (3, 3).

    >>> from evenlight.hardware.presentation.headset_views import EyeFov
    >>> fov = EyeFov(*np.radians([-45.0, 45.0, 45.0, -45.0]))
    >>> (direction_matrix(EyePose(Pose(), fov), (200, 100)) @ (200.0, 50.0, 1.0)).round(9).tolist()
    [1.0, 0.0, -1.0]
    """
    left, right, down, up = eye.fov.tangents()
    rays = np.array([[(right - left) / size[0], 0, left], [0, (down - up) / size[1], up], [0, 0, -1]])
    return np.asarray(rotation(eye.pose) @ rays)
