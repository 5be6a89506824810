"""The direct light of lamps, windows and the sun on samples: loops of the bake, for a range of samples each.

Light is counted as the luminance of white paper at a sample, facing along its normal. The sky is a clear
gradient, bright around the sun; the picture of it has some clouds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.fractal_noise import fractal_noise, smoothstep
from evenlight.stimuli.scenes.engine.light.bake_kernels import OFFSET, hashed, radical_inverse
from evenlight.stimuli.scenes.engine.light.ray_tree import DEPTH, blocker
from evenlight.stimuli.scenes.engine.scene import Floats, Scene, Sky, stream

FAINT = 0.004  # [cd/m^2] a lamp's light that is not worth a shadow
SKY_SIZE = (512, 2048)  # rows and columns of the picture
GRADIENT = 0.45  # exponent of the change from horizon to zenith over the sine of the altitude


@compiled_loop(error_model="numpy")
def _jitter(value, salt):
    """Return a place in the middle half of a cell: no bands, and less noise than anywhere in it."""
    return 0.25 + 0.5 * hashed(value, salt)


@compiled_loop(nogil=True, error_model="numpy")
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
    stack, guesses = np.empty((2, DEPTH)), np.full(len(lamps[0]), -1)
    sizes = _sizes(lamps[1], lamps[2], lamps[4])
    for i in range(begin, end):
        px, py, pz = place[i]
        nx, ny, nz = normal[i]
        for m in range(len(lamps[0])):
            x, y, z = lamps[0][m, 0] - px, lamps[0][m, 1] - py, lamps[0][m, 2] - pz
            ax, ay, az = lamps[1][m]
            bx, by, bz = lamps[2][m]
            wide, high, area = sizes[m]
            # Nothing comes from the back of a lamp, nor from below the surface.
            below = x * lamps[3][m, 0] + y * lamps[3][m, 1] + z * lamps[3][m, 2] >= 0
            up, along, across = (
                nx * x + ny * y + nz * z,
                nx * ax + ny * ay + nz * az,
                nx * bx + ny * by + nz * bz,
            )
            highest = up + max(along, 0.0) + max(across, 0.0)
            if lamps[5][m] == own[i] or below or (highest <= 0 and not both[i]):
                continue
            mx, my, mz = x + 0.5 * (ax + bx), y + 0.5 * (ay + by), z + 0.5 * (az + bz)
            distance = math.sqrt(mx * mx + my * my + mz * mz)
            reach = max(distance - 0.5 * (wide + high), 0.05)
            bright = max(lamps[6][m, 0], lamps[6][m, 1], lamps[6][m, 2])
            if bright * area / (math.pi * reach * reach) < FAINT:
                continue
            columns = min(max(math.ceil(3.0 * wide / max(distance, 0.2)), 1), 6)
            rows = min(max(math.ceil(3.0 * high / max(distance, 0.2)), 1), 6)
            share = 0.0
            for a in range(columns):
                for b in range(rows):
                    s, t = (a + _jitter(i, 3 + 7 * a + b)) / columns, (b + _jitter(i, 91 + 7 * a + b)) / rows
                    share += _seen(tree, lamps, m, i, s, t, place, normal, own, both, guesses, stack)
            share *= area / (math.pi * columns * rows)
            for c in range(3):
                light[i, c] += share * lamps[6][m, c]


@compiled_loop(error_model="numpy")
def _sizes(along, across, triangle):
    """Return the lengths of the edges of pieces, and their areas, (n, 3)."""
    sizes = np.empty((len(along), 3))
    for m in range(len(along)):
        sizes[m, 0], sizes[m, 1] = math.sqrt((along[m] ** 2).sum()), math.sqrt((across[m] ** 2).sum())
        whole = math.sqrt((np.cross(along[m], across[m]) ** 2).sum())
        sizes[m, 2] = 0.5 * whole if triangle[m] else whole
    return sizes


@compiled_loop(error_model="numpy")
def _seen(tree, lamps, m, i, s, t, place, normal, own, both, guesses, stack):
    """Return cos cos / distance^2 towards a point of a lamp [1/m^2], 0 if it is hidden."""
    if lamps[4][m] and s + t > 1:
        s, t = 1 - s, 1 - t
    x = lamps[0][m, 0] + s * lamps[1][m, 0] + t * lamps[2][m, 0] - place[i, 0]
    y = lamps[0][m, 1] + s * lamps[1][m, 1] + t * lamps[2][m, 1] - place[i, 1]
    z = lamps[0][m, 2] + s * lamps[1][m, 2] + t * lamps[2][m, 2] - place[i, 2]
    squared = x * x + y * y + z * z
    distance = math.sqrt(squared)
    if distance < 1e-3:
        return 0.0
    here = (x * normal[i, 0] + y * normal[i, 1] + z * normal[i, 2]) / distance
    there = -(x * lamps[3][m, 0] + y * lamps[3][m, 1] + z * lamps[3][m, 2]) / distance
    side = OFFSET if here > 0 else -OFFSET
    if both[i]:
        here = 0.5 * abs(here)
    if here <= 0 or there <= 0:
        return 0.0
    ray = x / distance, y / distance, z / distance
    found = _first_on(
        tree, place[i], normal[i], side, ray, distance - 0.003, own[i], lamps[5][m], i, guesses[m], stack
    )
    if found >= 0:
        guesses[m] = found
        return 0.0
    # Very near to a lamp the inverse square of few points would overshoot: a lamp fills half of all at most.
    return here * there / max(squared, 0.01)


@compiled_loop(error_model="numpy")
def _first_on(tree, place, normal, side, d, far, own, other, ray, guess, stack):
    """Return what stops a ray, as `blocker` does, that starts somewhat to the side of a place, (3,)."""
    return blocker(
        tree, np.float32(place[0] + side * normal[0]), np.float32(place[1] + side * normal[1]),
        np.float32(place[2] + side * normal[2]), np.float32(d[0]), np.float32(d[1]), np.float32(d[2]),
        np.float32(far), own, other, ray, guess, stack,
    )  # fmt: skip


@compiled_loop(nogil=True, error_model="numpy")
def through_windows(begin, end, tree, windows, sky, place, normal, own, both, light):
    """Add the light of the sky that comes through windows; parameters as in `gather` and `from_lamps`."""
    stack = np.empty((2, DEPTH))
    bright = max(sky[0].max(), sky[1].max())
    for w in range(len(windows)):
        along, across = windows[w, 1] - windows[w, 0], windows[w, 3] - windows[w, 0]
        facing = np.cross(along, across)
        area = math.sqrt((facing**2).sum())
        facing /= area
        wide, high = math.sqrt((along**2).sum()), math.sqrt((across**2).sum())
        middle, guess = windows[w, 0] + 0.5 * (along + across), -1
        for i in range(begin, end):
            mx, my, mz = middle[0] - place[i, 0], middle[1] - place[i, 1], middle[2] - place[i, 2]
            distance = math.sqrt(mx * mx + my * my + mz * mz)
            reach = max(distance - 0.5 * (wide + high), 0.05)
            up = mx * normal[i, 0] + my * normal[i, 1] + mz * normal[i, 2]
            faint = bright * area / (math.pi * reach * reach) < 2 * FAINT
            if faint or (up < -0.5 * (wide + high) and not both[i]):
                continue
            columns = min(max(math.ceil(3.0 * wide / max(distance, 0.3)), 1), 8)
            rows = min(max(math.ceil(3.0 * high / max(distance, 0.3)), 1), 8)
            for a in range(columns):
                for b in range(rows):
                    s = (a + _jitter(i, 5 + 11 * a + b)) / columns - 0.5
                    t = (b + _jitter(i, 131 + 11 * a + b)) / rows - 0.5
                    x, y, z = (
                        mx + s * along[0] + t * across[0],
                        my + s * along[1] + t * across[1],
                        mz + s * along[2] + t * across[2],
                    )
                    squared = x * x + y * y + z * z
                    far = math.sqrt(squared)
                    here = (x * normal[i, 0] + y * normal[i, 1] + z * normal[i, 2]) / far
                    side = OFFSET if here > 0 else -OFFSET
                    if both[i]:
                        here = 0.5 * abs(here)
                    if here <= 0:
                        continue
                    ray = x / far, y / far, z / far
                    found = _first_on(
                        tree, place[i], normal[i], side, ray, np.inf, own[i], -1, i, guess, stack
                    )
                    if found >= 0:
                        guess = found
                        continue
                    there = abs(ray[0] * facing[0] + ray[1] * facing[1] + ray[2] * facing[2])
                    share = here * there * area / (math.pi * max(squared, 0.02) * columns * rows)
                    height = max(ray[2], 0.0) ** sky[2]
                    for c in range(3):
                        light[i, c] += share * (sky[1][c] + height * (sky[0][c] - sky[1][c]))


@compiled_loop(nogil=True, error_model="numpy")
def from_sun(begin, end, tree, towards, spread, place, normal, own, both, light):
    """Set, per sample, which share of the sun's light arrives, over a few points around it.

    `towards` is the sun's direction, (3,); `spread`, (n, 2, 3), the steps to the neighbouring samples [m].
    """
    tries, guess = 4, -1
    stack = np.empty((2, DEPTH))
    for i in range(begin, end):
        here = (normal[i] * towards).sum()
        side = OFFSET if here > 0 else -OFFSET
        if both[i]:
            here = 0.75 * abs(here)
        if here <= 0:
            continue
        free = 0
        for j in range(tries):
            s, t = (j + 0.5) / tries - 0.5, radical_inverse(j) + 0.125 - 0.5
            start = place[i] + s * spread[i, 0] + t * spread[i, 1]
            found = _first_on(tree, start, normal[i], side, towards, np.inf, own[i], -1, i, guess, stack)
            free += found < 0
            guess = found if found >= 0 else guess
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
