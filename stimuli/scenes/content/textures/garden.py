"""Textures of the garden: grass, leaves with holes between them, bark, gravel, soil, flowers."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.fractal_noise import ridged, smoothstep
from evenlight.stimuli.scenes.content.textures import detail
from evenlight.stimuli.scenes.content.textures.tileable import (
    Colour,
    Image,
    albedo,
    blended,
    cells,
    ellipse,
    rgb,
    shaded,
    stamp,
    texture,
    tileable_noise,
)
from evenlight.stimuli.scenes.engine.scene import Floats


@texture
@detail.detailed(detail.LAWN)
def grass(rng: np.random.Generator, size: int, light: Colour, dark: Colour) -> Image:
    """Return a mown lawn: blades one over the other, clover and dry spots (about 1.5 m a tile)."""
    broad = tileable_noise(rng, size, (4, 4), 5)
    picture = blended(dark, rgb(dark) * 0.6, tileable_noise(rng, size, (24, 24), 3))
    for _ in range(size * 5):
        down, across, tone, turn = rng.random(4)
        cover = ellipse(1.6, size / 26 * (0.5 + tone), np.pi * (0.5 + 0.7 * (turn - 0.5)))
        colour = blended(dark, light, rgb(0.3 + 0.7 * tone))
        stamp(picture, (down, across), colour, 0.8 * cover)
    dry = smoothstep(broad, 0.6, 0.95)
    # Faintly: a spot that stands out is seen again and again, tile by tile.
    faded = blended(picture, rgb(light) * rgb([1.5, 1.2, 1.0]), 0.12 * dry)
    return albedo(shaded(faded, 0.85 + 0.2 * broad))


@texture
@detail.detailed(detail.LEAFY)
def leaves(
    rng: np.random.Generator, size: int, light: Colour, dark: Colour, number: int = 170, length: float = 0.13
) -> Image:
    """Return a sprig with holes, (size, size, 4): lit leaves over shaded ones (about 0.7 m a tile).

    It is ragged all around and does not reach the edges, so that a card of it does not look like a square.

    Parameters
    ----------
    light, dark : Colour
        Leaves in front and leaves behind.
    number : int
        How many leaves; fewer leave more holes.
    length : float
        Length of a leaf as a share of the tile.
    """
    lobes, start = rng.integers(4, 7), 2 * np.pi * rng.random()
    turn, tone = 2 * np.pi * rng.random(number), rng.random(number)
    ragged = 1 - 0.22 * (1 + np.sin(lobes * turn + start)) * rng.random(number)
    away = (0.49 - 0.6 * length) * np.sqrt(rng.random(number)) * ragged
    places = 0.5 + away[:, np.newaxis] * np.stack([np.sin(turn), np.cos(turn)], axis=1)
    # Leaves point outwards, more or less.
    return _strewn(
        size, (light, dark), places, np.stack([turn + rng.normal(0, 0.7, number), tone], 1), length
    )


def _strewn(
    size: int, colours: tuple[Colour, Colour], places: Floats, turns_and_tones: Floats, length: float
) -> Image:
    """Return leaves at some places, each turned and toned, the later ones lighter and over the others."""
    light, dark = colours
    # Holes carry the colour of shaded leaves, so that mipmaps have no pale rims.
    picture = np.zeros((size, size, 4), dtype=np.float32)
    picture[..., :3] = rgb(dark) * rgb(0.8)
    orders = np.linspace(0, 1, len(places))
    for order, (down, across), (turn, tone) in zip(orders, places, turns_and_tones, strict=True):
        long = size * length * (0.6 + 0.6 * tone)
        stamp(picture[..., :3], (down, across), 0.5 * rgb(dark), 0.5 * ellipse(long * 0.65, long * 1.2, turn))
        cover = ellipse(long * 0.42, long, turn)
        colour = blended(dark, light, rgb(0.15 + 0.85 * order * (0.5 + 0.5 * tone)))
        stamp(picture, (down, across), [*colour.tolist(), 1.0], cover)
        vein = ellipse(max(1.0, size / 300), long * 0.85, turn)
        stamp(picture, (down, across), [*(1.35 * colour).tolist(), 1.0], 0.5 * vein)
    picture[..., :3] = albedo(picture[..., :3])
    return np.clip(picture, 0, 1)


@texture
@detail.detailed(detail.LAWN)
def thicket(rng: np.random.Generator, size: int, light: Colour, dark: Colour) -> Image:
    """Return leaves so dense that nothing is seen through them, (size, size, 3) (about 0.8 m a tile)."""
    low, high = (
        _strewn(size, colours, rng.random((number, 2)), rng.random((number, 2)) * [2 * np.pi, 1], length)
        for colours, number, length in (((dark, _darker(dark, 0.3)), 200, 0.10), ((light, dark), 190, 0.085))
    )
    return albedo(low[..., :3] * (1 - high[..., 3:]) + high[..., :3] * high[..., 3:])


@texture
@detail.detailed(detail.LEAFY)
def blossoms(
    rng: np.random.Generator, size: int, petals: tuple[Colour, ...], green: Colour, number: int = 40
) -> Image:
    """Return a sprig with flowers among its leaves, with holes, (size, size, 4) (about 0.5 m a tile)."""
    behind = leaves(green, _darker(green, 0.35), 140, 0.10)
    picture = behind(rng, size)
    for _ in range(number):
        turn, tone, away, around = rng.random(4)
        down, across = (0.5 + 0.4 * np.sqrt(away) * side(2 * np.pi * around) for side in (np.sin, np.cos))
        colour = rgb(petals[rng.integers(len(petals))]) * rgb(0.7 + 0.4 * tone)
        radius = size * 0.026
        for petal in range(5):
            angle = 2 * np.pi * (turn + petal / 5)
            place = down + radius / size * np.sin(angle), across + radius / size * np.cos(angle)
            stamp(
                picture,
                (place[0] % 1, place[1] % 1),
                [*colour.tolist(), 1.0],
                ellipse(radius, 1.6 * radius, angle),
            )
        stamp(picture, (down, across), [0.6, 0.42, 0.04, 1.0], ellipse(radius * 0.9, radius * 0.9, 0.0))
    picture[..., :3] = albedo(picture[..., :3])
    return np.clip(picture, 0, 1)


def _darker(colour: Colour, factor: float) -> Colour:
    """Return a colour times a factor."""
    red, green, blue = colour
    return factor * red, factor * green, factor * blue


@texture
@detail.detailed(detail.LOOSE)
def bark(rng: np.random.Generator, size: int, colour: Colour) -> Image:
    """Return furrowed bark; the furrows run along v (about 0.6 m a tile)."""
    furrow = ridged(tileable_noise(rng, size, (3, 10), 5, 0.6))
    lichen = smoothstep(tileable_noise(rng, size, (6, 6), 4), 0.62, 0.85)
    picture = shaded(np.broadcast_to(rgb(colour), (size, size, 3)), 1.25 - 0.95 * furrow)
    return albedo(blended(picture, (0.22, 0.25, 0.16), 0.5 * lichen))


@texture
@detail.detailed(detail.LOOSE)
def gravel(rng: np.random.Generator, size: int, colours: tuple[Colour, ...], stones: int = 1600) -> Image:
    """Return pebbles, each of its own grey, with shade between them (about 1 m a tile)."""
    index, edge = cells(rng, size, stones)
    palette = rgb(colours)[rng.integers(0, len(colours), stones)]
    palette *= (0.65 + 0.7 * rng.random((stones, 1))).astype(np.float32)
    grain = tileable_noise(rng, size, (size // 4, size // 4), 1)
    return albedo(shaded(palette[index], (0.25 + 0.75 * smoothstep(edge, 0.0, 0.5)) * (0.85 + 0.3 * grain)))


@texture
@detail.detailed(detail.LOOSE)
def soil(rng: np.random.Generator, size: int, colour: Colour) -> Image:
    """Return crumbly soil (about 1 m a tile)."""
    crumbs = ridged(tileable_noise(rng, size, (16, 16), 5, 0.75))
    broad = tileable_noise(rng, size, (3, 3), 3)
    factor = (0.5 + 0.8 * (1 - crumbs)) * (0.7 + 0.6 * broad)
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))
