"""The columns of a scene that is being built: surfaces go in an object at a time, `Patches` come out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.stimuli.scenes.scene import Floats, Material, Patches, Vector

DARK: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Pieces:
    """Flat pieces of surface of one object: all of them parallelograms, or all of them triangles.

    Attributes
    ----------
    corners : array, (n, 3, 3)
        Of each the first corner and its two neighbours [m].
    normals : array, (n, 3, 3)
        Unit normals there.
    uvs : array, (n, 3, 2)
        Texture coordinates there, in repeats.
    triangle : bool
        Whether they are triangles.
    """

    corners: Floats
    normals: Floats
    uvs: Floats
    triangle: bool


class PatchColumns:
    """Collects pieces and what they are made of.

    Parameters
    ----------
    scene : str
        Name of the scene, for what goes wrong.
    """

    def __init__(self, scene: str) -> None:
        self._scene = scene
        self._materials: dict[str, Material] = {}
        self._rows: list[tuple[Floats, ...]] = []  # origin, along, across, normals and uvs of an object
        self._shared: list[tuple[bool, int, Floats, Floats]] = []  # its triangle, material, tint and emission

    def __len__(self) -> int:
        return len(self._rows)

    def take(
        self, pieces: Pieces, material: Material, tint: Sequence[float], emission: Sequence[float] | Floats
    ) -> None:
        """Append the pieces of an object.

        Parameters
        ----------
        pieces : Pieces
            Where they are in the scene.
        material : Material
            What they are made of.
        tint : (float, float, float)
            Factor of the albedo.
        emission : (float, float, float)
            Luminance that they send out themselves, linear RGB [cd/m^2].
        """
        known = self._materials.setdefault(material.name, material)
        if known is not material and known != material:
            raise ValueError(f"scene {self._scene}: two different materials are called {material.name!r}")
        index = list(self._materials).index(material.name)
        origin = pieces.corners[:, 0]
        along, across = pieces.corners[:, 1] - origin, pieces.corners[:, 2] - origin
        self._rows.append((origin, along, across, pieces.normals, pieces.uvs))
        self._shared.append((pieces.triangle, index, np.asarray(tint, float), np.asarray(emission, float)))

    def patches(self) -> Patches:
        """Return all pieces; there must be some."""
        origin, along, across, normals, uvs = (np.concatenate(rows) for rows in zip(*self._rows, strict=True))
        # What is the same for all pieces of an object is written out here, for all objects at once.
        counts = [len(row[0]) for row in self._rows]
        triangle, index, tint, emission = (
            np.repeat(np.array(shared), counts, axis=0) for shared in zip(*self._shared, strict=True)
        )
        columns = (origin, along, across, triangle, normals, uvs, index, tint, emission)
        for column in columns:
            column.setflags(write=False)
        return Patches(*columns)

    def materials(self) -> tuple[Material, ...]:
        """Return the materials, in the order in which they were first used."""
        return tuple(self._materials.values())
