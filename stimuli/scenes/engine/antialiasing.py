"""Several samples of each pixel, on a turned grid, and their mean.

A square grid of samples that is turned against the pixels has every sample of a pixel in a row and a column
of its own, so that upright and level edges, which rooms are full of, are resolved as finely as the number of
samples, not as its root. Turned such that from a pixel to the next are whole steps of the grid, it lies in
every pixel alike. For the eyes of a headset, which do not wait, the graphics card takes the samples of each
pixel itself: it finds out for each what is in front, but the colour of a surface only once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from evenlight.stimuli.scenes.engine.scene import Floats
from evenlight.stimuli.shaders import shader

MOST_DRAWN = 2**23  # [samples] at a time: bigger pictures are drawn in tiles
LARGEST_SIDE = 8192  # [samples]


@dataclass(frozen=True, slots=True)
class Antialiasing:
    """The grid of samples: the next pixel to the right is `along` steps to the right and `aside` down.

    Attributes
    ----------
    along, aside : int
        Steps of the grid; a pixel has `along`^2 + `aside`^2 places in it.
    samples : int
        That the graphics card takes at each of them.
    """

    along: int
    aside: int = 0
    samples: int = 1

    def places(self) -> list[tuple[int, int]]:
        """Return where in the grid a pixel has its samples, from its lower left corner.

        >>> Antialiasing(2).places()
        [(0, 0), (0, 1), (1, 0), (1, 1)]
        >>> len(Antialiasing(4, 1).places())
        17
        """
        n, m = self.along, self.aside
        found = []
        for u in range(n + m):
            for v in range(-m, n):
                # Twice the place in the pixel, as a multiple of 1 / (n^2 + m^2).
                x, y = n * (2 * u + 1) - m * (2 * v + 1), m * (2 * u + 1) + n * (2 * v + 1)
                if min(x, y) >= 0 and max(x, y) < 2 * (n * n + m * m):
                    found.append((u, v))
        return found

    def numbering(self) -> tuple[int, int, int, int]:
        """Return b, c, d and g that number a pixel's samples.

        The sample (u, v) has the number g (((u + b v) mod c) + c (v mod d)) mod c d: all from 0 to c d - 1
        occur once in each pixel, and neighbours are far apart.
        """
        n, m = self.along, self.aside
        count = n * n + m * m
        spread = next(g for g in range(round(0.618 * count), 2 * count + 1) if math.gcd(g, count) == 1)
        if m == 0:
            return 0, n, n, spread
        return n * pow(m, -1, count) % count, count, 1, spread

    def sharper(self) -> tuple[float, float]:
        """Return by how many levels a finer copy of an image is taken, and how oblique, squared, at most."""
        # The mean of many samples smooths by itself what a finer copy shows; that of few would flicker.
        return (-1.25, 64.0) if self.along > 2 else (0.0, 4.0)

    def possible(self, most: int) -> Antialiasing:
        """Return the grid with as many samples at a place as a graphics card takes at most.

        >>> EYES.possible(8).samples, EYES.possible(2).samples, LIVE.possible(0) == LIVE
        (4, 2, True)
        """
        return replace(self, samples=max(min(self.samples, most), 1))


NONE, LIVE, OFFLINE, EYES = (
    Antialiasing(1),
    Antialiasing(2, 1),
    Antialiasing(5, 2),
    Antialiasing(1, samples=4),
)


@dataclass(frozen=True, slots=True)
class Tile:
    """A part of a picture [pixels], its lower left corner counted from that of the picture."""

    left: int
    bottom: int
    width: int
    height: int

    def drawn_size(self, grid: Antialiasing) -> tuple[int, int]:
        """Return width and height of the samples around it."""
        return (
            grid.along * self.width + grid.aside * self.height,
            grid.along * self.height + grid.aside * self.width,
        )

    def origin(self, grid: Antialiasing) -> tuple[int, int]:
        """Return where the samples of the picture's lower left corner lie among those of the tile."""
        n, m = grid.along, grid.aside
        return -n * self.left - m * self.bottom, m * (self.left + self.width) - n * self.bottom

    def placing(self, size: tuple[int, int], grid: Antialiasing) -> Floats:
        """Return the matrix, (3, 3), from a picture of some size to its samples, both from -1 to 1."""
        n, m = grid.along, grid.aside
        x, y = size[0] / 2, size[1] / 2
        pixels = np.array([[x, 0, x], [0, y, y], [0, 0, 1]])
        turned = np.array([[n, m, 0], [-m, n, 0], [0, 0, 1]])
        turned[:2, 2] = self.origin(grid)
        width, height = self.drawn_size(grid)
        return np.asarray(np.array([[2 / width, 0, -1], [0, 2 / height, -1], [0, 0, 1]]) @ turned @ pixels)


def tiles(size: tuple[int, int], grid: Antialiasing) -> list[Tile]:
    """Return the tiles in which a picture is drawn, all of one size: they may reach beyond it.

    There is one where the graphics card takes the samples: such a picture is drawn while someone waits.
    """
    width, height = size
    if grid.samples > 1:
        return [Tile(0, 0, width, height)]
    while True:
        drawn = Tile(0, 0, width, height).drawn_size(grid)
        if drawn[0] * drawn[1] <= MOST_DRAWN and max(drawn) <= LARGEST_SIDE:
            break
        width, height = (-(-width // 2), height) if width >= height else (width, -(-height // 2))
    return [
        Tile(left, bottom, width, height)
        for left in range(0, size[0], width)
        for bottom in range(0, size[1], height)
    ]


def average_fragment(grid: Antialiasing) -> str:
    """Return the shader for the mean of a pixel's samples."""
    places = grid.places()
    sampler = "sampler2DMS" if grid.samples > 1 else "sampler2D"
    offsets = ", ".join(f"ivec2({u}, {v})" for u, v in places)
    source = shader("average").replace("OFFSETS", offsets).replace("COUNT", str(len(places)))
    source = source.replace("SAMPLES", str(grid.samples)).replace("SAMPLER", sampler)
    return source.replace("ALONG", str(grid.along)).replace("ASIDE", str(grid.aside))
