"""A scene from a glTF file: its surfaces and lamps in our coordinates, to be lit by us.

glTF counts in metres with y up; here z is up: (x, y, z) there is (x, -z, y) here, as in Blender.
Triangles of a mesh that form a parallelogram become one patch, which is lit without a seam. There is one
texture for each image; colours are tints.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_sizes import MOST_SCENE_PIXELS, require_size
from evenlight.stimuli.scenes.engine.camera_path_file import light_in
from evenlight.stimuli.scenes.engine.scene import SEED, Floats, Material, Patches, Scene, Sky
from evenlight.stimuli.scenes.engine.shapes import at_right_angles, widest_corner_first
from evenlight.stimuli.scenes.gltf.gltf_file import GltfFile, in_one_line

if TYPE_CHECKING:
    import trimesh
    from PIL.Image import Image

UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up
TWIN = 0.001  # [m] the two sides of a thin surface are this far apart
SMALL = 1e-12  # [m^2] triangles of less area are left out
FLAT = 1e-4  # [m, and repeats of a texture] corners of a parallelogram fit to this
FACETED = 1e-3  # unit normals that differ by less are those of a flat piece
SMALLEST, LARGEST = 0.5, 2000.0  # [m] longest side of a scene
SHARES = np.arange(256, dtype=np.float32) / 255  # of the values of an image, and in linear light (sRGB)
LIGHT = np.where(SHARES <= 0.04045, SHARES / 12.92, ((SHARES + 0.055) / 1.055) ** 2.4)
MOST_TRIANGLES = 1_000_000
MOST_ENTRIES = 20 * MOST_TRIANGLES  # of its lists of numbers, as often as meshes name them
MOST_TEXTURES = 256
THERE = 0.5  # opacity from which a surface that would be blended counts as there
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
    named = [
        header["accessors"][number]
        for mesh in header.get("meshes", ())
        for one in mesh["primitives"]
        for number in (*one["attributes"].values(), *([one["indices"]] if "indices" in one else []))
    ]  # a file may have one piece of memory stand for many
    require_size(sum(int(one["count"]) for one in named), MOST_ENTRIES, file.path, "points and corners")
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
    corners = [patches.origin, patches.origin + patches.along, patches.origin + patches.across]
    extent = np.ptp(np.concatenate(corners), axis=0)
    if not SMALLEST <= extent.max() <= LARGEST:
        size = " x ".join(f"{side:.5g}" for side in extent)
        raise InputError(
            f"{file.path}: it measures {size} m; need {SMALLEST:g} to {LARGEST:g} m along its longest side, "
            "as glTF counts in metres"
        )


def patches_of(mesh: trimesh.Trimesh, matrix: Floats, surface: Surface) -> Patches:
    """Return the surface of a mesh.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        With `_NORMAL`, `_COLOR_0` and texture coordinates as attributes of its points, where it has them.
    matrix : array, (4, 4)
        Where it stands, y up.
    surface : Surface
        What it is made of.

    Raises
    ------
    ValueError
        If it holds what is no number.
    """
    turned = UPRIGHT @ matrix[:3, :3]
    points = np.asarray(mesh.vertices, float) @ turned.T + UPRIGHT @ matrix[:3, 3]
    if not np.isfinite(points).all():
        raise ValueError("positions that are not numbers")
    faces = np.asarray(mesh.faces)
    faces = widest_corner_first(points, faces[:, ::-1] if np.linalg.det(turned) < 0 else faces)
    faces = faces[np.linalg.norm(_sides(points[faces]), axis=1) > SMALL]
    corners, n = points[faces], len(faces)
    given = {key: _as_numbers(values)[faces] for key, values in mesh.vertex_attributes.items()}
    uvs = next((values for key, values in given.items() if "TEXCOORD" in key), np.zeros((n, 3, 2)))
    colours = given.get("_COLOR_0", np.ones((n, 3, 3)))[..., :3].mean(axis=1).clip(0, 1)
    normals = given["_NORMAL"] @ np.linalg.pinv(turned) if "_NORMAL" in given else np.zeros((n, 3, 3))
    patches = Patches(
        corners[:, 0],
        corners[:, 1] - corners[:, 0],
        corners[:, 2] - corners[:, 0],
        np.ones(n, dtype=np.bool_),
        _unit_normals(normals, _sides(corners)),
        uvs * [1, -1] + [0, 1],
        np.full(n, surface.number),
        np.ones((n, 3)) if surface.emission.any() else colours * surface.tint,
        np.tile(surface.emission, (n, 1)),
    )
    return joined(patches)


def _sides(corners: Floats) -> Floats:
    return at_right_angles(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _as_numbers(values: NDArray[Any]) -> Floats:
    """Return numbers of a file: whole ones stand for shares of their range."""
    numbers = values.astype(float) / (np.iinfo(values.dtype).max if values.dtype.kind in "iu" else 1)
    if not np.isfinite(numbers).all():
        raise ValueError("normals, colours or texture coordinates are not numbers")
    return numbers


def _unit_normals(given: Floats, sides: Floats) -> Floats:
    """Return unit normals at the corners of triangles, those of flat ones where none are given."""
    flat = (sides / np.linalg.norm(sides, axis=1, keepdims=True))[:, None]
    length = np.linalg.norm(given, axis=2, keepdims=True)
    normals = np.where(length > 1e-9, given / np.maximum(length, 1e-9), flat)
    # Normals as a file rounds them would make a flat piece a bent one.
    level = (np.abs(normals - flat) < FACETED).all(axis=(1, 2), keepdims=True)
    return np.asarray(np.where(level, flat, normals))


def joined(patches: Patches) -> Patches:
    """Return triangles, each from its widest corner, where two in a row that form a parallelogram are one."""
    corners = patches.origin[:, None] + np.stack(
        [np.zeros_like(patches.along), patches.along, patches.across], axis=1
    )
    fits = np.asarray((np.abs(np.diff(patches.tint, axis=0)) < FLAT).all(axis=1))
    for values, limit in ((corners, FLAT), (patches.normals, FACETED), (patches.uvs, FLAT)):
        a, b = values[:-1], values[1:]
        # Both sides of the longest edge, which they share; and the corner that is across from it.
        for gap in (a[:, 1] - b[:, 2], a[:, 2] - b[:, 1], a[:, 1] + a[:, 2] - a[:, 0] - b[:, 0]):
            fits &= (np.abs(gap) < limit).all(axis=1)
    fits[1:] &= ~fits[:-1]
    whole, kept = np.append(fits, [False]), ~np.append([False], fits)
    fewer = replace(patches, triangle=~whole)
    return Patches(*(getattr(fewer, name)[kept] for name in Patches.__dataclass_fields__))


def together(parts: list[Patches]) -> Patches:
    """Return all patches of some parts."""
    return Patches(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Patches.__dataclass_fields__)
    )


def other_sides(patches: Patches) -> Patches:
    """Return what is seen of thin surfaces from behind, a little apart from their front."""
    facing = at_right_angles(patches.across, patches.along)
    back = [0, 2, 1]
    return replace(
        patches,
        origin=patches.origin + TWIN * facing / np.linalg.norm(facing, axis=1, keepdims=True),
        along=patches.across,
        across=patches.along,
        normals=-patches.normals[:, back],
        uvs=patches.uvs[:, back],
    )


@dataclass(frozen=True, eq=False)
class Surface:
    """What some triangles are made of."""

    number: int  # of its material among those of the file; all white where there is no texture
    tint: Floats  # (3,): factor of the albedo
    emission: Floats  # (3,): luminance, linear RGB [cd/m^2]
    both_sides: bool  # whether it is seen from behind, too


class Surfaces:
    """The materials of a file, each texture once.

    Parameters
    ----------
    file : GltfFile
        Whose.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._materials: dict[tuple[Any, ...], Material] = {}
        self._pixels = 0

    def materials(self) -> tuple[Material, ...]:
        """Return those that were asked for."""
        return tuple(self._materials.values())

    def of(self, number: int | None) -> Surface | None:
        """Return the surface of a material; None if it is so transparent that it is not there."""
        entry = {} if number is None else self._file.header["materials"][number]
        paint = entry.get("pbrMetallicRoughness", {})
        *tint, opacity = numbers(paint.get("baseColorFactor", (1, 1, 1, 1)), 4).clip(0, 1)
        mode, texture = entry.get("alphaMode", "OPAQUE"), paint.get("baseColorTexture")
        emission, cutoff = self._emission(entry), None
        if mode != "OPAQUE":
            cutoff = float(entry.get("alphaCutoff", THERE)) if mode == "MASK" else THERE
            if texture is None and opacity < cutoff:
                return None
            cutoff /= max(opacity, 1e-9)
        if emission.any():
            texture, cutoff, tint = None, None, [1, 1, 1]
        gloss = round(1 - float(np.clip(paint.get("roughnessFactor", 1), 0, 1)), 1)
        if emission.any() or "metallicRoughnessTexture" in paint:  # which says that the factor is not all
            gloss = 0.0
        key = self._key(texture, cutoff, gloss)
        both = bool(entry.get("doubleSided", False)) and not self._materials[key].cutout
        return Surface(list(self._materials).index(key), np.array(tint), emission, both)

    def _emission(self, entry: dict[str, Any]) -> Floats:
        strength = entry.get("extensions", {}).get("KHR_materials_emissive_strength", {})
        emission = numbers(entry.get("emissiveFactor", (0, 0, 0)), 3) * numbers(
            [strength.get("emissiveStrength", 1)], 1
        )
        if emission.any() and "emissiveTexture" in entry:
            picture = self._file.image(entry["emissiveTexture"]["index"])
            emission = emission * [_linear(picture, k).mean(dtype=float) for k in range(3)]
        return np.asarray(emission)

    def _key(self, texture: dict[str, Any] | None, cutoff: float | None, gloss: float) -> tuple[Any, ...]:
        from PIL import Image

        source = None if texture is None else self._file.header["textures"][texture["index"]]["source"]
        key = source, cutoff, gloss
        if key not in self._materials:
            if len(self._materials) >= MOST_TEXTURES:
                raise InputError(
                    f"{self._file.path}: it has more than {MOST_TEXTURES} textures; put some into one image"
                )
            white = Image.new("RGBA", (1, 1), "white")
            image = white if texture is None else self._file.image(texture["index"])
            self._pixels += image.width * image.height
            require_size(self._pixels, MOST_SCENE_PIXELS, self._file.path, "pixels in its textures")
            if cutoff is not None and np.asarray(image)[..., 3].min() / 255 >= cutoff:
                cutoff = None
            # A partial function, which the cache of textures leaves alone: its name does not tell the image.
            made = partial(_resampled, image, cutoff)
            self._materials[key] = Material(f"image {key}", made, 1.0, gloss, cutoff is not None)
        return key


def numbers(values: Any, count: int) -> Floats:
    """Return so many numbers of 0 or above."""
    found = np.asarray(values, dtype=float)
    if found.shape != (count,) or not (np.isfinite(found) & (found >= 0)).all():
        raise ValueError(f"need {count} numbers of 0 or above for a colour, got {values}")
    return found


def _resampled(
    image: Image, cutoff: float | None, rng: np.random.Generator, size: int
) -> NDArray[np.float32]:
    """Return an image as a texture of some size: albedo in linear light, and with a cutoff what is there."""
    from PIL import Image as Images

    channels = [Images.fromarray(_linear(image, k)) for k in range(3)]
    if cutoff is not None:
        channels.append(
            Images.fromarray((cutoff <= SHARES).astype(np.float32)[np.asarray(image.getchannel(3))])
        )
    sized = [np.asarray(channel.resize((size, size), Images.Resampling.BILINEAR)) for channel in channels]
    return np.asarray(np.clip(np.stack(sized, axis=2), 0, 1), dtype=np.float32)


def _linear(image: Image, channel: int) -> NDArray[np.float32]:
    return np.asarray(LIGHT[np.asarray(image.getchannel(channel))])
