"""A time-lapse of a sunrise over a lake, reversed at half of its duration, as in the paper's section 4.

Mountains, wooded hills and pines stand still under sky, sun, clouds and haze that change with the sun's
altitude, and all of it appears again in the lake. Lengths are shares of the picture's height. Each part draws
from a generator of its own, so that a larger picture shows the same scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.fractal_noise import fractal_noise, ridged, smoothstep
from evenlight.stimuli.sequence_format import BuiltInSequence, on_grid

Image = NDArray[np.floating[Any]]  # float32, which NumPy's stubs forget in arithmetic
Light = dict[str, NDArray[np.float32]]
Span = tuple[float, float]
Ground = tuple[int, Image]  # the first row of land, and `_Land` from there on
# Rows, as shares of the height, columns, of the width, and light of spots.
Spots = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
VERSION = 3  # to be raised when the pictures change
SEED = 2
NIGHT, MORNING = -12.0, 22.0  # altitude of the sun in the first and last frame, and in the middle [degrees]
SUN_RADIUS = 0.030
HORIZON, WATERLINE = 0.60, 0.655  # down to where there is sky, and land
BRIGHTEST = 4.0  # linear light, as a share of the display's peak, above which nothing more is told apart
ROCK, SNOW = np.array([[0.150, 0.135, 0.130], [0.80, 0.84, 0.92]], np.float32)
MEADOW, FOREST, PINE = np.array(
    [[0.085, 0.105, 0.035], [0.030, 0.058, 0.026], [0.020, 0.034, 0.018]], np.float32
)
# Pines in front: place across the picture, height; both as shares.
PINES = (
    (0.015, 0.62), (0.065, 0.46), (0.118, 0.33), (0.165, 0.19), (0.205, 0.13), (0.985, 0.50), (0.945, 0.34),
    (0.905, 0.21), (0.868, 0.13), (0.745, 0.07), (0.300, 0.08), (0.250, 0.10),
)  # fmt: skip
# For each altitude linear light as shares of the display's peak (Rec. 709 primaries), chosen by eye after
# photographs of clear mornings, with the exposure of a camera that follows the light: what is 10^6 in nature
# is about 60 here.
LIGHT = Path(__file__).with_name("sunrise_light.csv")
COLOURS = ("zenith", "middle", "horizon", "glow", "cloud_lit", "cloud_dark", "ambient", "sun", "disc")


@dataclass(frozen=True, slots=True)
class Sunrise(BuiltInSequence):
    """Night, sunrise over mountains and a lake, morning, and all of it backwards.

    Frame k and the k-th frame from the end are the same picture. Pixel values are 10 bits, encoded for a
    display with gamma 2.2.
    """

    @property
    def name(self) -> str:
        """Short name for titles."""
        return "sunrise"

    def sha256(self) -> str:
        """Return the SHA-256 of the sequence's definition."""
        return sha256_of_bytes(f"sunrise {VERSION} {SEED} {self.format!r}".encode())

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in order."""
        return self.frames_at(range(self.n_frames))

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Yield the frames of some numbers."""
        scenery, times = _Scenery(self.format.width, self.format.height), self.format.times()
        last = self.n_frames - 1
        for k in numbers:
            phase = min(k, last - k) / (last / 2)
            yield Frame(*times[k], scenery.picture(NIGHT + phase * (MORNING - NIGHT)))


class _Scenery:
    """All that does not change with the light, and how the light falls on it."""

    def __init__(self, width: int, height: int) -> None:
        from scipy.interpolate import PchipInterpolator  # here, as it takes long to import

        far, near, stars, clouds, lake, lamps = np.random.default_rng(SEED).spawn(6)
        self._width, self._height, self._water = width, height, max(round(WATERLINE * height), 2)
        self._rows, self._columns = _centres(self._water, height)[:, np.newaxis], _centres(width, height)
        self._far = _far_shore(far, height, width).upper(self._water)
        self._near = _near_shore(near, height, width).upper(height)
        self._stars, self._lamps = self._spots(0.55, *_stars(stars)), self._spots(0.75, *_lamps(lamps))
        self._add_clouds(clouds)
        self._add_waves(lake)
        altitudes, *colours = np.loadtxt(LIGHT, delimiter=",", skiprows=1, unpack=True)
        self._light = PchipInterpolator(altitudes, np.log(colours), axis=1)
        # Pixel values over the root of linear light: linear up to 0.6, then a shoulder up to the sun.
        light = np.linspace(0, math.sqrt(BRIGHTEST), 8193) ** 2
        tone = np.minimum(light, 0.6) + 0.4 * (1 - np.exp(-np.maximum(light - 0.6, 0) / 0.4))
        self._tone = on_grid((tone / tone[-1]) ** (1 / 2.2))

    def _spots(self, radius: float, rows: Image, columns: Image, colours: Image) -> Image:
        """Return round spots, of a radius in a picture of 360 rows [pixels]."""
        from scipy.ndimage import gaussian_filter

        light = np.zeros((self._water, self._width, 3), np.float32)
        at = (rows * self._height).astype(int) % self._water, (columns * self._width).astype(int)
        np.add.at(light, at, colours)
        sigma = radius * self._height / 360 / math.sqrt(2)
        return np.asarray(gaussian_filter(light, (sigma, sigma, 0)) * (2 * math.pi * sigma**2))

    def _add_clouds(self, rng: np.random.Generator) -> None:
        up = HORIZON - self._rows[self._rows < HORIZON][:, np.newaxis]
        aspect, away, seen = self._width / self._height, 1 / (up + 0.16), smoothstep(up, 0.0, 0.14)
        self._decks = []  # flat, seen from below in perspective
        for cells, octaves, gain, most, across, along, speed in (
            ((6, 5), 6, 0.55, 0.70, 46, 88, 2.2), ((5, 7), 7, 0.52, 0.95, 62, 130, 3.6),
        ):  # fmt: skip
            noise = fractal_noise(rng, (512, 1024), cells, octaves, gain)
            ahead = np.roll(noise, -6, axis=0) + np.roll(noise, 4, axis=1)
            facing = np.clip(0.45 + 4.0 * (noise - 0.5 * ahead), 0, 1)
            place = along * away, across * away * (self._columns - aspect / 2)
            self._decks.append((smoothstep(noise, 0.54, 0.80), facing, place, speed, most * seen))
        self._mist = fractal_noise(rng, (1, 1024), (1, 7), octaves=5)[0]
        self._mist_at = self._columns * (560 / aspect)

    def _add_waves(self, rng: np.random.Generator) -> None:
        shape = self._height - self._water, self._width
        self._depth = _centres(shape[0], shape[0])[:, np.newaxis]
        self._waves = [  # they crowd with distance
            (swell, speed, 9 * fractal_noise(rng, shape, cells, 3, 0.6) + crowding / (self._depth + 0.10))
            for swell, speed, cells, crowding in (
                (0.010, 1.1, (9, 7), 9.0), (0.009, 1.7, (16, 18), 17.0), (0.008, 2.6, (34, 40), 34.0),
            )
        ]  # fmt: skip

    def picture(self, altitude: float) -> NDArray[np.uint16]:
        """Return the pixel values, (height, width, 3), for an altitude of the sun [degrees]."""
        colours = np.exp(self._light(altitude)).astype(np.float32).reshape(-1, 3)
        light = dict(zip(COLOURS, colours, strict=True))
        # The sun climbs a little to the right.
        sun = (0.575 + 0.0045 * altitude) * self._width / self._height, 0.545 - 0.019 * altitude
        picture = np.empty((self._height, self._width, 3), dtype=np.float32)
        above = picture[: self._water]
        self._paint_sky(above, light, sun, altitude)
        towards = np.exp(-(((self._columns - sun[0]) / 0.6) ** 2))[:, np.newaxis]
        air = 0.62 * light["horizon"] + 0.20 * light["middle"] + 0.40 * towards * light["glow"]
        _paint(self._far, above, light, air, altitude)
        self._paint_mist(above, air, altitude)
        above += self._lamps * _fade(altitude, -2.0, -6.0)
        picture[self._water :] = self._mirrored(above, light, sun[0] * self._height, altitude)
        _paint(self._near, picture, light, air, altitude)
        steps = np.float32((len(self._tone) - 1) / math.sqrt(BRIGHTEST))
        return np.asarray(self._tone[(steps * np.sqrt(picture.clip(0, BRIGHTEST))).astype(np.uint16)])

    def _paint_sky(self, sky: Image, light: Light, sun: Span, altitude: float) -> None:
        from scipy.ndimage import map_coordinates

        up = np.clip((HORIZON - self._rows) / HORIZON, 0, 1)
        bands = light["horizon"] + smoothstep(up, 0.0, 0.42) * (light["middle"] - light["horizon"])
        sky[...] = (bands + smoothstep(up, 0.25, 1.0) * (light["zenith"] - bands))[:, np.newaxis]
        squared = (self._columns - sun[0]) ** 2 + (self._rows - sun[1]) ** 2
        glow = 0.30 / (1 + squared / 0.012) + 0.14 / (1 + squared / 0.09)
        glow += 0.75 * np.exp(-(((self._columns - sun[0]) / 0.55) ** 2)) * np.exp(-((up / 0.30) ** 1.3))
        sky += glow[..., np.newaxis] * light["glow"] + self._stars * _fade(altitude, -3.0, -9.0)
        disc = np.clip((SUN_RADIUS - np.sqrt(squared)) * self._height + 0.5, 0, 1)
        for opacity, facing, (along, across), speed, most in self._decks:
            at = np.broadcast_arrays(along, across + speed * (altitude + 40))
            cover, lit = (map_coordinates(y, at, order=1, mode="grid-wrap") for y in (opacity, facing))
            cover, rows = (most * cover)[..., np.newaxis], slice(len(cover))
            lit += 0.6 / (1 + squared[rows] / 0.03)  # clouds before the sun shine through
            cloud = light["cloud_dark"] + lit[..., np.newaxis] * (light["cloud_lit"] - light["cloud_dark"])
            sky[rows] += cover * (cloud - sky[rows])
            disc[rows] *= 1 - 0.8 * cover[..., 0]
        sky += disc[..., np.newaxis] * light["disc"]

    def _paint_mist(self, picture: Image, air: Image, altitude: float) -> None:
        place = (self._mist_at + 3.0 * (altitude + 40)).astype(np.intp) % len(self._mist)
        strength = np.float32(0.75 * math.exp(-(((altitude - 2) / 6.0) ** 2)) + 0.10)
        heap = strength * np.exp(-(((self._rows - WATERLINE + 0.012) / 0.030) ** 2))
        thick = heap * np.clip(1.6 * self._mist[place] - 0.1, 0, 1)
        picture += thick[..., np.newaxis] * (1.1 * air - picture)

    def _mirrored(self, above: Image, light: Light, sun: float, altitude: float) -> Image:
        rows, width = len(self._depth), self._width
        slope = np.sum([swell * np.sin(at + speed * altitude) for swell, speed, at in self._waves], axis=0)
        reach, columns = self._height * (0.25 + 1.6 * self._depth), np.arange(width, dtype=np.float32)
        source = self._water - 1 - 1.15 * np.arange(rows)[:, np.newaxis]
        row = np.clip(source + reach * slope, 0, len(above) - 1).astype(np.int32)
        column = np.clip(columns + 0.3 * reach * slope, 0, width - 1).astype(np.int32)
        lake: Image = np.take(above.reshape(-1, 3), row * width + column, axis=0)
        lake *= (0.86 - 0.34 * self._depth)[..., np.newaxis]
        lake += light["ambient"] * np.array([0.018, 0.040, 0.050], np.float32)
        path = np.exp(-(((columns - sun) / (reach * (0.06 + 0.05 * self._depth))) ** 2))
        glitter = _fade(altitude, 1.5, 6.0) * 0.9 * path * smoothstep(slope, 0.006, 0.022)
        lake += glitter[..., np.newaxis] * light["sun"]
        return lake


class _Land:
    """Land at each pixel, (height, width, 7).

    The albedo R, G, B; how much the ground faces the sun; the share of the air's own light in what is seen;
    how early the sun reaches it, from the valley, 0, to the peaks, 1; what it covers of sky.
    """

    def __init__(self, height: int, width: int) -> None:
        self._map = np.zeros((height, width, 7), np.float32)
        self.rows, self.columns = _centres(height, height)[:, np.newaxis], _centres(width, width)

    def line(self, rng: np.random.Generator, cells: int, octaves: int, gain: float = 0.5) -> Image:
        return fractal_noise(rng, (1, len(self.columns)), (1, cells), octaves, gain).ravel()

    def texture(self, rng: np.random.Generator, cells: tuple[int, int], octaves: int, gain: float) -> Image:
        return fractal_noise(rng, self._map.shape[:2], cells, octaves, gain)

    def lay(self, edge: Image, *layers: Any) -> None:
        """Cover all below an edge; the layers are those of the map: albedo, facing, haze, height."""
        _blend(self._map, np.clip((self.rows - edge) * len(self.rows) + 0.5, 0, 1), *layers)

    def pine(self, rng: np.random.Generator, place: Span, tall: float, haze: float, height: float) -> None:
        rows, columns, _ = self._map.shape
        size = max(round(tall * rows), 3)
        half = max(round(0.21 * size), 1)
        along, across = (np.arange(size)[:, np.newaxis] + 0.5) / size, np.arange(-half, half + 1)
        ragged, speckle = rng.random((2, size, 2 * half + 1), dtype=np.float32)
        wander = np.cumsum(rng.normal(0, 0.12, size))[:, np.newaxis] * np.sign(across)
        saw = 0.60 + 0.40 * ((along * (5 + 13 * min(size / 160, 1)) + wander) % 1)
        boughs = 0.19 * size * along**0.85 * saw * (0.75 + 0.5 * ragged)
        reach = np.where(along > 0.95, 0.02 * size, boughs)  # down to its trunk
        cover = np.clip(np.maximum(reach, 0.35) - np.abs(across) + 0.5, 0, 1)
        right = np.clip(0.5 + across / (2 * np.maximum(reach, 1)), 0, 1)
        shade = np.clip(0.55 * (right + saw - 0.6) + 0.25 * speckle, 0, 1)
        top, left = round(place[0] * rows) - size, round(place[1] * columns) - half
        there = self._map[max(top, 0) : max(top + size, 0), max(left, 0) : max(left + 2 * half + 1, 0)]
        inside = np.s_[max(-top, 0) :, max(-left, 0) :]
        cover, shade = (part[inside][: len(there), : there.shape[1]] for part in (cover, shade))
        _blend(there, cover, PINE * (0.6 + 0.9 * shade)[..., np.newaxis], shade, haze, height)

    def upper(self, rows: int) -> Ground:
        """Return the land of the upper rows, from the first one on that it covers."""
        top = int(self._map[:rows, :, 6].any(axis=1).argmax())
        return top, self._map[top:rows]


def _blend(land: Image, mask: Image, albedo: Image, *layers: Any) -> None:
    new = np.ones_like(land)
    new[..., :3], new[..., 3], new[..., 4], new[..., 5] = albedo, *layers
    land += mask[..., np.newaxis] * (new - land)


def _paint(ground: Ground, picture: Image, light: Light, air: Image, altitude: float) -> None:
    """Paint land; the sun's light comes down the slopes as it climbs: first to the peaks, then the valley."""
    top, land = ground
    own, (facing, haze, height, cover) = land[..., :3], np.moveaxis(land[..., 3:], -1, 0)[..., np.newaxis]
    line = 0.80 - 0.085 * (altitude + 1.5)
    shown = own * (light["ambient"] + facing * smoothstep(height, line, line + 0.2) * light["sun"])
    shown += haze * (air - shown)
    picture[top:] += cover * (shown - picture[top:])


def _far_shore(rng: np.random.Generator, height: int, width: int) -> _Land:
    land = _Land(height, width)
    mountains, far, near, shore, *woods = rng.spawn(6)
    _add_mountains(land, mountains)
    _add_hills(land, far, level=0.530, relief=0.090, haze=0.42, tone=1.25)
    _add_hills(land, near, level=0.590, relief=0.075, haze=0.20, tone=1.05)
    edge = 0.643 - 0.035 * smoothstep(1 - land.columns, 0.45, 1.0) + 0.012 * (land.line(shore, 6, 4) - 0.5)
    texture = land.texture(shore, (60, 40), 4, 0.7)
    land.lay(edge, MEADOW * (0.4 + 1.1 * texture)[..., np.newaxis], 0.3 + 0.5 * texture, 0.12, 0.08)
    _add_trees(land, woods[0], count=2600, rows=(0.565, 0.640), size=(0.012, 0.024), haze=(0.24, 0.12))
    _add_trees(land, woods[1], count=900, rows=(0.640, 0.662), size=(0.026, 0.050), haze=(0.10, 0.06))
    return land


def _add_mountains(land: _Land, rng: np.random.Generator) -> None:
    rows, x = land.rows, land.columns
    crest = ridged(land.line(rng, 5, 7, 0.48))
    massif = np.exp(-(((x - 0.30) / 0.20) ** 2)) + 0.55 * np.exp(-(((x - 0.86) / 0.14) ** 2))
    edge = 0.560 - 0.21 * massif * (0.55 + 0.45 * crest) - 0.075 * crest
    faces = ridged(land.texture(rng, (4, 9), 6, 0.50))
    down, aside = np.gradient(faces)
    facing = np.clip(0.42 + 0.5 * (aside * len(x) / 16 - down * len(rows) / 40), 0, 1)
    above = np.clip((0.55 - rows) / 0.21, 0, 1) + 0.45 * (faces - 0.65) + 0.30 * (facing - 0.5)
    rock = ROCK * (0.55 + 0.9 * faces)[..., np.newaxis]
    albedo = rock + smoothstep(above, 0.26, 0.44)[..., np.newaxis] * (SNOW - rock)
    haze = 0.50 + 0.22 * smoothstep(rows, 0.40, 0.57)
    land.lay(edge, albedo, facing, haze, np.clip((0.60 - rows) / 0.27, 0, 1))


def _add_hills(
    land: _Land, rng: np.random.Generator, level: float, relief: float, haze: float, tone: float
) -> None:
    shape, tops = land.line(rng, 3, 5, 0.45), land.line(rng, 120, 3, 0.8)
    edge = level - relief * (shape - 0.5) * 1.6 - 0.006 * tops
    folds, trees = land.texture(rng, (9, 9), 5, 0.55), land.texture(rng, (110, 170), 2, 0.8)
    aside = np.gradient(folds, axis=1) * len(land.columns) / 22
    facing = np.clip(0.40 + 0.5 * aside + 0.5 * (trees - 0.5), 0, 1)
    wood = FOREST * tone * (0.35 + 1.3 * trees)[..., np.newaxis]
    albedo = wood + smoothstep(folds, 0.66, 0.78)[..., np.newaxis] * 0.6 * (MEADOW - wood)
    misty = haze + 0.22 * smoothstep(land.rows - edge, 0.0, 0.10)  # mist gathers in the valleys
    land.lay(edge, albedo, facing, misty, np.clip((0.66 - land.rows) / 0.33, 0, 1))


def _near_shore(rng: np.random.Generator, height: int, width: int) -> _Land:
    land = _Land(height, width)
    bumps, blades = land.line(rng, 3, 6), land.line(rng, 160, 3, 0.8)
    edge = 0.955 + 0.05 * (bumps - 0.5) - 0.10 * np.abs(2 * land.columns - 1) ** 3
    edge = edge - 0.022 * np.clip(blades - 0.35, 0, 1)
    texture = land.texture(rng, (24, 60), 4, 0.8)
    land.lay(edge, MEADOW * 0.45 * (0.5 + texture)[..., np.newaxis], texture, 0.0, 0.0)
    for (place, size), draw in zip(PINES, rng.spawn(len(PINES)), strict=True):
        foot = float(np.interp(place, land.columns, edge)) + 0.04
        land.pine(draw, (foot, place), size, haze=0.0, height=0.05)
    return land


def _add_trees(land: _Land, rng: np.random.Generator, count: int, rows: Span, size: Span, haze: Span) -> None:
    """Add conifers, the far ones first; they stand in groups, smaller and hazier with distance."""
    groups = fractal_noise(rng, (64, 256), (5, 11), octaves=3)
    depth, place, sizes = np.sort(rng.random(count)), rng.random(count), rng.normal(1, 0.18, count)
    stands = groups[(depth * 63).astype(int), (place * 255).astype(int)] > 0.47
    for share, across, scale in zip(depth[stands], place[stands], sizes[stands], strict=True):
        foot, tall, air = (low + share * (high - low) for low, high in (rows, size, haze))
        land.pine(rng, (foot, across), tall * np.clip(scale, 0.6, 1.5), haze=air, height=0.66 - foot)


def _stars(rng: np.random.Generator) -> Spots:
    rows, columns = rng.random(420) ** 1.2 * WATERLINE * 0.85, rng.random(420)
    power = np.minimum(0.035 * rng.pareto(1.4, (420, 1)) + 0.015, 0.8)  # bright ones are few
    return rows, columns, power * (1 + rng.normal(0, 0.12, (420, 1)) * [1.0, 0.2, -1.0])


def _lamps(rng: np.random.Generator) -> Spots:
    """Return those of a village on the far shore."""
    rows, columns = 0.642 - 0.020 * rng.random(16) ** 2, 0.335 + 0.06 * rng.normal(size=16)
    return rows, columns, rng.uniform(0.15, 0.75, (16, 1)) * [1.0, 0.58, 0.22]


def _centres(count: int, length: int) -> NDArray[np.float32]:
    return ((np.arange(count) + 0.5) / length).astype(np.float32)


def _fade(altitude: float, none: float, full: float) -> np.float32:
    return np.float32(min(max((altitude - none) / (full - none), 0.0), 1.0))
