"""Builds scenes: walls, furniture and lights go in, a `Scene` comes out.

Metres, z up, x east, y north. Texture coordinates count repeats of the texture, u to the right and v up, as
seen from the visible side; where none are given, they follow from the position, so that neighbouring walls
continue each other's pattern.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.stimuli.scenes.engine.scene import (
    REC_709,
    Floats,
    Ground,
    Material,
    Patches,
    Place,
    Scene,
    Sky,
    Sun,
    Vector,
    stream,
)
from evenlight.stimuli.scenes.engine.shapes import (
    BOX_SIDES,
    DARK,
    at_right_angles,
    cylinder_side,
    projected,
    sphere,
    widest_corner_first,
)

__all__ = ["Material", "SceneModel"]

WHITE: Vector = (1.0, 1.0, 1.0)
FLAT = 1e-6  # [m] a parallelogram's corners fit to this


class SceneModel:
    """A scene that is being built.

    Parameters
    ----------
    name : str
        Of the scene.
    seed : int
        Of all that is random in it.
    """

    def __init__(self, name: str, seed: int) -> None:
        self.name, self.seed = name, seed
        self.rng = stream(seed, name)
        self._materials: dict[str, Material] = {}
        # Of each object: origin, along, across, normals and uvs of its pieces; what they have in common is
        # whether they are triangles, the material, tint and emission.
        self._pieces: list[tuple[Floats, ...]] = []
        self._common: list[tuple[bool, int, Floats, Floats]] = []
        self._windows: list[Floats] = []
        self._sun: Sun | None = None
        self._sky = Sky()
        self._walkable: list[Ground] = []
        self._places: list[Place] = []
        self._turned, self._moved = np.eye(3), np.zeros(3)

    def rng_for(self, name: str) -> np.random.Generator:
        """Return a generator of its own for a name: adding an object does not reshuffle the others."""
        return stream(self.seed, name)

    @contextmanager
    def at(self, position: ArrayLike, turn: float = 0.0, *, tilt: float = 0.0) -> Iterator[None]:
        """Move all that is added inside to a position [m], turned about the vertical [degrees, to the left].

        `tilt` [degrees] first lifts what lies along x (a turn about the local y axis). Calls may be nested.
        """
        before = self._turned, self._moved
        t, h = math.radians(turn), math.radians(tilt)
        about_z = np.array([[math.cos(t), -math.sin(t), 0], [math.sin(t), math.cos(t), 0], [0, 0, 1]])
        about_y = np.array([[math.cos(h), 0, -math.sin(h)], [0, 1, 0], [math.sin(h), 0, math.cos(h)]])
        self._moved = before[1] + before[0] @ np.asarray(position, dtype=float)
        self._turned = before[0] @ about_z @ about_y
        try:
            yield
        finally:
            self._turned, self._moved = before

    def quad(
        self,
        corners: ArrayLike,
        material: Material,
        *,
        uvs: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        tint: Sequence[float] = WHITE,
        shine: Sequence[float] | Floats = DARK,
    ) -> None:
        """Add a flat quadrilateral.

        Parameters
        ----------
        corners : array_like, (4, 3)
            Counter-clockwise seen from the visible side [m].
        material : Material
            What it is made of.
        uvs : array_like, (4, 2), optional
            Texture coordinates of the corners, in repeats: (0, 0), (1, 0), (1, 1), (0, 1) shows one picture
            upright if the first corner is the lower left one.
        normals : array_like, (4, 3), optional
            Unit normals of the corners, if it is to be lit like a part of something round.
        tint : (float, float, float)
            Factor of the albedo, in [0, 1].
        shine : (float, float, float)
            Luminance that it sends out itself, linear RGB [cd/m^2].
        """
        four = np.asarray(corners, dtype=float)
        if four.shape != (4, 3):
            raise ValueError(f"quad of {material.name}: need 4 corners of 3 numbers, got shape {four.shape}")
        facing = at_right_angles(four[2] - four[0], four[3] - four[1])
        size = np.sqrt(facing @ facing)
        if not size > 0:
            raise ValueError(f"quad of {material.name}: it has no area, corners {four.tolist()}")
        facing = facing / size
        mapped = (
            self._mapped(four[None], facing[None], material)[0] if uvs is None else np.asarray(uvs, float)
        )
        regular = np.abs(four[0] + four[2] - four[1] - four[3]).max() < FLAT and (
            np.abs(mapped[0] + mapped[2] - mapped[1] - mapped[3]).max() < FLAT
        )
        chosen = np.array([[0, 1, 3]] if regular else [[0, 1, 2], [0, 2, 3]])
        given = np.array([facing] * 4) if normals is None else np.asarray(normals, float)
        pieces = four[chosen], given[chosen], mapped[chosen]
        self._take(*pieces, material, tint, shine, triangle=not regular)

    def box(
        self,
        low: ArrayLike,
        high: ArrayLike,
        material: Material,
        *,
        turn: float = 0.0,
        skip: str = "",
        tint: Sequence[float] = WHITE,
    ) -> None:
        """Add a box from its lower to its higher corner [m].

        Parameters
        ----------
        low, high : array_like, (3,)
            Opposite corners.
        material : Material
            What it is made of.
        turn : float
            About the vertical through its centre, to the left [degrees].
        skip : str
            Sides to leave out, among "xXyYzZ": x the one of lower x, X that of higher x, and so on.
        tint : (float, float, float)
            Factor of the albedo.
        """
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        if not (low < high).all():
            raise ValueError(
                f"box of {material.name}: need low < high, got {low.tolist()} and {high.tolist()}"
            )
        if turn:
            middle = (low + high) / 2 * [1, 1, 0]
            with self.at(middle, turn):
                self.box(low - middle, high - middle, material, skip=skip, tint=tint)
            return
        sides = [corners for side, corners in BOX_SIDES.items() if side not in skip]
        if sides:
            self._rectangles(low + np.array(sides) * (high - low), material, tint)

    def cylinder(
        self,
        base: ArrayLike,
        top: ArrayLike,
        radius: float | tuple[float, float],
        material: Material,
        *,
        segments: int = 24,
        caps: bool = True,
        tint: Sequence[float] = WHITE,
    ) -> None:
        """Add a cylinder, or a cone by its two radii, from the middle of its base to that of its top [m]."""
        base, top = np.asarray(base, dtype=float), np.asarray(top, dtype=float)
        radii = radius if isinstance(radius, tuple) else (radius, radius)
        side = cylinder_side(base, top, radii, segments, material.tile)
        if radii[0] == radii[1]:
            # Whole parallelograms: light on the halves of divided ones would not meet at their seams.
            k = np.arange(segments)
            chosen = np.stack([k, k + 1, k + segments + 1], axis=1)
            points, normals, uvs = side.points[chosen], side.normals[chosen], side.uvs[chosen]
            self._take(points, normals, uvs, material, tint, triangle=False)
        else:
            self.mesh(side.points, side.triangles, material, uvs=side.uvs, normals=side.normals, tint=tint)
        # Each edge goes counter-clockwise seen from outside.
        edges = side.points[segments::-1], side.points[segments + 1 :]
        for middle, size, edge in zip((base, top), radii, edges, strict=True) if caps else ():
            if size > 0:
                self._disc(middle, edge, material, tint)

    def sphere(
        self,
        centre: ArrayLike,
        radius: float | Sequence[float],
        material: Material,
        *,
        segments: int = 24,
        tint: Sequence[float] = WHITE,
    ) -> None:
        """Add a sphere, or an ellipsoid if three radii are given [m]."""
        radii = np.broadcast_to(np.asarray(radius, dtype=float), (3,))
        points, triangles, uvs = sphere(segments)
        normals = points / radii
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        around = np.round(2 * math.pi * radii.max() / material.tile) or 1.0
        self.mesh(
            np.asarray(centre) + radii * points,
            triangles,
            material,
            uvs=uvs * [around, math.pi * radii[2] / material.tile],
            normals=normals,
            tint=tint,
        )

    def mesh(
        self,
        positions: ArrayLike,
        triangles: ArrayLike,
        material: Material,
        *,
        uvs: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        tint: Sequence[float] = WHITE,
    ) -> None:
        """Add triangles.

        Parameters
        ----------
        positions : array_like, (n, 3)
            Points [m].
        triangles : array_like of int, (m, 3)
            Three points each, counter-clockwise seen from the visible side.
        material : Material
            What they are made of.
        uvs : array_like, (n, 2), optional
            Texture coordinates of the points, in repeats.
        normals : array_like, (n, 3), optional
            Unit normals of the points, for smooth surfaces; flat triangles without.
        tint : (float, float, float)
            Factor of the albedo.
        """
        local, chosen = np.asarray(positions, dtype=float), np.asarray(triangles, dtype=int)
        chosen = widest_corner_first(local, chosen)
        corners = local[chosen]
        facing = at_right_angles(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(facing, axis=1)
        corners, chosen, facing = corners[size > 0], chosen[size > 0], facing[size > 0]
        facing /= size[size > 0, np.newaxis]
        given = (
            np.repeat(facing[:, None], 3, axis=1) if normals is None else np.asarray(normals, float)[chosen]
        )
        mapped = self._mapped(corners, facing, material) if uvs is None else np.asarray(uvs, float)[chosen]
        self._take(corners, given, mapped, material, tint, triangle=True)

    def lamp(self, corners: ArrayLike, luminance: float, colour: Sequence[float] = WHITE) -> None:
        """Add a luminous parallelogram of some luminance [cd/m^2]; it shines to its visible side."""
        shine = np.asarray(colour, float)
        shine = shine * luminance / (shine @ REC_709)
        self.quad(corners, GLOWING, shine=shine)

    def window(self, corners: ArrayLike) -> None:
        """Say where a room sees the sky, as a parallelogram: the bake then finds its light without noise.

        Nothing is drawn. Without it the light comes in all the same, but with more grain.
        """
        self._windows.append(self._placed(np.asarray(corners, dtype=float)))

    def sun(
        self, azimuth: float, altitude: float, illuminance: float, colour: Sequence[float] = WHITE
    ) -> None:
        """Let the sun shine: azimuth clockwise from north and altitude [degrees], illuminance [lx].

        A white surface at right angles to it has the luminance illuminance / pi [cd/m^2].
        """
        red, green, blue = (float(c) for c in colour)
        self._sun = Sun(azimuth, altitude, illuminance, (red, green, blue))

    def sky(self, zenith: Sequence[float], horizon: Sequence[float]) -> None:
        """Set the sky's linear RGB luminance at the zenith and at the horizon [cd/m^2]."""
        (a, b, c), (d, e, f) = zenith, horizon
        self._sky = Sky((a, b, c), (d, e, f))

    def walkable(
        self,
        low_xy: Sequence[float],
        high_xy: Sequence[float],
        floor_z: float = 0.0,
        *,
        slope: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Say where one may walk: a rectangle, the height of its lower corner [m], its rise per metre.

        Rectangles that touch or overlap are joined; a doorway needs a rectangle of its own. Stay about 0.3 m
        from walls and furniture. Stairs are one rectangle with a slope.
        """
        low, high = (float(low_xy[0]), float(low_xy[1])), (float(high_xy[0]), float(high_xy[1]))
        self._walkable.append(Ground(low, high, float(floor_z), slope))

    def place(self, name: str, low: Sequence[float], high: Sequence[float]) -> None:
        """Name a region, such as "living room" or "garden", from its lower to its higher corner [m]."""
        (a, b, c), (d, e, f) = low, high
        self._places.append(Place(name, (a, b, c), (d, e, f)))

    def build(self) -> Scene:
        """Return the scene."""
        if not self._pieces:
            raise ValueError(f"scene {self.name}: there is nothing in it")
        # What is the same for all pieces of an object is written out here, for all objects at once.
        counts = [len(pieces[0]) for pieces in self._pieces]
        common = [np.repeat(np.array(one), counts, axis=0) for one in zip(*self._common, strict=True)]
        own = [np.concatenate(pieces) for pieces in zip(*self._pieces, strict=True)]
        columns = (*own[:3], common[0], *own[3:], *common[1:])
        for column in columns:
            column.setflags(write=False)
        return Scene(
            self.name,
            self.seed,
            Patches(*columns),
            tuple(self._materials.values()),
            np.array(self._windows).reshape(-1, 4, 3),
            self._sun,
            self._sky,
            tuple(self._walkable),
            tuple(self._places),
        )

    def _rectangles(self, fours: Floats, material: Material, tint: Sequence[float]) -> None:
        facing = at_right_angles(fours[:, 2] - fours[:, 0], fours[:, 3] - fours[:, 1])
        facing /= np.linalg.norm(facing, axis=1, keepdims=True)
        mapped, three = self._mapped(fours, facing, material), [0, 1, 3]
        normals = np.repeat(facing[:, None], 3, axis=1)
        self._take(fours[:, three], normals, mapped[:, three], material, tint, triangle=False)

    def _disc(self, middle: Floats, edge: Floats, material: Material, tint: Sequence[float]) -> None:
        k = np.arange(1, len(edge))
        points = np.concatenate([middle[None], edge])
        self.mesh(points, np.stack([np.zeros_like(k), k, k + 1], 1), material, tint=tint)

    def _mapped(self, corners: Floats, facing: Floats, material: Material) -> Floats:
        # What is moved shows another part of the pattern, so that two boards are not twins.
        offset = (self._moved * [0.731, 0.417, 0.0]).sum() if self._moved.any() else 0.0
        return np.asarray(projected(corners, facing) / material.tile + offset)

    def _take(
        self,
        corners: Floats,
        normals: Floats,
        uvs: Floats,
        material: Material,
        tint: Sequence[float],
        shine: Sequence[float] | Floats = DARK,
        *,
        triangle: bool,
    ) -> None:
        """Add pieces: corner and two neighbours, (n, 3, 3), unit normals and texture coordinates there."""
        known = self._materials.setdefault(material.name, material)
        if known is not material and known != material:
            raise ValueError(f"scene {self.name}: two different materials are called {material.name!r}")
        index = list(self._materials).index(material.name)
        origin, along, across = self._placed(corners).swapaxes(0, 1)
        self._pieces.append((origin, along - origin, across - origin, normals @ self._turned.T, uvs))
        self._common.append((triangle, index, np.asarray(tint, float), np.asarray(shine, float)))

    def _placed(self, points: Floats) -> Floats:
        return np.asarray(points @ self._turned.T + self._moved)


def _white(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
    return np.ones((size, size, 3), dtype=np.float32)


GLOWING = Material("glowing", _white, 1.0)
