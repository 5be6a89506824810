"""Which blocks of a scene are hidden behind walls, found in a small depth picture of its large surfaces."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.camera import FAR, NEAR
from evenlight.stimuli.scenes.scene import Floats, Scene
from evenlight.stimuli.scenes.vertices import Blocks

SHRUNK = 3  # the small picture has this fraction of the large one's width and height
SIDE, AREA = 0.7, 1.2  # [m], [m^2] patches of this size hide others
SLACK = 0.02  # [m] a block is drawn although it is this far behind


def occluders(scene: Scene) -> NDArray[np.uint32]:
    """Return the indices of triangles that hide what is behind them, for the scene's vertices."""
    patches = scene.patches
    wide, high = (np.linalg.norm(edge, axis=1) for edge in (patches.along, patches.across))
    chosen = (np.minimum(wide, high) >= SIDE) & (wide * high >= AREA) & ~patches.triangle & ~scene.holed()
    if not chosen.any():
        return np.zeros(3, dtype=np.uint32)  # a triangle without area
    triangles = 4 * np.flatnonzero(chosen)[:, None] + np.array([0, 1, 2, 1, 3, 2])
    return np.asarray(triangles, dtype=np.uint32)


def not_hidden(
    blocks: Blocks, chosen: NDArray[np.int64], matrix: Floats, depth: NDArray[np.float32]
) -> NDArray[np.int64]:
    """Return those of some blocks that are not wholly behind what a depth picture holds.

    Parameters
    ----------
    blocks : Blocks
        Of the scene.
    chosen : array of int, (n,)
        Which of them to look at.
    matrix : array, (4, 4)
        From the scene to clip space.
    depth : array of float32, (height, width)
        Of the large surfaces, row 0 at the bottom, 0 at the near plane and 1 at the far one.
    """
    seen = _visible(blocks.low[chosen], blocks.high[chosen], matrix, _distance(depth))
    return np.asarray(chosen[seen])


def _distance(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the distance along the view for depths [m]."""
    return np.asarray(2 * FAR * NEAR / (FAR + NEAR - (2 * depth - 1) * (FAR - NEAR)), dtype=np.float32)


@numba.njit(cache=True, error_model="numpy")
def _visible(low, high, matrix, distance):
    """Return which boxes have a pixel of the rectangle around them that nothing nearer covers."""
    rows, columns = distance.shape
    seen = np.ones(len(low), np.bool_)
    for k in range(len(low)):
        nearest = np.inf
        left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(8):
            x = high[k, 0] if corner & 1 else low[k, 0]
            y = high[k, 1] if corner & 2 else low[k, 1]
            z = high[k, 2] if corner & 4 else low[k, 2]
            w = matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z + matrix[3, 3]
            nearest = min(nearest, w)
            if w > NEAR:
                across = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) / w
                up = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) / w
                left, right = min(left, across), max(right, across)
                bottom, top = min(bottom, up), max(top, up)
        if nearest <= NEAR:
            continue  # around the eye
        first = max(int((left + 1) / 2 * columns) - 1, 0)
        last = min(int((right + 1) / 2 * columns) + 1, columns - 1)
        low_row = max(int((bottom + 1) / 2 * rows) - 1, 0)
        high_row = min(int((top + 1) / 2 * rows) + 1, rows - 1)
        seen[k] = _any_behind(distance, low_row, high_row, first, last, nearest - SLACK)
    return seen


@numba.njit(cache=True, error_model="numpy")
def _any_behind(distance, low_row, high_row, first, last, limit):
    """Return whether a rectangle of pixels has one that is farther than a limit."""
    for row in range(low_row, high_row + 1):
        for column in range(first, last + 1):
            if distance[row, column] >= limit:
                return True
    return False
