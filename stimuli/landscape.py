"""A procedural landscape for `sunrise`: mountains, wooded hills, a lake's shore, pines; and its daylight.

The land has no light yet: the colours of a day that breaks follow from the altitude of the sun.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.fractal_noise import fractal_noise, ridged, smoothstep

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

Image = NDArray[np.floating[Any]]  # float32, which NumPy's stubs forget in arithmetic
# Heights are shares of the picture's height from the top.
WATERLINE = 0.655
ROCK = (0.150, 0.135, 0.130)
SNOW = (0.80, 0.84, 0.92)
MEADOW = (0.085, 0.105, 0.035)
FOREST = (0.030, 0.058, 0.026)
PINE = (0.020, 0.034, 0.018)
# Linear light as shares of the display's peak (Rec. 709 primaries), chosen by eye after photographs of clear
# mornings, with the exposure of a camera that follows the light: what is 10^6 in nature is about 60 here.
ALTITUDES = (-12.0, -7.0, -3.0, 0.0, 3.0, 7.0, 12.0, 22.0)
COLOURS = {
    "zenith": "0.0035 0.0062 0.0145 | 0.008 0.0145 0.036 | 0.028 0.046 0.105 | 0.065 0.10 0.20 | "
    "0.11 0.17 0.32 | 0.14 0.24 0.45 | 0.15 0.29 0.56 | 0.14 0.31 0.64",
    "middle": "0.0055 0.0088 0.0185 | 0.019 0.020 0.042 | 0.105 0.080 0.125 | 0.27 0.18 0.21 | "
    "0.40 0.33 0.36 | 0.40 0.44 0.52 | 0.37 0.49 0.66 | 0.32 0.50 0.76",
    "horizon": "0.010 0.013 0.024 | 0.050 0.033 0.043 | 0.27 0.13 0.10 | 0.60 0.30 0.16 | "
    "0.80 0.46 0.21 | 0.84 0.60 0.34 | 0.80 0.72 0.55 | 0.66 0.75 0.82",
    "glow": "0.002 0.001 0.0005 | 0.07 0.026 0.008 | 0.48 0.17 0.04 | 1.0 0.42 0.10 | "
    "1.25 0.62 0.18 | 1.1 0.66 0.25 | 0.72 0.54 0.30 | 0.40 0.37 0.30",
    "cloud_lit": "0.011 0.015 0.026 | 0.075 0.042 0.050 | 0.58 0.22 0.15 | 1.15 0.52 0.27 | "
    "1.25 0.82 0.50 | 1.15 0.98 0.78 | 1.05 1.02 0.95 | 1.0 1.0 0.99",
    "cloud_dark": "0.0055 0.008 0.016 | 0.020 0.019 0.034 | 0.095 0.070 0.105 | 0.21 0.16 0.20 | "
    "0.33 0.29 0.34 | 0.40 0.42 0.48 | 0.46 0.51 0.58 | 0.52 0.59 0.68",
    "ambient": "0.036 0.054 0.10 | 0.050 0.058 0.10 | 0.12 0.11 0.155 | 0.22 0.21 0.26 | "
    "0.30 0.32 0.38 | 0.36 0.41 0.50 | 0.40 0.47 0.57 | 0.42 0.50 0.62",
    "sun": "0.0005 0.0002 0.0001 | 0.002 0.0008 0.0003 | 0.02 0.006 0.002 | 0.42 0.12 0.03 | "
    "1.25 0.56 0.20 | 1.7 1.15 0.66 | 2.0 1.65 1.2 | 2.2 2.0 1.7",
    "disc": "3 0.5 0.05 | 3 0.5 0.05 | 3 0.6 0.06 | 3.5 0.7 0.08 | "
    "4 1.1 0.15 | 5 2.0 0.45 | 7 4.5 2.0 | 9 8 6.5",
}


@dataclass(frozen=True, slots=True)
class Landscape:
    """What the land is like at each pixel; arrays (height, width), albedo (height, width, 3).

    Attributes
    ----------
    albedo : array
        Share of light that is sent back, R, G, B.
    facing : array
        How much the ground faces the sun, 0 to 1.
    haze : array
        Share of the air's own light in what is seen, 0 (near) to 1 (far).
    height : array
        How early the sun reaches the ground: 1 for the highest peaks, 0 for the valley.
    cover : array
        Share of the pixel that the land covers; the rest is sky.
    """

    albedo: Image
    facing: Image
    haze: Image
    height: Image
    cover: Image


def far_shore(rng: np.random.Generator, height: int, width: int) -> Landscape:
    """Return everything between sky and lake: two mountain ranges, wooded hills, a meadow at the shore."""
    land = _empty(height, width)
    parts = iter(rng.spawn(6))  # one for each, so that none depends on what the others draw
    _add_mountains(land, next(parts))
    _add_range(land, next(parts), level=0.530, relief=0.090, haze=0.42, tone=1.25)
    _add_range(land, next(parts), level=0.590, relief=0.075, haze=0.20, tone=1.05)
    _add_shore(land, next(parts))
    _add_trees(land, next(parts), count=2600, rows=(0.565, 0.640), size=(0.012, 0.024), haze=(0.24, 0.12))
    _add_trees(land, next(parts), count=900, rows=(0.640, 0.662), size=(0.026, 0.050), haze=(0.10, 0.06))
    return land


def near_shore(rng: np.random.Generator, height: int, width: int) -> Landscape:
    """Return the bank in front, with grass and with pines that frame the view."""
    land = _empty(height, width)
    rows, columns = _grid(height, width)
    bumps = fractal_noise(rng, (1, width), (1, 3), octaves=6)[0]
    edge = 0.955 + 0.05 * (bumps - 0.5) - 0.10 * np.abs(2 * columns[0] - 1) ** 3
    blades = fractal_noise(rng, (1, width), (1, 160), octaves=3, gain=0.8)[0]
    edge = edge - 0.022 * np.clip(blades - 0.35, 0, 1)
    texture = fractal_noise(rng, (height, width), (24, 60), octaves=4, gain=0.8)
    _add(
        land,
        rows,
        edge,
        np.asarray(MEADOW, np.float32) * 0.45 * (0.5 + texture)[..., np.newaxis],
        texture,
        0.0,
        0.0,
    )
    pines = rng.spawn(len(_FRAME))
    for (place, size), draw in zip(_FRAME, pines, strict=True):
        foot = float(np.interp(place, columns[0], edge)) + 0.04
        _stamp(land, pine(draw, round(size * height)), place, foot, haze=0.0, height=0.05)
    return land


# Pines in front: place across the picture, height; both as shares.
_FRAME = (
    (0.015, 0.62), (0.065, 0.46), (0.118, 0.33), (0.165, 0.19), (0.205, 0.13), (0.985, 0.50), (0.945, 0.34),
    (0.905, 0.21), (0.868, 0.13), (0.745, 0.07), (0.300, 0.08), (0.250, 0.10),
)  # fmt: skip


def pine(rng: np.random.Generator, size: int) -> tuple[Image, Image]:
    """Return coverage and shading of a conifer `size` pixels high, both (size, width)."""
    size = max(size, 3)
    half = max(round(0.21 * size), 1)
    along = (np.arange(size, dtype=np.float32) + 0.5)[:, np.newaxis] / size
    across = np.arange(-half, half + 1, dtype=np.float32)[np.newaxis, :]
    tiers = 5 + 13 * min(size / 160, 1)
    wander = np.cumsum(rng.normal(0, 0.02, (size, 2)), axis=0).astype(np.float32)
    saw = 0.60 + 0.40 * ((along * tiers + np.where(across < 0, wander[:, :1], wander[:, 1:]) * 6) % 1)
    ragged = 0.75 + 0.5 * rng.random((size, 2 * half + 1), dtype=np.float32)
    reach = 0.19 * size * along**0.85 * saw * ragged
    reach = np.where(along > 0.95, 0.02 * size, reach)  # the trunk
    cover = np.clip(np.maximum(reach, 0.35) - np.abs(across) + 0.5, 0, 1).astype(np.float32)
    right = np.clip(0.5 + across / (2 * np.maximum(reach, 1)), 0, 1)
    shade = np.clip(
        0.55 * right + 0.55 * (saw - 0.6) + 0.25 * rng.random(cover.shape, dtype=np.float32), 0, 1
    )
    return cover, shade.astype(np.float32)


def _empty(height: int, width: int) -> Landscape:
    """Return a landscape without land."""
    flat = [np.zeros((height, width), dtype=np.float32) for _ in range(4)]
    return Landscape(np.zeros((height, width, 3), dtype=np.float32), *flat)


def centres(count: int, length: int) -> Image:
    """Return the places of the centres of some pixels, as shares of a length in pixels.

    >>> centres(2, 4).tolist()
    [0.125, 0.375]
    """
    return ((np.arange(count) + 0.5) / length).astype(np.float32)


def _grid(height: int, width: int) -> tuple[Image, Image]:
    """Return the row and the column of each pixel as shares of the height and the width."""
    return centres(height, height)[:, np.newaxis], centres(width, width)[np.newaxis, :]


def _add(
    land: Landscape,
    rows: Image,
    edge: Image,
    albedo: Image,
    facing: Image,
    haze: float | Image,
    height: float | Image,
) -> None:
    """Put land in front of what is there, below an edge (width,) given as shares of the height."""
    mask = np.clip((rows - edge[np.newaxis, :]) * rows.shape[0] + 0.5, 0, 1).astype(np.float32)
    _cover(land, (slice(None), slice(None)), mask, (facing, haze, height))
    land.albedo[...] += mask[..., np.newaxis] * (albedo - land.albedo)


def _cover(
    land: Landscape, where: tuple[slice, slice], mask: Image, values: tuple[Image | float, ...]
) -> None:
    """Put something that faces the sun, is seen through haze and lies so high in front of what is there."""
    facing, haze, height = values
    land.facing[where] += mask * (facing - land.facing[where])
    land.haze[where] += mask * (haze - land.haze[where])
    land.height[where] += mask * (height - land.height[where])
    land.cover[where] += mask * (1 - land.cover[where])


def _add_mountains(land: Landscape, rng: np.random.Generator) -> None:
    """Add a snowy range far away."""
    height, width = land.cover.shape
    rows, columns = _grid(height, width)
    crest = ridged(fractal_noise(rng, (1, width), (1, 5), octaves=7, gain=0.48))[0]
    massif = np.exp(-(((columns[0] - 0.30) / 0.20) ** 2)) + 0.55 * np.exp(
        -(((columns[0] - 0.86) / 0.14) ** 2)
    )
    edge = 0.560 - 0.21 * massif * (0.55 + 0.45 * crest) - 0.075 * crest
    faces = ridged(fractal_noise(rng, (height, width), (4, 9), octaves=6, gain=0.50))
    slope = np.gradient(faces, axis=1) * width / 16 - np.gradient(faces, axis=0) * height / 40
    facing = np.clip(0.42 + 0.5 * slope, 0, 1)
    above = np.clip((0.55 - rows) / 0.21, 0, 1) + 0.45 * (faces - 0.65) + 0.30 * (facing - 0.5)
    snow = smoothstep(above.astype(np.float32), 0.26, 0.44)[..., np.newaxis]
    rock = np.asarray(ROCK, np.float32) * (0.55 + 0.9 * faces)[..., np.newaxis]
    albedo = rock + snow * (np.asarray(SNOW, np.float32) - rock)
    depth = 0.50 + 0.22 * smoothstep(rows, 0.40, 0.57)
    _add(land, rows, edge, albedo, facing, depth, np.clip((0.60 - rows) / 0.27, 0, 1))


def _add_range(
    land: Landscape, rng: np.random.Generator, level: float, relief: float, haze: float, tone: float
) -> None:
    """Add a range of wooded hills whose crest lies about a level, with the texture of tree tops."""
    height, width = land.cover.shape
    rows, _ = _grid(height, width)
    shape = fractal_noise(rng, (1, width), (1, 3), octaves=5, gain=0.45)[0]
    tops = fractal_noise(rng, (1, width), (1, 120), octaves=3, gain=0.8)[0]
    edge = level - relief * (shape - 0.5) * 1.6 - 0.006 * tops
    folds = fractal_noise(rng, (height, width), (9, 9), octaves=5, gain=0.55)
    trees = fractal_noise(rng, (height, width), (110, 170), octaves=2, gain=0.8)
    slope = np.gradient(folds, axis=1) * width / 22
    facing = np.clip(0.40 + 0.5 * slope + 0.5 * (trees - 0.5), 0, 1)
    clearing = smoothstep(folds, 0.66, 0.78)[..., np.newaxis] * 0.6
    wood = np.asarray(FOREST, np.float32) * tone * (0.35 + 1.3 * trees)[..., np.newaxis]
    albedo = wood + clearing * (np.asarray(MEADOW, np.float32) - wood)
    depth = haze + 0.22 * smoothstep(rows - edge[np.newaxis, :], 0.0, 0.10)  # mist gathers in the valleys
    _add(land, rows, edge, albedo, facing, depth, np.clip((0.66 - rows) / 0.33, 0, 1))


def _add_shore(land: Landscape, rng: np.random.Generator) -> None:
    """Add the meadow along the far side of the lake."""
    height, width = land.cover.shape
    rows, columns = _grid(height, width)
    edge = 0.643 - 0.035 * smoothstep(1 - columns[0], 0.45, 1.0) + 0.012 * (
        fractal_noise(rng, (1, width), (1, 6), octaves=4)[0] - 0.5
    )  # fmt: skip
    texture = fractal_noise(rng, (height, width), (60, 40), octaves=4, gain=0.7)
    albedo = np.asarray(MEADOW, np.float32) * (0.4 + 1.1 * texture)[..., np.newaxis]
    _add(land, rows, edge, albedo, 0.3 + 0.5 * texture, 0.12, 0.08)


def _add_trees(
    land: Landscape,
    rng: np.random.Generator,
    count: int,
    rows: tuple[float, float],
    size: tuple[float, float],
    haze: tuple[float, float],
) -> None:
    """Add conifers, the far ones first; they stand in groups, smaller and hazier with distance."""
    height = len(land.cover)
    groups = fractal_noise(rng, (64, 256), (5, 11), octaves=3)
    depth = np.sort(rng.random(count))
    place = rng.random(count)
    sizes = rng.normal(1, 0.18, count)
    near = groups[(depth * 63).astype(int), (place * 255).astype(int)]
    for share, across, scale in zip(depth[near > 0.47], place[near > 0.47], sizes[near > 0.47], strict=True):
        foot = rows[0] + share * (rows[1] - rows[0])
        tall = (size[0] + share * (size[1] - size[0])) * float(np.clip(scale, 0.6, 1.5))
        air = haze[0] + share * (haze[1] - haze[0])
        _stamp(land, pine(rng, round(tall * height)), across, foot, haze=air, height=0.66 - foot)


def _stamp(
    land: Landscape, tree: tuple[Image, Image], across: float, foot: float, haze: float, height: float
) -> None:
    """Put one tree in front of what is there."""
    cover, shade = tree
    tall, wide = cover.shape
    rows, columns = land.cover.shape
    top, left = round(foot * rows) - tall, round(across * columns) - wide // 2
    ys, xs = slice(max(top, 0), min(top + tall, rows)), slice(max(left, 0), min(left + wide, columns))
    if ys.start >= ys.stop or xs.start >= xs.stop:
        return
    inside = (slice(ys.start - top, ys.stop - top), slice(xs.start - left, xs.stop - left))
    mask, light = cover[inside], shade[inside]
    _cover(land, (ys, xs), mask, (light, haze, height))
    colour = np.asarray(PINE, np.float32) * (0.6 + 0.9 * light)[..., np.newaxis]
    land.albedo[ys, xs] += mask[..., np.newaxis] * (colour - land.albedo[ys, xs])


@dataclass(frozen=True, slots=True)
class Daylight:
    """Colours of one moment, each three shares of the display's peak: R, G, B.

    Attributes
    ----------
    zenith, middle, horizon, glow, cloud_lit, cloud_dark, ambient, sun, disc : array, (3,)
        Of the sky above, half-way and at the horizon; of the glow below the sun; of clouds towards the sun
        and away from it; of the light that falls on the land from the sky and from the sun; of the sun.
    """

    zenith: NDArray[np.float32]
    middle: NDArray[np.float32]
    horizon: NDArray[np.float32]
    glow: NDArray[np.float32]
    cloud_lit: NDArray[np.float32]
    cloud_dark: NDArray[np.float32]
    ambient: NDArray[np.float32]
    sun: NDArray[np.float32]
    disc: NDArray[np.float32]


def daylight(altitude: float) -> Daylight:
    """Return the colours for an altitude of the sun [degrees], from -12 to 22; the eye sees ratios, so logs.

    >>> daylight(22.0).zenith.tolist() == daylight(30.0).zenith.tolist()
    True
    """
    at = min(max(altitude, ALTITUDES[0]), ALTITUDES[-1])
    return Daylight(**{name: np.exp(curve(at)).astype(np.float32) for name, curve in _curves().items()})


@cache
def _curves() -> dict[str, PchipInterpolator]:
    """Return smooth curves through the logarithms of the colours."""
    from scipy.interpolate import PchipInterpolator  # here, as it takes long to import

    curves = {}
    for name, colours in COLOURS.items():
        table = np.array([[float(part) for part in colour.split()] for colour in colours.split("|")])
        curves[name] = PchipInterpolator(ALTITUDES, np.log(table))
    return curves
