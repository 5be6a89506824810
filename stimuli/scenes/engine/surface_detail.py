"""Fine structure of surfaces that are looked at from near: small tiles, multiplied onto the albedo.

A material's texture has texels of some millimetres. What is finer (fibres, threads, pores) comes from a tile
of `TILE` that all materials of a kind share. Its mean is 1, so neither the baked light nor the mean albedo
changes, and it fades into its mean with distance as its mipmaps do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine.scene import SEED, Floats, Material, Scene, stream

SIZE = 512  # [texels] of a tile
TILE = 0.25  # [m] that a tile covers: a texel is 0.5 mm
STRETCH = 1.5  # a texture that is stretched by more over its surface does not carry the detail
OUTLIERS = 3.5  # standard deviations, beyond which a relief is cut off
Relief = Callable[[np.random.Generator, int], NDArray[np.float32]]


@dataclass(frozen=True)
class Detail:
    """Fine structure of a kind of surface."""

    # returns how light each place is, (size, size), in any unit; opposite edges meet. u runs to the right
    relief: Relief
    strength: float  # standard deviation of the albedo over its mean, where a texel is seen as such

    def __post_init__(self) -> None:
        if not 0 <= self.strength <= 1 / OUTLIERS:
            raise ValueError(f"need a strength of detail from 0 to {1 / OUTLIERS:.2f}, got {self.strength:g}")


def detail_tiles(materials: Sequence[Material]) -> tuple[NDArray[np.uint8], Floats]:
    """Return the tiles that some materials have, and which of them each has and how strongly.

    Returns
    -------
    tiles : array of uint8, (k, SIZE, SIZE)
        The reliefs, row 0 at the bottom: 0 and 255 are `OUTLIERS` standard deviations off the mean. The first
        is even, for materials without detail.
    chosen : array, (m, 2)
        The layer, and the share of the albedo that code 255 adds.
    """
    details = [detail_of(material) for material in materials]
    reliefs = list(dict.fromkeys(detail.relief for detail in details if detail))
    tiles = [np.full((SIZE, SIZE), 127, dtype=np.uint8), *map(_codes, reliefs)]
    chosen = [(1 + reliefs.index(d.relief), OUTLIERS * d.strength) if d else (0, 0.0) for d in details]
    return np.stack(tiles), np.array(chosen, dtype=np.float64)


def detail_of(material: Material) -> Detail | None:
    """Return the detail of a material: that which its texture says it has, as its attribute `detail`."""
    found = getattr(material.texture, "detail", None)
    return found if isinstance(found, Detail) else None


@cache
def _codes(relief: Relief) -> NDArray[np.uint8]:
    rng = stream(SEED, relief.__name__)
    values = relief(rng, SIZE).astype(np.float64)
    values -= values.mean()
    values = np.clip(values / (values.std() * OUTLIERS), -1, 1)
    values -= values.mean()  # of what was cut off
    codes = np.floor(127.5 * (1 + values) + rng.random(values.shape))
    return np.asarray(np.clip(codes, 0, 255)[::-1], dtype=np.uint8)


def detail_coordinates(scene: Scene) -> Floats:
    """Return where in the tiles the corners of each patch are: at the origin and the ends of its edges.

    They go with the texture where that has about its material's scale, so that neighbouring patches continue
    each other's detail; else, as on a picture that fills its surface, they are lengths on the surface itself.

    Returns
    -------
    coordinates : array, (n, 3, 2)
        In repeats.
    """
    patches = scene.patches
    wide = np.linalg.norm(patches.along, axis=1)
    flat = np.zeros((len(patches), 3, 2))
    flat[:, 1, 0] = wide
    flat[:, 2, 0] = (patches.along * patches.across).sum(axis=1) / wide
    flat[:, 2, 1] = np.linalg.norm(np.cross(patches.along, patches.across), axis=1) / wide
    tile = np.array([material.tile for material in scene.materials])[patches.material]
    laid = patches.uvs * tile[:, None, None]
    stretch = np.linalg.svd(np.linalg.solve(flat[:, 1:], laid[:, 1:] - laid[:, :1]), compute_uv=False)
    true_to_scale = np.all((stretch > 1 / STRETCH) & (stretch < STRETCH), axis=1, keepdims=True)
    repeats = np.where(true_to_scale[..., None], laid, flat) / TILE
    return np.asarray(repeats - np.floor(repeats.mean(axis=1, keepdims=True)))
