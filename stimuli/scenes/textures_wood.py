"""Textures of wood: boards with their grain, planks and parquet, painted boards."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.fractal_noise import smoothstep
from evenlight.stimuli.scenes.colours import Colour, Texture, albedo, blended, rgb, shaded
from evenlight.stimuli.scenes.tileable import places, tileable_noise


def grain(rng: np.random.Generator, size: int, rings: int = 9) -> NDArray[np.float32]:
    """Return how dark the grain of wood is, 0 to 1; it runs from left to right."""
    down, across = places(size)
    bend = tileable_noise(rng, size, (3, 1), 4, 0.45)
    ring = np.sin(2 * np.pi * (rings * down + 3.2 * bend + 0 * across))
    fibres = tileable_noise(rng, size, (size // 6, 4), 3, 0.7)
    pores = smoothstep(tileable_noise(rng, size, (size // 3, 12), 1), 0.72, 0.9)
    dark: NDArray[np.float32] = 0.45 + 0.22 * ring + 0.55 * (fibres - 0.5) + 0.35 * pores
    return np.clip(dark, 0, 1).astype(np.float32)


def wood(light: Colour, dark: Colour, rings: int = 9) -> Texture:
    """Return a sawn and oiled board; the grain runs along u (about 0.8 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        return albedo(blended(light, dark, grain(rng, size, rings)))

    return texture


def planks(light: Colour, dark: Colour, rows: int = 8) -> Texture:
    """Return floor boards laid along u, ends broken at random, narrow dark gaps (about 1.2 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        row = np.minimum((down * rows).astype(np.intp), rows - 1)
        ends = np.sort(rng.random((rows, 2)) * 0.5 + np.array([0.0, 0.5]), axis=1)
        second = ((across >= ends[row, 0]) & (across < ends[row, 1])).astype(np.intp)
        tone = rng.random((rows, 2))[row, second]
        figure = grain(rng, size, 7)
        # Every board shows its own stretch of the grain.
        shift = rng.integers(0, size, (rows, 2))[row, second]
        column = (np.arange(size)[np.newaxis, :] + shift) % size
        own = figure[(np.arange(size)[:, np.newaxis] + 3 * shift) % size, column]
        picture = shaded(blended(light, dark, 0.25 + 0.7 * own), 0.72 + 0.5 * tone)
        gap = np.abs(down * rows - row - 0.5) > 0.5 - max(0.012, 0.6 * rows / size)
        for end in range(2):
            gap = gap | (np.abs(across - ends[row, end]) < 0.6 / size)
        return albedo(shaded(picture, 1 - 0.6 * gap))

    return texture


def painted_boards(colour: Colour, boards: int = 8) -> Texture:
    """Return upright tongue-and-groove boards under paint (about 1 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        place = np.mod(across * boards, 1)
        groove = smoothstep(np.abs(place - 0.5), 0.44, 0.49)
        bead = smoothstep(np.abs(place - 0.5), 0.36, 0.40) - smoothstep(np.abs(place - 0.5), 0.40, 0.44)
        tone = (0.93 + 0.12 * rng.random(boards))[(across * boards).astype(np.intp) % boards]
        brush = tileable_noise(rng, size, (3, size // 4), 2)
        factor = tone * (1 - 0.6 * groove - 0.15 * bead) * (0.93 + 0.12 * brush) + 0 * down
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def panel_door(light: Colour, dark: Colour) -> Texture:
    """Return a whole door leaf of six panels: one tile is the leaf, v from the floor up."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        relief = np.ones((size, size), dtype=np.float32)
        for top, bottom in ((0.06, 0.22), (0.28, 0.55), (0.62, 0.93)):
            for left, right in ((0.13, 0.46), (0.54, 0.87)):
                inside = np.minimum(
                    np.minimum(down - top, bottom - down) * 2, np.minimum(across - left, right - across)
                )
                edge = smoothstep(inside, 0.0, 0.012) - smoothstep(inside, 0.024, 0.036)
                lit = np.where((down - top < 0.02) | (across - left < 0.035), 0.55, 1.22)
                relief *= 1 + edge * (lit - 1)
        figure = grain(rng, size, 6).T
        return albedo(shaded(blended(light, dark, figure), relief))

    return texture
