"""Colours, and patterns whose edges meet: noise, grids of bricks and tiles, scattered stamps, cells.

A colour is the linear light that a surface reflects, written as one picks it on a screen. A texture is called
with a generator and a size and gives linear albedo, (size, size, 3) in [0, 1], whose opposite edges meet;
those with holes give a fourth channel, the share of the pixel that is covered. Row 0 is the top of what
stands upright (v = 1 if v is counted from below).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from evenlight.stimuli.fractal_noise import smoothstep
from evenlight.stimuli.scenes.engine.scene import Texture

Colour = tuple[float, float, float]
Image = NDArray[np.float32]
Choices = ParamSpec("Choices")


def texture(
    paint: Callable[Concatenate[np.random.Generator, int, Choices], Image],
) -> Callable[Choices, Texture]:
    """Turn a function of (rng, size, choices) into one that takes the choices and returns the texture."""

    @functools.wraps(paint)
    def choose(*choices: Choices.args, **named: Choices.kwargs) -> Texture:
        def chosen(rng: np.random.Generator, size: int) -> Image:
            return paint(rng, size, *choices, **named)

        chosen.__module__ = paint.__module__  # tells whether the scenes' own sources define it
        vars(chosen).update(vars(paint))  # its detail
        return chosen

    return choose


def tileable_noise(
    rng: np.random.Generator, size: int, cells: tuple[int, int], octaves: int = 4, gain: float = 0.5
) -> Image:
    """Return fractal value noise, (size, size), about in [0, 1], that joins itself at all four edges.

    Parameters
    ----------
    rng : Generator
        Source of the lattice values.
    size : int
        Width and height [pixels].
    cells : (int, int)
        Lattice cells over the height and the width in the first octave.
    octaves : int
        How many octaves are added; those finer than the pixels are left out.
    gain : float
        Amplitude of an octave relative to the one before it.
    """
    total = np.zeros((size, size), dtype=np.float32)
    power = 0.0
    for octave in range(octaves):
        down, across = cells[0] << octave, cells[1] << octave
        if octave and max(down, across) > size:
            break
        lattice = rng.random((down, across), dtype=np.float32) - np.float32(0.5)
        total += np.float32(gain**octave) * (_spread(size, down) @ lattice @ _spread(size, across).T)
        power += gain ** (2 * octave)
    # One octave has a standard deviation of about 0.2: this spreads the sum over [0, 1].
    return total / np.float32(1.3 * power**0.5) + np.float32(0.5)


def _spread(size: int, cells: int) -> Image:
    """Return the matrix that interpolates periodic lattice values at the centres of the pixels."""
    position = (np.arange(size) + 0.5) * cells / size
    below = np.floor(position).astype(np.intp) % cells
    share = smoothstep(position - np.floor(position), 0.0, 1.0)
    matrix = np.zeros((size, cells), dtype=np.float32)
    matrix[np.arange(size), below] += (1 - share).astype(np.float32)
    matrix[np.arange(size), (below + 1) % cells] += share.astype(np.float32)
    return matrix


def places(size: int) -> tuple[Image, Image]:
    """Return how far down and how far right each pixel's centre lies, as columns and rows of [0, 1)."""
    centres = ((np.arange(size) + 0.5) / size).astype(np.float32)
    return centres[:, np.newaxis], centres[np.newaxis, :]


def cells(
    rng: np.random.Generator, size: int, number: int, stretch: float = 1.0
) -> tuple[NDArray[np.intp], Image]:
    """Return, for a scatter of points, which is nearest to each pixel, and how far the border of its cell is.

    Parameters
    ----------
    rng : Generator
        Source of the points.
    size : int
        Width and height [pixels].
    number : int
        How many points.
    stretch : float
        Width of a cell over its height.

    Returns
    -------
    index : array, (size, size)
    edge : array, (size, size)
        0 on the border between two cells, about 0.5 well inside one.
    """
    box = np.array([stretch, 1.0])
    tree = cKDTree(rng.random((number, 2)) * box, boxsize=box)
    down, across = np.meshgrid(*(value.ravel() for value in places(size)), indexing="ij")
    found = tree.query(np.stack([down, across], axis=-1) * box, k=2)
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    spacing = np.sqrt(stretch / number)
    edge = ((distance[..., 1] - distance[..., 0]) / spacing).astype(np.float32)
    return np.asarray(nearest[..., 0], dtype=np.intp), edge


def courses(
    size: int, rows: int, per_row: int, shift: float, joint: tuple[float, float]
) -> tuple[NDArray[np.intp], Image]:
    """Return the number of the brick or tile at each pixel, and how much of it is not joint, 0 to 1.

    Parameters
    ----------
    size : int
        Width and height [pixels].
    rows, per_row : int
        Courses over the height (even if shifted), stones over the width.
    shift : float
        How far every second course is moved, in stones.
    joint : (float, float)
        Widths of the level and the upright joints, in heights and widths of a stone.
    """
    down, across = places(size)
    row = np.floor(down * rows).astype(np.intp)
    along = across * per_row + shift * (row % 2)
    column = np.floor(along).astype(np.intp) % per_row
    level = np.abs(down * rows - row - 0.5)
    upright = np.abs(along - np.floor(along) - 0.5)
    soft = 1.2 * np.array([rows, per_row]) / size
    body = smoothstep(0.5 - level, joint[0] / 2 - soft[0] / 2, joint[0] / 2 + soft[0] / 2)
    body = body * smoothstep(0.5 - upright, joint[1] / 2 - soft[1] / 2, joint[1] / 2 + soft[1] / 2)
    return row * per_row + column, body.astype(np.float32)


def stamp(picture: Image, centre: tuple[float, float], colour: Any, cover: NDArray[np.floating[Any]]) -> None:
    """Paint a colour into the picture, in place, where `cover` says how much; it wraps at the edges.

    Parameters
    ----------
    picture : array, (size, size, channels)
    centre : (float, float)
        How far down and right the middle of the stamp lies, in [0, 1).
    colour : array_like, (channels,) or (height, width, channels)
    cover : array, (height, width)
        Share of the pixel that the stamp hides.
    """
    size = len(picture)
    down = (int(centre[0] * size) - cover.shape[0] // 2 + np.arange(cover.shape[0])) % size
    right = (int(centre[1] * size) - cover.shape[1] // 2 + np.arange(cover.shape[1])) % size
    where = np.ix_(down, right)
    share = cover[..., np.newaxis].astype(np.float32)
    picture[where] = picture[where] * (1 - share) + np.asarray(colour, dtype=np.float32) * share


def ellipse(height: float, width: float, turn: float) -> Image:
    """Return the cover of an ellipse, in pixels, turned by an angle [radians], with soft edges."""
    reach = int(np.ceil(max(height, width) / 2)) + 1
    grid = np.arange(-reach, reach + 1, dtype=np.float32)
    down, across = np.meshgrid(grid, grid, indexing="ij")
    along = across * np.cos(turn) + down * np.sin(turn)
    aside = down * np.cos(turn) - across * np.sin(turn)
    radius = np.hypot(along / max(width / 2, 0.5), aside / max(height / 2, 0.5))
    softness = 1.5 / max(min(height, width), 1.5)
    return (1 - smoothstep(radius, 1 - softness, 1 + softness / 2)).astype(np.float32)


def linear(code: str) -> Colour:
    """Return the linear albedo of a colour picked as sRGB "rrggbb".

    >>> linear("ffffff"), linear("000000")
    ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    """
    encoded = np.array([int(code[at : at + 2], 16) for at in (0, 2, 4)]) / 255
    light = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    red, green, blue = light.tolist()
    return red, green, blue


def rgb(colour: Any) -> Image:
    """Return one colour or several as an array in single precision, as pictures are."""
    return np.asarray(colour, dtype=np.float32)


def blended(low: Any, high: Any, share: NDArray[Any]) -> Image:
    """Return the picture, (..., 3), that goes from colour `low` to `high` as `share` goes from 0 to 1."""
    amount = np.clip(share, 0, 1)[..., np.newaxis].astype(np.float32)
    first, second = rgb(low), rgb(high)
    mixed: Image = first + amount * (second - first)
    return mixed


def albedo(picture: NDArray[np.floating[Any]]) -> Image:
    """Return a picture kept within what real surfaces reflect: nothing is black, nothing a mirror."""
    kept: Image = np.clip(picture, 0.004, 0.92).astype(np.float32)
    return kept


def shaded(picture: Image, factor: NDArray[np.floating[Any]]) -> Image:
    """Return the picture, (..., 3), times a factor for each pixel."""
    product: Image = picture * factor[..., np.newaxis].astype(np.float32)
    return product
