"""The direct light of lamps, windows and the sun on samples: loops of the bake, for a range of samples each.

Light is counted as the luminance of white paper at a sample, facing along its normal. The sky is a clear
gradient, bright around the sun; the picture of it has some clouds.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from evenlight.stimuli.fractal_noise import fractal_noise, smoothstep
from evenlight.stimuli.scenes.light.bake_kernels import OFFSET, hashed, radical_inverse
from evenlight.stimuli.scenes.light.ray_tree import DEPTH, blocked
from evenlight.stimuli.scenes.scene import Floats, Scene, Sky, stream

FAINT = 0.004  # [cd/m^2] a lamp's light that is not worth a shadow
SKY_SIZE = (512, 2048)  # rows and columns of the picture
GRADIENT = 0.45  # exponent of the change from horizon to zenith over the sine of the altitude


@numba.njit(cache=True, error_model="numpy")
def _jitter(value, salt):
    """Return a place in the middle half of a cell: no bands, and less noise than anywhere in it."""
    return 0.25 + 0.5 * hashed(value, salt)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def from_lamps(begin, end, tree, lamps, place, normal, own, both, light):
    """Add the light of lamps, each seen from every sample at a grid of its points.

    Parameters
    ----------
    tree : RayTree
        The scene.
    lamps : tuple
        Origin, along, across and unit normal, (l, 3) each, whether a triangle, patch, luminance (l, 3).
    place, normal, own, both
        Of the samples, as in `gather`.
    light : array, (n, 3)
        To which it is added.
    """
    for i in range(begin, end):
        stack = np.empty(DEPTH, np.int32)
        for m in range(len(lamps[0])):
            if lamps[5][m] == own[i]:
                continue
            middle = lamps[0][m] + 0.5 * (lamps[1][m] + lamps[2][m])
            wide = math.sqrt((lamps[1][m] ** 2).sum())
            high = math.sqrt((lamps[2][m] ** 2).sum())
            area = wide * high * (0.5 if lamps[4][m] else 1.0)
            distance = math.sqrt(((middle - place[i]) ** 2).sum())
            reach = max(distance - 0.5 * (wide + high), 0.05)
            bright = lamps[6][m].max()
            if bright * area / (math.pi * reach * reach) < FAINT:
                continue
            columns = min(max(math.ceil(3.0 * wide / max(distance, 0.2)), 1), 6)
            rows = min(max(math.ceil(3.0 * high / max(distance, 0.2)), 1), 6)
            share = 0.0
            for a in range(columns):
                for b in range(rows):
                    share += _seen(
                        tree,
                        lamps,
                        m,
                        i,
                        (a + _jitter(i, 3 + 7 * a + b)) / columns,
                        (b + _jitter(i, 91 + 7 * a + b)) / rows,
                        place,
                        normal,
                        own,
                        both,
                        stack,
                    )
            share *= area / (math.pi * columns * rows)
            for c in range(3):
                light[i, c] += share * lamps[6][m, c]


@numba.njit(cache=True, error_model="numpy")
def _seen(tree, lamps, m, i, s, t, place, normal, own, both, stack):
    """Return cos cos / distance^2 towards a point of a lamp [1/m^2], 0 if it is hidden."""
    if lamps[4][m] and s + t > 1:
        s, t = 1 - s, 1 - t
    to = lamps[0][m] + s * lamps[1][m] + t * lamps[2][m] - place[i]
    squared = (to**2).sum()
    distance = math.sqrt(squared)
    if distance < 1e-3:
        return 0.0
    here = (to * normal[i]).sum() / distance
    there = -(to * lamps[3][m]).sum() / distance
    if both[i]:
        here = 0.5 * abs(here)
    if here <= 0 or there <= 0:
        return 0.0
    side = OFFSET if (to * normal[i]).sum() > 0 else -OFFSET
    start = place[i] + side * normal[i]
    if blocked(
        tree,
        np.float32(start[0]),
        np.float32(start[1]),
        np.float32(start[2]),
        np.float32(to[0] / distance),
        np.float32(to[1] / distance),
        np.float32(to[2] / distance),
        np.float32(distance - 0.003),
        own[i],
        lamps[5][m],
        i,
        stack,
    ):
        return 0.0
    # Very near to a lamp the inverse square of few points would overshoot: a lamp fills half of all at most.
    return here * there / max(squared, 0.01)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def through_windows(begin, end, tree, windows, sky, place, normal, own, both, light):
    """Add the light of the sky that comes through windows; parameters as in `gather` and `from_lamps`."""
    for i in range(begin, end):
        stack = np.empty(DEPTH, np.int32)
        for w in range(len(windows)):
            along, across = windows[w, 1] - windows[w, 0], windows[w, 3] - windows[w, 0]
            facing = np.cross(along, across)
            area = math.sqrt((facing**2).sum())
            facing /= area
            middle = windows[w, 0] + 0.5 * (along + across) - place[i]
            distance = math.sqrt((middle**2).sum())
            wide, high = math.sqrt((along**2).sum()), math.sqrt((across**2).sum())
            bright = max(sky[0].max(), sky[1].max())
            reach = max(distance - 0.5 * (wide + high), 0.05)
            if bright * area / (math.pi * reach * reach) < 2 * FAINT:
                continue
            columns = min(max(math.ceil(3.0 * wide / max(distance, 0.3)), 1), 8)
            rows = min(max(math.ceil(3.0 * high / max(distance, 0.3)), 1), 8)
            for a in range(columns):
                for b in range(rows):
                    s = (a + _jitter(i, 5 + 11 * a + b)) / columns
                    t = (b + _jitter(i, 131 + 11 * a + b)) / rows
                    to = windows[w, 0] + s * along + t * across - place[i]
                    squared = (to**2).sum()
                    d = to / math.sqrt(squared)
                    here = (d * normal[i]).sum()
                    side = OFFSET if here > 0 else -OFFSET
                    if both[i]:
                        here = 0.5 * abs(here)
                    if here <= 0:
                        continue
                    start = place[i] + side * normal[i]
                    if blocked(
                        tree,
                        np.float32(start[0]),
                        np.float32(start[1]),
                        np.float32(start[2]),
                        np.float32(d[0]),
                        np.float32(d[1]),
                        np.float32(d[2]),
                        np.float32(np.inf),
                        own[i],
                        -1,
                        i,
                        stack,
                    ):
                        continue
                    share = (
                        here
                        * abs((d * facing).sum())
                        * area
                        / (math.pi * max(squared, 0.02) * columns * rows)
                    )
                    up = max(d[2], 0.0) ** sky[2]
                    for c in range(3):
                        light[i, c] += share * (sky[1][c] + up * (sky[0][c] - sky[1][c]))


@numba.njit(nogil=True, cache=True, error_model="numpy")
def from_sun(begin, end, tree, towards, spread, place, normal, own, both, light):
    """Set, per sample, which share of the sun's light arrives, over a few points around it.

    `towards` is the sun's direction, (3,); `spread`, (n, 2, 3), the steps to the neighbouring samples [m].
    """
    tries = 4
    for i in range(begin, end):
        stack = np.empty(DEPTH, np.int32)
        here = (normal[i] * towards).sum()
        side = OFFSET if here > 0 else -OFFSET
        if both[i]:
            here = 0.75 * abs(here)
        if here <= 0:
            continue
        free = 0
        for j in range(tries):
            s, t = (j + 0.5) / tries - 0.5, radical_inverse(j) + 0.125 - 0.5
            start = place[i] + s * spread[i, 0] + t * spread[i, 1] + side * normal[i]
            free += not blocked(
                tree, np.float32(start[0]), np.float32(start[1]), np.float32(start[2]),
                np.float32(towards[0]), np.float32(towards[1]), np.float32(towards[2]), np.float32(np.inf),
                own[i], -1, i, stack,
            )  # fmt: skip
        light[i] = here * free / tries


def sky_luminance(sky: Sky, upward: Floats) -> Floats:
    """Return the clear sky's luminance, (..., 3), for the z of directions, (...) [cd/m^2].

    Below the horizon it is that of the horizon: haze. This is what lights the scene.

    >>> sky_luminance(Sky((1.0, 2.0, 4.0), (8.0, 8.0, 8.0)), np.array([1.0, 0.0, -0.5])).tolist()
    [[1.0, 2.0, 4.0], [8.0, 8.0, 8.0], [8.0, 8.0, 8.0]]
    """
    share = np.clip(upward, 0, 1)[..., None] ** GRADIENT
    return np.asarray(np.asarray(sky.horizon) + share * (np.asarray(sky.zenith) - np.asarray(sky.horizon)))


def sky_picture(scene: Scene, size: tuple[int, int] = SKY_SIZE) -> NDArray[np.float32]:
    """Return the sky by altitude and azimuth, (rows, columns, 3) [cd/m^2].

    Row 0 is straight down and the last straight up, in steps of the square root of the altitude from the
    horizon; column 0 is north, and azimuth grows with the columns.
    """
    rows, columns = size
    place = 2 * (np.arange(rows) + 0.5) / rows - 1
    altitude = np.sign(place) * place**2 * math.pi / 2
    azimuth = 2 * math.pi * (np.arange(columns) + 0.5) / columns
    light = np.repeat(sky_luminance(scene.sky, np.sin(altitude))[:, None], columns, axis=1)
    if not np.any([scene.sky.zenith, scene.sky.horizon]):
        return light.astype(np.float32)
    flat = np.cos(altitude)[:, None]
    directions = np.stack(
        [flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(altitude)[:, None] + 0 * azimuth], axis=2
    )
    if scene.sun is not None:
        towards = directions @ scene.sun.direction()
        near = np.arccos(np.clip(towards, -1, 1))
        light += (
            (0.5 * np.exp(-near / 0.12) + 0.25 * np.exp(-near / 0.5))[..., None]
            * np.mean(scene.sky.horizon)
            * np.asarray(scene.sun.colour)
        )
    _add_clouds(scene, light, directions)
    return light.astype(np.float32)


def _add_clouds(scene: Scene, light: Floats, directions: Floats) -> None:
    """Lay fair-weather clouds over the picture of the sky, seen in perspective on a flat deck."""
    noise = fractal_noise(stream(scene.seed, "clouds"), (1024, 1024), (4, 4), octaves=7, gain=0.52)
    upward = directions[..., 2]
    up = np.maximum(upward, 0.03)
    x, y = (260 * directions[..., k] / (up + 0.08) for k in (0, 1))
    seen, behind = (
        map_coordinates(noise, [y + shift, x], order=1, mode="mirror").astype(np.float64) for shift in (0, 14)
    )
    cover = smoothstep(seen, 0.52, 0.75) * smoothstep(upward, 0.02, 0.25) * 0.8
    white = 1.25 * np.mean(scene.sky.horizon) * (0.75 + 0.5 * behind)
    light += cover[..., None] * (white[..., None] * np.array([1.0, 1.0, 1.02]) - light)
