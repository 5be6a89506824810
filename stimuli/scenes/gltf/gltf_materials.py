"""The materials of a glTF file as those of the renderer: albedo and opacity, and light laid over them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_sizes import MOST_SCENE_PIXELS, require_size
from evenlight.stimuli.scenes.engine.scene import Floats, Material, Sampling
from evenlight.stimuli.scenes.gltf.gltf_file import BRIGHTEST, GltfFile

if TYPE_CHECKING:
    from PIL.Image import Image

SHARES = np.arange(256, dtype=np.float32) / 255  # of the values of an image, and in linear light (sRGB)
LIGHT = np.where(SHARES <= 0.04045, SHARES / 12.92, ((SHARES + 0.055) / 1.055) ** 2.4)
MOST_TEXTURES = 256
LAID_OVER = -1.0  # opacity of light that is added to what is there
THERE = 0.5  # opacity from which a masked texel is there, if the file does not say
CLAMPED, MIRRORED, NEAREST = 33071, 33648, 9728  # glTF 2.0 specification, 5.26
SPECULAR = "KHR_materials_pbrSpecularGlossiness"
GLOW_SIZE = 64  # [texels] of the copy of an emissive texture from which patches' means are taken
UNSEEN = Material("unseen", lambda rng, size: np.zeros((1, 1, 4), dtype=np.float32), 1.0,
                  blended=True, sampling=Sampling((1, 1)))  # fmt: skip


class Laid(NamedTuple):
    """How a texture lies on a mesh: its set of coordinates, and the matrix that maps them, (2, 3)."""

    coordinates: str
    matrix: Floats


@dataclass(frozen=True, eq=False)
class Surface:
    """What some triangles are made of."""

    number: int  # of its material among those of the file; all white where there is no texture
    tint: Floats  # (3,): factor of the albedo
    emission: Floats  # (3,): luminance, linear RGB [cd/m^2]
    both_sides: bool  # whether it is seen from behind, too
    laid: Laid
    glow: Surface | None = None  # light of a texture, laid over it
    light: NDArray[np.float32] | None = None  # (GLOW_SIZE, GLOW_SIZE, 3): a small copy of that, row 0 on top


class Surfaces:
    """The materials of a file, each texture once."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._materials: dict[tuple[Any, ...], Material] = {}
        self._pixels = 0
        self._surfaces: dict[int | None, Surface | None] = {}

    def materials(self) -> tuple[Material, ...]:
        """Return those that were asked for."""
        return tuple(self._materials.values())

    def unseen(self, emission: Floats) -> Surface:
        """Return what shines with some luminance, is not seen, and hides nothing."""
        self._materials.setdefault(("unseen",), UNSEEN)
        number = list(self._materials).index(("unseen",))
        return Surface(number, np.ones(3), emission, False, Laid("", np.zeros((2, 3))))

    def of(self, number: int | None) -> Surface | None:
        """Return the surface of a material; None if it is so transparent that it is not there."""
        if number not in self._surfaces:
            self._surfaces[number] = self._read(number)
        return self._surfaces[number]

    def _read(self, number: int | None) -> Surface | None:
        entry = {} if number is None else self._file.header["materials"][number]
        (colour, texture), (gloss, metal) = paint_of(entry), self._shine_of(entry)
        *tint, opacity = colour.clip(0, 1)
        mode, both = entry.get("alphaMode", "OPAQUE"), bool(entry.get("doubleSided", False))
        emission, glow = light_of(entry), None
        shining = entry.get("emissiveTexture") if emission.any() else None
        if shining is not None and self._file.image(shining["index"]) is not None:
            material, laid = self._made(shining, None, (0.0, 0.0), None, LAID_OVER)
            light = self.materials()[material].texture(np.random.default_rng(0), (GLOW_SIZE, GLOW_SIZE))
            glow = Surface(material, np.ones(3), emission, both, laid, light=light[..., :3])
            emission = np.zeros(3)
        through = numbers([extension(entry, "KHR_materials_transmission").get("transmissionFactor", 0)], 1)[0]
        blended = (mode == "BLEND" or through > 0) and not emission.any()
        opacity = (1.0 if mode == "OPAQUE" else opacity) * (1 - min(through, 1.0))
        cutoff = float(entry.get("alphaCutoff", THERE)) if mode == "MASK" and not blended else None
        relief = relief_of(entry)
        if emission.any():
            texture, relief, cutoff, tint, gloss, metal = None, None, None, [1, 1, 1], 0.0, 0.0
        image = None if texture is None else self._file.image(texture["index"])
        if (blended and not (opacity or through)) or (image is None and opacity < (cutoff or 0)):
            return None
        cutoff = None if cutoff is None else cutoff / max(opacity, 1e-9)
        needed = 1.0 if blended else cutoff
        if image is None or needed is None or np.asarray(image.getchannel(3)).min() / 255 >= needed:
            cutoff, blended = None, blended and opacity < 1
        material, laid = self._made(texture, relief, (gloss, metal), cutoff, opacity if blended else None)
        return Surface(material, np.array(tint), emission, both and cutoff is None, laid, glow)

    def _shine_of(self, entry: dict[str, Any]) -> tuple[float, float]:
        """Return the gloss of a material, and how metallic it is; of textures, the means."""
        paint, shiny = entry.get("pbrMetallicRoughness", {}), extension(entry, SPECULAR)
        if "KHR_materials_unlit" in entry.get("extensions", {}) or "specularGlossinessTexture" in shiny:
            return 0.0, 0.0
        rough, metal = float(paint.get("roughnessFactor", 1)), float(paint.get("metallicFactor", 1))
        if SPECULAR in entry.get("extensions", {}):
            rough, metal = 1 - float(shiny.get("glossinessFactor", 1)), 0.0
        elif "metallicRoughnessTexture" in paint:
            image = self._file.image(paint["metallicRoughnessTexture"]["index"])
            means = (
                [1, 1] if image is None else [np.asarray(image.getchannel(k)).mean() / 255 for k in (1, 2)]
            )
            rough, metal = rough * means[0], metal * means[1]
        gloss, metal = np.clip([1 - rough, metal], 0, 1).round(1).tolist()  # few kinds, and few textures
        return gloss, metal

    def _made(
        self, texture: dict[str, Any] | None, relief: dict[str, Any] | None, shine: tuple[float, float],
        cutoff: float | None, opacity: float | None,
    ) -> tuple[int, Laid]:  # fmt: skip
        """Return the number of a material, made if it is new, and how its texture lies."""
        from PIL import Image as Images

        image, source, name = Images.new("RGBA", (1, 1), "white"), None, ""
        found, map_ = (None if one is None else self._file.image(one["index"]) for one in (texture, relief))
        scale = float(relief.get("scale", 1)) if relief else 1.0
        numbers([abs(scale)], 1)  # refused if it is none
        bumps = self._file.source(relief["index"]) if relief else None
        if texture is not None and found is not None:
            image, source = found, self._file.source(texture["index"])
            name = named(self._file.header["images"][source], f"image {source}")
        lying = (texture if found is not None else relief if map_ is not None else None) or {}
        number = self._file.header["textures"][lying["index"]].get("sampler") if lying else None
        sampler = {} if number is None else self._file.header["samplers"][number]
        across, down = sampler.get("wrapS"), sampler.get("wrapT")
        mirrored, clamped = ((across == kind, down == kind) for kind in (MIRRORED, CLAMPED))
        nearest = sampler.get("magFilter") == NEAREST
        key = source, bumps, scale, cutoff, opacity, shine, mirrored, clamped, nearest
        if key not in self._materials:
            if len(self._materials) >= MOST_TEXTURES:
                raise InputError(
                    f"{self._file.path}: it has more than {MOST_TEXTURES} textures; put some into one image"
                )
            self._pixels += image.width * image.height + (0 if map_ is None else map_.width * map_.height)
            require_size(self._pixels, MOST_SCENE_PIXELS, self._file.path, "pixels in its textures")
            size = image.width * (1 + mirrored[0]), image.height * (1 + mirrored[1])
            # A partial function, which the cache of textures leaves alone: its name does not tell the image.
            made = partial(_resampled, image, cutoff, opacity, mirrored)
            kind = *shine, cutoff is not None, opacity is not None, Sampling(size, clamped, nearest, name)
            uneven = None if map_ is None else _relief(map_, scale, mirrored)
            self._materials[key] = Material(f"image {key}", made, 1.0, *kind, uneven)
        return list(self._materials).index(key), _laid(lying, mirrored)


def paint_of(entry: dict[str, Any]) -> tuple[Floats, dict[str, Any] | None]:
    """Return the base colour of a material, (4,), and its texture if it has one.

    Of specular-glossiness it is the diffuse colour, less what is reflected as the extension says.
    """
    paint, shiny = entry.get("pbrMetallicRoughness", {}), extension(entry, SPECULAR)
    if SPECULAR in entry.get("extensions", {}):
        colour = numbers(shiny.get("diffuseFactor", (1, 1, 1, 1)), 4)
        colour[:3] *= 1 - min(numbers(shiny.get("specularFactor", (1, 1, 1)), 3).max(), 1.0)
        return colour, shiny.get("diffuseTexture")
    return numbers(paint.get("baseColorFactor", (1, 1, 1, 1)), 4), paint.get("baseColorTexture")


def relief_of(entry: dict[str, Any]) -> dict[str, Any] | None:
    """Return the normal map of a material, if it lies as the texture of its colour does."""
    relief, colour = entry.get("normalTexture"), paint_of(entry)[1]
    if relief is not None and colour is not None:
        own, other = (_laid(one, (False, False)) for one in (relief, colour))
        if own.coordinates != other.coordinates or not np.allclose(own.matrix, other.matrix):
            return None
    return None if relief is None else dict(relief)


def named(entry: dict[str, Any], otherwise: str) -> str:
    """Return the name of something in a file, fit to be shown."""
    name = str(entry.get("name") or entry.get("uri") or otherwise)
    return "".join(letter for letter in name if letter.isprintable())[:60]


def light_of(entry: dict[str, Any]) -> Floats:
    """Return the light of a material before its texture, linear RGB, (3,) [cd/m^2], at most BRIGHTEST."""
    strength = extension(entry, "KHR_materials_emissive_strength").get("emissiveStrength", 1)
    given = numbers(entry.get("emissiveFactor", (0, 0, 0)), 3) * numbers([strength], 1)
    return np.asarray(given.clip(max=BRIGHTEST))


def extension(entry: dict[str, Any], name: str) -> dict[str, Any]:
    """Return what an extension says of something, nothing if it is not there."""
    return dict(entry.get("extensions", {}).get(name, {}))


def numbers(values: Any, count: int) -> Floats:
    """Return so many numbers of 0 or above."""
    found = np.asarray(values, dtype=float)
    if found.shape != (count,) or not (np.isfinite(found) & (found >= 0)).all():
        raise ValueError(f"need {count} numbers of 0 or above for a colour, got {values}")
    return found


def _laid(texture: dict[str, Any], mirrored: tuple[bool, ...]) -> Laid:
    """Return how a texture lies; one that is mirrored is stored with its mirror image beside it."""
    moved = extension(texture, "KHR_texture_transform")
    turn = float(moved.get("rotation", 0))
    across, up = moved.get("scale", (1, 1))
    # Counter-clockwise, with v down.
    matrix = np.array([
        [math.cos(turn) * across, math.sin(turn) * up, moved.get("offset", (0, 0))[0]],
        [-math.sin(turn) * across, math.cos(turn) * up, moved.get("offset", (0, 0))[1]],
    ], dtype=float)  # fmt: skip
    if not np.isfinite(matrix).all():
        raise ValueError("a texture transform that is not of numbers")
    number = moved.get("texCoord", texture.get("texCoord", 0))
    return Laid(f"_TEXCOORD_{number}", matrix / (1 + np.array(mirrored))[:, None])


def _resampled(
    image: Image,
    cutoff: float | None,
    opacity: float | None,
    mirrored: tuple[bool, bool],
    rng: np.random.Generator,
    size: tuple[int, int],
) -> NDArray[np.float32]:
    """Return an image as a texture of some width and height, in linear light.

    With a cutoff the last channel says what is there; with an opacity it is that, and albedo its share.
    """
    from PIL import Image as Images

    channels = [_linear(image, k) for k in range(3)]
    if cutoff is not None or opacity is not None:
        alpha = np.asarray(image.getchannel(3))
        kept = SHARES * np.float32(opacity or 0) if cutoff is None else (cutoff <= SHARES).astype("f4")
        channels.append(kept[alpha].clip(0))
        if opacity is not None and opacity != LAID_OVER:
            channels[:3] = [channel * channels[3] for channel in channels[:3]]
    channels = [_with_mirror_image(one, mirrored) for one in channels]
    if size != channels[0].shape[::-1]:
        box = Images.Resampling.BOX
        channels = [np.asarray(Images.fromarray(one).resize(size, box)) for one in channels]
    return np.asarray(np.clip(np.stack(channels, axis=2), 0, 1), dtype=np.float32)


def _relief(image: Image, scale: float, mirrored: tuple[bool, bool]) -> NDArray[np.uint8]:
    """Return how normals lean (`Material.relief`), after a scale, and of unit length."""
    normals = np.asarray(image.convert("RGB"), dtype=np.float32) / 127.5 - 1
    normals[..., :2] *= scale
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-6)
    codes = np.rint((normals[..., :2] + 1) * 127.5).astype(np.uint8)
    return np.ascontiguousarray(_with_mirror_image(codes, mirrored)[::-1])


def _with_mirror_image(image: NDArray[Any], mirrored: tuple[bool, bool]) -> NDArray[Any]:
    for axis in (0, 1):
        if mirrored[1 - axis]:
            image = np.concatenate([image, np.flip(image, axis)], axis)
    return image


def _linear(image: Image, channel: int) -> NDArray[np.float32]:
    return np.asarray(LIGHT[np.asarray(image.getchannel(channel))])
