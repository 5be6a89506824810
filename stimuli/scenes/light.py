"""The light of a scene as a picture, kept in the user's cache between runs."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes import bake
from evenlight.stimuli.scenes.charts import Charts, texels_of
from evenlight.stimuli.scenes.definition import light_sources
from evenlight.stimuli.scenes.kept_files import keep, kept, one_at_a_time
from evenlight.stimuli.scenes.light_quality import Quality
from evenlight.stimuli.scenes.material_textures import MaterialTextures
from evenlight.stimuli.scenes.scene import Floats, Scene


def light_picture(
    scene: Scene, charts: Charts, textures: MaterialTextures, quality: Quality | None
) -> NDArray[np.float16]:
    """Return the light on all surfaces, (height, width, 3): the luminance of white paper [cd/m^2].

    Without a quality it is a mere guess, brighter from above: for a quick look.
    """
    surfaces = textures.albedo, textures.coverage
    if quality is None:
        light = _guess(scene, charts)
    else:
        group = f"light-{scene.name}-{quality.name.lower()}"
        name = f"{group}-{_key(scene, surfaces, quality)}"
        with one_at_a_time(group):
            stored = _fitting(kept(name), int((charts.columns * charts.rows).sum()))
            if stored is None:
                stored = bake.baked(scene, charts, surfaces, quality).astype(np.float16)
                keep(name, stored, instead_of=f"{group}-*")
            light = stored
    texels = texels_of(scene.patches, charts)
    picture = np.zeros((charts.size[1], charts.size[0], 3), dtype=np.float16)
    picture[charts.top[texels.patch] + texels.row, charts.left[texels.patch] + texels.column] = light
    return picture


def _guess(scene: Scene, charts: Charts) -> NDArray[np.float16]:
    """Return light that depends on the direction of surfaces alone."""
    texels, patches = texels_of(scene.patches, charts), scene.patches
    normal = patches.normals[texels.patch, 0]
    light = (15 + 9 * normal[:, 2:] + 3 * normal[:, :1] + 1.5 * normal[:, 1:2]) * np.ones(3)
    own = patches.emission[texels.patch]
    return np.where(own.any(axis=1, keepdims=True), own, light).astype(np.float16)


def _key(scene: Scene, surfaces: tuple[Floats, Floats], quality: Quality) -> str:
    """Return the SHA-256 of all that the light depends on."""
    patches = scene.patches
    digest = hashlib.sha256(repr((quality.name, quality.value, scene.sun, scene.sky)).encode())
    for file in light_sources():
        digest.update(file.read_bytes())
    for array in (
        patches.origin, patches.along, patches.across, patches.triangle, patches.normals, patches.material,
        patches.tint, patches.emission, scene.windows, *surfaces,
    ):  # fmt: skip
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _fitting(light: NDArray[Any] | None, texels: int) -> NDArray[np.float16] | None:
    """Return what was kept, if it is the light of so many texels."""
    if light is None or light.shape != (texels, 3) or light.dtype != np.float16:
        return None
    return light if np.isfinite(light).all() else None
