"""The sun's view of a scene: sharp shadows are looked up in a depth picture of what the sun sees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evenlight.stimuli.scenes.engine.scene import Floats, Scene, direction_of

if TYPE_CHECKING:
    import moderngl

SHADOW_SIZE = 4096  # [texels]


def sun_matrix(scene: Scene) -> Floats:
    """Return the matrix from the scene to the sun's picture, clip space, for columns, (4, 4).

    It covers three corners of every patch: of one that reaches far beyond all others, such as the ground, the
    fourth corner may lie outside, and has no shadows.
    """
    assert scene.sun is not None
    ahead = -scene.sun.direction()
    right = direction_of(scene.sun.azimuth - 90, 0.0)
    axes = np.stack([right, np.cross(right, ahead), ahead])
    patches = scene.patches
    points = np.concatenate([patches.origin, patches.origin + patches.along, patches.origin + patches.across])
    seen = points @ axes.T
    low, high = seen.min(axis=0) - 0.1, seen.max(axis=0) + 0.1
    matrix = np.eye(4)
    matrix[:3, :3] = axes * (2 / (high - low))[:, None]
    matrix[:3, 3] = -(high + low) / (high - low)
    return matrix


def texel_size(matrix: Floats) -> float:
    """Return the larger side of a texel of the sun's picture [m]."""
    return float((2 / np.linalg.norm(matrix[:2, :3], axis=1)).max() / SHADOW_SIZE)


def lookup_matrix(matrix: Floats) -> Floats:
    """Return the matrix from the scene to texture coordinates and depth in [0, 1]."""
    return np.asarray(np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]]) @ matrix)


def empty_shadow_map(context: moderngl.Context) -> moderngl.Texture:
    """Return a depth texture for the lookup of shadows that says that all is lit."""
    depth = context.depth_texture((1, 1), np.ones(1, dtype="f4").tobytes())
    depth.compare_func = "<="
    return depth
