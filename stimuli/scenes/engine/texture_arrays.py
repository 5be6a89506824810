"""The textures of a scene on the graphics card: those of one size and kind are layers of one array."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.scenes.engine.material_textures import MaterialTextures
from evenlight.stimuli.scenes.engine.scene import Floats, Material, Sampling, Scene
from evenlight.stimuli.scenes.engine.surface_detail import detail_tiles

if TYPE_CHECKING:
    import moderngl

UNITS = {"albedo": 0, "cutoffs": 5, "relief": 8}  # for textures


def words_of(material: Material) -> tuple[str, ...]:
    """Return what a shader needs to have defined for a material: what is matt costs no reflections."""
    shiny, uneven = material.gloss > 0 or material.metal > 0, material.relief is not None
    return ("SHINY",) * shiny + ("RELIEF",) * uneven


class TextureArrays:
    """The textures of a scene's materials; the card filters images with an anisotropy."""

    def __init__(
        self, context: moderngl.Context, scene: Scene, textures: MaterialTextures, anisotropy: float
    ) -> None:
        self.layers = np.zeros((len(scene.materials), 1))  # of each material, in its array
        self._arrays: list[tuple[moderngl.Texture | moderngl.TextureArray, ...]] = []  # as in `UNITS`
        array_of = np.zeros(len(scene.materials), dtype=np.int64)
        self.words: list[tuple[str, ...]] = []  # what the shader of each array has defined
        kinds: dict[tuple[tuple[str, ...], Sampling | None, Any, Any], list[int]] = {}
        for k, (material, codes) in enumerate(zip(scene.materials, textures.codes, strict=True)):
            own = material.sampling and replace(material.sampling, size=codes.shape[1::-1], image="")
            relief = () if material.relief is None else material.relief.shape
            kinds.setdefault((words_of(material), own, codes.shape, relief), []).append(k)
        matt_first = sorted(kinds.items(), key=lambda one: len(one[0][0]))  # what it hides costs less
        for number, ((words, sampling, *_), members) in enumerate(matt_first):
            array_of[members], self.layers[members, 0] = number, np.arange(len(members))
            layers = [[textures.codes[k] for k in members]]
            layers.append([map_ for k in members if (map_ := scene.materials[k].relief) is not None])
            albedo, *uneven = (_array(context, own, sampling, anisotropy) for own in layers if own)
            cut = textures.cutoffs[members].astype("f4")
            cutoffs = context.texture(cut.shape[::-1], 1, cut.tobytes(), dtype="f4")
            cutoffs.repeat_x = False
            self._arrays.append((albedo, cutoffs, *uneven))
            self.words.append(words)
        self._array_of = array_of[scene.patches.material]

    def use(self, number: int) -> None:
        """Let shaders see an array."""
        for texture, unit in zip(self._arrays[number], UNITS.values(), strict=False):  # some have no relief
            texture.use(unit)

    def runs(self, patches: NDArray[np.int64], parts: int = 0) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """Yield patches in runs of one array, with its number: as they come, or in parts each sorted by it.

        The first parts are the smaller ones: near surfaces, which hide much.
        """
        number = self._array_of[patches]
        if parts and len(self._arrays) > 1:
            part = (parts * np.sqrt(np.arange(len(patches)) / max(len(patches), 1))).astype(int)
            order = np.lexsort((number, part))
            patches, number = patches[order], number[order]
        for run in np.split(patches, np.flatnonzero(np.diff(number)) + 1):
            if len(run):
                yield int(self._array_of[run[0]]), run


def _array(
    context: moderngl.Context, layers: list[NDArray[np.uint8]], sampling: Sampling | None, anisotropy: float
) -> moderngl.TextureArray:
    height, width, channels = layers[0].shape
    array = context.texture_array((width, height, len(layers)), channels)
    for layer, codes in enumerate(layers):
        array.write(codes.tobytes(), viewport=(0, 0, layer, width, height, 1))
    array.build_mipmaps()
    near = graphics.NEAREST if sampling and sampling.nearest else graphics.LINEAR
    one = sampling and anisotropy == 1  # finer than needed: one copy is enough, at 4/5 of the time
    array.filter = graphics.LINEAR_MIPMAP_NEAREST if one else graphics.LINEAR_MIPMAP_LINEAR, near
    if sampling:
        array.anisotropy = anisotropy
        array.repeat_x, array.repeat_y = (not clamped for clamped in sampling.clamped)
    return array


def detail_texture(context: moderngl.Context, scene: Scene) -> tuple[moderngl.TextureArray, Floats]:
    """Return the tiles of fine structure, and the layer and strength of each material, (m, 2)."""
    tiles, chosen = detail_tiles(scene.materials)
    content = (tiles / 255).astype("f2").tobytes()
    detail = context.texture_array((*tiles.shape[:0:-1], len(tiles)), 1, content, dtype="f2")
    detail.build_mipmaps()
    # One copy is enough for what is so faint: a second one costs 5 % of a frame on a CPU.
    detail.filter = graphics.LINEAR_MIPMAP_NEAREST, graphics.LINEAR
    return detail, chosen
