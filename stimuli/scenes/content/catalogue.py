"""The scenes and the walks through them, by name or from files. A new scene gets a line in `SCENES`."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import read_text
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.camera_path_file import path_from_text
from evenlight.stimuli.scenes.engine.scene import SEED, Scene
from evenlight.stimuli.scenes.gltf.gltf_file import SUFFIXES, read_gltf, sha256_of_gltf

PATHS = Path(__file__).parent / "paths"
# Module within this folder and function that build each, for a seed.
SCENES = {"house": ("house.house", "house"), "school": ("school.school", "school")}


@lru_cache(maxsize=2)
def scene_named(name: str, seed: int = SEED) -> Scene:
    """Return a scene.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in SCENES:
        raise InputError(f"no scene {name!r}: there are {', '.join(SCENES)}")
    module, function = SCENES[name]
    build: Callable[[int], Scene] = getattr(
        importlib.import_module(f"evenlight.stimuli.scenes.content.{module}"), function
    )
    return build(seed)


def scene_of(path: CameraPath) -> Scene:
    """Return the scene that a path leads through, in the light that the path says.

    Raises
    ------
    InputError
        If it cannot be read, or nothing lights it.
    """
    if is_scene_file(path.scene):
        from evenlight.stimuli.scenes.gltf.texture_memory import with_images_that_fit

        scene = _scene_in(Path(path.scene), sha256_of_gltf(Path(path.scene)))
        scene = with_images_that_fit(scene, path)
    else:
        scene = scene_named(path.scene)
    scene = replace(scene, sky=path.sky or scene.sky, sun=path.sun or scene.sun)
    lit = scene.sun is not None or np.any([scene.sky.zenith, scene.sky.horizon])
    if not lit and not scene.patches.emission.any():
        raise InputError(
            f"{path.scene}: nothing lights it; give materials that emit light, a sun, or a sky in the path"
        )
    return scene


@lru_cache(maxsize=2)
def _scene_in(file: Path, sha256: str) -> Scene:
    """Return the scene of a file with some content."""
    from evenlight.stimuli.scenes.gltf.gltf_scene import scene_from_gltf

    return scene_from_gltf(read_gltf(file))


def is_scene_file(name: str) -> bool:
    """Return whether a name is that of a file with a scene.

    >>> is_scene_file("lab.glb"), is_scene_file("house")
    (True, False)
    """
    return name.lower().endswith(SUFFIXES)


def path_named(name: str, scene: str = "") -> CameraPath:
    """Return a path that comes with the scenes, or that of a file.

    Parameters
    ----------
    name : str
        Of the path, or a json file.
    scene : str
        Name or file of the scene, in place of the path's own, which may be a file beside the path. Only
        the path of a file leads through another scene.

    Raises
    ------
    InputError
        If there is none, or it cannot be used.
    """
    if scene and not name.endswith(".json"):
        raise InputError(f"{name}: need a camera path through {scene}, a .json file (docs/scenes.md)")
    file = Path(name) if name.endswith(".json") else PATHS / f"{name}.json"
    if name.endswith(".json") and not file.exists():
        raise InputError(f"{name}: there is no such camera path; give a .json file that is there")
    if not file.exists():
        known = ", ".join(sorted(p.stem for p in PATHS.glob("*.json") if "." not in p.stem))
        raise InputError(f"no camera path {name!r}: there are {known}")
    path = path_from_text(file.stem, read_text(file, "a camera path"), scene)
    if is_scene_file(path.scene):
        path = path if scene else replace(path, scene=str(file.parent / path.scene))
        if not Path(path.scene).is_file():
            raise InputError(f"camera path {path.name}: there is no scene {path.scene}; put the file there")
    elif path.scene not in SCENES:
        raise InputError(
            f"camera path {path.name}: need a scene among {', '.join(SCENES)}, or a file that ends in "
            f"{' or '.join(SUFFIXES)}, got {path.scene!r}"
        )
    return path
