"""Surfaces that only the school has: paint, court, ceiling, cork, nets, fence.

Each texture takes (rng, size) and returns linear albedo, (size, size, 3), or with alpha, (size, size, 4), for
cut-outs; opposite edges join. Row 0 is the top. Lengths inside a texture are shares of its side, so that a
larger texture shows the same surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.colours import Texture, albedo, linear
from evenlight.stimuli.scenes.tileable import tileable_noise

Image = NDArray[np.float32]


def plain(colour: str, mottling: float = 0.12, cells: int = 8) -> Texture:
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

    def texture(rng: np.random.Generator, size: int) -> Image:
        shade = 1 + mottling * (2 * tileable_noise(rng, size, (cells, cells), 5) - 1)
        return albedo(np.array(linear(colour)) * shade[..., np.newaxis])

    return texture


def _apart(values: NDArray[np.float64], place: float) -> NDArray[np.float64]:
    """Return how far values in [0, 1) are from a place, on a ring of length 1."""
    away: NDArray[np.float64] = np.abs((values - place + 0.5) % 1 - 0.5)
    return away


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
    del rng
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
