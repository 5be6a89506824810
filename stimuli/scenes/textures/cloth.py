"""Textures of cloth: upholstery, carpet, a knotted rug, curtains, towels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.fractal_noise import smoothstep
from evenlight.stimuli.scenes.textures.tileable import (
    Colour,
    Texture,
    albedo,
    blended,
    places,
    rgb,
    shaded,
    tileable_noise,
)


def weave(rng: np.random.Generator, size: int, threads: int) -> NDArray[np.float32]:
    """Return how light the threads of a plain weave are, about 0.7 to 1.2."""
    down, across = places(size)
    over = np.sin(2 * np.pi * threads * down) * np.sin(2 * np.pi * threads * across)
    slub = tileable_noise(rng, size, (threads, 4), 1) + tileable_noise(rng, size, (4, threads), 1)
    return rgb(0.8 + 0.13 * over + 0.2 * slub)


def fabric(colour: Colour, threads: int = 48) -> Texture:
    """Return upholstery in a plain weave with wear (about 0.5 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        wear = tileable_noise(rng, size, (3, 3), 4)
        factor = weave(rng, size, threads) * (0.85 + 0.3 * wear)
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def striped_fabric(colours: tuple[Colour, ...], repeat: int = 2) -> Texture:
    """Return cloth with stripes across u: towels, deck chairs, awnings, curtains."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        band = np.floor(across * repeat * len(colours)).astype(np.intp) % len(colours)
        picture = np.broadcast_to(rgb(colours)[band], (size, size, 3))
        return albedo(shaded(picture, weave(rng, size, 48) + 0 * down))

    return texture


def checked_fabric(colour: Colour, second: Colour, number: int = 6) -> Texture:
    """Return gingham: two sets of stripes that cross (about 0.6 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        share = 0.5 * (np.mod(down * number, 1) < 0.5) + 0.5 * (np.mod(across * number, 1) < 0.5)
        return albedo(shaded(blended(colour, second, share), weave(rng, size, 48)))

    return texture


def curtain(colour: Colour, folds: int = 6) -> Texture:
    """Return hanging cloth: a pattern of leaves in tone, its folds darker (about 0.8 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        fold = 0.80 + 0.20 * np.sin(2 * np.pi * folds * across)
        leaf = np.sin(2 * np.pi * (4 * down + 0.6 * np.sin(2 * np.pi * 4 * across)))
        leaf = smoothstep(leaf * np.sin(2 * np.pi * 8 * across), 0.35, 0.5)
        factor = fold * (1 - 0.25 * leaf) * weave(rng, size, 64)
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def carpet(colour: Colour, second: Colour) -> Texture:
    """Return a loop-pile carpet in two mixed yarns (about 0.6 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        loops = max(size // 5, 8)
        yarn = tileable_noise(rng, size, (loops, loops), 1)
        broad = tileable_noise(rng, size, (4, 4), 4)
        down, across = places(size)
        pile = 0.82 + 0.18 * np.sin(2 * np.pi * loops * down) * np.sin(2 * np.pi * loops * across)
        return albedo(
            shaded(blended(colour, second, smoothstep(yarn, 0.25, 0.75)), pile * (0.85 + 0.3 * broad))
        )

    return texture


def rug(ground: Colour, border: Colour, accent: Colour) -> Texture:
    """Return a whole knotted rug: borders, a medallion, small flowers; one tile is the rug."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        # Symmetric about both middles, as the looms make them; that also makes opposite edges equal.
        x, y = _folded(size)
        rim = 1 - np.maximum(x, y)
        picture = blended(ground, accent, 0.8 * _flowers(x, y, 7))
        picture = blended(picture, border, 0.9 * smoothstep(_flowers(x, y, 13), 0.6, 0.7))
        medallion = np.hypot(x * 1.15, y) + 0.05 * np.cos(8 * np.arctan2(y, x))
        rings = smoothstep(np.cos(2 * np.pi * 5.5 * medallion), -0.2, 0.2)
        inner = 1 - smoothstep(medallion, 0.55, 0.56)
        picture = blended(picture, blended(border, accent, rings), inner)
        small = smoothstep(np.abs(medallion - 0.34) + 0.08 * _flowers(x, y, 17), 0.06, 0.07)
        picture = blended(blended(picture, ground, inner), picture, small)
        frieze = blended(border, ground, smoothstep(_flowers(x, y, 9), 0.5, 0.6))
        picture = blended(picture, frieze, 1 - smoothstep(rim, 0.26, 0.265))
        for near, far, colour in ((0.25, 0.28, accent), (0.21, 0.225, ground), (0.05, 0.075, accent)):
            line = smoothstep(rim, near - 0.004, near) * (1 - smoothstep(rim, far, far + 0.004))
            picture = blended(picture, colour, line)
        picture = blended(picture, border, 1 - smoothstep(rim, 0.035, 0.04))
        abrash = tileable_noise(rng, size, (12, 1), 3)  # bands where the dye of the wool changed
        knots = tileable_noise(rng, size, (size // 3, size // 3), 1)
        return albedo(shaded(picture, 0.72 + 0.3 * abrash + 0.3 * (knots - 0.3)))

    return texture


def _folded(size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the distances from the two middle lines, 0 to 1 at the edges, as (size, size) arrays."""
    down, across = places(size)
    y, x = np.meshgrid(np.abs(2 * down.ravel() - 1), np.abs(2 * across.ravel() - 1), indexing="ij")
    return x, y


def _flowers(x: NDArray[np.float32], y: NDArray[np.float32], number: int) -> NDArray[np.float32]:
    """Return a lattice of small four-leaved flowers, 0 to 1."""
    petals = np.cos(np.pi * number * x) * np.cos(np.pi * number * y)
    between = np.cos(np.pi * number * (x + y) * 1.0) * np.cos(np.pi * number * (x - y) * 1.0)
    return np.asarray(smoothstep(np.abs(petals) + 0.45 * between, 0.5, 0.8), dtype=np.float32)
