"""A scene as a .glb file for Blender and other programs.

Colours are base colours and textures; lamps are emissive in cd/m^2. Sky, sun and windows are kept as the
scene's extras, from where they are read back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine.camera_path_file import table_of_light
from evenlight.stimuli.scenes.engine.material_textures import CUTOFF, material_textures
from evenlight.stimuli.scenes.engine.scene import Floats, Scene
from evenlight.stimuli.scenes.engine.vertices import corners_of
from evenlight.stimuli.scenes.gltf.gltf_file import UPRIGHT

if TYPE_CHECKING:
    import trimesh


def glb_of(scene: Scene) -> bytes:
    """Return a scene as a .glb file."""
    import trimesh
    from trimesh.exchange.gltf import export_glb

    patches, textures = scene.patches, material_textures(scene)
    images = [_image(codes) for codes in textures.codes]
    kinds = np.column_stack([patches.material, patches.emission])
    rows, kind = np.unique(kinds, axis=0, return_inverse=True)
    meshes, entries = trimesh.Scene(base_frame=scene.name), dict[str, dict[str, Any]]()
    for k, (number, *emission) in enumerate(rows.tolist()):
        index = int(number)
        name = f"{scene.materials[index].name} {k}"
        entries[name] = _material(scene, index, np.array(emission), textures.scale[index])
        meshes.add_geometry(_mesh(scene, kind.ravel() == k, name, images[index]), geom_name=name)

    def complete(tree: dict[str, Any]) -> None:
        """Write what the library would round or does not know."""
        for material in tree["materials"]:
            entry = entries[material["name"]]
            material["pbrMetallicRoughness"] |= entry.pop("pbrMetallicRoughness")
            material.update(entry)
        for mesh in tree["meshes"]:
            attributes = mesh["primitives"][0]["attributes"]
            attributes["COLOR_0"] = attributes.pop("_TINT")
        tree["scenes"][0]["extras"] = {
            "evenlight": table_of_light(scene.sky, scene.sun) | {"windows": scene.windows.tolist()}
        }
        tree["extensionsUsed"] = ["KHR_materials_emissive_strength"]

    written: bytes = export_glb(meshes, include_normals=True, tree_postprocessor=complete)
    return written


def _mesh(scene: Scene, chosen: NDArray[np.bool_], name: str, image: Any) -> trimesh.Trimesh:
    import trimesh
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    patches, whole = scene.patches, ~scene.patches.triangle[chosen]
    used = np.column_stack([*np.ones((3, len(whole)), dtype=np.bool_), whole])  # corners
    number = np.cumsum(used).reshape(-1, 4) - 1
    faces = np.stack([number[:, [0, 1, 2]], number[:, [1, 3, 2]]], axis=1)
    normals = corners_of(patches.normals[chosen])[used]
    return trimesh.Trimesh(
        vertices=corners_of(patches.corners[chosen])[used] @ UPRIGHT,
        faces=faces[np.column_stack([np.ones_like(whole), whole])],
        vertex_normals=normals / np.linalg.norm(normals, axis=1, keepdims=True) @ UPRIGHT,
        vertex_attributes={
            "_TINT": np.repeat(patches.tint[chosen], used.sum(axis=1), axis=0).astype(np.float32)
        },
        visual=TextureVisuals(
            corners_of(patches.uvs[chosen])[used], PBRMaterial(name=name, baseColorTexture=image)
        ),
        process=False,
    )


def _image(codes: NDArray[np.uint8]) -> Any:
    from PIL import Image

    light = codes[::-1, :, :3] / 255
    shares = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    colours = np.rint(255 * shares).astype(np.uint8)
    opaque = (codes[..., 3] == 255).all()
    image = Image.fromarray(colours if opaque else np.dstack([colours, codes[::-1, :, 3]]))
    image.format = "PNG"
    return image


def _material(scene: Scene, index: int, emission: Floats, scale: Floats) -> dict[str, Any]:
    material = scene.materials[index]
    paint = {
        "baseColorFactor": [*scale.tolist(), 1.0],
        "metallicFactor": material.metal,
        "roughnessFactor": 1.0 - material.gloss,
    }
    entry: dict[str, Any] = {"pbrMetallicRoughness": paint}
    if material.cutout:
        entry |= {"alphaMode": "MASK", "alphaCutoff": CUTOFF, "doubleSided": True}
    if emission.any():
        strength = float(emission.max())
        entry["emissiveFactor"] = (emission / strength).tolist()
        entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    return entry
