"""Surfaces that only the school has: paint, court, ceiling, cork, nets; spines, lockers, drawers, a clock.

`content.textures.tileable` says what a texture takes and returns. What is drawn is drawn at twice the size
and averaged in linear light. Lengths inside a texture are shares of its side, so that a larger texture shows
the same surface.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.content.textures import detail
from evenlight.stimuli.scenes.content.textures.tileable import Image, albedo, linear, texture, tileable_noise
from evenlight.stimuli.scenes.engine.scene import Texture

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Box = tuple[float, float, float, float]


@texture
@detail.detailed(detail.PLASTERED)
def plain(rng: np.random.Generator, size: int, colour: str, mottling: float = 0.12, cells: int = 8) -> Image:
    """Return a surface of one colour with the unevenness of paint, vinyl or leather.

    Parameters
    ----------
    colour : str
        As sRGB "rrggbb".
    mottling : float
        How far the noise takes the albedo up and down, as a share.
    cells : int
        Lattice cells of the largest spots over the tile.
    """
    shade = 1 + mottling * (2 * tileable_noise(rng, size, (cells, cells), 5) - 1)
    return albedo(np.array(linear(colour)) * shade[..., np.newaxis])


def _apart(values: NDArray[np.float64], place: float) -> NDArray[np.float64]:
    """Return how far values in [0, 1) are from a place, on a ring of length 1."""
    away: NDArray[np.float64] = np.abs((values - place + 0.5) % 1 - 0.5)
    return away


@detail.detailed(detail.CAST)
def ceiling_tiles(rng: np.random.Generator, size: int) -> Image:
    """Return four mineral-fibre tiles in their metal grid, with pin holes."""
    tile = (
        np.array(linear("dcdad2")) * (0.93 + 0.14 * tileable_noise(rng, size, (16, 16), 3))[..., np.newaxis]
    )
    holes = rng.random((64, 64)) < 0.28
    rows, columns = np.mgrid[0:size, 0:size] * 64 // size
    tile[holes[rows, columns]] *= 0.82
    rows, columns = np.mgrid[0:size, 0:size] / size
    grid = np.minimum(_apart(2 * columns, 0.0), _apart(2 * rows, 0.0))
    tile[grid < 0.03] = np.array(linear("eceae6"))
    tile[grid < 0.006] = np.array(linear("8f8d88"))
    return albedo(tile)


@detail.detailed(detail.VARNISHED)
def gym_floor(rng: np.random.Generator, size: int) -> Image:
    """Return maple strips laid in a running bond: 32 rows in a tile, grain along x."""
    strips = 32
    rows, columns = np.mgrid[0:size, 0:size] / size
    strip = np.floor(rows * strips).astype(np.intp)
    shift = rng.random(strips)[strip]
    board = np.floor((columns + shift) * 3).astype(np.intp) % 3
    tone = rng.uniform(0.8, 1.12, (strips, 3))[strip, board]
    grain = tileable_noise(rng, size, (8, 8), 4)
    streaks = rng.uniform(0.92, 1.08, size).repeat(size).reshape(size, size)
    wood = np.array(linear("c99a5b")) * (tone * streaks * (0.88 + 0.24 * grain))[..., np.newaxis]
    seam = _apart(rows * strips, 0.0) < 0.03
    butt = _apart((columns + shift) * 3, 0.0) < 0.004
    wood[seam | butt] *= 0.62
    return albedo(wood)


@detail.detailed(detail.LOOSE)
def cork(rng: np.random.Generator, size: int) -> Image:
    """Return pressed cork: brown crumbs, a few dark ones."""
    crumbs = tileable_noise(rng, size, (40, 40), 3)
    shade = 0.6 + 0.7 * crumbs
    shade[crumbs < 0.3] *= 0.6
    return albedo(np.array(linear("b98a55")) * shade[..., np.newaxis])


def chain_link(rng: np.random.Generator, size: int) -> Image:
    """Return a wire fence, alpha-tested: 8 x 8 diamonds of galvanized wire in a tile."""
    del rng  # made by machine: all meshes are alike
    rows, columns = np.mgrid[0:size, 0:size] / size
    rising, falling = _apart(8 * (columns + rows), 0.0), _apart(8 * (columns - rows), 0.0)
    return _wires(np.minimum(rising, falling), 0.075, "9aa39c")


def basketball_net(rng: np.random.Generator, size: int) -> Image:
    """Return the cords of a net, alpha-tested: wide meshes above, narrow ones below."""
    del rng  # knotted alike everywhere
    rows, columns = np.mgrid[0:size, 0:size] / size
    rising, falling = _apart(8 * columns + 5 * rows, 0.0), _apart(8 * columns - 5 * rows, 0.0)
    return _wires(np.minimum(rising, falling), 0.1, "eceae2")


def spokes(rng: np.random.Generator, size: int) -> Image:
    """Return the spokes of a bicycle wheel, alpha-tested: 18 of them, and a hub."""
    rows, columns = (np.mgrid[0:size, 0:size] + 0.5) / size - 0.5
    radius, angle = np.hypot(rows, columns), np.arctan2(rows, columns)
    away = np.abs(np.sin(9 * angle)) / 9 * radius
    away[radius < 0.05] = 0
    away[radius > 0.47] = 1
    return _wires(away, 0.006, "b9bcc0")


def _wires(away: NDArray[np.float64], half_width: float, colour: str) -> Image:
    """Return wires where `away` is below `half_width`, rounded by shade, nothing elsewhere."""
    image = np.zeros((*away.shape, 4), dtype=np.float32)
    round_share = np.sqrt(np.clip(1 - (away / half_width) ** 2, 0, 1))
    image[..., :3] = np.array(linear(colour)) * (0.6 + 0.4 * round_share[..., np.newaxis])
    image[..., 3] = away < half_width
    return image


class Sheet:
    """A square sheet of side 1 to draw on, row 0 on top; colours as in a style sheet.

    Parameters
    ----------
    size : int
        Side of the finished picture [pixels].
    ground : str
        Its colour; with `#00000000` the sheet is clear where nothing is drawn.
    """

    def __init__(self, size: int, ground: str) -> None:
        from PIL import Image as Picture
        from PIL import ImageDraw

        self._side = 2 * size
        self._picture = Picture.new("RGBA", (self._side, self._side), ground)
        self._draw = ImageDraw.Draw(self._picture)

    def box(self, box: Box, colour: str) -> None:
        """Fill a rectangle (left, top, right, bottom)."""
        left, top, right, bottom = (round(edge * self._side) for edge in box)
        if right > left and bottom > top:
            self._draw.rectangle((left, top, right - 1, bottom - 1), fill=colour)

    def disc(self, box: Box, colour: str | None, edge: str | None = None, width: float = 0.0) -> None:
        """Fill an ellipse, or draw its outline of a width inwards."""
        left, top, right, bottom = (round(edge * self._side) for edge in box)
        self._draw.ellipse(
            (left, top, right, bottom), fill=colour, outline=edge, width=round(width * self._side)
        )

    def polygon(self, points: list[tuple[float, float]], colour: str) -> None:
        """Fill a polygon."""
        self._draw.polygon([(x * self._side, y * self._side) for x, y in points], fill=colour)

    def line(self, points: list[tuple[float, float]], colour: str, width: float) -> None:
        """Draw a line through points."""
        scaled = [(x * self._side, y * self._side) for x, y in points]
        self._draw.line(scaled, fill=colour, width=max(round(width * self._side), 1), joint="curve")

    def words(self, text: str, centre: tuple[float, float], height: float, colour: str) -> None:
        """Set a line of bold type about a point; its letters' height includes the descent."""
        place = centre[0] * self._side, centre[1] * self._side
        self._draw.text(place, text, fill=colour, font=_font(max(round(height * self._side), 4)), anchor="mm")

    def picture(self) -> Image:
        """Return the finished sheet as linear albedo, (size, size, 4)."""
        codes = np.asarray(self._picture, dtype=np.float32) / 255
        light = codes.copy()
        light[..., :3] = np.where(
            codes[..., :3] <= 0.04045, codes[..., :3] / 12.92, ((codes[..., :3] + 0.055) / 1.055) ** 2.4
        )
        half = self._side // 2
        averaged: Image = light.reshape(half, 2, half, 2, 4).mean(axis=(1, 3)).astype(np.float32)
        return averaged


@functools.cache
def _font(size: int) -> FreeTypeFont:
    """Return the bold type that comes with matplotlib, alike on every machine."""
    import matplotlib
    from PIL import ImageFont

    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"
    return ImageFont.truetype(str(file), size, layout_engine=ImageFont.Layout.BASIC)


@texture
@detail.detailed(detail.PRINTED)
def drawn(
    rng: np.random.Generator,
    size: int,
    ground: str,
    paint: Callable[[Sheet, np.random.Generator], None],
    wear: float = 0.06,
) -> Image:
    """Return the texture that a painter makes on a sheet.

    Parameters
    ----------
    ground : str
        Colour of the sheet.
    paint : callable
        Draws on it, with a generator.
    wear : float
        How far noise takes the albedo up and down, as a share.
    """
    sheet = Sheet(size, ground)
    paint(sheet, rng)
    shade = 1 + wear * (2 * tileable_noise(rng, size, (8, 8), 5) - 1)
    return albedo(sheet.picture()[..., :3] * shade[..., np.newaxis])


CLOTH_COLOURS = (
    "#82443e", "#46604f", "#43577a", "#97784a", "#6a4a5a", "#b7a888", "#5a5a5c", "#9c614d",
    "#6a7e57", "#466f78", "#c7bda6", "#7b5f48", "#a8524a", "#d2b15c", "#66718a", "#48545e",
)  # fmt: skip
SPINE_ROWS = 4


@detail.detailed(detail.PRINTED)
def library_spines(rng: np.random.Generator, size: int) -> Image:
    """Return book spines with shelf marks: four rows on top of each other, each filling a tile's width."""
    sheet = Sheet(size, "#37322d")
    for row in range(SPINE_ROWS):
        left, bottom = 0.0, (row + 1) / SPINE_ROWS
        while left < 1:
            width = min(
                rng.choice([0.014, 0.02, 0.026, 0.034, 0.045, 0.055]) * rng.uniform(0.85, 1.2), 1 - left
            )
            if 1 - left - width < 0.012:
                width = 1 - left
            _spine(sheet, (left, bottom - 1 / SPINE_ROWS, left + width, bottom), rng)
            left += width
    return albedo(sheet.picture()[..., :3])


@detail.detailed(detail.PRINTED)
def faded_spines(rng: np.random.Generator, size: int) -> Image:
    """Return book spines that have greyed in a store: less contrast, nothing black."""
    return albedo(0.6 * library_spines(rng, size) + 0.4 * np.array(linear("a3957f")))


def _spine(sheet: Sheet, box: Box, rng: np.random.Generator) -> None:
    """Draw a spine: rounded by shade, with bands, lettering along it, and a label at the foot."""
    left, top, right, bottom = box
    width, tall = right - left, bottom - top
    colour = CLOTH_COLOURS[rng.integers(len(CLOTH_COLOURS))]
    sheet.box(box, shaded(colour, 0.7))
    sheet.box((left + 0.1 * width, top, right - 0.06 * width, bottom), colour)
    sheet.box((left + 0.3 * width, top, left + 0.55 * width, bottom), shaded(colour, 1.18))
    ink = "#e3c878" if rng.random() < 0.6 else "#ece6da"
    for height in rng.choice([0.28, 0.34, 0.42, 0.72, 0.78], size=rng.integers(0, 4), replace=False):
        sheet.box((left + 0.06 * width, top + height * tall, right, top + (height + 0.012) * tall), ink)
    start, length = rng.uniform(0.4, 0.46), rng.uniform(0.12, 0.26)
    letters = int(length * tall / 0.006)
    for letter in range(letters):
        if rng.random() < 0.8:
            at = top + start * tall + letter * 0.006
            sheet.box((left + 0.34 * width, at, right - 0.3 * width, at + 0.004), ink)
    if rng.random() < 0.8:
        foot = (left + 0.1 * width, bottom - 0.2 * tall, right - 0.06 * width, bottom - 0.1 * tall)
        sheet.box(foot, "#e9e6da")
        for line in (0.185, 0.155, 0.125):
            sheet.box(
                (
                    left + 0.25 * width,
                    bottom - line * tall,
                    right - 0.25 * width,
                    bottom - (line - 0.012) * tall,
                ),
                "#3a3a3a",
            )


def shaded(colour: str, factor: float) -> str:
    """Return a colour made darker or paler, code by code.

    >>> shaded("#204060", 2.0)
    '#4080c0'
    """
    codes = (min(round(int(colour[start : start + 2], 16) * factor), 255) for start in (1, 3, 5))
    return "#" + "".join(f"{code:02x}" for code in codes)


LOCKER_DOORS = 4


def locker_fronts(colours: tuple[str, ...]) -> Texture:
    """Return four locker doors side by side, each as tall as the tile: vents, plate, lock, stickers."""

    def paint(sheet: Sheet, rng: np.random.Generator) -> None:
        for door in range(LOCKER_DOORS):
            _locker(sheet, door, colours[door % len(colours)], rng)

    return drawn("#20262a", paint)


def _locker(sheet: Sheet, door: int, colour: str, rng: np.random.Generator) -> None:
    """Draw one door; a door is three times as tall as it is wide, which the sheet squeezes."""
    x, wide = door / LOCKER_DOORS, 1 / LOCKER_DOORS
    sheet.box((x + 0.03 * wide, 0.008, x + 0.97 * wide, 0.992), shaded(colour, 1.1))
    sheet.box((x + 0.06 * wide, 0.016, x + 0.97 * wide, 0.992), colour)
    sheet.box((x + 0.94 * wide, 0.016, x + 0.97 * wide, 0.992), shaded(colour, 0.7))
    for start in (0.08, 0.82):
        for vent in range(6):
            top = start + 0.018 * vent
            sheet.box((x + 0.25 * wide, top, x + 0.75 * wide, top + 0.005), "#14181a")
            sheet.box((x + 0.25 * wide, top + 0.005, x + 0.75 * wide, top + 0.009), shaded(colour, 1.3))
    sheet.box((x + 0.34 * wide, 0.225, x + 0.66 * wide, 0.265), "#e8e4d6")
    sheet.words(str(rng.integers(100, 400)), (x + 0.5 * wide, 0.245), 0.036, "#1b1b1b")
    sheet.box((x + 0.78 * wide, 0.42, x + 0.9 * wide, 0.56), "#8b8f92")
    sheet.disc((x + 0.8 * wide, 0.475, x + 0.88 * wide, 0.505), "#2c2e30")
    for _ in range(rng.integers(0, 4)):
        side, place = rng.uniform(0.06, 0.14), (rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.7))
        left, top = x + place[0] * wide, place[1]
        tint = ("#e2b93b", "#d2473b", "#3b8fd2", "#f1efe6", "#62b35b", "#b55bb3")[rng.integers(6)]
        if rng.random() < 0.5:
            sheet.disc((left, top, left + side * 1.5 * wide, top + side / 2), tint)
        else:
            sheet.box((left, top, left + side * 2.2 * wide, top + side / 3), tint)
            sheet.box((left, top + side / 9, left + side * 1.8 * wide, top + side / 6), "#2a2a2a")


@detail.detailed(detail.VARNISHED)
def catalogue_drawers(rng: np.random.Generator, size: int) -> Image:
    """Return 4 x 4 oak drawers of a card catalogue, each with a brass label frame and a pull."""

    def paint(sheet: Sheet, rng: np.random.Generator) -> None:
        for row in range(4):
            for column in range(4):
                x, y, tone = column / 4, row / 4, rng.uniform(0.92, 1.08)
                sheet.box((x + 0.006, y + 0.006, x + 0.244, y + 0.244), shaded("#7d5630", tone))
                for _ in range(14):
                    grain = y + rng.uniform(0.01, 0.236)
                    sheet.box((x + 0.008, grain, x + 0.242, grain + 0.003), shaded("#6d4928", tone))
                sheet.box((x + 0.07, y + 0.04, x + 0.18, y + 0.11), "#b3924c")
                sheet.box((x + 0.078, y + 0.048, x + 0.172, y + 0.102), "#efe8d3")
                letter = "ABCDEFGHIJKLMNOPQRSTUVWZ"[(4 * row + column) % 24]
                sheet.words(f"{letter}-{letter}z", (x + 0.125, y + 0.075), 0.034, "#33302a")
                sheet.disc((x + 0.1, y + 0.14, x + 0.15, y + 0.19), "#b3924c")
                sheet.disc((x + 0.11, y + 0.145, x + 0.14, y + 0.175), "#dcc179")

    return drawn("#3a2514", paint)(rng, size)


@detail.detailed(detail.GLAZED)
def clock_face(rng: np.random.Generator, size: int) -> Image:
    """Return a station clock at ten to eleven, on a ground of its rim's colour."""

    def paint(sheet: Sheet, rng: np.random.Generator) -> None:
        sheet.disc((0.03, 0.03, 0.97, 0.97), "#f4f2ea")
        for minute in range(60):
            long = minute % 5 == 0
            turn = np.pi * minute / 30
            inner = 0.37 if long else 0.41
            ends = [(0.5 + r * np.sin(turn), 0.5 - r * np.cos(turn)) for r in (inner, 0.44)]
            sheet.line(ends, "#161616", 0.022 if long else 0.008)
        for turn, length, width in (
            (2 * np.pi * 10.83 / 12, 0.24, 0.035),
            (2 * np.pi * 50 / 60, 0.37, 0.025),
        ):
            sheet.line(
                [(0.5, 0.5), (0.5 + length * np.sin(turn), 0.5 - length * np.cos(turn))], "#161616", width
            )
        sheet.line([(0.5, 0.5), (0.5 + 0.33, 0.5 + 0.12)], "#c22a20", 0.012)
        sheet.disc((0.475, 0.475, 0.525, 0.525), "#c22a20")

    return drawn("#2b2d2f", paint, wear=0.0)(rng, size)
