"""Where a camera sees points of a scene, by the geometry of a pinhole."""

import numpy as np
from numpy.typing import ArrayLike

from evenlight.stimuli.scenes.engine.camera import Camera


def project(camera: Camera, points: ArrayLike, size: tuple[int, int]) -> np.ndarray:
    """Where points appear, (n, 2): pixels from the upper left corner, x right, y down; behind the eye nan.

    The middle of the first pixel is at (0.5, 0.5).

    >>> project(Camera((0.0, 0.0, 0.0), 0.0), [[1.0, 2.0, 0.0]], (1280, 720)).round(6).tolist()
    [[960.0, 360.0]]
    """
    right, up, ahead = ((np.asarray(points, dtype=float) - camera.position) @ camera.axes().T).T
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(ahead > 0, camera.focal_pixels(size[0]) / ahead, np.nan)
    return np.stack([size[0] / 2 + scale * right, size[1] / 2 - scale * up], axis=1)
