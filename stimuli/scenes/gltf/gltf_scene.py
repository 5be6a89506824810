"""A scene from a glTF file: its surfaces and lamps in our coordinates, to be lit by us.

glTF counts in metres with y up; here z is up: (x, y, z) there is (x, -z, y) here, as in Blender.
"""

from __future__ import annotations

import json
import re
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.engine.camera_path_file import light_in
from evenlight.stimuli.scenes.engine.scene import SEED, Patches, Scene, Sky
from evenlight.stimuli.scenes.gltf.gltf_file import GltfFile, in_one_line
from evenlight.stimuli.scenes.gltf.gltf_materials import Surfaces
from evenlight.stimuli.scenes.gltf.gltf_meshes import other_sides, patches_of, together

if TYPE_CHECKING:
    import trimesh

SMALLEST, LARGEST = 0.5, 2000.0  # [m] longest side of a scene
MOST_TRIANGLES = 1_000_000
MOST_LAMPS = 5_000  # luminous pieces: the bake looks for each of them from everywhere


def scene_from_gltf(file: GltfFile) -> Scene:
    """Return the scene of a file (docs/scenes.md says what is read).

    Raises
    ------
    InputError
        If there is nothing to be seen in it, or something that cannot be used.
    """
    with in_one_line(file.path):
        loaded, surfaces = _loaded(file), Surfaces(file)
        patches = _patches(file, loaded, surfaces)
        scenes = file.header.get("scenes", [{}])
        ours = (scenes[file.header.get("scene", 0)].get("extras") or {}).get("evenlight", {})
        sky, sun = light_in(ours)
        windows = np.asarray(ours.get("windows", ()), dtype=float).reshape(-1, 4, 3)
        if not (np.abs(windows) <= LARGEST).all():
            raise ValueError(f"need windows at most {LARGEST:g} m away")
    name = re.sub(r"[^\w .-]", "_", file.path.name)
    return Scene(name, SEED, patches, surfaces.materials(), windows, sun, sky or Sky(), (), ())


def _loaded(file: GltfFile) -> trimesh.Scene:
    """Return meshes and where they stand, read by trimesh.

    It is told numbers instead of names, and that all attributes are of our own making: then it hands them
    over as they are, where it would round colours to 8 bits and flip whole-numbered coordinates wrongly.
    """
    import trimesh

    header = json.loads(json.dumps(file.header))
    paints = [material.get("pbrMetallicRoughness", {}) for material in header.get("materials", ())]
    texcoords = [f"TEXCOORD_{paint.get('baseColorTexture', {}).get('texCoord', 0)}" for paint in paints]
    header["materials"] = [{"name": str(k)} for k in range(len(texcoords))]
    for key in ("images", "textures", "cameras", "animations", "skins"):
        header.pop(key, None)
    header["buffers"] = [{"uri": str(k)} for k in range(len(file.buffers))]
    for k, node in enumerate(header.get("nodes", ())):
        node["name"] = str(k)
        node.pop("camera", None)
    for k, mesh in enumerate(header.get("meshes", ())):
        mesh["name"] = str(k)
        for primitive in mesh["primitives"]:
            texcoord = texcoords[primitive["material"]] if "material" in primitive else ""
            kept = primitive["attributes"]
            primitive["attributes"] = {"POSITION": kept["POSITION"]} | {
                f"_{name}": kept[name] for name in ("NORMAL", "COLOR_0", texcoord) if name in kept
            }
    resolver = {str(k): data for k, data in enumerate(file.buffers)}
    text = json.dumps(header).encode()
    return trimesh.load_scene(BytesIO(text), file_type="gltf", resolver=resolver, process=False)


def _patches(file: GltfFile, loaded: trimesh.Scene, surfaces: Surfaces) -> Patches:
    """Return all surfaces, in the order of the file; refuse what is too much, too large or too small."""
    placed = [(node, *loaded.graph[node]) for node in loaded.graph.nodes_geometry]
    placed.sort(key=lambda one: (int(one[0].split("_")[0]), one[2]))
    solid = [(matrix, loaded.geometry[name]) for _, matrix, name in placed]
    solid = [(matrix, mesh) for matrix, mesh in solid if len(getattr(mesh, "faces", ()))]
    total = sum(len(mesh.faces) for _, mesh in solid)
    if total > MOST_TRIANGLES:
        raise InputError(
            f"{file.path}: it has {total} triangles; need {MOST_TRIANGLES} at most, so simplify its meshes"
        )
    parts, lamps = list[Patches](), 0
    for matrix, mesh in solid:
        material = getattr(mesh.visual, "material", None)
        surface = surfaces.of(None if material is None else int(material.name))
        if surface is None:
            continue
        part = patches_of(mesh, matrix, surface)
        parts += [part, other_sides(part)] if surface.both_sides else [part]
        lamps += len(part) if surface.emission.any() else 0
    if not sum(map(len, parts)):
        raise InputError(f"{file.path}: there are no triangles to be seen in it; need a scene of meshes")
    if lamps > MOST_LAMPS:
        raise InputError(
            f"{file.path}: {lamps} triangles shine; need {MOST_LAMPS} at most, so simplify the lamps"
        )
    patches = together(parts)
    _check_size(file, patches)
    return patches


def _check_size(file: GltfFile, patches: Patches) -> None:
    """Refuse a scene that is too large or too small to be one in metres."""
    corners = [patches.origin, patches.origin + patches.along, patches.origin + patches.across]
    extent = np.ptp(np.concatenate(corners), axis=0)
    if not SMALLEST <= extent.max() <= LARGEST:
        size = " x ".join(f"{side:.5g}" for side in extent)
        raise InputError(
            f"{file.path}: it measures {size} m; need {SMALLEST:g} to {LARGEST:g} m along its longest side, "
            "as glTF counts in metres"
        )
