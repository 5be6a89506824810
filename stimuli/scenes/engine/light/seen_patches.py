"""Which patches of a scene the views along a path show, by rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.light.ray_tree import DEPTH, nearest, ray_tree
from evenlight.stimuli.scenes.engine.scene import Floats, Scene
from evenlight.stimuli.scenes.engine.vertices import faces_of

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
        met = _met(tree._replace(coverage=facing), np.array(camera.position, np.float32), rays.astype("f4"))
        found.append(met)
    return np.concatenate(found)


@compiled_loop(error_model="numpy")
def _met(tree, eye, rays):
    """Return which patch each ray meets first, -1 for none."""
    met, stack = np.full(len(rays), -1), np.empty((2, DEPTH))
    for i in range(len(rays)):
        x, y, z = rays[i]
        k = nearest(tree, eye[0], eye[1], eye[2], x, y, z, -1, i, stack)[0]
        if k >= 0:
            met[i] = tree.patch[k]
    return met
