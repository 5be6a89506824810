"""The patches of a scene as vertices and indices, and which of them a view shows.

They are cut into blocks. Those behind walls are left out: a small depth picture of the large surfaces shows
which ones are hidden. Of the others, patches that face away or lie outside the view are left out one by one,
and near ones are drawn first, so that what is behind them costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.scenes.engine.camera import FAR, NEAR
from evenlight.stimuli.scenes.engine.light.bake import Charts
from evenlight.stimuli.scenes.engine.scene import Floats, Patches, Scene
from evenlight.stimuli.scenes.engine.surface_detail import detail_coordinates

BLOCK = 4.0  # [m] of ground that a block covers
STOREY = 3.0  # [m] of height that a block covers
LARGE = 5.0  # [m] longer patches are blocks of their own kind, or small ones would be drawn with them
VERTEX = np.dtype(
    [
        ("position", "f4", 3),
        ("normal", "f2", 4),  # and the number of the room
        ("uv", "f4", 2),
        ("detail_at", "f4", 2),
        ("light_at", "f4", 2),
        ("tint", "f4", 3),
        ("material", "f4"),
    ]
)
LAYOUT = "3f4 4f2 2f4 2f4 2f4 3f4 1f4"
ATTRIBUTES = ("position", "normal", "uv", "detail_at", "light_at", "tint", "material")
SOLID, HOLED, BLENDED = 0, 1, 2  # drawn in this order
SHRUNK = 3  # the small picture has this fraction of the large one's width and height
SIDE, AREA = 0.7, 1.2  # [m], [m^2] patches of this size hide others
DEPTHS = 1024  # that patches are sorted by
SLACK = 0.02  # [m] a block is drawn although it is this far behind


@dataclass(frozen=True, eq=False)
class Blocks:
    """Runs of the patches in an order of their own, with the boxes around them."""

    order: NDArray[np.int64]  # (n,): the patches, block by block
    # (b,): which places in that order
    first: NDArray[np.int64]
    count: NDArray[np.int64]
    # (b, 3): corners of the boxes [m]
    low: Floats
    high: Floats
    kind: NDArray[np.int64]  # (b,): whether the surfaces are solid, have holes, or are blended


@dataclass(frozen=True, eq=False)
class Faces:
    """Where the patches are."""

    corners: Floats  # (n, 4, 3): the last one is unused by triangles [m]
    planes: Floats  # (n, 4): unit normal, and minus its product with a corner: positive in front [m]
    triangle: NDArray[np.bool_]  # (n,): whether the patch is a triangle

    def indices(self, patches: NDArray[np.int64]) -> NDArray[np.uint32]:
        """Return the indices of some patches' triangles."""
        corners = 4 * patches[:, None] + np.array([0, 1, 2, 1, 3, 2])
        kept = np.ones((len(patches), 6), dtype=bool)
        kept[self.triangle[patches], 3:] = False
        return np.asarray(corners[kept], dtype=np.uint32)


def faces_of(patches: Patches) -> Faces:
    """Return where patches are."""
    normal = np.cross(patches.along, patches.across)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)  # some have no area
    planes = np.column_stack([normal, -(normal * patches.origin).sum(axis=1)])
    return Faces(corners_of(patches.corners), planes, patches.triangle)


def vertices_of(scene: Scene, charts: Charts, faces: Faces) -> NDArray[np.void]:
    """Return the vertices: each patch has four, the last unused by triangles."""
    patches = scene.patches
    n = len(patches)
    vertices = np.zeros((n, 4), dtype=VERTEX)
    vertices["position"] = faces.corners
    vertices["normal"][..., :3] = corners_of(patches.normals)
    # Whole repeats are taken away, so that far from the origin no precision is lost.
    clamped = np.array([m.sampling.clamped if m.sampling else (False, False) for m in scene.materials])
    whole = np.where(clamped[patches.material, None], 0, np.floor(patches.uvs.mean(axis=1, keepdims=True)))
    vertices["uv"] = corners_of(patches.uvs - whole)
    vertices["detail_at"] = corners_of(detail_coordinates(scene))
    vertices["light_at"] = corners_of(charts.coordinates())
    vertices["tint"] = patches.tint[:, None] if patches.shades is None else corners_of(patches.shades)
    vertices["material"] = patches.material[:, None]
    return vertices.ravel()


def corners_of(corners: Floats) -> Floats:
    """Return corners with the one across from the first, (n, 4, k): origin, along, across, both."""
    last = corners[:, 1] + corners[:, 2] - corners[:, 0]
    return np.concatenate([corners, last[:, None]], axis=1)


def blocks_of(scene: Scene, faces: Faces) -> Blocks:
    """Return the blocks of a scene's patches."""
    kind = kinds_of(scene)
    whole = np.where(faces.triangle[:, None, None], faces.corners[:, [0, 1, 2, 2]], faces.corners)
    low, high = whole.min(axis=1), whole.max(axis=1)
    large = (high - low).max(axis=1) > LARGE
    cell = np.floor((low + high) / 2 / [BLOCK, BLOCK, STOREY]).astype(np.int64)
    cell[large] //= 4
    key = np.column_stack([kind, large, cell])
    _, block = np.unique(key, axis=0, return_inverse=True)
    block = block.ravel()
    order = np.argsort(block, kind="stable")
    edges = np.flatnonzero(np.diff(block[order], prepend=-1))
    return Blocks(
        order,
        edges,
        np.diff(edges, append=len(order)),
        np.minimum.reduceat(low[order], edges),
        np.maximum.reduceat(high[order], edges),
        kind[order][edges],
    )


def kinds_of(scene: Scene) -> NDArray[np.int64]:
    """Return of each patch whether it is `SOLID`, `HOLED` or `BLENDED`."""
    kinds = [BLENDED if m.blended else HOLED if m.cutout else SOLID for m in scene.materials]
    return np.array(kinds)[scene.patches.material]


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


def occluders(scene: Scene, faces: Faces) -> NDArray[np.uint32]:
    """Return the indices of triangles that hide what is behind them, for the scene's vertices."""
    patches = scene.patches
    wide, high = (np.linalg.norm(edge, axis=1) for edge in (patches.along, patches.across))
    chosen = (
        (np.minimum(wide, high) >= SIDE)
        & (wide * high >= AREA)
        & ~patches.triangle
        & (kinds_of(scene) == SOLID)
    )
    if not chosen.any():
        return np.zeros(3, dtype=np.uint32)  # a triangle without area
    return faces.indices(np.flatnonzero(chosen))


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
    return np.asarray(2 * FAR * NEAR / (FAR + NEAR - (2 * depth - 1) * (FAR - NEAR)), dtype=np.float32)


@compiled_loop(error_model="numpy")
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


@compiled_loop(error_model="numpy")
def _any_behind(distance, low_row, high_row, first, last, limit):
    for row in range(low_row, high_row + 1):
        for column in range(first, last + 1):
            if distance[row, column] >= limit:
                return True
    return False


def shown_first_to_last(
    faces: Faces, blocks: Blocks, chosen: NDArray[np.int64], matrix: Floats, eye: ArrayLike
) -> NDArray[np.int64]:
    """Return the patches of some blocks that a view may show, roughly from the nearest to the farthest.

    Parameters
    ----------
    faces : Faces
        Where they are.
    blocks : Blocks
        Of the scene.
    chosen : array of int, (b,)
        Which blocks, all of one kind; those with holes are seen from both sides.
    matrix : array, (4, 4)
        From the scene to clip space.
    eye : array_like, (3,)
        Where one looks from [m].
    """
    runs = np.column_stack([blocks.first[chosen], blocks.count[chosen]])
    patches = _run_by_run(blocks.order, runs)
    eye = np.append(np.asarray(eye, dtype=float), 1.0)
    if len(chosen) and blocks.kind[chosen[0]] == HOLED:
        eye[:] = np.nan  # in front of nothing, and behind nothing
    depth = _depths(faces.corners, faces.planes, faces.triangle, patches, matrix, eye)
    return np.asarray(patches[np.argsort(depth, kind="stable")[np.count_nonzero(depth < 0) :]])


@compiled_loop()
def _run_by_run(order, runs):
    found = np.empty(runs[:, 1].sum(), np.int64)
    n = 0
    for first, count in runs:
        found[n : n + count] = order[first : first + count]
        n += count
    return found


@compiled_loop(error_model="numpy")
def _depths(corners, planes, triangle, patches, matrix, eye):
    """Return how far patches reach, from 0 to DEPTHS - 1, or -1 for those that are not seen."""
    depths = np.empty(len(patches), np.int16)
    for k, patch in enumerate(patches):
        depths[k] = -1
        p = planes[patch]
        if p[0] * eye[0] + p[1] * eye[1] + p[2] * eye[2] + p[3] <= 0:
            continue
        outside, farthest = 31, 0.0
        for corner in range(3 if triangle[patch] else 4):
            x, y, z = corners[patch, corner]
            across = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]
            up = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]
            w = matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z + matrix[3, 3]
            outside &= (across < -w) + 2 * (across > w) + 4 * (up < -w) + 8 * (up > w) + 16 * (w < NEAR)
            farthest = max(farthest, w)
        if outside == 0:
            depths[k] = int(np.sqrt(min(farthest / FAR, 1.0)) * (DEPTHS - 1))
    return depths
