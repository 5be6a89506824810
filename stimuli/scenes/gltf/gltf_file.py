"""A glTF 2.0 file with the buffers and images beside it; what cannot be read is refused."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.input_sizes import MOST_BYTES, MOST_PIXELS, require_size

if TYPE_CHECKING:
    from PIL.Image import Image

SUFFIXES = (".glb", ".gltf")
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942  # glTF 2.0 specification, 4.4
BRIGHTEST = 60_000.0  # [cd/m^2] light is stored in 16 bits
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up
TABLES = ("buffers", "images", "accessors")  # lists of them
# Extensions that a file may require: those of materials are read, or listed as not shown.
READ = (
    "KHR_materials_",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "EXT_texture_webp",
)


@dataclass(frozen=True, eq=False)
class GltfFile:
    """What a file holds."""

    path: Path
    header: dict[str, Any]
    buffers: tuple[bytes, ...]  # its buffers, those of other files included

    def source(self, texture: int) -> int | None:
        """Return which image a texture shows, WebP before others; None if its kind is not read."""
        entry = self.header["textures"][texture]
        webp = entry.get("extensions", {}).get("EXT_texture_webp", {})
        number = webp.get("source", entry.get("source"))
        return None if number is None else int(number)

    def image(self, texture: int) -> Image | None:
        """Return the image of a texture, RGBA; None if it is of a kind that is not read.

        Raises
        ------
        InputError
            If it is not there, or cannot be read.
        """
        from PIL import Image

        number = self.source(texture)
        if number is None:
            return None
        entry = self.header["images"][number]
        if "bufferView" in entry:
            view = self.header["bufferViews"][entry["bufferView"]]
            first = view.get("byteOffset", 0)
            data = self.buffers[view["buffer"]][first : first + view["byteLength"]]
        else:
            data = _bytes_at(self.path, entry["uri"], "image")
        try:
            Image.MAX_IMAGE_PIXELS = None  # we have a limit of our own
            image = Image.open(BytesIO(data))
            require_size(image.width * image.height, MOST_PIXELS, self.path, "pixels in a texture")
            return image.convert("RGBA")
        except InputError:
            raise
        except (OSError, SyntaxError, ValueError) as error:
            where = f"image {entry.get('uri', entry.get('name', texture))!s:.60}"
            raise InputError(
                f"{self.path}: {where} cannot be read ({error}); give a PNG, JPEG or WebP"
            ) from None


def read_gltf(path: Path) -> GltfFile:
    """Return the content of a .glb or .gltf file.

    Raises
    ------
    InputError
        If it is no glTF 2.0 file, a file beside it is missing, or it needs what is not read.
    """
    with in_one_line(path):
        header, own = _header_of(path)
        buffers = _buffers(path, header, own)
    return GltfFile(path, header, buffers)


def _buffers(path: Path, header: dict[str, Any], own: bytes) -> tuple[bytes, ...]:
    """Return the buffers of a file that can be read."""
    version = str(header["asset"].get("version"))
    if not version.startswith("2."):
        raise InputError(f"{path}: need glTF of version 2, got version {version}")
    needed = [str(name) for name in header.get("extensionsRequired", ()) if not str(name).startswith(READ)]
    if needed:
        raise InputError(f"{path}: it needs {', '.join(needed)}, which is not read; export it uncompressed")
    if any("sparse" in accessor for accessor in header.get("accessors", ())):
        raise InputError(f"{path}: its sparse accessors are not read; export it without shape keys")
    return tuple(
        _bytes_at(path, entry["uri"], "buffer") if "uri" in entry else own
        for entry in header.get("buffers", ())
    )


def sha256_of_gltf(path: Path) -> str:
    """Return the SHA-256 of a file and of all files that it names.

    Raises
    ------
    InputError
        If one is missing, or it is no glTF file.
    """
    with in_one_line(path):
        header, _ = _header_of(path)
        digest = hashlib.sha256(_content(path))
        for kind in ("buffers", "images"):
            for entry in header.get(kind, ()):
                if "uri" in entry:
                    digest.update(hashlib.sha256(_bytes_at(path, entry["uri"], kind[:-1])).digest())
    return digest.hexdigest()


@contextmanager
def in_one_line(path: Path) -> Iterator[None]:
    """Refuse a file in one line wherever its content, which may be anything, breaks what reads it."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        words = f"{type(error).__name__}: {error}".splitlines()[0]
        raise InputError(f"{path}: its content cannot be read ({words:.100}); export it again") from None


def _header_of(path: Path) -> tuple[dict[str, Any], bytes]:
    try:
        data, own = _content(path), b""
        if data[:4] == MAGIC:
            chunks = _chunks(data)
            data, own = chunks.get(JSON_CHUNK, b""), chunks.get(BINARY_CHUNK, b"")
        header = json.loads(data)
        if not (isinstance(header, dict) and isinstance(header.get("asset"), dict)):
            raise TypeError("it has no asset")
        entries = [header["asset"], *(entry for key in TABLES for entry in header.get(key, ()))]
        if not all(isinstance(entry, dict) and isinstance(entry.get("uri", ""), str) for entry in entries):
            raise TypeError("it holds something other than tables")
    except InputError:
        raise
    except (json.JSONDecodeError, UnicodeDecodeError):
        raise InputError(f"{path}: not glTF; need a .glb or .gltf file as a modeller exports it") from None
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: not a whole glTF file ({error!s:.80}); export it again") from None
    return header, own


def _content(path: Path) -> bytes:
    with open_input(path, "glTF, or what it names", MOST_BYTES) as stream:
        return stream.read()


def _chunks(data: bytes) -> dict[int, bytes]:
    at, chunks = 12, dict[int, bytes]()
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > len(data):
            raise ValueError(f"it ends after {len(data)} bytes, within a chunk")
        chunks[kind] = data[at + 8 : at + 8 + length]
        at += 8 + length
    return chunks


def _bytes_at(path: Path, uri: str, kind: str) -> bytes:
    """Return what a URI of a glTF file stands for: data in itself, or a file beside it."""
    try:
        if uri.startswith("data:"):
            return base64.b64decode(uri.split("base64,", 1)[1], validate=True)
        named = Path(unquote(uri))
        if named.anchor or ".." in named.parts:
            raise ValueError("outside of its folder")  # a file of a stranger reads nothing else of this user
        if not (path.parent / named).exists():
            raise ValueError("missing")
        return _content(path.parent / named)
    except InputError:
        raise
    except (IndexError, binascii.Error):
        raise InputError(f"{path}: the data of a {kind} are not in base64; export it again") from None
    except (OSError, ValueError):
        raise InputError(
            f"{path}: its {kind} {unquote(uri)[:80]!r} is not beside it; copy it there"
        ) from None
