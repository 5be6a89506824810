"""Textures of single things: a screen, a clock's face, a keyboard, a pegboard, wire mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.fractal_noise import smoothstep
from evenlight.stimuli.scenes.colours import Colour, Texture, albedo, blended, rgb, shaded
from evenlight.stimuli.scenes.textures_print import landscape_painting
from evenlight.stimuli.scenes.tileable import places, tileable_noise


def screen(sky: Colour, glow: Colour) -> Texture:
    """Return a television that is off: dark glass with a dim room in it; one tile is the whole."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        mirrored = 0.12 * landscape_painting(sky, (0.02, 0.02, 0.03), glow)(rng, size)
        down, across = places(size)
        rim = np.minimum(np.minimum(down, 1 - down), np.minimum(across, 1 - across))
        return albedo(blended((0.012, 0.012, 0.014), mirrored + 0.012, smoothstep(rim, 0.02, 0.2)))

    return texture


def dial_face(ground: Colour, ink: Colour) -> Texture:
    """Return the face of a clock with its marks and two hands; one tile is the whole."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        y, x = 2 * down - 1 + 0 * across, 2 * across - 1 + 0 * down
        radius, angle = np.hypot(x, y), np.arctan2(x, -y) / (2 * np.pi)
        marks = (np.abs(np.mod(12 * angle + 0.5, 1) - 0.5) < 0.13) & (radius > 0.72) & (radius < 0.86)
        marks |= (np.abs(np.mod(60 * angle + 0.5, 1) - 0.5) < 0.16) & (radius > 0.8) & (radius < 0.86)
        for turn, length, wide in ((0.31, 0.45, 0.045), (0.72, 0.68, 0.03)):  # about a quarter to four
            along = x * np.sin(2 * np.pi * turn) - y * np.cos(2 * np.pi * turn)
            aside = x * np.cos(2 * np.pi * turn) + y * np.sin(2 * np.pi * turn)
            marks |= (np.abs(aside) < wide) & (along > -0.1) & (along < length)
        marks |= (radius > 0.93) & (radius < 1.0)
        return albedo(blended(ground, ink, marks) * rgb(0.96 + 0.04 * rng.random()))

    return texture


def keyboard() -> Texture:
    """Return keys in rows, black on grey: a keyboard, a row of switches; one tile is the whole."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        key = np.minimum(
            np.abs(np.mod(down * 5, 1) - 0.5) < 0.38, np.abs(np.mod(across * 14, 1) - 0.5) < 0.38
        )
        sign = (np.abs(np.mod(down * 5, 1) - 0.5) < 0.14) & (np.abs(np.mod(across * 14, 1) - 0.5) < 0.1)
        picture = blended((0.25, 0.25, 0.26), (0.03, 0.03, 0.035), key)
        return albedo(
            blended(picture, (0.6, 0.6, 0.6), sign & (tileable_noise(rng, size, (16, 16), 1) > 0.3))
        )

    return texture


def perforated(colour: Colour, number: int = 16) -> Texture:
    """Return a board with a grid of round holes (0.5 m a tile with 16 holes across)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        hole = np.hypot(np.mod(down * number, 1) - 0.5, np.mod(across * number, 1) - 0.5)
        fibre = tileable_noise(rng, size, (size // 4, size // 4), 2)
        factor = (0.15 + 0.85 * smoothstep(hole, 0.13, 0.2)) * (0.85 + 0.3 * fibre)
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def wire(colour: Colour, number: int = 6) -> Texture:
    """Return crossed wires with holes between, (size, size, 4) (0.3 m a tile with 6 meshes across)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        near = np.minimum(
            np.abs(np.mod(down * number, 1) - 0.5) + 0 * across,
            np.abs(np.mod(across * number, 1) - 0.5) + 0 * down,
        )
        picture = np.empty((size, size, 4), dtype=np.float32)
        picture[..., :3] = albedo(
            shaded(
                np.broadcast_to(rgb(colour), (size, size, 3)),
                0.8 + 0.4 * tileable_noise(rng, size, (32, 32), 2),
            )
        )
        picture[..., 3] = 1 - smoothstep(near, 0.06, 0.10)
        return picture

    return texture
