"""Textures that people printed or painted: spines of books, paintings, posters, papers, labels.

And of single things: a screen, a clock's face, a keyboard, a pegboard.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.fractal_noise import fractal_noise, smoothstep
from evenlight.stimuli.scenes.content.textures import detail
from evenlight.stimuli.scenes.content.textures.tileable import (
    Colour,
    Image,
    albedo,
    blended,
    linear,
    places,
    rgb,
    shaded,
    texture,
    tileable_noise,
)
from evenlight.stimuli.scenes.engine.scene import Texture

SPINES, SHELVES = 24, 4
"""Spines beside each other, and rows of them, in one tile of `book_spines`."""
SPINE_COLOURS = tuple(
    linear(code)
    for code in (
        "7d1f24", "23395d", "2f5d3a", "c9b458", "d8cfb8", "4a3226", "8c5a2b", "5a2a55", "1c1c20", "b8432f",
        "3d7a8a", "e4ddcf", "6b7b3a", "9a2f4a", "2b2f77", "c77c3a", "515761", "a89877", "0f4c4c", "d9a441",
    )
)  # fmt: skip
PAPER, INK = linear("eee7d6"), linear("1d1d22")


@texture
@detail.detailed(detail.PRINTED)
def book_spines(rng: np.random.Generator, size: int, colours: tuple[Colour, ...] = SPINE_COLOURS) -> Image:
    """Return SHELVES rows of SPINES spines with bands, titles and wear: one spine is 1/SPINES by 1/SHELVES.

    As a strip, one row is a shelf of about 0.8 m by 0.25 m; for single books take the cells by
    `spine_cell`.
    """
    picture = np.zeros((size, size, 3), dtype=np.float32)
    rows, columns = _edges(size, SHELVES), _edges(size, SPINES)
    for shelf in range(SHELVES):
        for spine in range(SPINES):
            area = picture[rows[shelf] : rows[shelf + 1], columns[spine] : columns[spine + 1]]
            area[...] = _spine(rng, area.shape[0], area.shape[1], colours)
    wear = tileable_noise(rng, size, (16, 16), 4)
    return albedo(shaded(picture, 0.78 + 0.4 * wear))


def spine_cell(number: int) -> tuple[float, float, float, float]:
    """Return where spine `number` lies in a tile of `book_spines`: u from, v from, u to, v to; v counts up.

    >>> spine_cell(0)[2:] == (1 / SPINES, 1.0)
    True
    """
    row, column = divmod(number % (SPINES * SHELVES), SPINES)
    return column / SPINES, 1 - (row + 1) / SHELVES, (column + 1) / SPINES, 1 - row / SHELVES


def _edges(size: int, number: int) -> NDArray[np.intp]:
    """Return where each of `number` equal parts begins, and where the last one ends [pixels]."""
    return np.round(np.linspace(0, size, number + 1)).astype(np.intp)


def _spine(rng: np.random.Generator, height: int, width: int, colours: tuple[Colour, ...]) -> Image:
    """Return one spine, upright: rounded, with bands and a title along it."""
    cloth = rgb(colours[rng.integers(len(colours))]) * rgb(0.75 + 0.5 * rng.random())
    print_colour = rgb(linear("d9b65a") if cloth.mean() < 0.25 and rng.random() < 0.6 else PAPER)
    if cloth.mean() > 0.3:
        print_colour = rgb(INK)
    across = (np.arange(width) + 0.5) / width
    down = (np.arange(height) + 0.5) / height
    picture = np.broadcast_to(cloth, (height, width, 3)).copy()
    for place in rng.choice([0.06, 0.12, 0.24, 0.78, 0.86, 0.94], rng.integers(1, 4), replace=False):
        picture[np.abs(down - place) < 0.5 / height + 0.008 * rng.random()] = print_colour
    if rng.random() < 0.25:  # a label pasted on
        picture[(down > 0.14) & (down < 0.3)] = rgb(PAPER) if cloth.mean() < 0.3 else print_colour
    start, stop = 0.30 + 0.08 * rng.random(), 0.60 + 0.14 * rng.random()
    letters = rng.random(height) < 0.72
    title = ((down > start) & (down < stop) & letters)[:, np.newaxis] & (np.abs(across - 0.5) < 0.17)
    picture[title] = print_colour
    rounded = 0.42 + 0.58 * np.sin(np.pi * np.clip(across * 0.94 + 0.03, 0, 1)) ** 0.6
    return picture * rounded[np.newaxis, :, np.newaxis].astype(np.float32)


@texture
@detail.detailed(detail.PRINTED)
def framed(
    rng: np.random.Generator, size: int, picture: Texture, frame: Colour, mat: Colour | None = None
) -> Image:
    """Return a picture in its frame, with a mat around it if one is named; one tile is the whole."""
    down, across = places(size)
    rim = np.minimum(np.minimum(down, 1 - down), np.minimum(across, 1 - across))
    painted = picture(rng, size)
    if mat is not None:
        painted = blended(painted, mat, 1 - smoothstep(rim, 0.165, 0.172))
        painted = shaded(painted, 1 - 0.5 * ((rim > 0.158) & (rim < 0.166)))
    bevel = 0.55 + 0.75 * smoothstep(rim, 0.0, 0.03) - 0.5 * smoothstep(rim, 0.04, 0.06)
    wood = tileable_noise(rng, size, (24, 24), 3)
    edge = shaded(np.broadcast_to(rgb(frame), painted.shape), bevel * (0.8 + 0.4 * wood))
    return albedo(blended(edge, painted, smoothstep(rim, 0.06, 0.066)))


@texture
@detail.detailed(detail.PRINTED)
def landscape_painting(
    rng: np.random.Generator, size: int, sky: Colour, land: Colour, light: Colour
) -> Image:
    """Return a painted landscape: clouds, ranges of hills, a lake, brush strokes."""
    down, _ = places(size)
    clouds = fractal_noise(rng, (size, size), (6, 3), 5)
    picture = blended(sky, light, smoothstep(clouds + 0.9 * down, 0.75, 1.2))
    for layer in range(4):
        crest = 0.42 + 0.13 * layer + (0.22 - 0.03 * layer) * (fractal_noise(rng, (1, size), (1, 4), 5) - 0.5)
        tone = blended(light, land, rgb(0.25 + 0.24 * layer))
        strokes = fractal_noise(rng, (size, size), (40, 14), 3)
        hill = shaded(np.broadcast_to(tone, picture.shape), 0.45 + 1.0 * strokes)
        picture = blended(picture, hill, smoothstep(down - crest, 0.0, 0.008))
    return albedo(shaded(picture, 0.85 + 0.3 * fractal_noise(rng, (size, size), (60, 30), 2)))


@texture
@detail.detailed(detail.PRINTED)
def abstract_painting(rng: np.random.Generator, size: int, colours: tuple[Colour, ...]) -> Image:
    """Return fields of colour with broad brush strokes and a few black lines."""
    down, across = places(size)
    picture = np.broadcast_to(rgb(colours[0]), (size, size, 3)).copy()
    for _ in range(14):
        top, left, high, wide = rng.random(4) * [0.9, 0.9, 0.45, 0.45]
        wobble = 0.03 * (fractal_noise(rng, (size, size), (4, 4), 4) - 0.5)
        inside = (
            (down + wobble > top) & (down < top + high) & (across + wobble > left) & (across < left + wide)
        )
        stroke = 0.7 + 0.6 * fractal_noise(rng, (size, size), (50, 4), 3)
        colour = np.broadcast_to(rgb(colours[rng.integers(len(colours))]), picture.shape)
        picture = blended(picture, shaded(colour, stroke), 0.9 * inside)
    for _ in range(3):
        bend = rng.random() + 0.4 * (fractal_noise(rng, (1, size), (1, 3), 3) - 0.5)
        picture = blended(picture, INK, np.abs(down - bend) < 0.006)
    return albedo(picture)


def written(rng: np.random.Generator, height: int, width: int, lines: int) -> Image:
    """Return lines of writing too small to read, (height, width): 1 where there is ink."""
    ink = np.zeros((height, width), dtype=np.float32)
    edges = _edges(height, lines)
    for line in range(lines):
        thick = max(1, (edges[line + 1] - edges[line]) // 2)
        length = int(width * (1.0 if rng.random() < 0.75 else 0.3 + 0.6 * rng.random()))
        strokes = rng.random((thick, width)) < 0.75
        gaps = np.repeat(rng.random(width // 3 + 1) < 0.84, 3)[:width]
        ink[edges[line] : edges[line] + thick, :length] = (strokes & gaps)[:, :length]
    return ink


@texture
@detail.detailed(detail.PRINTED)
def poster(rng: np.random.Generator, size: int, ground: Colour, shapes: tuple[Colour, ...]) -> Image:
    """Return a poster: a picture of discs and rays, a heading in large letters, small print, a margin."""
    down, across = places(size)
    angle = np.arctan2(down - 0.45, across - 0.5)
    rays = smoothstep(np.sin(angle * 2 * rng.integers(5, 11)), -0.1, 0.1)
    picture = blended(ground, rgb(ground) * rgb(1.35), rays)
    for _ in range(5):
        y, x, radius = rng.random(3) * [0.5, 0.8, 0.16] + [0.12, 0.1, 0.05]
        disc = 1 - smoothstep(np.hypot(down - y, across - x), radius, radius + 0.01)
        picture = blended(picture, shapes[rng.integers(len(shapes))], disc)
    _print(picture, _heading(rng, int(0.1 * size), int(0.76 * size)), (0.7, 0.12))
    _print(picture, written(rng, int(0.1 * size), int(0.76 * size), 5), (0.83, 0.12))
    margin = np.minimum(np.minimum(down, 1 - down), np.minimum(across, 1 - across))
    return albedo(blended(PAPER, picture, smoothstep(margin, 0.035, 0.04)))


def _heading(rng: np.random.Generator, height: int, width: int) -> Image:
    """Return a word in large made-up letters: bars and bows in equal cells."""
    letters = 8
    cell = width // letters
    ink = np.zeros((height, width), dtype=np.float32)
    for letter in range(letters):
        area = ink[:, letter * cell : letter * cell + max(2, int(0.8 * cell))]
        thick = max(1, cell // 5)
        for part in rng.permutation(5)[:3]:
            rows, columns = area.shape
            if part < 2:
                area[:, (0 if part == 0 else columns - thick) :][:, :thick] = 1
            else:
                top = (0, rows // 2 - thick // 2, rows - thick)[part - 2]
                area[top : top + thick] = 1
    return ink


def _print(picture: Image, ink: Image, corner: tuple[float, float]) -> None:
    """Print ink into the picture, in place, its upper left corner at a share of the size."""
    top, left = (int(part * len(picture)) for part in corner)
    area = picture[top : top + ink.shape[0], left : left + ink.shape[1]]
    area[...] = blended(area, INK, 0.9 * ink[: area.shape[0], : area.shape[1]])


@texture
@detail.detailed(detail.PRINTED)
def papers(rng: np.random.Generator, size: int, ground: Colour, number: int = 12) -> Image:
    """Return a board with sheets of paper pinned on it, one over the other; one tile is the board."""
    cork = tileable_noise(rng, size, (size // 4, size // 4), 2)
    picture = shaded(np.broadcast_to(rgb(ground), (size, size, 3)), 0.6 + 0.8 * cork)
    tints = [PAPER, linear("f4f4f0"), linear("f2e394"), linear("b9d4e8"), linear("e8b9b4"), linear("bfdcb0")]
    for _ in range(number):
        high, wide = (int(size * (0.16 + 0.14 * part)) for part in rng.random(2))
        top, left = (
            int(part * (0.9 * size - side) + 0.05 * size)
            for part, side in zip(rng.random(2), (high, wide), strict=True)
        )
        picture[top + 2 : top + high + 3, left + 2 : left + wide + 3] *= rgb(0.5)
        sheet = np.broadcast_to(rgb(tints[rng.integers(len(tints))]), (high, wide, 3)).copy()
        _print_sheet(rng, sheet)
        picture[top : top + high, left : left + wide] = sheet
        picture[top + 1 : top + 4, left + wide // 2 : left + wide // 2 + 3] = linear("b02a2a")
    return albedo(picture)


def _print_sheet(rng: np.random.Generator, sheet: Image) -> None:
    """Write lines on a sheet, in place, and sometimes a picture above them."""
    high, wide = sheet.shape[:2]
    top = high // 8
    if rng.random() < 0.4:
        sheet[top : high // 2, wide // 8 : -wide // 8] *= rgb(rng.random(3) * 0.7 + 0.15)
        top = high // 2 + high // 12
    ink = written(rng, max(high - top - high // 8, 4), wide - wide // 4, max(3, (high - top) // 6))
    area = sheet[top : top + ink.shape[0], wide // 8 : wide // 8 + ink.shape[1]]
    area[...] = blended(area, INK, 0.75 * ink)


@texture
@detail.detailed(detail.PRINTED)
def label(rng: np.random.Generator, size: int, ground: Colour, stripe: Colour) -> Image:
    """Return a label or a carton's side: a coloured band, a mark, small print; one tile is the whole."""
    down, across = places(size)
    fibre = tileable_noise(rng, size, (size // 4, 8), 2)
    picture = shaded(np.broadcast_to(rgb(ground), (size, size, 3)), 0.85 + 0.3 * fibre)
    picture = blended(picture, stripe, (np.abs(down - 0.32) < 0.13) & (np.abs(across - 0.5) < 0.42))
    mark = np.hypot(down - 0.32, across - 0.5)
    picture = blended(picture, PAPER, (mark < 0.09) & (mark > 0.05))
    _print(picture, _heading(rng, size // 10, int(0.6 * size)), (0.52, 0.2))
    _print(picture, written(rng, size // 6, int(0.6 * size), 5), (0.68, 0.2))
    return albedo(picture)


@texture
@detail.detailed(detail.GLAZED)
def screen(rng: np.random.Generator, size: int, sky: Colour, glow: Colour) -> Image:
    """Return a television that is off: dark glass with a dim room in it; one tile is the whole."""
    mirrored = 0.12 * landscape_painting(sky, (0.02, 0.02, 0.03), glow)(rng, size)
    down, across = places(size)
    rim = np.minimum(np.minimum(down, 1 - down), np.minimum(across, 1 - across))
    return albedo(blended((0.012, 0.012, 0.014), mirrored + 0.012, smoothstep(rim, 0.02, 0.2)))


@texture
@detail.detailed(detail.GLAZED)
def dial_face(rng: np.random.Generator, size: int, ground: Colour, ink: Colour) -> Image:
    """Return the face of a clock with its marks and two hands; one tile is the whole."""
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


@texture
@detail.detailed(detail.GLAZED)
def keyboard(rng: np.random.Generator, size: int) -> Image:
    """Return keys in rows, black on grey: a keyboard, a row of switches; one tile is the whole."""
    down, across = places(size)
    key = np.minimum(np.abs(np.mod(down * 5, 1) - 0.5) < 0.38, np.abs(np.mod(across * 14, 1) - 0.5) < 0.38)
    sign = (np.abs(np.mod(down * 5, 1) - 0.5) < 0.14) & (np.abs(np.mod(across * 14, 1) - 0.5) < 0.1)
    picture = blended((0.25, 0.25, 0.26), (0.03, 0.03, 0.035), key)
    return albedo(blended(picture, (0.6, 0.6, 0.6), sign & (tileable_noise(rng, size, (16, 16), 1) > 0.3)))


@texture
@detail.detailed(detail.SAWN)
def perforated(rng: np.random.Generator, size: int, colour: Colour, number: int = 16) -> Image:
    """Return a board with a grid of round holes (0.5 m a tile with 16 holes across)."""
    down, across = places(size)
    hole = np.hypot(np.mod(down * number, 1) - 0.5, np.mod(across * number, 1) - 0.5)
    fibre = tileable_noise(rng, size, (size // 4, size // 4), 2)
    factor = (0.15 + 0.85 * smoothstep(hole, 0.13, 0.2)) * (0.85 + 0.3 * fibre)
    return albedo(shaded(np.broadcast_to(rgb(colour), (size, size, 3)), factor))
