"""Where one may walk in a scene that does not say so, found by rays on a grid of columns.

A piece of floor faces up, is no steeper than 35 degrees and has `HEADROOM` over it. It is joined to the next
where the step is low enough and no wall between. About 0.2 m are kept from where it is joined to none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.scenes.engine.camera_path import HIGHEST_EYE, LOWEST_EYE
from evenlight.stimuli.scenes.engine.light.ray_tree import DEPTH, blocker, nearest, ray_tree
from evenlight.stimuli.scenes.engine.scene import Floats, Scene, Vector

CELL = 0.1  # [m] of the grid
KEPT_AWAY = 2  # cells, from walls and edges: 0.15 to 0.25 m
WIDEST = 100.0  # [m] each way that are looked at
STEEPEST = 0.819  # cosine of 35 degrees
HEADROOM, STEP = 2.0, 0.25  # [m] over a floor, and up to the next
TOUCHING = 0.03  # [m] surfaces so near are one, such as a rug and the floor
WALLS_MET = np.arange(0.3, HEADROOM, 0.3)  # [m] over the floor


@dataclass(frozen=True, eq=False)
class FoundGround:
    """Pieces of floor, `CELL` wide, that one can walk to from each other.

    Attributes
    ----------
    corner : array, (2,)
        Of the grid, in the south-west [m].
    first : array of int, (columns east, columns north + 1)
        Which pieces are those of a column: from its own entry to the next one's.
    height, slope : arrays, (n,) and (n, 2)
        Of the pieces in their middle [m], and their slopes east and north.
    walkable : array of bool, (n,)
        Which of them one may stand on.
    middle : (float, float, float)
        The place on it that is farthest from all walls [m], under a roof if there is one.
    """

    corner: Floats
    first: NDArray[np.int64]
    height: Floats
    slope: Floats
    walkable: NDArray[np.bool_]
    middle: Vector

    def heights(self, x: float, y: float, margin: float = 0.0) -> list[float]:
        """Return the heights of the floors at a point, of each storey [m]; pieces need no margin to join."""
        return [height for _, height in self.pieces(x, y)]

    def pieces(self, x: float, y: float) -> list[tuple[int, float]]:
        """Return which pieces lie over each other at a point, and how high they are there [m]."""
        east, north = (np.array([x, y]) - self.corner) / CELL
        i, j = math.floor(east), math.floor(north)
        if not (0 <= i < self.first.shape[0] and 0 <= j < self.first.shape[1] - 1):
            return []
        here = np.arange(self.first[i, j], self.first[i, j + 1])
        here = here[self.walkable[here]]
        rise = self.slope[here] @ [east - i - 0.5, north - j - 0.5] * CELL
        return list(zip(here.tolist(), (self.height[here] + rise).tolist(), strict=True))


def found_ground(scene: Scene, eyes: Sequence[Vector] = ()) -> FoundGround:
    """Return the ground of a scene that is under the first of some eyes [m] that has one under it.

    Without, it is the largest, under a roof if any is.

    Raises
    ------
    InputError
        If there is no floor to walk on.
    """
    from scipy.ndimage import distance_transform_cdt
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    patches = scene.patches
    low, high = patches.corners.min(axis=(0, 1)), patches.corners.max(axis=(0, 1))
    inside = (eye[:2] for eye in eyes if (low[:2] <= eye[:2]).all() and (eye[:2] <= high[:2]).all())
    around = np.array(next(inside, (low + high)[:2] / 2))
    # Walls often stand at round numbers; columns do not.
    corner = np.maximum(low[:2], around - WIDEST / 2) - 0.37 * CELL
    size = np.ceil((np.minimum(high[:2], around + WIDEST / 2) - corner) / CELL).astype(int).clip(0)
    facing = np.cross(patches.along, patches.across)
    level = facing[:, 2] >= STEEPEST * np.linalg.norm(facing, axis=1)
    tree, floors = (ray_tree(patches, stops) for stops in (np.ones(len(patches)), level.astype(float)))
    first, height, roofed = _floors(tree, floors, scene.holed(), corner, high[2] + 1, size)
    links = _links(tree, first, height, corner)
    whole = links >= 0
    beside = whole[links[:, :2], 2:] & whole[links[:, 2:], :2]  # which tells of the end of a thin wall
    free = whole.all(axis=1) & beside.all(axis=(1, 2))
    for _ in range(KEPT_AWAY - 1):
        free = free & free[links].all(axis=1)
    if not free.any():
        raise InputError(
            f"{scene.name}: found no floor to walk on: need one that faces up, level, with {HEADROOM:g} m of "
            "room over it; or say where it is as `walkable` in a camera path"
        )
    both = (links >= 0) & free[:, None] & free[links]
    joined = coo_array((np.ones(both.sum()), (np.nonzero(both)[0], links[both])), shape=(len(free),) * 2)
    part = connected_components(joined, directed=False)[1]
    for _ in range(2):  # steps become slopes
        height = (height + np.where(links >= 0, height[links], height[:, None]).sum(axis=1)) / 5
    slope = (height[links[:, ::2]] - height[links[:, 1::2]]) / (2 * CELL)
    ground = FoundGround(corner, first, height, slope, free, (0.0, 0.0, 0.0))
    inner = free & roofed if (free & roofed).any() else free
    under = [
        k for x, y, z in eyes for k, floor in ground.pieces(x, y) if LOWEST_EYE <= z - floor <= HIGHEST_EYE
    ]
    mine = part == (part[under[0]] if under else np.argmax(np.bincount(part[inner])))
    inner = inner & mine if (inner & mine).any() else free & mine
    storey = np.quantile(height[inner], 0.5, method="nearest")
    inner &= np.abs(height - storey) < HEADROOM / 2
    column = np.searchsorted(first.ravel(), np.arange(len(free)), side="right") - 1
    open_ = np.zeros(first.size, dtype=bool)
    open_[column[inner]] = True
    away = distance_transform_cdt(np.pad(open_.reshape(first.shape), 1))[1:-1, 1:-1].ravel()
    k = int(np.argmax(np.where(inner, away[column], -1)))
    place = np.array(np.unravel_index(column[k], first.shape))
    x, y = (corner + (place + 0.5) * CELL).tolist()
    return replace(ground, walkable=free & mine, middle=(x, y, float(height[k])))


@compiled_loop(error_model="numpy")
def _floors(tree, floors, holed, corner, top, size):
    """Return the first piece of each column, and height and whether there is a roof over each piece."""
    first = np.zeros((size[0], size[1] + 1), np.int64)
    heights, roofed, stack = [top for _ in range(0)], [False for _ in range(0)], np.empty((2, DEPTH))
    zero, one = np.float32(0), np.float32(1)
    for i in range(size[0]):
        for j in range(size[1]):
            first[i, j] = len(heights)
            x, y = np.float32(corner[0] + (i + 0.5) * CELL), np.float32(corner[1] + (j + 0.5) * CELL)
            z = top
            while True:
                k, distance, _, _ = nearest(floors, x, y, np.float32(z), zero, zero, -one, -1, 0, stack)
                if k < 0:
                    break
                z -= distance + TOUCHING
                over = np.float32(z + 2 * TOUCHING)
                k, room, _, _ = nearest(tree, x, y, over, zero, zero, one, -1, 0, stack)
                if k < 0 or room + TOUCHING >= HEADROOM:
                    heights.append(z + TOUCHING)
                    roofed.append(k >= 0 and not holed[tree.patch[k]])
        first[i, size[1]] = len(heights)
    return first, np.array(heights), np.array(roofed)


@compiled_loop(error_model="numpy")
def _links(tree, first, height, corner):
    """Return which pieces are joined to each, (n, 4): in the east, west, north and south; -1 for none."""
    links, stack = np.full((len(height), 4), -1), np.empty((2, DEPTH))
    zero, cell = np.float32(0), np.float32(CELL)
    for i in range(first.shape[0]):
        for j in range(first.shape[1] - 1):
            x, y = np.float32(corner[0] + (i + 0.5) * CELL), np.float32(corner[1] + (j + 0.5) * CELL)
            for side in range(2):
                east, north = i + 1 - side, j + side
                if east == first.shape[0] or north == first.shape[1] - 1:
                    continue
                for a in range(first[i, j], first[i, j + 1]):
                    for b in range(first[east, north], first[east, north + 1]):
                        if abs(height[a] - height[b]) > STEP:
                            continue
                        free = True
                        for over in WALLS_MET:
                            z = np.float32(max(height[a], height[b]) + over)
                            dx, dy = np.float32(1 - side), np.float32(side)
                            free = free and (
                                blocker(tree, x, y, z, dx, dy, zero, cell, -1, -1, 0, -1, stack) < 0
                            )
                        if free:
                            links[a, 2 * side], links[b, 2 * side + 1] = b, a
    return links
