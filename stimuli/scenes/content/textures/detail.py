"""What surfaces look like from near: fibres, threads, pores, blades; and which kind has how much of it.

A relief covers 0.25 m. Its coarsest structure is about 1 cm: what is coarser would repeat visibly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from evenlight.stimuli.fractal_noise import ridged, smoothstep
from evenlight.stimuli.scenes.content.textures.tileable import Image, cells, places, tileable_noise
from evenlight.stimuli.scenes.engine.surface_detail import Detail

Paint = TypeVar("Paint", bound=Callable[..., Any])


def grains(rng: np.random.Generator, size: int) -> Image:
    """Return the grain of paint, plaster and paper: no direction, all sizes up to 8 mm."""
    return tileable_noise(rng, size, (32, 32), 5, 0.85)


def fibres(rng: np.random.Generator, size: int) -> Image:
    """Return the fibres of sawn wood along u, with short dark pores."""
    fine = tileable_noise(rng, size, (64, 3), 4, 0.85)
    pores = smoothstep(tileable_noise(rng, size, (170, 16), 1), 0.72, 0.9)
    return fine - np.float32(0.5) * pores


def threads(rng: np.random.Generator, size: int) -> Image:
    """Return a plain weave of threads 2 mm wide, some of them thicker."""
    down, across = places(size)
    over = np.sin(2 * np.pi * 64 * down) * np.sin(2 * np.pi * 64 * across)
    slub = tileable_noise(rng, size, (128, 6), 2) + tileable_noise(rng, size, (6, 128), 2)
    fluff = tileable_noise(rng, size, (64, 64), 4, 0.8)
    return np.asarray(0.35 * over + 0.5 * slub + 0.6 * fluff, dtype=np.float32)


def pores(rng: np.random.Generator, size: int) -> Image:
    """Return cast or burnt stone: sand of many sizes, and small dark holes."""
    sand = tileable_noise(rng, size, (40, 40), 5, 0.95)
    holes = smoothstep(tileable_noise(rng, size, (44, 44), 2), 0.74, 0.92)
    return sand - np.float32(0.8) * holes


def chips(rng: np.random.Generator, size: int) -> Image:
    """Return small stones, each of its own grey, with shade between them: asphalt, gravel, crumbs."""
    index, edge = cells(rng, size, 1800)
    tone = rng.random(1800, dtype=np.float32)[index]
    return tone * np.float32(0.6) + smoothstep(edge, 0.0, 0.4) + tileable_noise(rng, size, (128, 128), 3)


def tufts(rng: np.random.Generator, size: int) -> Image:
    """Return pile and blades: thin light ridges over dark gaps."""
    upright = ridged(tileable_noise(rng, size, (24, 56), 4, 0.8))
    lying = ridged(tileable_noise(rng, size, (56, 24), 4, 0.8))
    return np.asarray(np.maximum(upright, lying), dtype=np.float32)


def brushed(rng: np.random.Generator, size: int) -> Image:
    """Return fine scratches along u."""
    return tileable_noise(rng, size, (256, 4), 2)


PLASTERED = Detail(grains, 0.03)
PRINTED = Detail(grains, 0.02)
GLAZED = Detail(grains, 0.01)
SAWN = Detail(fibres, 0.09)
VARNISHED = Detail(fibres, 0.06)
PAINTED_WOOD = Detail(fibres, 0.025)
WOVEN = Detail(threads, 0.12)
CAST = Detail(pores, 0.08)
BURNT = Detail(pores, 0.11)
SPLIT = Detail(chips, 0.07)
LOOSE = Detail(chips, 0.2)
LAWN = Detail(tufts, 0.22)
LEAFY = Detail(grains, 0.06)
METALLIC = Detail(brushed, 0.015)


def detailed(detail: Detail) -> Callable[[Paint], Paint]:
    """Give a texture, or all that a function of `texture` returns, the detail of its kind."""

    def mark(paint: Paint) -> Paint:
        vars(paint)["detail"] = detail
        return paint

    return mark
