"""The patches of a scene as vertices and indices, cut into blocks that are drawn or left out as a whole.

Blocks behind walls are left out: a small depth picture of the large surfaces shows which ones are hidden.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.camera import FAR, NEAR
from evenlight.stimuli.scenes.light.bake import Charts
from evenlight.stimuli.scenes.scene import Floats, Patches, Scene

BLOCK = 4.0  # [m] of ground that a block covers
STOREY = 3.0  # [m] of height that a block covers
LARGE = 5.0  # [m] longer patches are blocks of their own kind, or small ones would be drawn with them
VERTEX = np.dtype(
    [
        ("position", "f4", 3),
        ("normal", "f2", 4),
        ("uv", "f4", 2),
        ("light_at", "f4", 2),
        ("tint", "f4", 3),
        ("material", "f4"),
    ]
)
LAYOUT = "3f4 3f2 2x1 2f4 2f4 3f4 1f4"
ATTRIBUTES = ("position", "normal", "uv", "light_at", "tint", "material")
SHRUNK = 3  # the small picture has this fraction of the large one's width and height
SIDE, AREA = 0.7, 1.2  # [m], [m^2] patches of this size hide others
SLACK = 0.02  # [m] a block is drawn although it is this far behind


@dataclass(frozen=True, eq=False)
class Blocks:
    """Runs of the index buffer, with the boxes around them.

    Attributes
    ----------
    first, count : arrays of int, (b,)
        Which indices.
    low, high : arrays, (b, 3)
        Corners of the boxes [m].
    cutout : array of bool, (b,)
        Whether the surfaces have holes.
    """

    first: NDArray[np.int64]
    count: NDArray[np.int64]
    low: Floats
    high: Floats
    cutout: NDArray[np.bool_]


def buffers_of(scene: Scene, charts: Charts) -> tuple[NDArray[np.void], NDArray[np.uint32], Blocks]:
    """Return vertices, indices and blocks: each patch has four vertices, the last unused by triangles."""
    patches = scene.patches
    n = len(patches)
    vertices = np.zeros((n, 4), dtype=VERTEX)
    corners = np.stack([np.zeros_like(patches.origin), patches.along, patches.across], axis=1)
    corners += patches.origin[:, None]
    vertices["position"] = _fourth(corners)
    vertices["normal"][..., :3] = _fourth(patches.normals)
    # Whole repeats are taken away, so that far from the origin no precision is lost.
    vertices["uv"] = _fourth(patches.uvs - np.floor(patches.uvs.mean(axis=1, keepdims=True)))
    vertices["light_at"] = _fourth(charts.coordinates())
    vertices["tint"] = patches.tint[:, None]
    vertices["material"] = patches.material[:, None]
    order, blocks = _blocks(scene, corners)
    indices = 4 * order[:, None] + np.array([0, 1, 2, 1, 3, 2])
    kept = np.ones((n, 6), dtype=bool)
    kept[patches.triangle[order], 3:] = False
    return vertices.ravel(), indices[kept].astype(np.uint32), blocks


def _fourth(corners: Floats) -> Floats:
    """Return corners with the one across from the first, (n, 4, k): origin, along, across, both."""
    last = corners[:, 1] + corners[:, 2] - corners[:, 0]
    return np.concatenate([corners, last[:, None]], axis=1)


def _blocks(scene: Scene, corners: Floats) -> tuple[NDArray[np.int64], Blocks]:
    """Return the order of the patches block by block, and the blocks."""
    patches: Patches = scene.patches
    cutout = scene.holed()
    four = _fourth(corners)
    whole = np.where(patches.triangle[:, None, None], four[:, [0, 1, 2, 2]], four)
    low, high = whole.min(axis=1), whole.max(axis=1)
    large = (high - low).max(axis=1) > LARGE
    cell = np.floor((low + high) / 2 / [BLOCK, BLOCK, STOREY]).astype(np.int64)
    cell[large] //= 4
    key = np.column_stack([cutout, large, cell])
    _, block = np.unique(key, axis=0, return_inverse=True)
    block = block.ravel()
    order = np.argsort(block, kind="stable")
    edges = np.flatnonzero(np.diff(block[order], prepend=-1))
    sizes = np.where(patches.triangle, 3, 6)[order]
    count = np.add.reduceat(sizes, edges)
    return order, Blocks(
        np.concatenate([[0], np.cumsum(count)[:-1]]),
        count,
        np.minimum.reduceat(low[order], edges),
        np.maximum.reduceat(high[order], edges),
        cutout[order][edges],
    )


def in_view(blocks: Blocks, matrix: Floats) -> NDArray[np.int64]:
    """Return the blocks that a view may show, nearest first.

    Parameters
    ----------
    blocks : Blocks
        Of the scene.
    matrix : array, (4, 4)
        From the scene to clip space.
    """
    planes = np.concatenate([matrix[3] + matrix[:3], matrix[3] - matrix[:3]])
    # The corner of each box that is farthest along a plane's normal decides.
    farthest = np.where(planes[:, None, :3] > 0, blocks.high, blocks.low)
    seen = ((farthest * planes[:, None, :3]).sum(axis=2) + planes[:, 3:] >= 0).all(axis=0)
    nearest = np.where(matrix[3, :3] > 0, blocks.low, blocks.high) @ matrix[3, :3]
    chosen = np.flatnonzero(seen)
    return chosen[np.argsort(nearest[chosen], kind="stable")]


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
