"""What of a glTF file is not shown as in the file, and how much of the view along a path that is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.progress import note
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.light.seen_patches import seen_along
from evenlight.stimuli.scenes.engine.material_textures import material_textures
from evenlight.stimuli.scenes.engine.scene import Difference, Scene
from evenlight.stimuli.scenes.engine.vertices import BLENDED, kinds_of
from evenlight.stimuli.scenes.gltf.gltf_file import BRIGHTEST
from evenlight.stimuli.scenes.gltf.gltf_materials import SPECULAR, extension, light_of, named, relief_of

DRAWN_AS_BRIGHTEST = 150.0  # [cd/m^2] to a lamp that is brighter, what it reflects adds nothing
# Instead of extensions of materials, shown wholly or in part.
INSTEAD = {
    "KHR_materials_emissive_strength": "",
    SPECULAR: "",
    "KHR_materials_transmission": "a thin layer without refraction",
    "KHR_materials_unlit": "lit like the others",
}
TRIANGLES = 4  # glTF 2.0 specification, 5.24
_told: set[tuple[str, str]] = set()  # scenes and paths
SHAPES_READ = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_lights_punctual")


class Part(NamedTuple):
    """The pieces of a mesh that are of one material, by their numbers."""

    mesh: int
    material: int | None
    patches: NDArray[np.int64]


def differences_of(header: dict[str, Any], parts: list[Part]) -> list[Difference]:
    """Return what is not shown as in a file, each feature once for each material and mesh."""
    found: dict[tuple[str, str], list[NDArray[np.int64]]] = {}
    moved = _of_nodes(header)
    for mesh, material, patches in parts:
        whose = named(header["meshes"][mesh], f"mesh {mesh}")
        if material is not None:
            entry = header["materials"][material]
            name = f"{named(entry, f'material {material}')} on {whose}"
            for feature in _of_material(header, entry):
                found.setdefault((feature, name), []).append(patches)
        for feature in {*_of_mesh(header, header["meshes"][mesh]), *moved.get(mesh, ())}:
            found.setdefault((feature, whose), []).append(patches)
    for k, entry in enumerate(header.get("meshes", ())):
        if any(primitive.get("mode", TRIANGLES) < TRIANGLES for primitive in entry["primitives"]):
            found["points or lines (left out)", named(entry, f"mesh {k}")] = [np.zeros(0, dtype=np.int64)]
    return [Difference(*key, np.concatenate(patches)) for key, patches in found.items()]


def _of_material(header: dict[str, Any], entry: dict[str, Any]) -> Iterator[str]:
    light = light_of(entry)
    if light.max() >= BRIGHTEST:
        yield f"a lamp brighter than {BRIGHTEST:g} cd/m² (no brighter)"
    if light.any() and "emissiveTexture" not in entry:  # nothing but light is drawn
        if light.min() < DRAWN_AS_BRIGHTEST:
            yield "base colour of a lamp (only its light)"
        return
    paint, extensions = entry.get("pbrMetallicRoughness", {}), entry.get("extensions", {})
    shiny, unlit = extension(entry, SPECULAR), "KHR_materials_unlit" in extensions
    if SPECULAR in extensions:
        if max(shiny.get("specularFactor", (1, 1, 1))) > 0.05 or "specularGlossinessTexture" in shiny:
            yield "specular colour (reflects as plastics do)"
    elif "metallicRoughnessTexture" in paint and not unlit:
        yield "metal and roughness of a texture (their means)"
    if entry.get("alphaMode") == "MASK" and not entry.get("doubleSided"):
        yield "holes in one side (seen from both)"
    if "normalTexture" in entry and relief_of(entry) is None:
        yield "normal map that lies unlike the colour (drawn smooth)"
    if "occlusionTexture" in entry:
        yield "occlusion map (light is computed)"
    for name in sorted(extensions):
        if INSTEAD.get(name, "left out"):
            yield f"{name} ({INSTEAD.get(name, 'left out')})"
    shown = paint.get("baseColorTexture"), shiny.get("diffuseTexture"), relief_of(entry)
    for texture in (*shown, entry.get("emissiveTexture")):
        if texture is not None:
            kinds = header["textures"][texture["index"]]
            if "source" not in kinds and "EXT_texture_webp" not in kinds.get("extensions", {}):
                yield f"{', '.join(kinds.get('extensions', ['a texture without image']))} (its colour alone)"


def _of_mesh(header: dict[str, Any], mesh: dict[str, Any]) -> Iterator[str]:
    for primitive in mesh["primitives"]:
        paint = header["materials"][primitive["material"]] if "material" in primitive else {}
        colours = primitive["attributes"].get("COLOR_0")
        faded = colours is not None and paint.get("alphaMode", "OPAQUE") != "OPAQUE"
        if faded and header["accessors"][colours]["type"] == "VEC4":
            yield "opacity of points (left out)"
        for name in sorted({*primitive.get("extensions", ())} - {*SHAPES_READ}):
            yield f"{name} (left out)"
    if any(mesh.get("weights", ())):
        yield "morph targets (the shape without them)"


def _of_nodes(header: dict[str, Any]) -> dict[int, list[str]]:
    """Return what is not shown of the nodes that meshes hang on, by mesh."""
    nodes, features = header.get("nodes", []), dict[int, list[str]]()

    def note(number: int, feature: str) -> None:
        if "mesh" in nodes[number]:
            features.setdefault(nodes[number]["mesh"], []).append(feature)
        for child in nodes[number].get("children", ()):
            note(child, feature)

    for animation in header.get("animations", ()):
        for channel in animation["channels"]:
            if "node" in channel["target"]:
                note(channel["target"]["node"], "animation (stands still)")
    for node in nodes:
        if "mesh" in node:
            names = sorted({*node.get("extensions", ())} - {*SHAPES_READ})
            skins = ["skin (as it was bound)"] if "skin" in node else []
            features.setdefault(node["mesh"], []).extend([*skins, *(f"{name} (left out)" for name in names)])
    return features


def tell_differences(scene: Scene, path: CameraPath, field_of_view: float) -> None:
    """Tell what of a scene is not shown as in its file, once in a process for each path."""
    if scene.unlike and (scene.name, path.text) not in _told:
        _told.add((scene.name, path.text))
        note(f"{scene.name}: not shown as in the file:")
        for words in words_of_differences(scene, path, field_of_view):
            note(f"  {words}")


def words_of_differences(scene: Scene, path: CameraPath, field_of_view: float) -> list[str]:
    """Return a line for each thing that is not shown as in a scene's file (some are), most seen first.

    What of the view along a path shows surfaces that it concerns is counted with rays, not with drawn
    pixels. Those that pass a hole count for what is behind it.
    """
    stopped = material_textures(scene, 8).coverage[scene.patches.material]
    whose = np.concatenate([one.patches for one in scene.unlike])
    stopped[whose[kinds_of(scene)[whose] == BLENDED]] = 1.0  # although it may be all transparent
    seen = seen_along(scene, path, field_of_view, stopped)
    counts = np.bincount(seen[seen >= 0], minlength=len(scene.patches)) / len(seen)
    rows = [(float(counts[one.patches].sum()), one) for one in scene.unlike]
    rows.sort(key=lambda row: (-row[0], row[1].feature, row[1].where))
    words = [f"{share:.1%} of the view: " if len(one.patches) else "" for share, one in rows]
    return [f"{share}{one.feature}: {one.where}" for share, (_, one) in zip(words, rows, strict=True)]


def require_as_in_file(scene: Scene) -> None:
    """Refuse a scene of which something is not shown as in its file: raise `InputError`."""
    if scene.unlike:
        first = "; ".join(f"{one.feature}: {one.where}" for one in scene.unlike[:3])
        more = f"; and {len(scene.unlike) - 3} more" if len(scene.unlike) > 3 else ""
        raise InputError(
            f"{scene.name}: not shown as in the file: {first}{more}; leave out `strict`, or change it"
        )
