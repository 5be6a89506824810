"""Pictures on walls, screens and grounds of the school; `textures.school` says how they are drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evenlight.stimuli.scenes.content.textures import detail
from evenlight.stimuli.scenes.content.textures.school import Sheet, drawn, shaded
from evenlight.stimuli.scenes.content.textures.tileable import Image, albedo, linear, texture, tileable_noise

BRIGHT = ("#d2473b", "#3b7fd2", "#e2b93b", "#4fa35b", "#8d5bb3", "#e07b34", "#34a3a8", "#d25b8f")


def reading_poster(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw an open book under a word."""
    sheet.box((0.04, 0.04, 0.96, 0.96), "#e4a93a")
    for ray in range(9):
        turn = np.pi * (0.1 + 0.1 * ray)
        tip = (0.5 - 0.52 * np.cos(turn), 0.66 - 0.5 * np.sin(turn))
        sheet.line([(0.5, 0.66), tip], "#f4cf73", 0.035)
    for side in (-1, 1):
        page = [(0.5, 0.56), (0.5 + side * 0.34, 0.5), (0.5 + side * 0.34, 0.76), (0.5, 0.82)]
        sheet.polygon(page, "#f6f1e2")
        for line in range(7):
            y = 0.57 + 0.028 * line
            sheet.line([(0.5 + side * 0.04, y + 0.018), (0.5 + side * 0.3, y - 0.028)], "#8a8478", 0.008)
    sheet.polygon([(0.14, 0.77), (0.5, 0.83), (0.86, 0.77), (0.86, 0.8), (0.5, 0.87), (0.14, 0.8)], "#a5322a")
    sheet.words("READ", (0.5, 0.2), 0.24, "#a5322a")


def world_map(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw continents of an unknown world, with a grid of meridians and a legend."""
    sheet.box((0.03, 0.03, 0.97, 0.97), "#a9cfe0")
    for x in np.linspace(0.1, 0.9, 9):
        sheet.line([(x, 0.05), (x, 0.86)], "#c4dfea", 0.004)
    for y in np.linspace(0.1, 0.82, 7):
        sheet.line([(0.05, y), (0.95, y)], "#c4dfea", 0.004)
    for x, y, size in (
        (0.24, 0.28, 0.13),
        (0.3, 0.6, 0.1),
        (0.52, 0.5, 0.12),
        (0.55, 0.26, 0.1),
        (0.74, 0.3, 0.16),
        (0.82, 0.64, 0.07),
    ):
        for part in range(5):
            tint = ("#c9b36a", "#8fb36a", "#d29a6a", "#b7c98a", "#d8c690")[part]
            middle = (x + rng.normal(0, size / 3), y + rng.normal(0, size / 3))
            sheet.polygon(_blob(middle, size * rng.uniform(0.5, 0.75), rng), tint)
    sheet.words("THE WORLD", (0.3, 0.915), 0.07, "#22405a")
    for entry in range(5):
        sheet.box((0.58 + 0.07 * entry, 0.895, 0.63 + 0.07 * entry, 0.93), BRIGHT[entry])


def _blob(middle: tuple[float, float], radius: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return the outline of a lumpy shape."""
    turns = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    waves = [rng.normal(0, 0.25 / k) * np.cos(k * turns + rng.uniform(0, 6)) for k in range(2, 9)]
    away = radius * (1 + np.sum(waves, axis=0))
    return [
        (middle[0] + r * np.cos(t), middle[1] + 0.8 * r * np.sin(t)) for r, t in zip(away, turns, strict=True)
    ]


def planets_poster(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a sun and planets on black."""
    sheet.box((0.03, 0.03, 0.97, 0.97), "#10142b")
    for _ in range(120):
        x, y, size = rng.uniform(0.05, 0.95), rng.uniform(0.05, 0.95), rng.uniform(0.001, 0.004)
        sheet.disc((x, y, x + size, y + size), "#f4f0e0")
    sheet.disc((-0.18, 0.3, 0.22, 0.7), "#f2b134")
    sheet.box((0, 0.2, 0.03, 0.8), "#f6f3ea")
    x = 0.28
    for size, tint in (
        (0.02, "#b5a999"),
        (0.035, "#d9b26a"),
        (0.04, "#4f86c6"),
        (0.03, "#c1553a"),
        (0.1, "#d3a878"),
        (0.085, "#e0cb94"),
        (0.05, "#8fc7cf"),
        (0.05, "#3f61b5"),
    ):
        y = 0.5 + 0.3 * np.sin(9 * x)
        sheet.disc((x, y - size, x + 2 * size, y + size), shaded(tint, 0.6))
        sheet.disc((x, y - size, x + 1.75 * size, y + 0.8 * size), tint)
        x += 2 * size + 0.012 if size < 0.08 else 1.2 * size
    sheet.box((0.97, 0, 1, 1), "#f6f3ea")
    sheet.words("PLANETS", (0.5, 0.1), 0.1, "#f4e9c0")


def timetable_poster(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a timetable of coloured lessons."""
    sheet.words("TIMETABLE", (0.5, 0.1), 0.1, "#20303f")
    for column in range(5):
        sheet.words("MTWTF"[column], (0.17 + 0.165 * column, 0.2), 0.06, "#20303f")
        for row in range(7):
            box = (0.1 + 0.165 * column, 0.25 + 0.095 * row, 0.245 + 0.165 * column, 0.33 + 0.095 * row)
            sheet.box(box, shaded(BRIGHT[rng.integers(len(BRIGHT))], 1.15))
            sheet.box((box[0] + 0.02, box[1] + 0.03, box[2] - 0.03, box[1] + 0.045), "#2a2a2a")


def elements_poster(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw the periodic table."""
    sheet.box((0.03, 0.03, 0.97, 0.97), "#f0ede2")
    sheet.words("ELEMENTS", (0.5, 0.13), 0.11, "#20303f")
    for row in range(7):
        for column in range(18):
            if (row == 0 and 0 < column < 17) or (row in (1, 2) and 1 < column < 12):
                continue
            x, y = 0.06 + column * 0.049, 0.25 + row * 0.085
            tint = BRIGHT[(column // 3 + (row > 3)) % len(BRIGHT)]
            sheet.box((x, y, x + 0.044, y + 0.078), tint)
            sheet.box((x + 0.01, y + 0.02, x + 0.03, y + 0.05), "#f5f2e8")
    for column in range(15):
        sheet.box((0.16 + column * 0.049, 0.87, 0.204 + column * 0.049, 0.94), BRIGHT[2 + column % 2])


def sports_poster(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw the announcement of a match: a ball over bars of colour."""
    sheet.box((0.03, 0.03, 0.97, 0.97), "#1f4f8f")
    sheet.polygon([(0.03, 0.7), (0.97, 0.4), (0.97, 0.97), (0.03, 0.97)], "#d2473b")
    sheet.disc((0.28, 0.28, 0.76, 0.76), "#e08a3a")
    sheet.line([(0.29, 0.52), (0.75, 0.52)], "#2a1a10", 0.014)
    sheet.line([(0.52, 0.29), (0.52, 0.75)], "#2a1a10", 0.014)
    sheet.words("FINALS", (0.5, 0.15), 0.15, "#f6f3ea")
    sheet.words("FRI 16:00", (0.62, 0.88), 0.1, "#f6f3ea")


def paintings(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw four pictures as children paint them: houses, suns, flowers, hills."""
    for place in range(4):
        x, y = (place % 2) / 2, (place // 2) / 2
        sheet.box(
            (x + 0.015, y + 0.015, x + 0.485, y + 0.485), ("#bfe0f2", "#fbe9c0", "#d9f0c8", "#f6d5e2")[place]
        )
        sheet.polygon(
            [
                (x + 0.015, y + 0.36),
                (x + 0.25, y + 0.3),
                (x + 0.485, y + 0.38),
                (x + 0.485, y + 0.485),
                (x + 0.015, y + 0.485),
            ],
            "#5da84f",
        )
        sheet.disc((x + 0.36, y + 0.05, x + 0.46, y + 0.15), "#f5b81f")
        left, tint = x + rng.uniform(0.06, 0.16), BRIGHT[rng.integers(len(BRIGHT))]
        sheet.box((left, y + 0.24, left + 0.15, y + 0.4), tint)
        sheet.polygon([(left - 0.02, y + 0.24), (left + 0.075, y + 0.14), (left + 0.17, y + 0.24)], "#a03a2a")
        sheet.box((left + 0.05, y + 0.31, left + 0.09, y + 0.4), "#5a3a20")
        for _ in range(4):
            stem = x + rng.uniform(0.28, 0.46)
            sheet.line([(stem, y + 0.43), (stem, y + 0.34)], "#2f7a3a", 0.008)
            sheet.disc((stem - 0.02, y + 0.31, stem + 0.02, y + 0.35), BRIGHT[rng.integers(len(BRIGHT))])


POSTERS = {
    "reading": drawn("#f6f3ea", reading_poster),
    "map": drawn("#f6f3ea", world_map),
    "planets": drawn("#f6f3ea", planets_poster),
    "timetable": drawn("#f6f3ea", timetable_poster),
    "elements": drawn("#f6f3ea", elements_poster),
    "sports": drawn("#f6f3ea", sports_poster),
    "paintings": drawn("#f6f3ea", paintings),
}
PAPERS = 4  # rows and columns of `paper_sheets`


@detail.detailed(detail.PRINTED)
def paper_sheets(rng: np.random.Generator, size: int) -> Image:
    """Return 4 x 4 sheets of paper with type, tables and pictures, each filling its field."""

    def paint(sheet: Sheet, rng: np.random.Generator) -> None:
        tints = ("#f4f2ea", "#f4f2ea", "#f7eeb0", "#d6ecc8", "#f4d3d0", "#d2e4f4")
        for field in range(PAPERS**2):
            x, y, side = (field % PAPERS) / PAPERS, (field // PAPERS) / PAPERS, 1 / PAPERS
            sheet.box((x, y, x + side, y + side), tints[rng.integers(len(tints))])
            sheet.box((x + 0.03, y + 0.02, x + rng.uniform(0.12, 0.22), y + 0.04), "#2a2a30")
            picture = rng.random() < 0.4
            if picture:
                sheet.box((x + 0.04, y + 0.06, x + 0.21, y + 0.14), BRIGHT[rng.integers(len(BRIGHT))])
            for line in range(7 if not picture else 3):
                top = y + (0.16 if picture else 0.06) + 0.024 * line
                sheet.box((x + 0.03, top, x + rng.uniform(0.14, 0.22), top + 0.008), "#5a5a60")

    return drawn("#f4f2ea", paint)(rng, size)


@detail.detailed(detail.PRINTED)
def globe_map(rng: np.random.Generator, size: int) -> Image:
    """Return land and sea for a globe, joined at its seam, with meridians and parallels."""
    land = tileable_noise(rng, size, (3, 3), 6)
    height = np.clip((land - 0.52) / 0.2, 0, 1)[..., np.newaxis]
    ground = np.array(linear("9bb063")) * (1 - height) + np.array(linear("c9a468")) * height
    image = np.where((land > 0.52)[..., np.newaxis], ground, np.array(linear("3f7ea6")))
    rows, columns = np.mgrid[0:size, 0:size] / size
    lines = (columns * 24 % 1 < 0.05) | (rows * 12 % 1 < 0.03)
    image[lines] = 0.75 * image[lines] + 0.06
    return albedo(image)


def screen(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a catalogue search on a monitor."""
    sheet.box((0.03, 0.04, 0.97, 0.96), "#eef3f6")
    sheet.box((0.03, 0.04, 0.97, 0.14), "#2f6fa8")
    sheet.words("CATALOGUE", (0.24, 0.09), 0.06, "#ffffff")
    sheet.box((0.1, 0.2, 0.75, 0.27), "#ffffff")
    sheet.box((0.78, 0.2, 0.9, 0.27), "#4fa35b")
    for row in range(8):
        y = 0.33 + 0.075 * row
        sheet.box((0.1, y, 0.14, y + 0.05), BRIGHT[row % len(BRIGHT)])
        sheet.box((0.17, y, 0.17 + rng.uniform(0.3, 0.6), y + 0.018), "#30363c")
        sheet.box((0.17, y + 0.028, 0.17 + rng.uniform(0.2, 0.4), y + 0.04), "#8a949c")


def shelf_marks(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw the signs of five racks, one under the other, three times as wide as they are high."""
    for row, (text, tint) in enumerate(
        zip(("000-199", "200-399", "500-599", "700-799", "900-999"), BRIGHT, strict=False)
    ):
        y = row / 5
        sheet.box((0, y, 0.14, y + 0.2), tint)
        sheet.box((0, y, 1, y + 0.008), "#3a3a3a")
        sheet.words(text, (0.57, y + 0.105), 0.155, "#20242a")


def keyboard(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw rows of keys."""
    for row in range(5):
        for key in range(15):
            sheet.box(
                (0.02 + 0.064 * key, 0.06 + 0.18 * row, 0.074 + 0.064 * key, 0.2 + 0.18 * row), "#2c2e31"
            )


def scoreboard(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a scoreboard: HOME 42, GUEST 39, the time between."""
    sheet.box((0.01, 0.02, 0.99, 0.98), "#15181b")
    sheet.words("HOME", (0.2, 0.16), 0.1, "#f2f0e6")
    sheet.words("GUEST", (0.8, 0.16), 0.1, "#f2f0e6")
    for centre, digits, tint, height in (
        (0.2, "42", "#ff5a3a", 0.3),
        (0.8, "39", "#ff5a3a", 0.3),
        (0.5, "7:15", "#ffd23a", 0.13),
    ):
        sheet.words(digits, (centre, 0.55 if height > 0.2 else 0.4), height, tint)
    sheet.words("3", (0.5, 0.72), 0.16, "#5aff6a")


def name_board(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw the school's name; the board, four times as wide as it is high, shows the middle of the tile."""
    sheet.words("SCHOOL", (0.5, 0.51), 0.2, "#f4f0e0")


def exit_sign(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a door and an arrow towards it."""
    sheet.box((0.62, 0.12, 0.92, 0.88), "#f2fff4")
    sheet.polygon(
        [(0.08, 0.42), (0.34, 0.42), (0.34, 0.25), (0.56, 0.5), (0.34, 0.75), (0.34, 0.58), (0.08, 0.58)],
        "#f2fff4",
    )


def dim_classroom(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw what the pane of a classroom door shows: a far window, rows of desks in the dark."""
    sheet.box((0.08, 0.18, 0.92, 0.5), "#8fa4b0")
    for x in (0.28, 0.5, 0.72):
        sheet.box((x, 0.18, x + 0.03, 0.5), "#2c2f30")
    for row in range(4):
        y = 0.6 + 0.1 * row
        sheet.box((0.05 + 0.02 * row, y, 0.95, y + 0.03), "#4e4638")


@detail.detailed(detail.LOOSE)
def basketball(rng: np.random.Generator, size: int) -> Image:
    """Return the skin of a basketball: pebbled, with black seams along meridians and the equator."""
    grain = rng.uniform(0.8, 1.1, (size, size)).astype(np.float32)
    image = np.array(linear("c8652a")) * grain[..., np.newaxis]
    rows, columns = np.mgrid[0:size, 0:size] / size
    swing = 0.5 + 0.16 * np.cos(4 * np.pi * columns)
    seams = (np.abs(columns * 4 % 1 - 0.5) < 0.035) | (np.abs(rows - 0.5) < 0.012)
    seams |= np.abs(rows - swing) < 0.012
    image[seams] = 0.02
    return albedo(image)


def hopscotch(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw hopscotch, two fields in a row alternating with one, numbered from below."""
    number = 1
    for row, fields in enumerate((1, 1, 2, 1, 2, 1, 2)):
        bottom = 0.98 - row * 0.135
        for field in range(fields):
            left = 0.5 - fields * 0.09 + field * 0.18
            _outline(sheet, (left, bottom - 0.135, left + 0.18, bottom), "#f0ead8")
            sheet.words(str(number), (left + 0.09, bottom - 0.0675), 0.09, BRIGHT[number % len(BRIGHT)])
            number += 1


def _outline(sheet: Sheet, box: tuple[float, float, float, float], colour: str) -> None:
    """Draw the outline of a rectangle."""
    left, top, right, bottom = box
    sheet.line([(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], colour, 0.012)


def number_snail(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a spiral of numbered fields, with a head."""
    turns = np.linspace(0.6, 5.2 * np.pi, 160)
    reach = 0.05 + 0.024 * turns
    outer = [(0.5 + r * np.cos(t), 0.5 + r * np.sin(t)) for r, t in zip(reach, turns, strict=True)]
    sheet.line(outer, "#f2c53a", 0.02)
    for number, place in enumerate(np.linspace(30, 158, 20).astype(int), start=1):
        t, r = turns[place], reach[place] - 0.07
        sheet.words(str(number), (0.5 + r * np.cos(t), 0.5 + r * np.sin(t)), 0.05, "#f0ead8")
    sheet.disc((0.03, 0.42, 0.17, 0.56), "#4fa35b")


def four_square(sheet: Sheet, rng: np.random.Generator) -> None:
    """Draw a court of four squares in four colours."""
    for field, tint in enumerate(("#3b7fd2", "#d2473b", "#4fa35b", "#e2b93b")):
        x, y = 0.02 + 0.48 * (field % 2), 0.02 + 0.48 * (field // 2)
        sheet.box((x + 0.02, y + 0.02, x + 0.46, y + 0.46), tint)
        _outline(sheet, (x, y, x + 0.48, y + 0.48), "#f0ead8")
        sheet.words("ABCD"[field], (x + 0.24, y + 0.24), 0.2, "#f0ead8")


@texture
def on_the_ground(
    rng: np.random.Generator, size: int, paint: Callable[[Sheet, np.random.Generator], None]
) -> Image:
    """Return a painter's work as worn paint, alpha-tested: the ground shows through where feet went."""
    sheet = Sheet(size, "#00000000")
    paint(sheet, rng)
    image = sheet.picture()
    image[..., :3] *= (0.7 + 0.3 * tileable_noise(rng, size, (4, 4), 5))[..., np.newaxis]
    worn = tileable_noise(rng, size, (24, 24), 5, gain=0.8) < 0.24
    image[..., 3][worn] = 0
    return image
