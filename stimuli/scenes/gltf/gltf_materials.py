"""What the surfaces of a glTF file are made of: one texture for each image, colours as tints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.engine.scene import Floats, Material
from evenlight.stimuli.scenes.gltf.gltf_file import GltfFile

if TYPE_CHECKING:
    from PIL.Image import Image

MOST_TEXTURES = 256
THERE = 0.5  # opacity from which a surface that would be blended counts as there


@dataclass(frozen=True, eq=False)
class Surface:
    """What some triangles are made of."""

    number: int  # of its material among those of the file; all white where there is no texture
    tint: Floats  # (3,): factor of the albedo
    emission: Floats  # (3,): luminance, linear RGB [cd/m^2]
    both_sides: bool  # whether it is seen from behind, too


class Surfaces:
    """The materials of a file, each texture once.

    Parameters
    ----------
    file : GltfFile
        Whose.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._materials: dict[tuple[Any, ...], Material] = {}

    def materials(self) -> tuple[Material, ...]:
        """Return those that were asked for."""
        return tuple(self._materials.values())

    def of(self, number: int | None) -> Surface | None:
        """Return the surface of a material; None if it is so transparent that it is not there."""
        entry = {} if number is None else self._file.header["materials"][number]
        paint = entry.get("pbrMetallicRoughness", {})
        *tint, opacity = numbers(paint.get("baseColorFactor", (1, 1, 1, 1)), 4).clip(0, 1)
        mode, texture = entry.get("alphaMode", "OPAQUE"), paint.get("baseColorTexture")
        emission, cutoff = self._emission(entry), None
        if mode != "OPAQUE":
            cutoff = float(entry.get("alphaCutoff", THERE)) if mode == "MASK" else THERE
            if texture is None and opacity < cutoff:
                return None
            cutoff /= max(opacity, 1e-9)
        if emission.any():
            texture, cutoff, tint = None, None, [1, 1, 1]
        gloss = round(1 - float(np.clip(paint.get("roughnessFactor", 1), 0, 1)), 1)
        if emission.any() or "metallicRoughnessTexture" in paint:  # which says that the factor is not all
            gloss = 0.0
        key = self._key(texture, cutoff, gloss)
        both = bool(entry.get("doubleSided", False)) and not self._materials[key].cutout
        return Surface(list(self._materials).index(key), np.array(tint), emission, both)

    def _emission(self, entry: dict[str, Any]) -> Floats:
        strength = entry.get("extensions", {}).get("KHR_materials_emissive_strength", {})
        emission = numbers(entry.get("emissiveFactor", (0, 0, 0)), 3) * numbers(
            [strength.get("emissiveStrength", 1)], 1
        )
        if emission.any() and "emissiveTexture" in entry:
            picture = _linear(self._file.image(entry["emissiveTexture"]["index"]))
            emission = emission * picture[..., :3].mean(axis=(0, 1))
        return np.asarray(emission)

    def _key(self, texture: dict[str, Any] | None, cutoff: float | None, gloss: float) -> tuple[Any, ...]:
        from PIL import Image

        source = None if texture is None else self._file.header["textures"][texture["index"]]["source"]
        key = source, cutoff, gloss
        if key not in self._materials:
            if len(self._materials) >= MOST_TEXTURES:
                raise InputError(
                    f"{self._file.path}: it has more than {MOST_TEXTURES} textures; put some into one image"
                )
            white = Image.new("RGBA", (1, 1), "white")
            image = white if texture is None else self._file.image(texture["index"])
            if cutoff is not None and np.asarray(image)[..., 3].min() / 255 >= cutoff:
                cutoff = None
            # A partial function, which the cache of textures leaves alone: its name does not tell the image.
            made = partial(_resampled, image, cutoff)
            self._materials[key] = Material(f"image {key}", made, 1.0, gloss, cutoff is not None)
        return key


def numbers(values: Any, count: int) -> Floats:
    """Return so many numbers of 0 or above."""
    found = np.asarray(values, dtype=float)
    if found.shape != (count,) or not (np.isfinite(found) & (found >= 0)).all():
        raise ValueError(f"need {count} numbers of 0 or above for a colour, got {values}")
    return found


def _resampled(
    image: Image, cutoff: float | None, rng: np.random.Generator, size: int
) -> NDArray[np.float32]:
    """Return an image as a texture of some size: albedo in linear light, and with a cutoff what is there."""
    from PIL import Image as Images

    picture = _linear(image)
    if cutoff is not None:
        picture[..., 3] = picture[..., 3] >= cutoff
    channels = (Images.fromarray(picture[..., k].copy()) for k in range(3 if cutoff is None else 4))
    sized = [np.asarray(channel.resize((size, size), Images.Resampling.BILINEAR)) for channel in channels]
    return np.asarray(np.clip(np.stack(sized, axis=2), 0, 1), dtype=np.float32)


def _linear(image: Image) -> NDArray[np.float32]:
    shares = np.asarray(image, dtype=np.float32) / 255
    light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.concatenate([light[..., :3], shares[..., 3:]], axis=2), dtype=np.float32)
