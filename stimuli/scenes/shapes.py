"""Round shapes as corners and normals."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from stimuli.scenes.scene import Floats

# The corners of each side of a unit box, counter-clockwise from outside; x is the lower side, X the upper.
BOX_SIDES = {
    "x": ((0, 1, 0), (0, 0, 0), (0, 0, 1), (0, 1, 1)),
    "X": ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)),
    "y": ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
    "Y": ((1, 1, 0), (0, 1, 0), (0, 1, 1), (1, 1, 1)),
    "z": ((0, 1, 0), (1, 1, 0), (1, 0, 0), (0, 0, 0)),
    "Z": ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
}
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # of the axes


def ring(segments: int) -> Floats:
    """Return points of a unit circle, (segments + 1, 2), the first again at the end."""
    angle = np.linspace(0, 2 * math.pi, segments + 1)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[-1] = points[0]
    return points


def at_right_angles(first: Floats, second: Floats) -> Floats:
    """Return the cross product of vectors along the last axis, (..., 3).

    `numpy.cross` takes ten times as long for a single pair, and a scene has tens of thousands.

    >>> at_right_angles(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])).tolist()
    [0.0, 0.0, 1.0]
    """
    ahead, behind = first.take(NEXT, -1), first.take(LAST, -1)
    return np.asarray(ahead * second.take(LAST, -1) - behind * second.take(NEXT, -1))


def frame_along(axis: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return three unit vectors at right angles, the last along an axis, counter-clockwise around it."""
    along = np.asarray(axis, dtype=float)
    along = along / np.linalg.norm(along)
    other = np.array([1.0, 0, 0]) if abs(along[0]) < 0.9 else np.array([0, 1.0, 0])
    first = other - along * (other @ along)
    first /= np.linalg.norm(first)
    return first, at_right_angles(along, first), along


def sphere(segments: int) -> tuple[Floats, np.ndarray, Floats]:
    """Return points, triangles and texture coordinates of a unit sphere, z its axis.

    >>> points, triangles, uvs = sphere(8)
    >>> bool(np.allclose(np.linalg.norm(points, axis=1), 1))
    True
    """
    rows = max(segments // 2, 3)
    circle, height = ring(segments), np.linspace(-math.pi / 2, math.pi / 2, rows + 1)
    points = np.concatenate(
        [np.column_stack([circle * math.cos(h), np.full(segments + 1, math.sin(h))]) for h in height]
    )
    u, v = np.meshgrid(np.linspace(0, 1, segments + 1), np.linspace(0, 1, rows + 1))
    low = (np.arange(rows)[:, None] * (segments + 1) + np.arange(segments)).ravel()
    high = low + segments + 1
    triangles = np.concatenate(
        [
            np.stack([low, low + 1, high + 1], axis=1)[segments:],
            np.stack([low, high + 1, high], axis=1)[:-segments],
        ]
    )
    return points, triangles, np.stack([u.ravel(), v.ravel()], axis=1)
