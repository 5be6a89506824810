"""Textures of walls and floors: plaster, wallpaper, concrete, brick, tiles, stone, terrazzo; and of wood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.fractal_noise import smoothstep
from evenlight.stimuli.scenes.textures.tileable import (
    Colour,
    Texture,
    albedo,
    blended,
    cells,
    courses,
    places,
    rgb,
    shaded,
    stamp,
    tileable_noise,
)


def plaster(colour: Colour, roughness: float = 0.06) -> Texture:
    """Return painted plaster: nearly even, with trowel marks and grain (about 2 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        broad = tileable_noise(rng, size, (4, 3), 5)
        grain = tileable_noise(rng, size, (size // 4, size // 4), 2)
        factor = 1 + roughness * ((broad - 0.5) + (grain - 0.5))
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def stripes(colour: Colour, second: Colour, number: int = 8) -> Texture:
    """Return striped wallpaper with a small flower in every second stripe (about 1 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        down, across = places(size)
        wave = np.cos(2 * np.pi * number * across) + 0 * down
        flower = np.cos(2 * np.pi * 2 * number * down + np.pi * np.floor(number * across + 0.5))
        flower = smoothstep(flower + wave, 1.55, 1.8)
        line = smoothstep(np.abs(wave), 0.0, 0.35)
        share = 0.75 * smoothstep(wave, -0.2, 0.2) * line + 0.25 * (1 - line)
        picture = blended(colour, second, share * (1 - flower))
        fibre = tileable_noise(rng, size, (size // 4, size // 8), 2)
        return albedo(shaded(picture, 0.95 + 0.1 * fibre))

    return texture


def concrete(colour: Colour) -> Texture:
    """Return cast concrete: blotches, stains that ran down, pores (about 2.5 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        broad = tileable_noise(rng, size, (3, 3), 6, 0.6)
        streaks = tileable_noise(rng, size, (2, 24), 3)
        grain = tileable_noise(rng, size, (size // 3, size // 3), 1)
        factor = 0.72 + 0.42 * broad + 0.14 * (grain - 0.5) - 0.20 * smoothstep(streaks, 0.6, 0.95)
        pores = tileable_noise(rng, size, (size // 6, size // 6), 1)
        factor = factor * (1 - 0.5 * smoothstep(pores, 0.84, 0.92))
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def brick(colour: Colour, second: Colour, mortar: Colour, rows: int = 12) -> Texture:
    """Return bricks in running bond, each burnt a little differently (0.9 m a tile with 12 courses)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        per_row = max(rows // 3, 1)
        number, body = courses(size, rows, per_row, 0.5, (0.15, 0.05))
        tone = rng.random(rows * per_row)[number]
        burnt = (0.75 + 0.45 * rng.random(rows * per_row))[number]
        grain = tileable_noise(rng, size, (32, 32), 4, 0.7)
        stones = shaded(blended(colour, second, tone), burnt * (0.6 + 0.8 * grain))
        joints = shaded(np.broadcast_to(rgb(mortar), stones.shape), 0.75 + 0.5 * grain)
        rough = smoothstep(body + 0.5 * (grain - 0.5), 0.3, 0.7)
        return albedo(blended(joints, stones, rough))

    return texture


def painted_brick(colour: Colour, rows: int = 12) -> Texture:
    """Return bricks under an old coat of paint: courses show, colours hardly (0.9 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        number, body = courses(size, rows, max(rows // 3, 1), 0.5, (0.16, 0.055))
        tone = (0.9 + 0.14 * rng.random(int(number.max()) + 1))[number]
        dirt = tileable_noise(rng, size, (4, 4), 5)
        grain = tileable_noise(rng, size, (48, 48), 3)
        factor = tone * (0.72 + 0.28 * body) * (0.75 + 0.3 * dirt + 0.2 * grain)
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def tiles(colour: Colour, grout: Colour, number: int = 4, vary: float = 0.1) -> Texture:
    """Return square tiles, `number` over the width, each a little different in tone."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        index, body = courses(size, number, number, 0.0, (0.035, 0.035))
        tone = (1 + vary * (2 * rng.random(number * number) - 1))[index]
        glaze = tileable_noise(rng, size, (6, 6), 4)
        down, across = places(size)
        # The glaze pools towards the lower edge of a tile.
        pool = 0.94 + 0.08 * (np.mod(down * number, 1) + 0 * across)
        body_colour = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), tone * pool)
        return albedo(blended(grout, shaded(body_colour, 0.94 + 0.12 * glaze), body))

    return texture


def chequered_tiles(colour: Colour, second: Colour, number: int = 4) -> Texture:
    """Return tiles of two colours in turn (`number` is even), worn along their middles."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        index, body = courses(size, number, number, 0.0, (0.02, 0.02))
        odd = (index // number + index % number) % 2
        marble = tileable_noise(rng, size, (5, 5), 6, 0.6)
        vein = smoothstep(np.abs(marble - 0.5), 0.0, 0.12)
        picture = blended(colour, second, odd * (0.9 + 0.1 * vein) + (1 - odd) * 0.12 * (1 - vein))
        tone = (0.92 + 0.16 * rng.random(number * number))[index]
        return albedo(shaded(picture, tone * (0.35 + 0.65 * body)))

    return texture


def paving(colour: Colour, number: int = 4) -> Texture:
    """Return stone slabs in broken courses with weathered joints (about 2 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        index, body = courses(size, number, number // 2, 0.5, (0.045, 0.03))
        tone = (0.8 + 0.4 * rng.random(int(index.max()) + 1))[index]
        broad = tileable_noise(rng, size, (6, 6), 6, 0.65)
        specks = tileable_noise(rng, size, (size // 3, size // 3), 1)
        factor = tone * (0.68 + 0.5 * broad + 0.16 * (specks - 0.5))
        stone = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor)
        return albedo(blended((0.06, 0.065, 0.04), stone, smoothstep(body + 0.6 * (broad - 0.5), 0.2, 0.6)))

    return texture


def terrazzo(colour: Colour, chips: tuple[Colour, ...]) -> Texture:
    """Return polished chips of stone in cement (about 1 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        number = 1400
        index, edge = cells(rng, size, number)
        palette = rgb(chips)[rng.integers(0, len(chips), number)]
        palette *= (0.8 + 0.4 * rng.random((number, 1))).astype(np.float32)
        large = 0.1 + 0.5 * rng.random(number)
        return albedo(blended(colour, palette[index], smoothstep(edge - large[index], 0.0, 0.15)))

    return texture


def asphalt(colour: Colour) -> Texture:
    """Return asphalt: stones in tar, patches, a few cracks (about 2 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        grain = tileable_noise(rng, size, (size // 3, size // 3), 1)
        broad = tileable_noise(rng, size, (4, 4), 5)
        _, edge = cells(rng, size, 7)
        warp = tileable_noise(rng, size, (10, 10), 4)
        crack = 1 - smoothstep(edge + 0.25 * (warp - 0.5), 0.0, 0.03)
        factor = (0.6 + 0.5 * broad + 0.6 * (grain - 0.5)) * (1 - 0.5 * crack * smoothstep(warp, 0.5, 0.6))
        return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))

    return texture


def roof_tiles(colour: Colour, rows: int = 8) -> Texture:
    """Return clay roof tiles, each course in the shade of the one above (about 2 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        index, body = courses(size, rows, rows, 0.5, (0.02, 0.08))
        down, across = places(size)
        tone = (0.75 + 0.5 * rng.random(rows * rows))[index]
        course = 0.45 + 0.55 * smoothstep(np.mod(down * rows, 1), 0.0, 0.45)
        moss = tileable_noise(rng, size, (4, 4), 5)
        picture = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), tone * course * (0.5 + 0.5 * body))
        return albedo(blended(picture, (0.10, 0.11, 0.05), 0.6 * smoothstep(moss, 0.62, 0.9) + 0 * across))

    return texture


def metal(colour: Colour, rust: float = 0.0) -> Texture:
    """Return brushed or painted metal with scratches, and rust where `rust` is above 0 (about 1 m a tile)."""

    def texture(rng: np.random.Generator, size: int) -> NDArray[np.float32]:
        brushed = tileable_noise(rng, size, (size // 2, 3), 1)
        broad = tileable_noise(rng, size, (4, 4), 5)
        picture = np.broadcast_to(rgb(colour), (size, size, 3))
        picture = shaded(picture, 0.86 + 0.16 * brushed + 0.12 * (broad - 0.5))
        for _ in range(12):
            down, across = rng.random(2)
            cover = np.full((1, int(size * (0.02 + 0.1 * rng.random()))), 0.5)
            stamp(picture, (down, across), rgb(colour) * (0.6 if rng.random() < 0.5 else 1.25), cover)
        return albedo(blended(picture, (0.17, 0.06, 0.02), smoothstep(broad, 1.0 - rust, 1.2 - rust)))

    return texture


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
