"""What the eyes in a headset see of a scene: from the axes of OpenXR to those of scenes.

OpenXR has x to the right, y up and z backwards, scenes have x east, y north and z up. Straight ahead of a
headset (`HeadsetWindow.recentre`) is where one looks in the scene before the head turns.
"""

from __future__ import annotations

import math

import numpy as np

from evenlight.hardware.presentation.headset_views import EyePose, HeadsetFrame, Pose, forward, rotation
from evenlight.stimuli.scenes.engine.camera import EyeView
from evenlight.stimuli.scenes.engine.scene import Floats, Vector, direction_of


def eye_views(frame: HeadsetFrame, position: Vector, azimuth: float) -> tuple[EyeView, ...]:
    """Return what is seen of a scene in the views of a frame.

    Parameters
    ----------
    frame : HeadsetFrame
        Where the eyes are, and how far they see.
    position : (float, float, float)
        Of the headset's origin in the scene: x east, y north, z up [m].
    azimuth : float
        Where its straight ahead points: clockwise from north [deg].
    """
    to_scene = np.stack(
        [direction_of(azimuth + 90, 0.0), direction_of(0.0, 90.0), -direction_of(azimuth, 0.0)], axis=1
    )
    return tuple(_view(eye, to_scene, position) for eye in frame.eyes)


def _view(eye: EyePose, to_scene: Floats, position: Vector) -> EyeView:
    """Return what an eye sees, with the matrix from OpenXR's axes to those of the scene."""
    right, up, back = (to_scene @ rotation(eye.pose)).T
    place = np.asarray(position) + to_scene @ eye.pose.position
    return EyeView(_vector(place), _vector(right), _vector(up), _vector(-back), eye.fov.tangents())


def head_direction(head: Pose) -> tuple[float, float]:
    """Return where a head points: azimuth, clockwise from straight ahead, and altitude.

    Both in degrees.

    >>> head_direction(Pose())
    (0.0, 0.0)
    """
    right, up, back = forward(head)
    return math.degrees(math.atan2(right, -back)), math.degrees(math.asin(min(max(up, -1.0), 1.0)))


def _vector(array: Floats) -> Vector:
    x, y, z = array.tolist()
    return x, y, z
