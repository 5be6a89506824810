"""The sky as light: a clear gradient, bright around the sun, with some clouds in the picture of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from evenlight.stimuli.fractal_noise import fractal_noise, smoothstep
from evenlight.stimuli.scenes.scene import Floats, Scene, Sky, stream

SIZE = (512, 2048)  # rows and columns of the picture
GRADIENT = 0.45  # exponent of the change from horizon to zenith over the sine of the altitude


def sky_luminance(sky: Sky, upward: Floats) -> Floats:
    """Return the clear sky's luminance, (..., 3), for the z of directions, (...) [cd/m^2].

    Below the horizon it is that of the horizon: haze. This is what lights the scene.

    >>> sky_luminance(Sky((1.0, 2.0, 4.0), (8.0, 8.0, 8.0)), np.array([1.0, 0.0, -0.5])).tolist()
    [[1.0, 2.0, 4.0], [8.0, 8.0, 8.0], [8.0, 8.0, 8.0]]
    """
    share = np.clip(upward, 0, 1)[..., None] ** GRADIENT
    return np.asarray(np.asarray(sky.horizon) + share * (np.asarray(sky.zenith) - np.asarray(sky.horizon)))


def sky_picture(scene: Scene, size: tuple[int, int] = SIZE) -> NDArray[np.float32]:
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
