"""Textures of a building and its cloth.

Plaster, wallpaper, concrete, brick, tiles, stone, wood; upholstery, carpet, a knotted rug, curtains.
"""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.fractal_noise import smoothstep
from evenlight.stimuli.scenes.content.textures import detail
from evenlight.stimuli.scenes.content.textures.tileable import (
    Colour,
    Image,
    albedo,
    blended,
    cells,
    courses,
    places,
    rgb,
    shaded,
    stamp,
    texture,
    tileable_noise,
)


@texture
@detail.detailed(detail.PLASTERED)
def plaster(rng: np.random.Generator, size: int, colour: Colour, roughness: float = 0.06) -> Image:
    """Return painted plaster: nearly even, with trowel marks and grain (about 2 m a tile)."""
    broad = tileable_noise(rng, size, (4, 3), 5)
    grain = tileable_noise(rng, size, (size // 4, size // 4), 2)
    factor = 1 + roughness * ((broad - 0.5) + (grain - 0.5))
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.PRINTED)
def stripes(rng: np.random.Generator, size: int, colour: Colour, second: Colour, number: int = 8) -> Image:
    """Return striped wallpaper with a small flower in every second stripe (about 1 m a tile)."""
    down, across = places(size)
    wave = np.cos(2 * np.pi * number * across) + 0 * down
    flower = np.cos(2 * np.pi * 2 * number * down + np.pi * np.floor(number * across + 0.5))
    flower = smoothstep(flower + wave, 1.55, 1.8)
    line = smoothstep(np.abs(wave), 0.0, 0.35)
    share = 0.75 * smoothstep(wave, -0.2, 0.2) * line + 0.25 * (1 - line)
    picture = blended(colour, second, share * (1 - flower))
    fibre = tileable_noise(rng, size, (size // 4, size // 8), 2)
    return albedo(shaded(picture, 0.95 + 0.1 * fibre))


@texture
@detail.detailed(detail.CAST)
def concrete(rng: np.random.Generator, size: int, colour: Colour) -> Image:
    """Return cast concrete: blotches, stains that ran down, pores (about 2.5 m a tile)."""
    broad = tileable_noise(rng, size, (3, 3), 6, 0.6)
    streaks = tileable_noise(rng, size, (2, 24), 3)
    grain = tileable_noise(rng, size, (size // 3, size // 3), 1)
    factor = 0.72 + 0.42 * broad + 0.14 * (grain - 0.5) - 0.20 * smoothstep(streaks, 0.6, 0.95)
    pores = tileable_noise(rng, size, (size // 6, size // 6), 1)
    factor = factor * (1 - 0.5 * smoothstep(pores, 0.84, 0.92))
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.BURNT)
def brick(
    rng: np.random.Generator, size: int, colour: Colour, second: Colour, mortar: Colour, rows: int = 12
) -> Image:
    """Return bricks in running bond, each burnt a little differently (0.9 m a tile with 12 courses)."""
    per_row = max(rows // 3, 1)
    number, body = courses(size, rows, per_row, 0.5, (0.15, 0.05))
    tone = rng.random(rows * per_row)[number]
    burnt = (0.75 + 0.45 * rng.random(rows * per_row))[number]
    grain = tileable_noise(rng, size, (32, 32), 4, 0.7)
    stones = shaded(blended(colour, second, tone), burnt * (0.6 + 0.8 * grain))
    joints = shaded(np.broadcast_to(rgb(mortar), stones.shape), 0.75 + 0.5 * grain)
    rough = smoothstep(body + 0.5 * (grain - 0.5), 0.3, 0.7)
    return albedo(blended(joints, stones, rough))


@texture
@detail.detailed(detail.PLASTERED)
def painted_brick(rng: np.random.Generator, size: int, colour: Colour, rows: int = 12) -> Image:
    """Return bricks under an old coat of paint: courses show, colours hardly (0.9 m a tile)."""
    number, body = courses(size, rows, max(rows // 3, 1), 0.5, (0.16, 0.055))
    tone = (0.9 + 0.14 * rng.random(int(number.max()) + 1))[number]
    dirt = tileable_noise(rng, size, (4, 4), 5)
    grain = tileable_noise(rng, size, (48, 48), 3)
    factor = tone * (0.72 + 0.28 * body) * (0.75 + 0.3 * dirt + 0.2 * grain)
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.GLAZED)
def tiles(
    rng: np.random.Generator, size: int, colour: Colour, grout: Colour, number: int = 4, vary: float = 0.1
) -> Image:
    """Return square tiles, `number` over the width, each a little different in tone."""
    index, body = courses(size, number, number, 0.0, (0.035, 0.035))
    tone = (1 + vary * (2 * rng.random(number * number) - 1))[index]
    glaze = tileable_noise(rng, size, (6, 6), 4)
    down, across = places(size)
    # The glaze pools towards the lower edge of a tile.
    pool = 0.94 + 0.08 * (np.mod(down * number, 1) + 0 * across)
    body_colour = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), tone * pool)
    return albedo(blended(grout, shaded(body_colour, 0.94 + 0.12 * glaze), body))


@texture
@detail.detailed(detail.GLAZED)
def chequered_tiles(
    rng: np.random.Generator, size: int, colour: Colour, second: Colour, number: int = 4
) -> Image:
    """Return tiles of two colours in turn (`number` is even), worn along their middles."""
    index, body = courses(size, number, number, 0.0, (0.02, 0.02))
    odd = (index // number + index % number) % 2
    marble = tileable_noise(rng, size, (5, 5), 6, 0.6)
    vein = smoothstep(np.abs(marble - 0.5), 0.0, 0.12)
    picture = blended(colour, second, odd * (0.9 + 0.1 * vein) + (1 - odd) * 0.12 * (1 - vein))
    tone = (0.92 + 0.16 * rng.random(number * number))[index]
    return albedo(shaded(picture, tone * (0.35 + 0.65 * body)))


@texture
@detail.detailed(detail.SPLIT)
def paving(rng: np.random.Generator, size: int, colour: Colour, number: int = 4) -> Image:
    """Return stone slabs in broken courses with weathered joints (about 2 m a tile)."""
    index, body = courses(size, number, number // 2, 0.5, (0.045, 0.03))
    tone = (0.8 + 0.4 * rng.random(int(index.max()) + 1))[index]
    broad = tileable_noise(rng, size, (6, 6), 6, 0.65)
    specks = tileable_noise(rng, size, (size // 3, size // 3), 1)
    factor = tone * (0.68 + 0.5 * broad + 0.16 * (specks - 0.5))
    stone = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor)
    return albedo(blended((0.06, 0.065, 0.04), stone, smoothstep(body + 0.6 * (broad - 0.5), 0.2, 0.6)))


@texture
@detail.detailed(detail.GLAZED)
def terrazzo(rng: np.random.Generator, size: int, colour: Colour, chips: tuple[Colour, ...]) -> Image:
    """Return polished chips of stone in cement (about 1 m a tile)."""
    number = 1400
    index, edge = cells(rng, size, number)
    palette = rgb(chips)[rng.integers(0, len(chips), number)]
    palette *= (0.8 + 0.4 * rng.random((number, 1))).astype(np.float32)
    large = 0.1 + 0.5 * rng.random(number)
    return albedo(blended(colour, palette[index], smoothstep(edge - large[index], 0.0, 0.15)))


@texture
@detail.detailed(detail.LOOSE)
def asphalt(rng: np.random.Generator, size: int, colour: Colour) -> Image:
    """Return asphalt: stones in tar, patches, a few cracks (about 2 m a tile)."""
    grain = tileable_noise(rng, size, (size // 3, size // 3), 1)
    broad = tileable_noise(rng, size, (4, 4), 5)
    _, edge = cells(rng, size, 7)
    warp = tileable_noise(rng, size, (10, 10), 4)
    crack = 1 - smoothstep(edge + 0.25 * (warp - 0.5), 0.0, 0.03)
    factor = (0.6 + 0.5 * broad + 0.6 * (grain - 0.5)) * (1 - 0.5 * crack * smoothstep(warp, 0.5, 0.6))
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.BURNT)
def roof_tiles(rng: np.random.Generator, size: int, colour: Colour, rows: int = 8) -> Image:
    """Return clay roof tiles, each course in the shade of the one above (about 2 m a tile)."""
    index, body = courses(size, rows, rows, 0.5, (0.02, 0.08))
    down, across = places(size)
    tone = (0.75 + 0.5 * rng.random(rows * rows))[index]
    course = 0.45 + 0.55 * smoothstep(np.mod(down * rows, 1), 0.0, 0.45)
    moss = tileable_noise(rng, size, (4, 4), 5)
    picture = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), tone * course * (0.5 + 0.5 * body))
    return albedo(blended(picture, (0.10, 0.11, 0.05), 0.6 * smoothstep(moss, 0.62, 0.9) + 0 * across))


@texture
@detail.detailed(detail.METALLIC)
def metal(rng: np.random.Generator, size: int, colour: Colour, rust: float = 0.0) -> Image:
    """Return brushed or painted metal with scratches, and rust where `rust` is above 0 (about 1 m a tile)."""
    brushed = tileable_noise(rng, size, (size // 2, 3), 1)
    broad = tileable_noise(rng, size, (4, 4), 5)
    picture = np.broadcast_to(rgb(colour), (size, size, 3))
    picture = shaded(picture, 0.86 + 0.16 * brushed + 0.12 * (broad - 0.5))
    for _ in range(12):
        down, across = rng.random(2)
        cover = np.full((1, int(size * (0.02 + 0.1 * rng.random()))), 0.5)
        stamp(picture, (down, across), rgb(colour) * (0.6 if rng.random() < 0.5 else 1.25), cover)
    return albedo(blended(picture, (0.17, 0.06, 0.02), smoothstep(broad, 1.0 - rust, 1.2 - rust)))


def grain(rng: np.random.Generator, size: int, rings: int = 9) -> Image:
    """Return how dark the grain of wood is, 0 to 1; it runs from left to right."""
    down, across = places(size)
    bend = tileable_noise(rng, size, (3, 1), 4, 0.45)
    ring = np.sin(2 * np.pi * (rings * down + 3.2 * bend + 0 * across))
    fibres = tileable_noise(rng, size, (size // 6, 4), 3, 0.7)
    pores = smoothstep(tileable_noise(rng, size, (size // 3, 12), 1), 0.72, 0.9)
    dark: Image = 0.45 + 0.22 * ring + 0.55 * (fibres - 0.5) + 0.35 * pores
    return np.clip(dark, 0, 1).astype(np.float32)


@texture
@detail.detailed(detail.SAWN)
def wood(rng: np.random.Generator, size: int, light: Colour, dark: Colour, rings: int = 9) -> Image:
    """Return a sawn and oiled board; the grain runs along u (about 0.8 m a tile)."""
    return albedo(blended(light, dark, grain(rng, size, rings)))


@texture
@detail.detailed(detail.VARNISHED)
def planks(rng: np.random.Generator, size: int, light: Colour, dark: Colour, rows: int = 8) -> Image:
    """Return floor boards laid along u, ends broken at random, narrow dark gaps (about 1.2 m a tile)."""
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


@texture
@detail.detailed(detail.PAINTED_WOOD)
def painted_boards(rng: np.random.Generator, size: int, colour: Colour, boards: int = 8) -> Image:
    """Return upright tongue-and-groove boards under paint (about 1 m a tile)."""
    down, across = places(size)
    place = np.mod(across * boards, 1)
    groove = smoothstep(np.abs(place - 0.5), 0.44, 0.49)
    bead = smoothstep(np.abs(place - 0.5), 0.36, 0.40) - smoothstep(np.abs(place - 0.5), 0.40, 0.44)
    tone = (0.93 + 0.12 * rng.random(boards))[(across * boards).astype(np.intp) % boards]
    brush = tileable_noise(rng, size, (3, size // 4), 2)
    factor = tone * (1 - 0.6 * groove - 0.15 * bead) * (0.93 + 0.12 * brush) + 0 * down
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.PAINTED_WOOD)
def panel_door(rng: np.random.Generator, size: int, light: Colour, dark: Colour) -> Image:
    """Return a whole door leaf of six panels: one tile is the leaf, v from the floor up."""
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


def weave(rng: np.random.Generator, size: int, threads: int) -> Image:
    """Return how light the threads of a plain weave are, about 0.7 to 1.2."""
    down, across = places(size)
    over = np.sin(2 * np.pi * threads * down) * np.sin(2 * np.pi * threads * across)
    slub = tileable_noise(rng, size, (threads, 4), 1) + tileable_noise(rng, size, (4, threads), 1)
    return rgb(0.8 + 0.13 * over + 0.2 * slub)


@texture
@detail.detailed(detail.WOVEN)
def fabric(rng: np.random.Generator, size: int, colour: Colour, threads: int = 48) -> Image:
    """Return upholstery in a plain weave with wear (about 0.5 m a tile)."""
    wear = tileable_noise(rng, size, (3, 3), 4)
    factor = weave(rng, size, threads) * (0.85 + 0.3 * wear)
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.WOVEN)
def striped_fabric(
    rng: np.random.Generator, size: int, colours: tuple[Colour, ...], repeat: int = 2
) -> Image:
    """Return cloth with stripes across u: towels, deck chairs, awnings, curtains."""
    down, across = places(size)
    band = np.floor(across * repeat * len(colours)).astype(np.intp) % len(colours)
    picture = np.broadcast_to(rgb(colours)[band], (size, size, 3))
    return albedo(shaded(picture, weave(rng, size, 48) + 0 * down))


@texture
@detail.detailed(detail.WOVEN)
def checked_fabric(
    rng: np.random.Generator, size: int, colour: Colour, second: Colour, number: int = 6
) -> Image:
    """Return gingham: two sets of stripes that cross (about 0.6 m a tile)."""
    down, across = places(size)
    share = 0.5 * (np.mod(down * number, 1) < 0.5) + 0.5 * (np.mod(across * number, 1) < 0.5)
    return albedo(shaded(blended(colour, second, share), weave(rng, size, 48)))


@texture
@detail.detailed(detail.WOVEN)
def curtain(rng: np.random.Generator, size: int, colour: Colour, folds: int = 6) -> Image:
    """Return hanging cloth: a pattern of leaves in tone, its folds darker (about 0.8 m a tile)."""
    down, across = places(size)
    fold = 0.80 + 0.20 * np.sin(2 * np.pi * folds * across)
    leaf = np.sin(2 * np.pi * (4 * down + 0.6 * np.sin(2 * np.pi * 4 * across)))
    leaf = smoothstep(leaf * np.sin(2 * np.pi * 8 * across), 0.35, 0.5)
    factor = fold * (1 - 0.25 * leaf) * weave(rng, size, 64)
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))


@texture
@detail.detailed(detail.LAWN)
def carpet(rng: np.random.Generator, size: int, colour: Colour, second: Colour) -> Image:
    """Return a loop-pile carpet in two mixed yarns (about 0.6 m a tile)."""
    loops = max(size // 5, 8)
    yarn = tileable_noise(rng, size, (loops, loops), 1)
    broad = tileable_noise(rng, size, (4, 4), 4)
    down, across = places(size)
    pile = 0.82 + 0.18 * np.sin(2 * np.pi * loops * down) * np.sin(2 * np.pi * loops * across)
    return albedo(shaded(blended(colour, second, smoothstep(yarn, 0.25, 0.75)), pile * (0.85 + 0.3 * broad)))


@texture
@detail.detailed(detail.WOVEN)
def rug(rng: np.random.Generator, size: int, ground: Colour, border: Colour, accent: Colour) -> Image:
    """Return a whole knotted rug: borders, a medallion, small flowers; one tile is the rug."""
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


def _folded(size: int) -> tuple[Image, Image]:
    """Return the distances from the two middle lines, 0 to 1 at the edges, as (size, size) arrays."""
    down, across = places(size)
    y, x = np.meshgrid(np.abs(2 * down.ravel() - 1), np.abs(2 * across.ravel() - 1), indexing="ij")
    return x, y


def _flowers(x: Image, y: Image, number: int) -> Image:
    """Return a lattice of small four-leaved flowers, 0 to 1."""
    petals = np.cos(np.pi * number * x) * np.cos(np.pi * number * y)
    between = np.cos(np.pi * number * (x + y) * 1.0) * np.cos(np.pi * number * (x - y) * 1.0)
    return np.asarray(smoothstep(np.abs(petals) + 0.45 * between, 0.5, 0.8), dtype=np.float32)
