"""A time-lapse of a sunrise over a lake, reversed at half of its duration, as in the paper's section 4.

Sky, sun, clouds and haze change over the landscape, and all of it appears again in the lake.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.fractal_noise import fractal_noise, smoothstep
from evenlight.stimuli.landscape import (
    WATERLINE,
    Daylight,
    Image,
    Landscape,
    centres,
    daylight,
    far_shore,
    near_shore,
)
from evenlight.stimuli.sequence_format import SequenceFormat, on_grid

VERSION = 1  # to be raised when the pictures change
SEED = 2
NIGHT, MORNING = -12.0, 22.0  # altitude of the sun in the first and last frame, and in the middle [degrees]
SUN_RADIUS = 0.030  # shares of the picture's height, as all lengths here
HORIZON = 0.60  # down to here there is sky
RISEN, RISE = 0.545, 0.019  # where the sun is at altitude 0, and how far it climbs in a degree
BRIGHTEST = 4.0  # linear light, as a share of the display's peak, above which nothing more is told apart


@dataclass(frozen=True, slots=True)
class Sunrise:
    """Night, sunrise over mountains and a lake, morning, and all of it backwards.

    Frame k and the k-th frame from the end are the same picture. Pixel values are 10 bits, encoded for a
    display with gamma 2.2.

    Attributes
    ----------
    format : SequenceFormat
        Size, length and rate.
    """

    format: SequenceFormat = field(default_factory=lambda: SequenceFormat(duration=40.0))

    @property
    def name(self) -> str:
        """Short name for titles."""
        return "sunrise"

    @property
    def n_frames(self) -> int:
        """How many frames there are."""
        return self.format.n_frames

    @property
    def field_of_view(self) -> float:
        """Angle that the width is to span for the viewer [deg]."""
        return self.format.field_of_view

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
    """Everything of `sunrise` that does not change with the light, and how the light falls on it.

    Parameters
    ----------
    width, height : int
        Size of the picture [pixels].
    seed : int
        Seed of the landscape.
    """

    def __init__(self, width: int, height: int, seed: int) -> None:
        # Each part draws from its own generator, so that a larger picture shows the same scene.
        rng = np.random.default_rng(seed).spawn(6)
        self.width, self.height = width, height
        self.water = max(round(WATERLINE * height), 2)
        self._rows = centres(self.water, height)[:, np.newaxis]
        self._columns = centres(width, height)[np.newaxis, :]
        self._far = _Ground(far_shore(rng[0], height, width), slice(0, self.water))
        self._near = _Ground(near_shore(rng[1], height, width), slice(0, height))
        self._stars = _stars(rng[2], self.water, width, height)
        self._clouds = _Clouds(rng[3], self._rows, self._columns, width / height)
        self._lake = _Lake(rng[4], self.water, height, width)
        self._lamps = _lamps(rng[5], self.water, width, height)
        self._tone = _tone_curve()

    def picture(self, altitude: float) -> NDArray[np.uint16]:
        """Return the pixel values, (height, width, 3), for an altitude of the sun [degrees]."""
        light = daylight(altitude)
        # The sun climbs a little to the right.
        sun = (0.575 + 0.0045 * altitude) * self.width / self.height, RISEN - RISE * altitude
        picture = np.empty((self.height, self.width, 3), dtype=np.float32)
        above = picture[: self.water]
        self._paint_sky(above, light, sun, altitude)
        air = self._air(light, sun)
        self._far.paint(above, light, air, altitude)
        self._paint_mist(above, air, altitude)
        if altitude < -2:
            above += self._lamps * np.float32(_fade(altitude, -2.0, -6.0))
        picture[self.water :] = self._lake.mirrored(above, light, sun[0] * self.height, altitude)
        self._near.paint(picture, light, air, altitude)
        return self._encoded(picture)

    def _paint_sky(self, sky: Image, light: Daylight, sun: tuple[float, float], altitude: float) -> None:
        """Paint the sky, with stars, glow, sun and clouds."""
        up = np.clip((HORIZON - self._rows) / HORIZON, 0, 1)
        low, high = smoothstep(up, 0.0, 0.42), smoothstep(up, 0.25, 1.0)
        bands = light.horizon + low * (light.middle - light.horizon)
        sky[...] = (bands + high * (light.zenith - bands))[:, np.newaxis, :]
        squared = (self._columns - sun[0]) ** 2 + (self._rows - sun[1]) ** 2
        glow = 0.30 / (1 + squared / 0.012)
        glow += 0.14 / (1 + squared / 0.09)
        glow += 0.75 * np.exp(-(((self._columns - sun[0]) / 0.55) ** 2)) * np.exp(-((up / 0.30) ** 1.3))
        sky += glow[..., np.newaxis] * light.glow
        if altitude < -3:
            sky += self._stars * np.float32(_fade(altitude, -3.0, -9.0))
        cover, lit = self._clouds.at(altitude)
        rows = slice(0, len(cover))
        edge = lit + 0.6 / (1 + squared[rows] / 0.03)  # clouds before the sun shine through
        clouds = edge[..., np.newaxis] * (light.cloud_lit - light.cloud_dark)
        clouds += light.cloud_dark
        clouds -= sky[rows]
        clouds *= cover[..., np.newaxis]
        sky[rows] += clouds
        disc = np.clip((SUN_RADIUS - np.sqrt(squared)) * self.height + 0.5, 0, 1)
        disc[rows] *= 1 - 0.8 * cover
        seen = disc > 0
        sky[seen] += disc[seen, np.newaxis] * light.disc

    def _air(self, light: Daylight, sun: tuple[float, float]) -> Image:
        """Return the colour of hazy air along the horizon, (width, 3)."""
        towards = np.exp(-(((self._columns[0] - sun[0]) / 0.6) ** 2))[:, np.newaxis]
        air: Image = 0.62 * light.horizon + 0.20 * light.middle + 0.40 * towards * light.glow
        return air

    def _paint_mist(self, picture: Image, air: Image, altitude: float) -> None:
        """Paint the morning's mist over the far shore."""
        top = round((WATERLINE - 0.10) * self.height)
        strength = 0.75 * math.exp(-(((altitude - 2) / 6.0) ** 2)) + 0.10
        heap = np.exp(-(((self._rows[top:] - WATERLINE + 0.012) / 0.030) ** 2))
        share = np.float32(strength) * heap * self._clouds.mist(altitude)
        picture[top:] += share[..., np.newaxis] * (1.1 * air - picture[top:])

    def _encoded(self, picture: Image) -> NDArray[np.uint16]:
        """Return pixel values of linear light: what is near the peak or above is compressed smoothly."""
        steps = np.float32((len(self._tone) - 1) / math.sqrt(BRIGHTEST))
        np.clip(picture, 0, BRIGHTEST, out=picture)
        np.sqrt(picture, out=picture)
        picture *= steps
        return np.take(self._tone, picture.astype(np.uint16))


class _Ground:
    """A landscape under changing light; only the pixels that it covers are computed."""

    def __init__(self, land: Landscape, rows: slice) -> None:
        cover = land.cover[rows].ravel()
        self._at = np.flatnonzero(cover)
        self._column = self._at % land.cover.shape[1]
        haze, seen = land.haze[rows].ravel()[self._at], cover[self._at]
        self._own = land.albedo[rows].reshape(-1, 3)[self._at] * ((1 - haze) * seen)[:, np.newaxis]
        self._haze = (haze * seen)[:, np.newaxis]
        self._behind = (1 - seen)[:, np.newaxis]
        self._facing = land.facing[rows].ravel()[self._at]
        self._height = land.height[rows].ravel()[self._at]

    def paint(self, picture: Image, light: Daylight, air: Image, altitude: float) -> None:
        """Paint the landscape in front of a picture of the same rows.

        The sun's light comes down the slopes as it climbs: first to the peaks, last to the valley.
        """
        line = 0.80 - 0.085 * (altitude + 1.5)
        lit = (self._facing * smoothstep(self._height, line, line + 0.2))[:, np.newaxis]
        shown = lit * light.sun
        shown += light.ambient
        shown *= self._own
        shown += self._haze * np.take(air, self._column, axis=0)
        pixels = picture.reshape(-1, 3)
        shown += self._behind * np.take(pixels, self._at, axis=0)
        pixels[self._at] = shown


class _Clouds:
    """Two decks of clouds that drift, seen in perspective, and the mist over the lake."""

    TEXTURE = (512, 1024)  # so fine that the nearest clouds are smooth

    def __init__(self, rng: np.random.Generator, rows: Image, columns: Image, aspect: float) -> None:
        up: Image = HORIZON - rows[: np.count_nonzero(rows < HORIZON)]
        away: Image = 1 / (up + 0.16)
        seen = smoothstep(up, 0.0, 0.14)
        aside = columns - aspect / 2
        high = fractal_noise(rng, self.TEXTURE, (6, 5), octaves=6, gain=0.55)
        low = fractal_noise(rng, self.TEXTURE, (5, 7), octaves=7, gain=0.52)
        self._decks = (
            _Deck(high, 0.70 * seen, 46 * away * aside, 88 * away, speed=2.2),
            _Deck(low, 0.95 * seen, 62 * away * aside, 130 * away, speed=3.6),
        )
        self._mist = fractal_noise(rng, (1, 1024), (1, 7), octaves=5)[0]
        self._mist_at = columns[0] * (560 / aspect)

    def at(self, altitude: float) -> tuple[Image, Image]:
        """Return how much the clouds cover, and how much of them the sun lights, both (rows, width)."""
        far, near = (deck.at(altitude) for deck in self._decks)
        lit = far[1] + near[0] * (near[1] - far[1])
        return far[0] + near[0] * (1 - far[0]), lit

    def mist(self, altitude: float) -> Image:
        """Return how thick the mist is along the lake, (1, width), about 0 to 1."""
        place = (self._mist_at + 3.0 * (altitude + 40)).astype(np.intp) % len(self._mist)
        thick: Image = np.clip(1.6 * self._mist[place] - 0.1, 0, 1)
        return thick[np.newaxis, :]


class _Deck:
    """One deck of clouds: a flat texture that is looked at from below and drifts sideways."""

    def __init__(self, noise: Image, most: Image, across: Image, along: Image, speed: float) -> None:
        ahead = np.roll(noise, -6, axis=0) + np.roll(noise, 4, axis=1)
        facing = np.clip(0.45 + 4.0 * (noise - 0.5 * ahead), 0, 1)
        self._wide = noise.shape[1]
        self._layers: list[tuple[Image, Image]] = [
            (layer.ravel(), (np.roll(layer, -1, axis=1) - layer).ravel())
            for layer in (smoothstep(noise, 0.54, 0.80), facing)
        ]
        self._row = (along.astype(np.int32) % noise.shape[0]) * self._wide
        self._most, self._across, self._speed = most, across, speed

    def at(self, altitude: float) -> tuple[Image, Image]:
        """Return how much the clouds of the deck cover, and how much the sun lights them."""
        x: Image = self._across + np.float32(self._speed * (altitude + 40) + 8 * self._wide)
        whole = x.astype(np.int32)
        x -= whole
        whole &= self._wide - 1
        whole += self._row
        drawn = [np.take(layer, whole) + x * np.take(rise, whole) for layer, rise in self._layers]
        return drawn[0] * self._most, drawn[1]


class _Lake:
    """Water that mirrors what is above it, stirred by small waves."""

    def __init__(self, rng: np.random.Generator, water: int, height: int, width: int) -> None:
        rows = height - water
        self._depth = centres(rows, rows)[:, np.newaxis]
        self._source = water - 1 - np.float32(1.15) * np.arange(rows, dtype=np.float32)[:, np.newaxis]
        far = 1 / (self._depth + 0.10)  # waves crowd with distance
        self._phases = []
        for cells, crowding in (((9, 7), 9.0), ((16, 18), 17.0), ((34, 40), 34.0)):
            noise = fractal_noise(rng, (rows, width), cells, octaves=3, gain=0.6)
            self._phases.append(9 * noise + crowding * far)
        self._reach = height * (0.25 + 1.6 * self._depth)
        self._mirror = (0.86 - 0.34 * self._depth)[..., np.newaxis]
        self._columns = np.arange(width, dtype=np.float32)[np.newaxis, :]

    def mirrored(self, above: Image, light: Daylight, sun: float, altitude: float) -> Image:
        """Return the lake (rows, width, 3), for the picture above the waterline and the sun's column."""
        slope = np.zeros((len(self._depth), above.shape[1]), dtype=np.float32)
        for phase, swell, speed in zip(self._phases, (0.010, 0.009, 0.008), (1.1, 1.7, 2.6), strict=True):
            slope += np.float32(swell) * np.sin(phase + np.float32(speed * altitude))
        row = np.clip(self._source + self._reach * slope, 0, len(above) - 1).astype(np.int32)
        column = np.clip(self._columns + 0.3 * self._reach * slope, 0, above.shape[1] - 1).astype(np.int32)
        lake: Image = np.take(above.reshape(-1, 3), row * above.shape[1] + column, axis=0)
        lake *= self._mirror
        lake += light.ambient * np.array([0.018, 0.040, 0.050], dtype=np.float32)
        path = np.exp(-(((self._columns - sun) / (self._reach * (0.06 + 0.05 * self._depth))) ** 2))
        glitter = path * smoothstep(slope, 0.006, 0.022)
        lake += (_fade(altitude, 1.5, 6.0) * 0.9 * glitter)[..., np.newaxis] * light.sun
        return lake


def _stars(rng: np.random.Generator, rows: int, width: int, height: int) -> Image:
    """Return stars as linear light (rows, width, 3); bright ones are few, as in the sky."""
    sky = np.zeros((rows, width, 3), dtype=np.float32)
    scale = height / 360
    for _ in range(420):
        y, x = rng.random() ** 1.2 * rows * 0.85, rng.random() * width
        power = 0.035 * rng.pareto(1.4) + 0.015
        tint = 1 + rng.normal(0, 0.12) * np.array([1.0, 0.2, -1.0])
        _spot(sky, (y, x), 0.55 * scale, min(power, 0.8) * tint)
    return sky


def _lamps(rng: np.random.Generator, rows: int, width: int, height: int) -> Image:
    """Return the lamps of a village on the far shore as linear light (rows, width, 3)."""
    land = np.zeros((rows, width, 3), dtype=np.float32)
    for _ in range(16):
        place = (0.642 - 0.020 * rng.random() ** 2) * height, (0.335 + 0.10 * rng.normal(0, 0.6)) * width
        warm = np.array([1.0, 0.58, 0.22]) * rng.uniform(0.15, 0.75)
        _spot(land, place, 0.75 * height / 360, warm)
    return land


def _spot(picture: Image, place: tuple[float, float], radius: float, colour: NDArray[np.float64]) -> None:
    """Add a small soft spot of light."""
    reach = max(2, math.ceil(3 * radius))
    y, x = round(place[0]), round(place[1])
    rows = np.arange(max(y - reach, 0), min(y + reach + 1, picture.shape[0]))
    columns = np.arange(max(x - reach, 0), min(x + reach + 1, picture.shape[1]))
    if not (len(rows) and len(columns)):
        return
    down = np.exp(-(((rows - place[0]) / radius) ** 2))[:, np.newaxis]
    aside = np.exp(-(((columns - place[1]) / radius) ** 2))[np.newaxis, :]
    picture[np.ix_(rows, columns)] += ((down * aside)[..., np.newaxis] * colour).astype(np.float32)


def _fade(altitude: float, none: float, full: float) -> float:
    """Return how much of a light of the night is left: 0 above `none`, 1 below `full` [degrees]."""
    return min(max((altitude - none) / (full - none), 0.0), 1.0)


def _tone_curve() -> NDArray[np.uint16]:
    """Return pixel values over the square root of linear light from 0 to `BRIGHTEST`, in 8192 steps.

    Linear up to 0.6 of the peak, then a shoulder that reaches the peak with the sun.
    """
    light = np.linspace(0, math.sqrt(BRIGHTEST), 8193) ** 2
    over = np.maximum(light - 0.6, 0)
    tone = np.minimum(light, 0.6) + 0.4 * (1 - np.exp(-over / 0.4))
    return on_grid((tone / tone[-1]) ** (1 / 2.2))
