"""A finished scene: its surfaces, materials, lights and the ground one may walk on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
REC_709 = np.array([0.2126, 0.7152, 0.0722])  # luminance of linear red, green and blue
Texture = Callable[[np.random.Generator, Any], NDArray[np.float32]]
SEED = 1


@dataclass(frozen=True)
class Sampling:
    """How an image serves as a texture."""

    size: tuple[int, int]  # width and height [texels]
    clamped: tuple[bool, bool] = (False, False)  # whether it ends at its edges, instead of repeating
    nearest: bool = False  # whether its texels are seen as squares from near
    image: str = ""  # its name


@dataclass(frozen=True)
class Material:
    """What a surface is made of.

    Attributes
    ----------
    name : str
        Of its own: two different materials of a scene have different names.
    texture : function of (rng, size)
        Returns linear albedo in [0, 1], (size, size, 3), row 0 on top, which repeats without seams; with
        `cutout` (size, size, 4), where the last channel says what is there (1) and what is not (0). Its
        attribute `detail`, if it has one, is what it looks like from near (`surface_detail.Detail`). With
        `sampling`, width and height are asked for in place of a size.
    tile : float
        What one repeat of the texture covers [m].
    gloss : float
        How smooth it is, 0 matt to 1 like a mirror: 1 - roughness. It reflects what is around it.
    metal : float
        Whether it is of metal (1), which reflects in its own colour and has no light from below its surface.
    cutout : bool
        Whether the texture has holes (foliage, nets, fences); such surfaces are seen from both sides.
    blended : bool
        Whether the last channel is an opacity: the surface is drawn over what is behind it, which shows by
        the rest. The albedo is then that of the whole place, the see-through part of it counted as black.
    sampling : Sampling or None
        Of an image; None for textures that are made in the size that is asked for.
    relief : array of uint8, (height, width, 2), or None
        How normals lean towards where u and v grow, -1 to 1 in 255 steps, row 0 at the bottom.
    """

    name: str
    texture: Texture
    tile: float
    gloss: float = 0.0
    metal: float = 0.0
    cutout: bool = False
    blended: bool = False
    sampling: Sampling | None = None
    relief: NDArray[np.uint8] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not self.tile > 0:
            raise ValueError(f"material {self.name}: need a tile larger than 0 m, got {self.tile:g}")
        for quantity in ("gloss", "metal"):
            if not 0 <= getattr(self, quantity) <= 1:
                got = f"got {getattr(self, quantity):g}"
                raise ValueError(f"material {self.name}: need a {quantity} from 0 to 1, {got}")


@dataclass(frozen=True, eq=False)
class Patches:
    """Flat pieces of surface: parallelograms and triangles, each with its own row in every array.

    Attributes
    ----------
    origin, along, across : arrays, (n, 3)
        A corner, and the edges from it [m]; along x across points to the visible side.
    triangle : array of bool, (n,)
        Whether the piece is the half of the parallelogram that is next to the origin.
    normals : array, (n, 3, 3)
        Unit normals at the origin and at the ends of the two edges (smooth surfaces are not flat).
    uvs : array, (n, 3, 2)
        Texture coordinates there, in repeats; v points up in the texture.
    material : array of int, (n,)
        Index into the materials of the scene.
    tint : array, (n, 3)
        Factor of the texture's albedo, in [0, 1].
    emission : array, (n, 3)
        Luminance that the piece sends out itself, linear RGB [cd/m^2].
    shades : array, (n, 3, 3), or None
        The tint at the origin and at the ends of the two edges, where it changes; `tint` is then its mean.
    """

    origin: Floats
    along: Floats
    across: Floats
    triangle: NDArray[np.bool_]
    normals: Floats
    uvs: Floats
    material: NDArray[np.int64]
    tint: Floats
    emission: Floats
    shades: Floats | None = None

    def __len__(self) -> int:
        return len(self.origin)

    @property
    def corners(self) -> Floats:
        """The origin and the ends of the two edges, (n, 3, 3) [m]."""
        edges = np.stack([np.zeros_like(self.along), self.along, self.across], axis=1)
        return np.asarray(self.origin[:, None] + edges)


@dataclass(frozen=True, slots=True)
class Sun:
    """The sun: azimuth clockwise from north and altitude [degrees], illuminance [lx] and colour (RGB)."""

    azimuth: float
    altitude: float
    illuminance: float
    colour: Vector = (1.0, 1.0, 1.0)

    def direction(self) -> Floats:
        """Return the unit vector that points to the sun."""
        return direction_of(self.azimuth, self.altitude)

    def luminance(self) -> Floats:
        """Return the luminance of white paper that faces it, linear RGB, (3,) [cd/m^2]."""
        colour = np.asarray(self.colour)
        return np.asarray(colour / (colour @ REC_709) * self.illuminance / math.pi)


@dataclass(frozen=True, slots=True)
class Sky:
    """The sky: linear RGB luminance at the zenith and at the horizon [cd/m^2]."""

    zenith: Vector = (0.0, 0.0, 0.0)
    horizon: Vector = (0.0, 0.0, 0.0)


class Walkable(Protocol):
    """Ground that one may walk on."""

    @property
    def middle(self) -> Vector:
        """A place on it [m]."""

    def heights(self, x: float, y: float, margin: float = 0.0) -> list[float]:
        """Return the heights of its floors at a point, or at most a margin beside it, of each storey [m]."""


@dataclass(frozen=True, slots=True)
class Ground:
    """A rectangle that one may walk on: corners [m], height at the lower corner [m], slope along x and y."""

    low: tuple[float, float]
    high: tuple[float, float]
    floor: float
    slope: tuple[float, float] = (0.0, 0.0)

    def contains(self, x: float, y: float, margin: float = 0.0) -> bool:
        """Return whether a point is over it, its edges included."""
        return (
            self.low[0] - margin <= x <= self.high[0] + margin
            and self.low[1] - margin <= y <= self.high[1] + margin
        )

    def height(self, x: float, y: float) -> float:
        """Return the height of the floor at a point [m].

        >>> Ground((0.0, 0.0), (4.0, 2.0), -3.0, slope=(0.5, 0.0)).height(4.0, 1.0)
        -1.0
        """
        return self.floor + self.slope[0] * (x - self.low[0]) + self.slope[1] * (y - self.low[1])

    @property
    def middle(self) -> Vector:
        """Its middle [m]."""
        x, y = (self.low[0] + self.high[0]) / 2, (self.low[1] + self.high[1]) / 2
        return x, y, self.height(x, y)

    def heights(self, x: float, y: float, margin: float = 0.0) -> list[float]:
        """Return the height of the floor at a point, if it is over it [m]."""
        return [self.height(x, y)] if self.contains(x, y, margin) else []


@dataclass(frozen=True, slots=True)
class Place:
    """A named region, such as a room: its lower and higher corner [m]."""

    name: str
    low: Vector
    high: Vector


@dataclass(frozen=True, eq=False)
class Difference:
    """What is not shown as in the file of a scene: which feature of it, whose, and of which patches."""

    feature: str
    where: str
    patches: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Scene:
    """All there is in a place.

    Attributes
    ----------
    name : str
        Of the scene.
    seed : int
        Of all that is random in it, textures included.
    patches : Patches
        Its surfaces.
    materials : tuple of Material
        What they are made of.
    windows : array, (n, 4, 3)
        Openings through which rooms see the sky, as parallelograms [m]; light is looked for there first.
    sun : Sun or None
        If it shines.
    sky : Sky
        Seen wherever there is no surface.
    walkable : tuple of Walkable
        Where one may walk; none of a scene that does not say so.
    places : tuple of Place
        Its regions.
    unlike : tuple of Difference
        What is not shown as in its file.
    """

    name: str
    seed: int
    patches: Patches
    materials: tuple[Material, ...]
    windows: Floats
    sun: Sun | None
    sky: Sky
    walkable: tuple[Walkable, ...]
    places: tuple[Place, ...]
    unlike: tuple[Difference, ...] = ()

    def holed(self) -> NDArray[np.bool_]:
        """Return which patches have holes, (n,)."""
        return np.array([material.cutout for material in self.materials])[self.patches.material]


def direction_of(azimuth: float, altitude: float) -> Floats:
    """Return the unit vector of a direction: azimuth clockwise from north (y), altitude up [degrees].

    >>> direction_of(90.0, 0.0).round(6).tolist()
    [1.0, 0.0, 0.0]
    """
    a, h = math.radians(azimuth), math.radians(altitude)
    return np.array([math.sin(a) * math.cos(h), math.cos(a) * math.cos(h), math.sin(h)])


def stream(seed: int, name: str) -> np.random.Generator:
    """Return a generator of its own for a name, so that a new object leaves the others as they are."""
    return np.random.default_rng([seed, *name.encode()])


class Quality(Enum):
    """How carefully light is computed: rays over all samples, and per sample at the least and the most."""

    COARSE = (1_000_000, 6, 32)
    FINE = (12_000_000, 32, 256)
