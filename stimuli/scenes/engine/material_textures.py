"""The textures of a scene's materials, made once per scene."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine.array_cache import cached_array, scenes_sha256, store_array
from evenlight.stimuli.scenes.engine.scene import Floats, Material, Scene, stream

SIZE = 512  # [texels] of each texture
SMALL = 64  # [texels] images are not made smaller for a quick look
LEVELS = 255  # of the 8-bit textures
CUTOFF = 0.45  # coverage of a texel below which it counts as a hole
SCENES_PACKAGE = "evenlight.stimuli.scenes."


@dataclass(frozen=True, eq=False)
class MaterialTextures:
    """Textures of 8 bits whose full scale is the highest albedo of each material."""

    # one for each material, (height, width, 4): share of the scale, and coverage; row 0 at the bottom
    codes: Sequence[NDArray[np.uint8]]
    scale: Floats  # (m, 3): albedo of code 255
    albedo: Floats  # (m, 3): mean albedo of what is there
    coverage: Floats  # (m,): mean coverage, 1 without holes
    # (m, levels): coverage below which a texel of each smaller copy counts as a hole, so that as much is
    # left of it
    cutoffs: Floats


def material_textures(scene: Scene, size: int = SIZE) -> MaterialTextures:
    """Return the textures of all materials, (size, size) texels each, and images smaller by size / `SIZE`.

    Those of a scene whose materials are all defined within `stimuli.scenes` go into the user's cache.
    """
    name = _name(scene, size)
    made = cached_array(name) if name else None
    if made is None or made.shape != (len(scene.materials), _bytes(size)) or made.dtype != np.uint8:
        own = [_texture(scene, material, _size_of(material, size)) for material in scene.materials]
        if name:
            made = np.stack([_packed(*one) for one in own])
            store_array(name, made, instead_of=f"textures-{scene.name}-{size}-*")
    else:
        own = [_unpacked(one, size) for one in made]
    codes, scale, albedo, coverage = zip(*own, strict=True)
    levels = max(max(one.shape[:2]) for one in codes).bit_length()
    cutoffs = np.full((len(codes), levels), CUTOFF)
    for k, share in enumerate(coverage):
        if share < 1:
            found = _cutoffs(codes[k][..., 3])
            cutoffs[k] = np.append(found, np.full(levels, found[-1]))[:levels]
    return MaterialTextures(codes, np.array(scale), np.array(albedo), np.array(coverage), cutoffs)


def _size_of(material: Material, size: int) -> tuple[int, int]:
    if material.sampling is None:
        return size, size
    width, height = (max(side * size // SIZE, min(side, SMALL)) for side in material.sampling.size)
    return width, height


def _cutoffs(coverage: NDArray[np.uint8]) -> Floats:
    """Return below which coverage each smaller copy of a texture has its holes, (levels,).

    Averaged, thin leaves would vanish and dense ones close up: the same share of texels is kept instead.
    """
    copy = coverage / LEVELS
    kept = float((copy >= CUTOFF).mean())
    cutoffs = [CUTOFF]
    while min(copy.shape) > 1:
        copy = copy[: len(copy) // 2 * 2, : copy.shape[1] // 2 * 2]
        copy = (copy[::2, ::2] + copy[1::2, ::2] + copy[::2, 1::2] + copy[1::2, 1::2]) / 4
        cutoffs.append(float(np.quantile(copy, 1 - kept)))
    return np.clip(cutoffs, 0.02, 0.98)


def _bytes(size: int) -> int:
    return 4 * size * size + 7 * 8


def _packed(codes: NDArray[np.uint8], *figures: Floats) -> NDArray[np.uint8]:
    numbers = np.concatenate([np.ravel(figure) for figure in figures])
    return np.concatenate([codes.ravel(), numbers.view(np.uint8)])


def _unpacked(packed: NDArray[np.uint8], size: int) -> tuple[NDArray[np.uint8], Floats, Floats, Floats]:
    codes, figures = np.split(packed, [4 * size * size])
    numbers = figures.view(np.float64)
    return codes.reshape(size, size, 4), numbers[:3], numbers[3:6], numbers[6]


def _name(scene: Scene, size: int) -> str:
    """Return a name that changes with all that textures are made from; empty if they are made elsewhere."""
    if not all(material.texture.__module__.startswith(SCENES_PACKAGE) for material in scene.materials):
        return ""
    digest = hashlib.sha256(repr((size, scene.seed, np.__version__, scenes_sha256())).encode())
    for material in scene.materials:
        digest.update(material.name.encode() + b"\0")
    return f"textures-{scene.name}-{size}-{digest.hexdigest()}"


def _texture(
    scene: Scene, material: Material, size: tuple[int, int]
) -> tuple[NDArray[np.uint8], Floats, Floats, NDArray[np.float64]]:
    width, height = size
    asked = size if material.sampling else width
    picture = np.asarray(material.texture(stream(scene.seed, material.name), asked), dtype=np.float32)
    depth = 4 if material.cutout or material.blended else 3
    if picture.shape != (height, width, depth):
        raise ValueError(
            f"texture of {material.name}: need shape ({height}, {width}, {depth}), got {picture.shape}"
        )
    if not (np.isfinite(picture).all() and picture.min() >= 0 and picture.max() <= 1):
        raise ValueError(f"texture of {material.name}: need albedo in [0, 1]")
    there = picture[..., 3] if depth == 4 else np.ones((height, width), dtype=np.float32)
    colour = picture[..., :3]
    counted = np.broadcast_to(np.float32(there.any()), there.shape) if material.blended else there
    weight = counted / max(there.sum(), 1e-9)
    mean = (colour * weight[..., None]).sum(axis=(0, 1), dtype=np.float64)
    if material.cutout:  # blurred into the holes, where small copies of the texture would show it
        colour = np.where(there[..., None] > 0.5, colour, mean.astype(np.float32))
    scale = np.maximum(colour.max(axis=(0, 1)), 1e-3).astype(np.float64)
    # Rounded at random, so that dark textures keep their mean in the smaller copies too.
    rounding = stream(scene.seed, f"rounding of {material.name}").random((height, width, 1), dtype=np.float32)
    codes = np.empty((height, width, 4), dtype=np.uint8)
    codes[..., :3] = np.minimum(colour / scale.astype(np.float32) * LEVELS + rounding, LEVELS)
    codes[..., 3] = np.rint(there * LEVELS)
    return codes[::-1], scale, mean, np.asarray(there.mean(dtype=np.float64))
