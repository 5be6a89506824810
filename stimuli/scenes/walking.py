"""Where a walker may go in a scene: over its walkable rectangles, along their edges, up and down slopes."""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.camera import EYE_HEIGHT
from evenlight.stimuli.scenes.camera_path import CameraPath
from evenlight.stimuli.scenes.scene import Ground, Scene, Vector

TOUCHING = 0.02  # [m] rectangles this near to each other are joined
STEP_UP = 0.45  # [m] the highest step; a floor above or below is not reached by walking under or over it
STRIDE = 0.05  # [m] of which a longer step is made up, so that none leaps over a gap
LOWEST_EYE, HIGHEST_EYE = 0.6, 2.2  # [m] above the floor, of a path that stays on the ground


def walked(position: Vector, step: tuple[float, float], scene: Scene) -> Vector:
    """Return where a walker's eye is after a step, which slides along walls and follows the floor.

    Parameters
    ----------
    position : (float, float, float)
        Of the eye before [m]; its height above the floor is kept.
    step : (float, float)
        What the walker wants to go, east and north [m].
    scene : Scene
        Where.

    Returns
    -------
    (float, float, float)
        Of the eye after [m]. Outside all walkable ground nobody moves.
    """
    ground = _under(position, scene)
    if ground is None:
        return position
    x, y, z = position
    eye = z - ground.height(x, y)
    floor = z - eye
    strides = max(int(np.ceil(np.hypot(*step) / STRIDE)), 1)
    for _ in range(strides):
        for east, north in ((step[0], step[1]), (step[0], 0.0), (0.0, step[1])):
            reached = _floor_at(x + east / strides, y + north / strides, floor, scene)
            if reached is not None:
                x, y, floor = x + east / strides, y + north / strides, reached
                break
    return x, y, floor + eye


def on_ground(position: Vector, scene: Scene, margin: float = TOUCHING) -> bool:
    """Return whether an eye is over walkable ground, at a height at which people have their eyes.

    `margin` is how far beside the ground still counts [m]; walkable ground keeps about 0.3 m from walls.
    """
    return _under(position, scene, margin) is not None


def check_path(path: CameraPath, scene: Scene) -> None:
    """Refuse a path one of whose keypoints is not over the scene's walkable ground.

    Raises
    ------
    InputError
        With the first such keypoint.
    """
    for point in path.keypoints:
        if not on_ground(point.position, scene):
            x, y, z = point.position
            raise InputError(
                f"camera path {path.name}: keypoint {point.name!r} at ({x:g}, {y:g}, {z:g}) m is outside the "
                f"walkable ground of {scene.name}; need eyes {LOWEST_EYE:g} to {HIGHEST_EYE:g} m over it"
            )


def _under(position: Vector, scene: Scene, margin: float = TOUCHING) -> Ground | None:
    """Return the ground under an eye, that whose distance is nearest to eye height, or None."""
    x, y, z = position
    fitting = [
        (abs(z - ground.height(x, y) - EYE_HEIGHT), k)
        for k, ground in enumerate(scene.walkable)
        if ground.contains(x, y, margin) and LOWEST_EYE <= z - ground.height(x, y) <= HIGHEST_EYE
    ]
    return scene.walkable[min(fitting)[1]] if fitting else None


def _floor_at(x: float, y: float, floor: float, scene: Scene) -> float | None:
    """Return the height of the floor at a point that can be reached from a floor of some height, or None."""
    heights = [ground.height(x, y) for ground in scene.walkable if ground.contains(x, y, TOUCHING)]
    near = [height for height in heights if abs(height - floor) <= STEP_UP]
    return min(near, key=lambda height: abs(height - floor)) if near else None
