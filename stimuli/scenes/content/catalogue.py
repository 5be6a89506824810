"""The scenes and the walks through them, by name or from files. A new scene gets a line in `SCENES`."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.storage.text_files import read_text
from evenlight.progress import note
from evenlight.stimuli.scenes.engine.camera import EYE_HEIGHT
from evenlight.stimuli.scenes.engine.camera_path import CameraPath, Keypoint, on_ground
from evenlight.stimuli.scenes.engine.camera_path_file import path_from_text
from evenlight.stimuli.scenes.engine.scene import SEED, Scene, Vector
from evenlight.stimuli.scenes.gltf.gltf_file import SUFFIXES, read_gltf, sha256_of_gltf
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW

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


def scene_searched(name: str) -> Scene:
    """Return the scene of a search: a built-in one by name, or that of the file of a path."""
    return scene_of(path_named(name)) if name.endswith(".json") else scene_named(name)


def files_sha256(path: CameraPath) -> str:
    """Return the SHA-256 of a path and of the files of its scene; of a built-in one the name counts."""
    scene = sha256_of_gltf(Path(path.scene)) if is_scene_file(path.scene) else path.scene
    return sha256_of_bytes(f"{scene} {path.text}".encode())


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
    if not file.exists():
        known = ", ".join(sorted(p.stem for p in PATHS.glob("*.json") if "." not in p.stem))
        raise InputError(f"no camera path {name!r}: there are {known}; or give a .json file that is there")
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


def is_walk_file(name: str) -> bool:
    """Return whether a name is that of a file with a scene, or with a camera path through one."""
    return is_scene_file(name) or name.endswith(".json")


@lru_cache(maxsize=1)
def scene_to_walk(name: str) -> tuple[Scene, CameraPath | None]:
    """Return a scene with its ground by name or file, and the path that a file's walk begins on.

    Raises
    ------
    InputError
        If there is no such scene or path, or no ground in it.
    """
    if not is_walk_file(name):
        return scene_named(name), None
    from evenlight.stimuli.scenes.engine.light.found_ground import found_ground
    from evenlight.stimuli.scenes.gltf.gltf_differences import tell_differences

    if is_scene_file(name):
        ground = found_ground(_scene_in(Path(name), sha256_of_gltf(Path(name))))
        x, y, floor = ground.middle
        path = _turning(name, (x, y, floor + EYE_HEIGHT))
        scene = replace(scene_of(path), walkable=(ground,))
    else:
        path = path_named(name)
        scene, eyes = scene_of(path), [point.position for point in path.keypoints]
        scene = replace(scene, walkable=path.walkable or scene.walkable or (found_ground(scene, eyes),))
    tell_differences(scene, path, FIELD_OF_VIEW)
    if off := [point.name for point in path.keypoints if not on_ground(point.position, scene)]:
        where = "nowhere on it: begins in its middle" if len(off) == len(path.keypoints) else ", ".join(off)
        note(f"{path.name}: keypoints that are not over the ground to walk on: {where}")
    return scene, path


def _turning(file: str, eye: Vector) -> CameraPath:
    """Return a path that turns round on the spot, for what is seen from there."""
    points = tuple(Keypoint(f"{k}", float(k), eye, 90.0 * k, 0.0) for k in range(5))
    return CameraPath(Path(file).stem, file, 4.0, points)
