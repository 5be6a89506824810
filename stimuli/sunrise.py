"""A time-lapse of a sunrise over a lake, reversed at half of its duration, as in the paper's section 4.

Mountains, wooded hills and pines stand still under sky, sun, clouds and haze that change with the sun's
altitude, and all of it appears again in the lake. Lengths are shares of the picture's height. Each part draws
from a generator of its own, so that a larger picture shows the same scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.fractal_noise import fractal_noise, ridged, smoothstep
from evenlight.stimuli.sequence_format import BuiltInSequence, on_grid

Image = NDArray[np.floating[Any]]  # float32, which NumPy's stubs forget in arithmetic
Light = dict[str, NDArray[np.float32]]
VERSION = 2  # to be raised when the pictures change
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
        scene = SunriseScene(self.format.width, self.format.height, SEED)
        last, times = self.n_frames - 1, self.format.times()
        for k in numbers:
            time, duration = times[k]
            phase = min(k, last - k) / (last / 2)
            yield Frame(time, duration, scene.picture(NIGHT + phase * (MORNING - NIGHT)))


class SunriseScene:
    """Everything of `Sunrise` that does not change with the light, and how the light falls on it.

    Parameters
    ----------
    width, height : int
        Size of the picture [pixels].
    seed : int
        Seed of the landscape.
    """

    def __init__(self, width: int, height: int, seed: int) -> None:
        from scipy.interpolate import PchipInterpolator  # here, as it takes long to import

        far, near, stars, clouds, lake, lamps = np.random.default_rng(seed).spawn(6)
        self._width, self._height, self._water = width, height, max(round(WATERLINE * height), 2)
        self._rows = _centres(self._water, height)[:, np.newaxis]
        self._columns = _centres(width, height)[np.newaxis, :]
        self._far = _ground(_far_shore(far, height, width)[: self._water])
        self._near = _ground(_near_shore(near, height, width))
        self._stars, self._lamps = (np.zeros((self._water, width, 3), np.float32) for _ in range(2))
        _add_stars(self._stars, stars, height)
        _add_lamps(self._lamps, lamps, height)
        self._add_clouds(clouds)
        self._add_waves(lake)
        table = [[colour.split() for colour in row.split("|")] for row in COLOURS.values()]
        self._colours = PchipInterpolator(ALTITUDES, np.log(np.array(table, float)), axis=1)
        # Pixel values over the root of linear light: linear up to 0.6, then a shoulder up to the sun.
        light = np.linspace(0, math.sqrt(BRIGHTEST), 8193) ** 2
        tone = np.minimum(light, 0.6) + 0.4 * (1 - np.exp(-np.maximum(light - 0.6, 0) / 0.4))
        self._tone = on_grid((tone / tone[-1]) ** (1 / 2.2))

    def _add_clouds(self, rng: np.random.Generator) -> None:
        up = HORIZON - self._rows[: np.count_nonzero(self._rows < HORIZON)]
        aspect, away, seen = self._width / self._height, 1 / (up + 0.16), smoothstep(up, 0.0, 0.14)
        aside = self._columns - aspect / 2
        high = fractal_noise(rng, (512, 1024), (6, 5), octaves=6, gain=0.55)
        low = fractal_noise(rng, (512, 1024), (5, 7), octaves=7, gain=0.52)
        # Two flat decks, seen from below in perspective: what they cover at most, places, speed to the left.
        self._decks = (
            (_deck(high), 0.70 * seen, 46 * away * aside, 88 * away, 2.2),
            (_deck(low), 0.95 * seen, 62 * away * aside, 130 * away, 3.6),
        )
        self._mist = fractal_noise(rng, (1, 1024), (1, 7), octaves=5)[0]
        self._mist_at = self._columns[0] * (560 / aspect)

    def _add_waves(self, rng: np.random.Generator) -> None:
        shape = self._height - self._water, self._width
        self._depth = _centres(shape[0], shape[0])[:, np.newaxis]
        far = 1 / (self._depth + 0.10)  # waves crowd with distance
        self._waves = [
            (swell, speed, 9 * fractal_noise(rng, shape, cells, octaves=3, gain=0.6) + crowding * far)
            for swell, speed, cells, crowding in (
                (0.010, 1.1, (9, 7), 9.0), (0.009, 1.7, (16, 18), 17.0), (0.008, 2.6, (34, 40), 34.0),
            )
        ]  # fmt: skip

    def picture(self, altitude: float) -> NDArray[np.uint16]:
        """Return the pixel values, (height, width, 3), for an altitude of the sun [degrees]."""
        colours = np.exp(self._colours(min(max(altitude, NIGHT), MORNING))).astype(np.float32)
        light = dict(zip(COLOURS, colours, strict=True))
        # The sun climbs a little to the right.
        sun = (0.575 + 0.0045 * altitude) * self._width / self._height, 0.545 - 0.019 * altitude
        picture = np.empty((self._height, self._width, 3), dtype=np.float32)
        above = picture[: self._water]
        self._paint_sky(above, light, sun, altitude)
        towards = np.exp(-(((self._columns[0] - sun[0]) / 0.6) ** 2))[:, np.newaxis]
        air = 0.62 * light["horizon"] + 0.20 * light["middle"] + 0.40 * towards * light["glow"]
        _paint(self._far, above, light, air, altitude)
        self._paint_mist(above, air, altitude)
        if altitude < -2:
            above += self._lamps * _fade(altitude, -2.0, -6.0)
        picture[self._water :] = self._mirrored(above, light, sun[0] * self._height, altitude)
        _paint(self._near, picture, light, air, altitude)
        steps = np.float32((len(self._tone) - 1) / math.sqrt(BRIGHTEST))
        return np.asarray(self._tone[(steps * np.sqrt(picture.clip(0, BRIGHTEST))).astype(np.uint16)])

    def _paint_sky(self, sky: Image, light: Light, sun: tuple[float, float], altitude: float) -> None:
        up = np.clip((HORIZON - self._rows) / HORIZON, 0, 1)
        low, high = smoothstep(up, 0.0, 0.42), smoothstep(up, 0.25, 1.0)
        bands = light["horizon"] + low * (light["middle"] - light["horizon"])
        sky[...] = (bands + high * (light["zenith"] - bands))[:, np.newaxis, :]
        squared = (self._columns - sun[0]) ** 2 + (self._rows - sun[1]) ** 2
        glow = 0.30 / (1 + squared / 0.012) + 0.14 / (1 + squared / 0.09)
        glow += 0.75 * np.exp(-(((self._columns - sun[0]) / 0.55) ** 2)) * np.exp(-((up / 0.30) ** 1.3))
        sky += glow[..., np.newaxis] * light["glow"]
        if altitude < -3:
            sky += self._stars * _fade(altitude, -3.0, -9.0)
        (far, far_lit), (near, near_lit) = (_drifted(deck, altitude) for deck in self._decks)
        cover, lit = far + near * (1 - far), far_lit + near * (near_lit - far_lit)
        rows = slice(0, len(cover))
        lit += 0.6 / (1 + squared[rows] / 0.03)  # clouds before the sun shine through
        clouds = light["cloud_dark"] + lit[..., np.newaxis] * (light["cloud_lit"] - light["cloud_dark"])
        sky[rows] += cover[..., np.newaxis] * (clouds - sky[rows])
        disc = np.clip((SUN_RADIUS - np.sqrt(squared)) * self._height + 0.5, 0, 1)
        disc[rows] *= 1 - 0.8 * cover
        seen = disc > 0
        sky[seen] += disc[seen, np.newaxis] * light["disc"]

    def _paint_mist(self, picture: Image, air: Image, altitude: float) -> None:
        top = round((WATERLINE - 0.10) * self._height)
        place = (self._mist_at + 3.0 * (altitude + 40)).astype(np.intp) % len(self._mist)
        thick = np.clip(1.6 * self._mist[place] - 0.1, 0, 1)
        strength = np.float32(0.75 * math.exp(-(((altitude - 2) / 6.0) ** 2)) + 0.10)
        heap = np.exp(-(((self._rows[top:] - WATERLINE + 0.012) / 0.030) ** 2))
        picture[top:] += (strength * heap * thick)[..., np.newaxis] * (1.1 * air - picture[top:])

    def _mirrored(self, above: Image, light: Light, sun: float, altitude: float) -> Image:
        rows, width = len(self._depth), self._width
        slope = np.zeros((rows, width), np.float32)
        for swell, speed, phase in self._waves:
            slope += np.float32(swell) * np.sin(phase + np.float32(speed * altitude))
        reach = self._height * (0.25 + 1.6 * self._depth)
        source = self._water - 1 - np.float32(1.15) * np.arange(rows, dtype=np.float32)[:, np.newaxis]
        columns = np.arange(width, dtype=np.float32)
        row = np.clip(source + reach * slope, 0, len(above) - 1).astype(np.int32)
        column = np.clip(columns + 0.3 * reach * slope, 0, width - 1).astype(np.int32)
        lake: Image = np.take(above.reshape(-1, 3), row * width + column, axis=0)
        lake *= (0.86 - 0.34 * self._depth)[..., np.newaxis]
        lake += light["ambient"] * np.array([0.018, 0.040, 0.050], np.float32)
        path = np.exp(-(((columns - sun) / (reach * (0.06 + 0.05 * self._depth))) ** 2))
        glitter = _fade(altitude, 1.5, 6.0) * 0.9 * path * smoothstep(slope, 0.006, 0.022)
        return lake + glitter[..., np.newaxis] * light["sun"]


Deck = tuple[Image, Image, Image, Image, float]


def _deck(noise: Image) -> Image:
    ahead = np.roll(noise, -6, axis=0) + np.roll(noise, 4, axis=1)
    facing = np.clip(0.45 + 4.0 * (noise - 0.5 * ahead), 0, 1)
    return np.stack([smoothstep(noise, 0.54, 0.80), facing])


def _drifted(deck: Deck, altitude: float) -> tuple[Image, Image]:
    """Return how much the clouds of a deck cover, and how much the sun lights them, both (rows, width)."""
    layers, most, across, along, speed = deck
    height, width = layers.shape[1:]
    x = across + np.float32(speed * (altitude + 40) + 8 * width)
    whole = x.astype(np.int32)
    row = along.astype(np.int32) % height * width
    left, right = row + whole % width, row + (whole + 1) % width
    cover, lit = (np.take(y, left) + (x - whole) * (np.take(y, right) - np.take(y, left)) for y in layers)
    return cover * most, lit


# Land: at each pixel the albedo R, G, B; how much the ground faces the sun; the share of the air's own light
# in what is seen; how early the sun reaches it, from the valley, 0, to the peaks, 1; what it covers of sky.


def _lay(land: Image, mask: Image, albedo: Image, facing: Image, haze: Image | float, height: Any) -> None:
    new = np.ones_like(land)
    new[..., :3], new[..., 3], new[..., 4], new[..., 5] = albedo, facing, haze, height
    land += mask[..., np.newaxis] * (new - land)


def _below(edge: Image, rows: Image) -> Image:
    return np.clip((rows - edge[np.newaxis, :]) * len(rows) + 0.5, 0, 1).astype(np.float32)


def _far_shore(rng: np.random.Generator, height: int, width: int) -> Image:
    land = np.zeros((height, width, 7), np.float32)
    parts = rng.spawn(6)
    _add_mountains(land, parts[0])
    _add_hills(land, parts[1], level=0.530, relief=0.090, haze=0.42, tone=1.25)
    _add_hills(land, parts[2], level=0.590, relief=0.075, haze=0.20, tone=1.05)
    rows, columns = _centres(height, height)[:, np.newaxis], _centres(width, width)
    bumps = fractal_noise(parts[3], (1, width), (1, 6), octaves=4)[0]
    edge = 0.643 - 0.035 * smoothstep(1 - columns, 0.45, 1.0) + 0.012 * (bumps - 0.5)
    texture = fractal_noise(parts[3], (height, width), (60, 40), octaves=4, gain=0.7)
    meadow = MEADOW * (0.4 + 1.1 * texture)[..., np.newaxis]
    _lay(land, _below(edge, rows), meadow, 0.3 + 0.5 * texture, 0.12, 0.08)
    _add_trees(land, parts[4], count=2600, rows=(0.565, 0.640), size=(0.012, 0.024), haze=(0.24, 0.12))
    _add_trees(land, parts[5], count=900, rows=(0.640, 0.662), size=(0.026, 0.050), haze=(0.10, 0.06))
    return land


def _add_mountains(land: Image, rng: np.random.Generator) -> None:
    height, width, _ = land.shape
    rows, x = _centres(height, height)[:, np.newaxis], _centres(width, width)
    crest = ridged(fractal_noise(rng, (1, width), (1, 5), octaves=7, gain=0.48))[0]
    massif = np.exp(-(((x - 0.30) / 0.20) ** 2)) + 0.55 * np.exp(-(((x - 0.86) / 0.14) ** 2))
    edge = 0.560 - 0.21 * massif * (0.55 + 0.45 * crest) - 0.075 * crest
    faces = ridged(fractal_noise(rng, (height, width), (4, 9), octaves=6, gain=0.50))
    slope = np.gradient(faces, axis=1) * width / 16 - np.gradient(faces, axis=0) * height / 40
    facing = np.clip(0.42 + 0.5 * slope, 0, 1)
    above = np.clip((0.55 - rows) / 0.21, 0, 1) + 0.45 * (faces - 0.65) + 0.30 * (facing - 0.5)
    rock = ROCK * (0.55 + 0.9 * faces)[..., np.newaxis]
    albedo = rock + smoothstep(above, 0.26, 0.44)[..., np.newaxis] * (SNOW - rock)
    haze = 0.50 + 0.22 * smoothstep(rows, 0.40, 0.57)
    _lay(land, _below(edge, rows), albedo, facing, haze, np.clip((0.60 - rows) / 0.27, 0, 1))


def _add_hills(
    land: Image, rng: np.random.Generator, level: float, relief: float, haze: float, tone: float
) -> None:
    height, width, _ = land.shape
    rows = _centres(height, height)[:, np.newaxis]
    shape = fractal_noise(rng, (1, width), (1, 3), octaves=5, gain=0.45)[0]
    tops = fractal_noise(rng, (1, width), (1, 120), octaves=3, gain=0.8)[0]
    edge = level - relief * (shape - 0.5) * 1.6 - 0.006 * tops
    folds = fractal_noise(rng, (height, width), (9, 9), octaves=5, gain=0.55)
    trees = fractal_noise(rng, (height, width), (110, 170), octaves=2, gain=0.8)
    facing = np.clip(0.40 + 0.5 * np.gradient(folds, axis=1) * width / 22 + 0.5 * (trees - 0.5), 0, 1)
    wood = FOREST * tone * (0.35 + 1.3 * trees)[..., np.newaxis]
    albedo = wood + smoothstep(folds, 0.66, 0.78)[..., np.newaxis] * 0.6 * (MEADOW - wood)
    misty = haze + 0.22 * smoothstep(rows - edge[np.newaxis, :], 0.0, 0.10)  # mist gathers in the valleys
    _lay(land, _below(edge, rows), albedo, facing, misty, np.clip((0.66 - rows) / 0.33, 0, 1))


def _near_shore(rng: np.random.Generator, height: int, width: int) -> Image:
    land = np.zeros((height, width, 7), np.float32)
    rows, columns = _centres(height, height)[:, np.newaxis], _centres(width, width)
    bumps = fractal_noise(rng, (1, width), (1, 3), octaves=6)[0]
    blades = fractal_noise(rng, (1, width), (1, 160), octaves=3, gain=0.8)[0]
    edge = 0.955 + 0.05 * (bumps - 0.5) - 0.10 * np.abs(2 * columns - 1) ** 3
    edge = edge - 0.022 * np.clip(blades - 0.35, 0, 1)
    texture = fractal_noise(rng, (height, width), (24, 60), octaves=4, gain=0.8)
    grass = MEADOW * 0.45 * (0.5 + texture)[..., np.newaxis]
    _lay(land, _below(edge, rows), grass, texture, 0.0, 0.0)
    for (place, size), draw in zip(PINES, rng.spawn(len(PINES)), strict=True):
        foot = float(np.interp(place, columns, edge)) + 0.04
        _add_pine(land, draw, (foot, place), size, haze=0.0, height=0.05)
    return land


def _add_trees(land: Image, rng: np.random.Generator, count: int, rows: Span, size: Span, haze: Span) -> None:
    """Add conifers, the far ones first; they stand in groups, smaller and hazier with distance."""
    groups = fractal_noise(rng, (64, 256), (5, 11), octaves=3)
    depth, place, sizes = np.sort(rng.random(count)), rng.random(count), rng.normal(1, 0.18, count)
    stands = groups[(depth * 63).astype(int), (place * 255).astype(int)] > 0.47
    for share, across, scale in zip(depth[stands], place[stands], sizes[stands], strict=True):
        foot, tall, air = (low + share * (high - low) for low, high in (rows, size, haze))
        tall *= np.clip(scale, 0.6, 1.5)
        _add_pine(land, rng, (foot, across), tall, haze=air, height=0.66 - foot)


def _add_pine(
    land: Image, rng: np.random.Generator, place: Span, tall: float, haze: float, height: float
) -> None:
    rows, columns, _ = land.shape
    size = max(round(tall * rows), 3)
    half = max(round(0.21 * size), 1)
    along = (np.arange(size, dtype=np.float32) + 0.5)[:, np.newaxis] / size
    across = np.arange(-half, half + 1, dtype=np.float32)[np.newaxis, :]
    tiers = 5 + 13 * min(size / 160, 1)
    wander = np.cumsum(rng.normal(0, 0.02, (size, 2)), axis=0).astype(np.float32)
    saw = 0.60 + 0.40 * ((along * tiers + np.where(across < 0, wander[:, :1], wander[:, 1:]) * 6) % 1)
    ragged = 0.75 + 0.5 * rng.random((size, 2 * half + 1), dtype=np.float32)
    reach = np.where(along > 0.95, 0.02 * size, 0.19 * size * along**0.85 * saw * ragged)  # with its trunk
    cover = np.clip(np.maximum(reach, 0.35) - np.abs(across) + 0.5, 0, 1)
    right = np.clip(0.5 + across / (2 * np.maximum(reach, 1)), 0, 1)
    speckle = rng.random(cover.shape, dtype=np.float32)
    shade = np.clip(0.55 * right + 0.55 * (saw - 0.6) + 0.25 * speckle, 0, 1)
    top, left = round(place[0] * rows) - size, round(place[1] * columns) - half
    ys, xs = slice(max(top, 0), max(top + size, 0)), slice(max(left, 0), max(left + 2 * half + 1, 0))
    there = land[ys, xs]
    inside = np.s_[ys.start - top :, xs.start - left :]
    cover, shade = (part[inside][: len(there), : there.shape[1]] for part in (cover, shade))
    _lay(there, cover, PINE * (0.6 + 0.9 * shade)[..., np.newaxis], shade, haze, height)


Span = tuple[float, float]
Ground = tuple[NDArray[np.intp], NDArray[np.intp], Image]


def _ground(land: Image) -> Ground:
    at = np.flatnonzero(land[..., 6])  # only what land covers is computed
    return at, at % land.shape[1], np.asfortranarray(land.reshape(-1, 7)[at])


def _paint(ground: Ground, picture: Image, light: Light, air: Image, altitude: float) -> None:
    """Paint land; the sun's light comes down the slopes as it climbs: first to the peaks, then the valley."""
    at, column, land = ground
    own, (facing, haze, height, cover) = land[:, :3], land[:, 3:].T[..., np.newaxis]
    line = 0.80 - 0.085 * (altitude + 1.5)
    shown = own * (light["ambient"] + facing * smoothstep(height, line, line + 0.2) * light["sun"])
    shown += haze * (np.take(air, column, axis=0) - shown)
    pixels = picture.reshape(-1, 3)
    behind = np.take(pixels, at, axis=0)
    pixels[at] = behind + cover * (shown - behind)


def _add_stars(sky: Image, rng: np.random.Generator, height: int) -> None:
    rows, width, _ = sky.shape
    for _ in range(420):
        place = rng.random() ** 1.2 * rows * 0.85, rng.random() * width
        power = min(0.035 * rng.pareto(1.4) + 0.015, 0.8)  # bright ones are few
        tint = 1 + rng.normal(0, 0.12) * np.array([1.0, 0.2, -1.0])
        _add_spot(sky, place, 0.55 * height / 360, power * tint)


def _add_lamps(land: Image, rng: np.random.Generator, height: int) -> None:
    for _ in range(16):  # a village on the far shore
        row, column = 0.642 - 0.020 * rng.random() ** 2, 0.335 + 0.10 * rng.normal(0, 0.6)
        warm = np.array([1.0, 0.58, 0.22]) * rng.uniform(0.15, 0.75)
        _add_spot(land, (row * height, column * land.shape[1]), 0.75 * height / 360, warm)


def _add_spot(picture: Image, place: Span, radius: float, colour: NDArray[np.float64]) -> None:
    reach = max(2, math.ceil(3 * radius))
    middles = [round(middle) for middle in place]
    rows, columns = (np.arange(max(m - reach, 0), m + reach + 1) for m in middles)
    rows, columns = rows[rows < picture.shape[0]], columns[columns < picture.shape[1]]
    down = np.exp(-(((rows - place[0]) / radius) ** 2))[:, np.newaxis]
    aside = np.exp(-(((columns - place[1]) / radius) ** 2))[np.newaxis, :]
    picture[np.ix_(rows, columns)] += ((down * aside)[..., np.newaxis] * colour).astype(np.float32)


def _centres(count: int, length: int) -> NDArray[np.float32]:
    return ((np.arange(count) + 0.5) / length).astype(np.float32)


def _fade(altitude: float, none: float, full: float) -> np.float32:
    return np.float32(min(max((altitude - none) / (full - none), 0.0), 1.0))
