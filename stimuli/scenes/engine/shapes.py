"""Shapes as corners, triangles and normals, and where a texture lies on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.stimuli.scenes.engine.scene import Floats, Vector

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
DARK: Vector = (0.0, 0.0, 0.0)
WHOLE = ((0, 0), (1, 0), (1, 1), (0, 1))  # texture coordinates that show one tile upright on a rectangle


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles between points."""

    points: Floats  # (n, 3): where they are [m]
    triangles: NDArray[np.intp]  # (m, 3): three points each, counter-clockwise seen from the visible side
    uvs: Floats  # (n, 2): texture coordinates of the points, in repeats
    normals: Floats  # (n, 3): unit normals of the points


def ring(segments: int) -> Floats:
    """Return points of a unit circle, (segments + 1, 2), the first again at the end."""
    angle = np.linspace(0, 2 * math.pi, segments + 1)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[-1] = points[0]
    return points


def rectangle(
    x: float | tuple[float, float], y: float | tuple[float, float], z: float | tuple[float, float]
) -> list[tuple[float, ...]]:
    """Return the corners of a rectangle: from where to where along two axes, a place on the third [m].

    It begins at the first ends and goes along the earlier axis first: counter-clockwise seen from -y, +x or
    +z if both spans run up. Where one runs down, the other side is the visible one.

    >>> rectangle((0.0, 2.0), 1.0, (0.0, 3.0))
    [(0.0, 1.0, 0.0), (2.0, 1.0, 0.0), (2.0, 1.0, 3.0), (0.0, 1.0, 3.0)]
    """
    orders = iter(((0, 1, 1, 0), (0, 0, 1, 1)))
    columns = [[s[k] for k in next(orders)] if isinstance(s, tuple) else [s] * 4 for s in (x, y, z)]
    return list(zip(*columns, strict=True))


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


def cylinder_side(base: Floats, top: Floats, radii: tuple[float, float], segments: int, tile: float) -> Mesh:
    """Return the side of a cylinder or a cone; the first `segments` + 1 points are its lower edge.

    Parameters
    ----------
    base, top : array, (3,)
        Middles of its ends [m].
    radii : (float, float)
        At the base and at the top [m]; no triangles end in a point.
    segments : int
        Flat pieces around.
    tile : float
        What one repeat of the texture covers [m].

    >>> side = cylinder_side(np.zeros(3), np.array([0, 0, 2.0]), (1.0, 0.5), 4, 1.0)
    >>> np.linalg.norm(side.points[:, :2], axis=1).round(6).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.5]
    """
    first, second, along = frame_along(top - base)
    length, (radius, upper) = float(np.linalg.norm(top - base)), radii
    out = ring(segments) @ np.stack([first, second])
    around = np.linspace(0, 2 * math.pi * max(radii) / tile, segments + 1)
    lean = out + along * (radius - upper) / length
    lean /= np.linalg.norm(lean, axis=1, keepdims=True)
    k = np.arange(segments)
    over = k + segments + 1
    lower_half, upper_half = np.stack([k, k + 1, over + 1], 1), np.stack([k, over + 1, over], 1)
    return Mesh(
        points=np.concatenate([base + radius * out, top + upper * out]),
        triangles=np.concatenate([lower_half] * (radius > 0) + [upper_half] * (upper > 0)),
        uvs=np.concatenate([np.column_stack([around, np.full(segments + 1, v)]) for v in (0, length / tile)]),
        normals=np.concatenate([lean, lean]),
    )


def widest_corner_first(points: Floats, triangles: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return triangles that begin opposite their longest edge: slender ones need little room for light.

    >>> widest_corner_first(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[1, 2, 0]])).tolist()
    [[0, 1, 2]]
    """
    corners = points[triangles]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2)
    order = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(triangles, order, axis=1)


def projected(corners: Floats, facing: Floats) -> Floats:
    """Return how far corners lie along and up their surface [m]: walls upright, floors with y up.

    Parameters
    ----------
    corners : array, (n, k, 3)
        Of flat pieces [m].
    facing : array, (n, 3)
        Unit normals of the pieces.

    Returns
    -------
    array, (n, k, 2)
        Neighbouring walls continue each other, no matter where their corners are.

    >>> wall = np.array([[[5.0, 0, 0], [7, 0, 0], [7, 0, 3]]])
    >>> projected(wall, np.array([[0, -1.0, 0]])).tolist()
    [[[5.0, 0.0], [7.0, 0.0], [7.0, 3.0]]]
    """
    flat = np.abs(facing[:, 2]) > 0.9
    u = np.where(
        flat[:, None],
        np.array([1.0, 0, 0]),
        np.stack([-facing[:, 1], facing[:, 0], np.zeros(len(facing))], axis=1),
    )
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = at_right_angles(facing, u)
    return np.stack([np.einsum("nkj,nj->nk", corners, axis) for axis in (u, v)], axis=2)
