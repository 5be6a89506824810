"""How large the images of a scene may be on the graphics card: as they are, while they fit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine.camera import NEAR
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.scene import Difference, Floats, Sampling, Scene

MOST_TEXELS = 1 << 27  # of all images of a scene: 512 MiB (768 with normal maps), a third more for copies
LARGEST_SIDE = 8192  # [texels] that all graphics cards take


def with_images_that_fit(scene: Scene, path: CameraPath) -> Scene:
    """Return a scene whose images fit into memory, those that are made smaller among its differences.

    That one is halved, again and again, of which the path shows most texels per degree from nearest.
    """
    sizes = np.array([m.sampling.size if m.sampling else (1, 1) for m in scene.materials])
    uneven = [(1, 1) if m.relief is None else m.relief.shape[1::-1] for m in scene.materials]
    sizes = np.maximum(sizes, uneven)
    given, finest = sizes.copy(), np.zeros(0)
    while sizes.prod(axis=1).sum() > MOST_TEXELS or sizes.max() > LARGEST_SIDE:
        finest = finest if len(finest) else _texels_per_degree(scene, path, sizes)
        k = np.argmax(
            np.where(sizes.max(axis=1) > LARGEST_SIDE, np.inf, np.where(sizes.max(axis=1) > 1, finest, 0))
        )
        sizes[k], finest[k] = np.maximum(sizes[k] // 2, 1), finest[k] / 2
    materials, unlike = list(scene.materials), list(scene.unlike)
    for k in np.flatnonzero((sizes != given).any(axis=1)):
        (w, h), relief = sizes[k].tolist(), materials[k].relief
        own = materials[k].sampling or Sampling((1, 1))
        smaller = replace(own, size=(min(own.size[0], w), min(own.size[1], h)))
        if relief is not None:
            relief = _smaller(relief, (min(relief.shape[1], w), min(relief.shape[0], h)))
        materials[k] = replace(materials[k], sampling=smaller, relief=relief)
        was = f"an image of {given[k, 0]}x{given[k, 1]} made smaller, {w}x{h}, to fit into memory"
        where = np.flatnonzero(scene.patches.material == k)
        unlike.append(Difference(f"{was} ({finest[k]:.3g} texels/°)", own.image, where))
    return replace(scene, materials=tuple(materials), unlike=tuple(unlike))


def _smaller(relief: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    from PIL import Image

    both = [Image.fromarray(relief[..., k]).resize(size, Image.Resampling.BOX) for k in range(2)]
    return np.stack([np.asarray(one) for one in both], axis=2)


def _texels_per_degree(scene: Scene, path: CameraPath, sizes: np.ndarray) -> Floats:
    """Return the texels per degree of each material's image where the path comes nearest, (m,)."""
    patches = scene.patches
    area = np.linalg.norm(np.cross(patches.along, patches.across), axis=1)
    repeats = np.abs(np.linalg.det(patches.uvs[:, 1:] - patches.uvs[:, :1]))
    middle, away = patches.along + patches.across, np.full(len(patches), np.inf)
    for time in np.linspace(0, path.duration, 64):
        eye = path.position(float(time))
        away = np.minimum(away, np.linalg.norm(patches.origin + middle / 2 - eye, axis=1))
    away = np.maximum(away - np.linalg.norm(middle, axis=1) / 2, NEAR)
    texels = np.sqrt(repeats * sizes.prod(axis=1)[patches.material] / area)  # for each metre
    found = np.full(len(sizes), np.inf)
    np.minimum.at(found, patches.material, texels * away * math.pi / 180)
    return found
