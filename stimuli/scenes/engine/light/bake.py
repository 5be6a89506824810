"""The light on all surfaces of a scene, from lamps, sky and sun, over several reflections.

It takes long to compute, and is stored in the user's cache between runs: a rectangle of texels per patch (its
chart), packed into one picture.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.progress import aside
from evenlight.stimuli.scenes.engine.array_cache import (
    cached_array,
    light_sources,
    one_at_a_time,
    store_array,
)
from evenlight.stimuli.scenes.engine.light import bake_kernels, bake_lights
from evenlight.stimuli.scenes.engine.light.bake_lights import GRADIENT
from evenlight.stimuli.scenes.engine.light.ray_tree import RayTree, ray_tree
from evenlight.stimuli.scenes.engine.light.stitches import stitched
from evenlight.stimuli.scenes.engine.material_textures import MaterialTextures
from evenlight.stimuli.scenes.engine.scene import Floats, Patches, Quality, Scene

BOUNCES = 5
SLICES = 64  # of the work, shared out among threads
# The loops that take long.
COUNTED: tuple[Callable[..., None], ...] = (
    bake_kernels.gather, bake_lights.from_lamps, bake_lights.through_windows,
)  # fmt: skip
BURIED_SHARE = 0.6  # of a sample's rays end at once, or inside something
MIXED = 0.35  # light is mixed over this share of the distance to what is around
SMOOTHINGS = 3  # of light that is gathered with few rays
SHARPER = 0.1  # lamps' light has hardly any noise: it is mixed over so much less
WIDTH = 2048  # of the picture [texels]
SMALL = 0.2  # [m] shorter sides have the same light from end to end
# Distance of texels [m] on patches of an area [m^2]: furniture needs fewer than walls, and lawns too.
SPACINGS = ((0.0, 0.4), (1.0, 0.3), (3.0, 0.17), (25.0, 0.2), (100.0, 0.3), (400.0, 0.5), (1e9, 0.5))
TEXELS = 280_000  # about so many at most: with more, all are set wider apart
MOST = 160  # texels along a side
MOST_WIDER = 6.0
BENT = 0.06  # [m] shorter pieces of round surfaces are lit like flat ones
MARGIN = 0.015  # [m] light is sought this far from the edges, where other patches touch


def light_picture(
    scene: Scene, charts: Charts, textures: MaterialTextures, quality: Quality | None
) -> NDArray[np.float16]:
    """Return the light on all surfaces, (height, width, 3): the luminance of white paper [cd/m^2].

    Without a quality it is only a guess, brighter from above: for a quick look.
    """
    surfaces = textures.albedo, textures.coverage
    if quality is None:
        light = _guess(scene, charts)
    else:
        group = f"light-{scene.name}-{quality.name.lower()}"
        name = f"{group}-{_key(scene, surfaces, quality)}"
        with one_at_a_time(group):
            stored = _fitting(cached_array(name), int((charts.columns * charts.rows).sum()))
            if stored is None:
                with aside(f"computing the light of {scene.name}, once", len(COUNTED) * SLICES) as at:
                    stored = baked(scene, charts, surfaces, quality, at).astype(np.float16)
                store_array(name, stored, instead_of=f"{group}-*")
            light = stored
    texels = texels_of(scene.patches, charts)
    picture = np.zeros((charts.size[1], charts.size[0], 3), dtype=np.float16)
    picture[charts.top[texels.patch] + texels.row, charts.left[texels.patch] + texels.column] = light
    return picture


def _guess(scene: Scene, charts: Charts) -> NDArray[np.float16]:
    """Return light that depends on the direction of surfaces alone."""
    texels, patches = texels_of(scene.patches, charts), scene.patches
    normal = patches.normals[texels.patch, 0]
    light = (15 + 9 * normal[:, 2:] + 3 * normal[:, :1] + 1.5 * normal[:, 1:2]) * np.ones(3)
    own = patches.emission[texels.patch]
    return np.where(own.any(axis=1, keepdims=True), own, light).astype(np.float16)


def _key(scene: Scene, surfaces: tuple[Floats, Floats], quality: Quality) -> str:
    """Return the SHA-256 of all that the light depends on."""
    patches = scene.patches
    digest = hashlib.sha256(repr((quality.name, quality.value, scene.sun, scene.sky)).encode())
    for file in light_sources():
        digest.update(file.read_bytes())
    for array in (
        patches.origin, patches.along, patches.across, patches.triangle, patches.normals, patches.material,
        patches.tint, patches.emission, scene.windows, *surfaces,
    ):  # fmt: skip
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _fitting(light: NDArray[Any] | None, texels: int) -> NDArray[np.float16] | None:
    """Return what was stored, if it is the light of so many texels."""
    if light is None or light.shape != (texels, 3) or light.dtype != np.float16:
        return None
    return light if np.isfinite(light).all() else None


@dataclass(frozen=True, eq=False)
class _Samples:
    """Where light is gathered: places that several texels share are sampled once."""

    of_texel: NDArray[np.int64]
    place: Floats
    normal: Floats
    patch: NDArray[np.int64]
    both: NDArray[np.bool_]
    spread: Floats


def baked(
    scene: Scene,
    charts: Charts,
    surfaces: tuple[Floats, Floats],
    quality: Quality,
    at: Callable[[int], None] = lambda done: None,
) -> NDArray[np.float32]:
    """Return the light on every texel: the luminance of white paper there, without direct sun, (t, 3).

    Parameters
    ----------
    scene : Scene
        What is lit.
    charts : Charts
        Of its patches.
    surfaces : (array (m, 3), array (m,))
        Mean albedo and coverage of the materials.
    quality : Quality
        How carefully.
    at : callable
        Is told how many slices of the long loops, `COUNTED`, are done.
    """
    patches = scene.patches
    albedo, coverage = surfaces
    texels = texels_of(patches, charts)
    samples = _samples(scene, charts, texels)
    tree = ray_tree(patches, coverage[patches.material])
    budget, least, most = quality.value
    n = len(samples.place)
    rays = int(np.clip(budget // n, least, most))
    where = samples.place, samples.normal, samples.patch, samples.both
    sky = np.asarray(scene.sky.zenith), np.asarray(scene.sky.horizon), GRADIENT
    facing = np.cross(patches.along, patches.across)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    hits, near = np.empty((n, rays), dtype=np.int32), np.empty((n, 2))
    gathered, lamps = np.zeros((n, 3)), np.zeros((n, 3))
    layout = charts.columns, charts.rows, texels.start, facing, samples.of_texel
    loops: tuple[tuple[object, ...], ...] = (
        (tree, layout, scene.windows, *where, sky, hits, gathered, near),
        (tree, _lamps(scene, facing), *where, lamps),
        (tree, scene.windows, sky, *where, gathered),
    )
    for k, (kernel, arguments) in enumerate(zip(COUNTED, loops, strict=True)):
        _shared(kernel, n, *arguments, at=partial(_told, at, k * SLICES))
    sun = _sun(scene, tree, samples)
    reflected = albedo[patches.material[samples.patch]] * patches.tint[samples.patch]
    first, received = lamps + sun + gathered, np.zeros((n, 3))
    for _ in range(BOUNCES):
        _shared(bake_kernels.bounce, n, hits, reflected * (first + received), received)
    light, lamps, near = (
        (gathered + received)[samples.of_texel],
        lamps[samples.of_texel],
        near[samples.of_texel],
    )
    for _ in range(SMOOTHINGS):
        light = _smoothed(patches, charts, texels, light, near)
    light = light + _smoothed(patches, charts, texels, lamps, near * [SHARPER, 1])
    return _finished(scene, charts, texels, stitched(patches, charts, texels, light))


def _told(at: Callable[[int], None], before: int, done: int) -> None:
    """Tell how many slices are done, after those of the loops before."""
    at(before + done)


def _shared(
    kernel: Callable[..., None], n: int, *arguments: object, at: Callable[[int], None] = lambda done: None
) -> None:
    """Run a kernel over n samples on all processors; which thread does what does not change the result."""
    edges = np.linspace(0, n, SLICES + 1).astype(int).tolist()
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        slices = threads.map(lambda k: kernel(edges[k], edges[k + 1], *arguments), range(SLICES))
        for done, _ in enumerate(slices, start=1):
            at(done)


def _samples(scene: Scene, charts: Charts, texels: Texels) -> _Samples:
    """Return where light is gathered."""
    patches, p = scene.patches, texels.patch
    s, t = texels.s[:, None], texels.t[:, None]
    place = patches.origin[p] + s * patches.along[p] + t * patches.across[p]
    ends = patches.normals[p]
    normal = ends[:, 0] + s * (ends[:, 1] - ends[:, 0]) + t * (ends[:, 2] - ends[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    # Neighbouring pieces of a smooth surface share their corners: one sample there, or it would show facets.
    bent = np.abs(np.diff(patches.normals, axis=1)).max(axis=(1, 2)) > 1e-9
    key = np.arange(len(p), dtype=np.int64) + (1 << 40)
    chosen = bent[p]
    numbers = np.rint(np.column_stack([place[chosen] * 1000, normal[chosen] * 32])).astype(np.int64)
    key[chosen] = (numbers * [73856093, 19349663, 83492791, 2654435, 805459861, 3674653]).sum(axis=1) % (
        1 << 40
    )
    _, kept, of_texel = np.unique(key, return_index=True, return_inverse=True)
    counts = np.stack([charts.columns, charts.rows])[:, p[kept]]
    spread = np.stack([patches.along[p[kept]], patches.across[p[kept]]], axis=1) / counts.T[..., None]
    return _Samples(of_texel.ravel(), place[kept], normal[kept], p[kept], scene.holed()[p[kept]], spread)


def _lamps(scene: Scene, facing: Floats) -> tuple[NDArray[np.generic], ...]:
    """Return the luminous patches as the kernels take them."""
    patches = scene.patches
    k = np.flatnonzero(patches.emission.any(axis=1))
    return (
        patches.origin[k], patches.along[k], patches.across[k], facing[k], patches.triangle[k], k,
        patches.emission[k],
    )  # fmt: skip


def _sun(scene: Scene, tree: RayTree, samples: _Samples) -> Floats:
    """Return the direct light of the sun on the samples, (n, 3)."""
    light = np.zeros((len(samples.place), 1))
    if scene.sun is None:
        return np.zeros((1, 3))
    _shared(bake_lights.from_sun, len(light),
        tree, scene.sun.direction(), samples.spread, samples.place, samples.normal, samples.patch,
        samples.both, light,
    )  # fmt: skip
    return np.asarray(light * scene.sun.luminance())


def _smoothed(patches: Patches, charts: Charts, texels: Texels, light: Floats, near: Floats) -> Floats:
    """Return the light of texels, (t, 3), blurred within each chart; `near` as `gather` gives it, (t, 2)."""
    lengths = np.stack([np.linalg.norm(edge, axis=1) for edge in (patches.along, patches.across)], axis=1)
    step = lengths / np.maximum(np.stack([charts.columns, charts.rows], axis=1) - 1, 1)
    out = np.empty_like(light)
    good = near[:, 1] < BURIED_SHARE
    reach = MIXED * near[:, 0]
    layout = charts.columns, charts.rows, texels.start, step, patches.triangle
    _shared(bake_kernels.smooth, len(patches), *layout, reach, good, light, out)
    return out


def _finished(scene: Scene, charts: Charts, texels: Texels, light: Floats) -> NDArray[np.float32]:
    """Return the light with that of lamps' own, and the unseen halves of triangles continued evenly."""
    own = scene.patches.emission[texels.patch]
    light = np.where(own.any(axis=1, keepdims=True), own, light)
    small = np.flatnonzero(scene.patches.triangle & (charts.columns == 2) & (charts.rows == 2))
    first = texels.start[small]
    light[first + 3] = np.maximum(light[first + 1] + light[first + 2] - light[first], 0)
    return light.astype(np.float32)


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
    # Where a smooth surface bends, its pieces have their light at the edge that they share.
    flat = np.abs(patches.normals[:, 1:] - patches.normals[:, :1]).max(axis=2) < 1e-9
    lengths = (np.linalg.norm(edge, axis=1) for edge in (patches.along, patches.across))
    margins = [np.where(flat[:, k], np.minimum(MARGIN / n, 0.1), 0)[patch] for k, n in enumerate(lengths)]
    s = _shares(column, charts.columns[patch], margins[0])
    t = _shares(row, charts.rows[patch], margins[1])
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


def _shares(index: NDArray[np.int64], count: NDArray[np.int64], margin: Floats) -> Floats:
    """Return places along an edge, from just inside one end to just inside the other; the middle if alone."""
    even = index / np.maximum(count - 1, 1)
    return np.where(count == 1, 0.5, margin + (1 - 2 * margin) * even)
