"""Which patches of a scene the views along a path show, by rays."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.light.ray_tree import DEPTH, RayTree, nearest, ray_tree
from evenlight.stimuli.scenes.engine.scene import Floats, Patches, Scene, Vector
from evenlight.stimuli.scenes.engine.vertices import faces_of

NOTHING = -1  # in place of a patch: the sky
VIEWS, RAYS = 24, (64, 36)  # along a path, and of each view


def seen_along(scene: Scene, path: CameraPath, field_of_view: float, stopped: Floats) -> NDArray[np.int64]:
    """Return which patch each ray of a path's views meets, -1 for the sky.

    `stopped` is the share of rays that each patch stops, (n,), unless it faces away.
    """
    tree, planes = ray_tree(scene.patches, stopped), faces_of(scene.patches).planes
    across, up = np.meshgrid(*((np.arange(count) + 0.5) / count for count in RAYS))
    found = []
    for time in np.linspace(0, path.duration, VIEWS):
        camera = path.camera(float(time), field_of_view)
        left, right, down, top = camera.tangents(RAYS)
        x, y = left + (right - left) * across.ravel(), down + (top - down) * up.ravel()
        rays = np.column_stack([x, y, np.ones_like(x)]) @ camera.axes()
        away = (planes @ [*camera.position, 1.0] < 0) & ~scene.holed()
        facing = np.where(away, 0, stopped)[tree.patch].astype(np.float32)
        eyes = np.tile(camera.position, (len(rays), 1))
        found.append(met(tree._replace(coverage=facing), eyes, rays)[0])
    return np.concatenate(found)


def met_from(patches: Patches, position: Vector, directions: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return how far away the patches are that rays of length 1 from a point meet first, and which.

    Back sides are met too, and holes. For nothing that is infinity, and `NOTHING`.
    """
    rays = np.asarray(directions, dtype=float)
    found, distances = met(_solid(patches), np.tile(position, (len(rays), 1)), rays)
    return distances, found


@lru_cache(maxsize=2)
def _solid(patches: Patches) -> RayTree:
    return ray_tree(patches, np.ones(len(patches)))


def met(tree: RayTree, eyes: Floats, rays: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return which patch each ray meets first, -1 for none, and how far away, in lengths of the ray."""
    patches, away = _met(tree, eyes.astype(np.float32), rays.astype(np.float32))
    return patches, away


@compiled_loop(error_model="numpy")
def _met(tree, eyes, rays):
    patches, away, stack = np.full(len(rays), -1), np.full(len(rays), np.inf), np.empty((2, DEPTH))
    for i in range(len(rays)):
        ox, oy, oz = eyes[i]
        x, y, z = rays[i]
        k, distance, _, _ = nearest(tree, ox, oy, oz, x, y, z, -1, i, stack)
        if k >= 0:
            patches[i], away[i] = tree.patch[k], distance
    return patches, away
