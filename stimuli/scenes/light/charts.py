"""Where the light on each patch is stored: a rectangle of texels per patch, packed into one picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.scene import Floats, Patches

WIDTH = 2048  # of the picture [texels]
SMALL = 0.2  # [m] shorter sides have the same light from end to end
# Distance of texels [m] on patches of an area [m^2]: furniture needs fewer than walls, and lawns too.
SPACINGS = ((0.0, 0.4), (1.0, 0.3), (3.0, 0.17), (25.0, 0.2), (100.0, 0.3), (400.0, 0.5), (1e9, 0.5))
TEXELS = 280_000  # about so many at most: with more, all are set wider apart
MOST = 160  # texels along a side
MOST_WIDER = 6.0
BENT = 0.06  # [m] shorter pieces of round surfaces are lit like flat ones
MARGIN = 0.015  # [m] light is sought this far from the edges, where other patches touch


@dataclass(frozen=True, eq=False)
class Charts:
    """The rectangles of all patches.

    Attributes
    ----------
    columns, rows : arrays of int, (n,)
        Size of each: texels along and across.
    left, top : arrays of int, (n,)
        Where each begins.
    size : (int, int)
        Width and height of the picture [texels].
    """

    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    left: NDArray[np.int64]
    top: NDArray[np.int64]
    size: tuple[int, int]

    def coordinates(self) -> Floats:
        """Return where each patch's origin and edges' ends are in the picture, (n, 3, 2) in [0, 1]."""
        first = np.stack([self.left, self.top], axis=1) + 0.5
        corners = np.repeat(first[:, None], 3, axis=1)
        corners[:, 1, 0] += self.columns - 1
        corners[:, 2, 1] += self.rows - 1
        return np.asarray(corners / self.size)


@dataclass(frozen=True, eq=False)
class Texels:
    """Every texel of every chart, one after the other, row by row.

    Attributes
    ----------
    patch : array of int, (t,)
        Whose light it is.
    start : array of int, (n,)
        First texel of each patch.
    column, row : arrays of int, (t,)
        Within the chart.
    s, t : arrays, (t,)
        Where on the patch, as shares of its edges.
    """

    patch: NDArray[np.int64]
    start: NDArray[np.int64]
    column: NDArray[np.int64]
    row: NDArray[np.int64]
    s: Floats
    t: Floats


def charts_of(patches: Patches, holed: NDArray[np.bool_]) -> Charts:
    """Return a rectangle for each patch, so fine as its size asks for.

    Parameters
    ----------
    patches : Patches
        Of a scene.
    holed : array of bool, (n,)
        Patches with holes, such as leaves: their light is the same all over.
    """
    counts = _counts(patches, holed, 1.0)
    wider = 1.0
    while counts.prod(axis=0).sum() > TEXELS and wider < MOST_WIDER:
        wider *= 1.15
        counts = _counts(patches, holed, wider)
    columns, rows = counts
    left, top, height = _packed(columns, rows)
    return Charts(columns, rows, left, top, (WIDTH, height))


def _counts(patches: Patches, holed: NDArray[np.bool_], wider: float) -> NDArray[np.int64]:
    """Return texels along and across each patch, (2, n), their distance some factor wider than usual."""
    lengths = np.stack([np.linalg.norm(edge, axis=1) for edge in (patches.along, patches.across)])
    areas, steps = zip(*SPACINGS, strict=True)
    step = wider * np.interp(lengths.prod(axis=0), areas, steps)
    counts = np.minimum(np.ceil(lengths / step).astype(np.int64) + 1, MOST)
    bent = np.abs(np.diff(patches.normals, axis=1)).max(axis=(1, 2)) > 1e-9
    bent &= lengths.max(axis=0) > BENT * wider
    counts[(lengths < SMALL * wider) & ~bent] = 1
    counts[:, holed | patches.emission.any(axis=1)] = 1
    return np.asarray(counts)


def texels_of(patches: Patches, charts: Charts) -> Texels:
    """Return the texels of the charts, with their place on the patches."""
    counts = charts.columns * charts.rows
    start = np.concatenate([[0], np.cumsum(counts)[:-1]])
    patch = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(counts.sum()) - start[patch]
    column, row = within % charts.columns[patch], within // charts.columns[patch]
    s = _shares(column, charts.columns[patch], np.linalg.norm(patches.along, axis=1)[patch])
    t = _shares(row, charts.rows[patch], np.linalg.norm(patches.across, axis=1)[patch])
    # The far half of a triangle's chart is not seen: it repeats the light of the long side.
    beyond = np.where(patches.triangle[patch], np.maximum(s + t - 1, 0) / 2 + 0.0, 0.0)
    s, t = s - beyond, t - beyond
    lone = patches.triangle[patch] & (counts[patch] == 1)
    return Texels(patch, start, column, row, np.where(lone, 1 / 3, s), np.where(lone, 1 / 3, t))


def _packed(
    columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Return left and top of each rectangle, packed on shelves, tallest first, and the height of all."""
    order = np.lexsort((np.arange(len(rows)), -columns, -rows))
    left, top = np.zeros_like(columns), np.zeros_like(rows)
    x = y = shelf = 0
    for k in order.tolist():
        width, height = int(columns[k]), int(rows[k])
        if x + width > WIDTH:
            x, y, shelf = 0, y + shelf, 0
        left[k], top[k] = x, y
        x, shelf = x + width, max(shelf, height)
    return left, top, y + shelf


def _shares(index: NDArray[np.int64], count: NDArray[np.int64], length: Floats) -> Floats:
    """Return places along an edge, from just inside one end to just inside the other; the middle if alone."""
    margin = np.minimum(MARGIN / length, 0.1)
    even = index / np.maximum(count - 1, 1)
    return np.where(count == 1, 0.5, margin + (1 - 2 * margin) * even)
