"""A scene from a glTF file: its surfaces and lamps in our coordinates, to be lit by us.

glTF counts in metres with y up; here z is up: (x, y, z) there is (x, -z, y) here, as in Blender.
Triangles of a mesh that form a parallelogram become one patch, which is lit without a seam. There is one
texture for each image; colours are tints.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from dataclasses import replace
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_sizes import require_size
from evenlight.stimuli.scenes.engine.camera_path_file import light_in
from evenlight.stimuli.scenes.engine.scene import REC_709, SEED, Difference, Floats, Patches, Scene, Sky, Sun
from evenlight.stimuli.scenes.engine.shapes import at_right_angles, widest_corner_first
from evenlight.stimuli.scenes.gltf.gltf_differences import Part, differences_of
from evenlight.stimuli.scenes.gltf.gltf_file import BRIGHTEST, UPRIGHT, GltfFile, in_one_line
from evenlight.stimuli.scenes.gltf.gltf_materials import Surface, Surfaces, extension, named, numbers

if TYPE_CHECKING:
    import trimesh

TWIN = 0.001  # [m] the two sides of a thin surface are this far apart
SMALL = 1e-12  # [m^2] triangles of less area are left out
FLAT = 1e-4  # [m, and repeats of a texture] corners of a parallelogram fit to this
FACETED = 1e-3  # unit normals that differ by less are those of a flat piece
SMALLEST, LARGEST = 0.5, 2000.0  # [m] longest side of a scene
MOST_TRIANGLES = 1_000_000
MOST_ENTRIES = 20 * MOST_TRIANGLES  # of its lists of numbers, as often as meshes name them
STRIP, FAN = 5, 6  # glTF 2.0 specification, 5.24
WHOLE = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}  # for 1 in each component type, 3.11
LIGHTS = "KHR_lights_punctual"
RADIUS = 0.02  # [m] of the ball that a point of light becomes, at least
FAINTEST = 0.01  # [cd/m^2] pieces under a darker part of an emissive texture do not shine
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
        lights, sun_of_file, unlike = _lights(file, loaded, surfaces)
        patches, parts = _patches(file, loaded, surfaces, lights)
        scenes = file.header.get("scenes", [{}])
        ours = (scenes[file.header.get("scene", 0)].get("extras") or {}).get("evenlight", {})
        sky, sun = light_in(ours)
        windows = np.asarray(ours.get("windows", ()), dtype=float).reshape(-1, 4, 3)
        if not (np.abs(windows) <= LARGEST).all():
            raise ValueError(f"need windows at most {LARGEST:g} m away")
        unlike += differences_of(file.header, parts)
    name = re.sub(r"[^\w .-]", "_", file.path.name)
    light = sun or sun_of_file, sky or Sky()
    return Scene(name, SEED, patches, surfaces.materials(), windows, *light, (), (), tuple(unlike))


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
    count, header["materials"] = len(header.get("materials", ())), []
    for key in ("images", "textures", "cameras", "animations", "skins", "extensions"):
        header.pop(key, None)
    for k, node in enumerate(header.get("nodes", ())):
        node["name"] = str(k)
        for key in ("camera", "extensions"):
            node.pop(key, None)
    for k, mesh in enumerate(header.get("meshes", ())):
        mesh["name"] = str(k)
        for primitive in mesh["primitives"]:
            kept = primitive["attributes"]
            primitive["attributes"] = {"POSITION": kept["POSITION"]} | {
                f"_{name}": kept[name]
                for name in kept
                if name in ("NORMAL", "COLOR_0") or name.startswith("TEXCOORD_")
            }
            primitive.pop("extensions", None)
            fan = primitive.get("mode") == FAN
            if fan:
                primitive["mode"] = STRIP
            number = primitive.get("material")
            if number is not None and not 0 <= number < count:
                raise ValueError(f"there is no material {number}")
            # A name for each, which tells whose the triangles are, and what their whole numbers stand for.
            primitive["material"] = len(header["materials"])
            whole = {name: _largest(header["accessors"][kept[name]], name) for name in kept}
            header["materials"].append({"name": json.dumps([k, number, fan, whole])})
    header["buffers"] = [{"uri": str(k)} for k in range(len(file.buffers))]
    resolver = {str(k): data for k, data in enumerate(file.buffers)}
    text = json.dumps(header).encode()
    scene = trimesh.load_scene(BytesIO(text), file_type="gltf", resolver=resolver, process=False)
    for mesh in scene.geometry.values():
        if not len(getattr(mesh, "faces", ())):
            continue
        *_, fan, whole = json.loads(mesh.visual.material.name)
        if whole["POSITION"] > 1:
            mesh.vertices = np.maximum(mesh.vertices / whole["POSITION"], -1)
        for key, values in mesh.vertex_attributes.items():
            if values.dtype.kind in "iu":
                mesh.vertex_attributes[key] = values / whole[key[1:]]
        if fan:
            first, middle, last = mesh.faces.T  # of a strip, every other one turned round
            last = np.where(np.arange(len(last)) % 2, first, last)
            mesh.faces = np.column_stack([np.full_like(last, first[0]), middle, last])
    return scene


def _largest(accessor: dict[str, Any], name: str) -> int:
    """Return the whole number that stands for 1 in an accessor; 1 where numbers are meant as they are."""
    shares = accessor.get("normalized") or name in ("NORMAL", "COLOR_0")
    return WHOLE.get(accessor["componentType"], 1) if shares else 1


def _lights(
    file: GltfFile, loaded: trimesh.Scene, surfaces: Surfaces
) -> tuple[list[Patches], Sun | None, list[Difference]]:
    """Return the lamps of a file, its sun, and what of its lights is not as in the file.

    A light of so many candela becomes a ball of as many on the average over directions, large enough not to
    be brighter than what can be stored. The brightest directional light is the sun.
    """
    import trimesh

    lamps, suns, unlike = list[Patches](), list[Sun](), list[Difference]()
    given = extension(file.header, LIGHTS).get("lights", [])
    for k, node in enumerate(file.header.get("nodes", ())):
        number = extension(node, LIGHTS).get("light")
        if number is None or str(k) not in loaded.graph.nodes:
            continue
        light, matrix, words = given[number], loaded.graph[str(k)][0], ""
        power = numbers(light.get("color", (1, 1, 1)), 3) * numbers([light.get("intensity", 1)], 1)
        x, y, z = UPRIGHT @ matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])  # a light looks back along its z
        if light["type"] != "directional":
            ball = trimesh.creation.icosahedron()
            ball.apply_scale(max(RADIUS, math.sqrt(power.max() * 4 / BRIGHTEST / ball.area)))
            shining = surfaces.unseen(power / (ball.area / 4))  # Cauchy: a quarter of a surface is seen
            lamps += [patches_of(ball, trimesh.transformations.translation_matrix(matrix[:3, 3]), shining)]
            words = "the cone of a spot (it shines to all sides)" if light["type"] == "spot" else ""
        elif z > 0 and power.any():
            red, green, blue = (power / power.max()).tolist()
            azimuth, altitude = math.degrees(math.atan2(x, y)) % 360, math.degrees(math.asin(z))
            suns.append(Sun(azimuth, altitude, float(power @ REC_709), (red, green, blue)))
            words = "more than one directional light (the brightest)" if len(suns) > 1 else ""
        else:
            words = "a directional light from below (left out)"
        if words:
            name = named(light, f"light {number}")
            unlike.append(Difference(words, name, np.zeros(0, dtype=np.int64)))
    return lamps, max(suns, key=lambda sun: sun.illuminance, default=None), unlike


def _patches(
    file: GltfFile, loaded: trimesh.Scene, surfaces: Surfaces, lights: list[Patches]
) -> tuple[Patches, list[Part]]:
    """Return the pieces of a file, and which of them are whose."""
    placed = [(node, *loaded.graph[node]) for node in loaded.graph.nodes_geometry]
    placed.sort(key=lambda one: (int(one[0].split("_")[0]), one[2]))
    solid = [(matrix, loaded.geometry[name]) for _, matrix, name in placed]
    solid = [(matrix, mesh) for matrix, mesh in solid if len(getattr(mesh, "faces", ()))]
    total = sum(len(mesh.faces) for _, mesh in solid)
    if total > MOST_TRIANGLES:
        raise InputError(
            f"{file.path}: it has {total} triangles; need {MOST_TRIANGLES} at most, so simplify its meshes"
        )
    pieces, parts, first = list(lights), list[Part](), sum(map(len, lights))
    for matrix, mesh in solid:
        number, material, *_ = json.loads(mesh.visual.material.name)
        surface, before = surfaces.of(material), len(pieces)
        if surface is not None:
            pieces.append(patches_of(mesh, matrix, surface))
            if surface.glow is not None:
                pieces.append(glowing(mesh, matrix, surface.glow))
            if surface.both_sides:
                pieces += [other_sides(piece) for piece in pieces[before:]]
        last = first + sum(map(len, pieces[before:]))
        parts.append(Part(number, material, np.arange(first, last)))
        first = last
    if not sum(map(len, pieces)) > sum(map(len, lights)):
        raise InputError(f"{file.path}: there are no triangles to be seen in it; need a scene of meshes")
    patches = together(pieces)
    lamps = int(patches.emission.any(axis=1).sum())
    if lamps > MOST_LAMPS:
        raise InputError(
            f"{file.path}: {lamps} triangles shine; need {MOST_LAMPS} at most, so simplify the lamps"
        )
    _check_size(file, patches)
    return patches, parts


def _check_size(file: GltfFile, patches: Patches) -> None:
    extent = np.ptp(patches.corners, axis=(0, 1))
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
    uvs = given.get(surface.laid.coordinates, np.zeros((n, 3, 2))) @ surface.laid.matrix[:, :2].T
    colours = given.get("_COLOR_0", np.ones((n, 3, 3)))[..., :3].clip(0, 1) * surface.tint
    if surface.emission.any():
        colours = np.ones((n, 3, 3))
    normals = given["_NORMAL"] @ np.linalg.pinv(turned) if "_NORMAL" in given else np.zeros((n, 3, 3))
    patches = Patches(
        corners[:, 0],
        corners[:, 1] - corners[:, 0],
        corners[:, 2] - corners[:, 0],
        np.ones(n, dtype=np.bool_),
        _unit_normals(normals, _sides(corners)),
        (uvs + surface.laid.matrix[:, 2]) * [1, -1] + [0, 1],
        np.full(n, surface.number),
        colours.mean(axis=1),
        np.tile(surface.emission, (n, 1)),
        colours,
    )
    return joined(patches)


def glowing(mesh: trimesh.Trimesh, matrix: Floats, glow: Surface) -> Patches:
    """Return the light of a mesh's emissive texture, as what is laid over the pieces that shine.

    A piece shines with the texture's mean over it, and its texture is drawn over that mean.
    """
    assert glow.light is not None
    patches = patches_of(mesh, matrix, glow)
    size, sums, counts = len(glow.light), np.zeros((len(patches), 3)), np.zeros((len(patches), 1))
    for s, t in itertools.product((np.arange(8) + 0.5) / 8, repeat=2):
        at = patches.uvs[:, 0] + [s, t] @ (patches.uvs[:, 1:] - patches.uvs[:, :1])
        column, row = (np.floor(at * size).astype(int) % size).T
        on_it = (~patches.triangle | (s + t < 1))[:, None]
        sums += on_it * glow.light[size - 1 - row, column]
        counts += on_it
    means = sums / counts
    kept = (means * patches.emission).max(axis=1) > FAINTEST
    over = 1 / np.maximum(means, 1e-6)
    shone = replace(
        patches, emission=means * patches.emission, tint=over, shades=np.repeat(over[:, None], 3, axis=1)
    )
    return Patches(*(getattr(shone, name)[kept] for name in Patches.__dataclass_fields__))


def _sides(corners: Floats) -> Floats:
    return at_right_angles(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _as_numbers(values: NDArray[Any]) -> Floats:
    numbers = values.astype(float)
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
    if not len(patches):
        return patches
    assert patches.shades is not None
    fits = np.ones(len(patches) - 1, dtype=np.bool_)
    each = (patches.corners, FLAT), (patches.normals, FACETED), (patches.uvs, FLAT), (patches.shades, FLAT)
    for values, limit in each:
        a, b = values[:-1], values[1:]
        # Both sides of the longest edge, which they share; and the corner that is across from it.
        for gap in (a[:, 1] - b[:, 2], a[:, 2] - b[:, 1], a[:, 1] + a[:, 2] - a[:, 0] - b[:, 0]):
            fits &= (np.abs(gap) < limit).all(axis=1)
    fits[1:] &= ~fits[:-1]
    whole, kept = np.append(fits, [False]), ~np.append([False], fits)
    tint = np.where(whole[:, None], patches.shades[:, 1:].mean(axis=1), patches.tint)
    fewer = replace(patches, triangle=~whole, tint=tint)
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
        shades=None if patches.shades is None else patches.shades[:, back],
    )
