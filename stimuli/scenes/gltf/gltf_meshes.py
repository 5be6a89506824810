"""Meshes as patches: neighbours that form a parallelogram become one, which is lit without a seam."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine.scene import Floats, Patches
from evenlight.stimuli.scenes.engine.shapes import at_right_angles, widest_corner_first
from evenlight.stimuli.scenes.gltf.gltf_materials import Surface

if TYPE_CHECKING:
    import trimesh

UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up
TWIN = 0.001  # [m] the two sides of a thin surface are this far apart
SMALL = 1e-12  # [m^2] triangles of less area are left out
FLAT = 1e-4  # [m, and repeats of a texture] corners of a parallelogram fit to this
FACETED = 1e-3  # unit normals that differ by less are those of a flat piece


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
    """Return the cross products of the sides of triangles, (n, 3)."""
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
