"""A glTF file of a floor and a lamp over it, written by hand, to be changed and damaged."""

import json
import struct
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

FLOOR, LAMP = 0, 1
SQUARE = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], dtype="<f4")  # faces up (y)
FACES = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
CORNERS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype="<f4")  # v down


@dataclass
class Glb:
    """A header and its buffer."""

    header: dict[str, Any]
    data: bytearray = field(default_factory=bytearray)

    def content(self) -> bytes:
        """The file."""
        text = json.dumps(self.header).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        chunks = (
            struct.pack("<II", len(text), 0x4E4F534A)
            + text
            + struct.pack("<II", len(data), 0x004E4942)
            + data
        )
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks

    def add_view(self, data: bytes) -> int:
        """Append bytes, and return the number of their view."""
        self.header["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        )
        self.data += data + b"\0" * (-len(data) % 4)
        self.header["buffers"][0]["byteLength"] = len(self.data)
        return len(self.header["bufferViews"]) - 1

    def add_array(self, values: np.ndarray, kind: str, component: int) -> int:
        """Append an array, and return the number of its accessor."""
        entry = {"bufferView": self.add_view(values.tobytes()), "componentType": component}
        self.header["accessors"].append(entry | {"count": len(values), "type": kind})
        return len(self.header["accessors"]) - 1

    def add_texture(self, material: int, image: bytes) -> None:
        """Give a material a texture."""
        self.header["images"] = [{"bufferView": self.add_view(image), "mimeType": "image/png"}]
        self.header["textures"] = [{"source": 0}]
        self.header["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}

    def set_floats(self, mesh: int, value: float) -> None:
        """Change the first coordinate of a mesh."""
        struct.pack_into("<f", self.data, self._start(self._primitive(mesh)["attributes"]["POSITION"]), value)

    def set_indices(self, mesh: int, value: int) -> None:
        """Change the first point of a mesh's triangles."""
        struct.pack_into("<H", self.data, self._start(self._primitive(mesh)["indices"]), value)

    def scale(self, factor: float) -> None:
        """Make all larger."""
        self.header["nodes"].append({"children": [0, 1], "scale": [factor] * 3})
        self.header["scenes"][0]["nodes"] = [2]

    def _primitive(self, mesh: int) -> dict[str, Any]:
        primitive: dict[str, Any] = self.header["meshes"][mesh]["primitives"][0]
        return primitive

    def _start(self, accessor: int) -> int:
        view = self.header["accessors"][accessor]["bufferView"]
        return int(self.header["bufferViews"][view]["byteOffset"])


def room() -> Glb:
    """A floor of 4 m by 4 m, and a lamp of 1 m by 1 m that looks down from 2.5 m."""
    lamp = {"KHR_materials_emissive_strength": {"emissiveStrength": 200.0}}
    glb = Glb(
        {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
            "nodes": [
                {"mesh": 0, "scale": [2, 1, 2]},
                {"mesh": 1, "scale": [0.5, 1, 0.5], "translation": [0, 2.5, 0], "rotation": [1, 0, 0, 0]},
            ],
            "materials": [
                {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.125, 1]}},
                {"emissiveFactor": [1, 0.5, 0.25], "extensions": lamp},
            ],
            "meshes": [], "accessors": [], "bufferViews": [], "buffers": [{}],
        }
    )  # fmt: skip
    for material in (FLOOR, LAMP):
        attributes = {
            "POSITION": glb.add_array(SQUARE, "VEC3", 5126),
            "TEXCOORD_0": glb.add_array(CORNERS, "VEC2", 5126),
        }
        primitive = {
            "attributes": attributes,
            "indices": glb.add_array(FACES, "SCALAR", 5123),
            "material": material,
        }
        glb.header["meshes"].append({"primitives": [primitive]})
    return glb


def image_bytes(pixels: np.ndarray) -> bytes:
    """A picture as a PNG file."""
    out = BytesIO()
    Image.fromarray(pixels).save(out, format="PNG")
    return out.getvalue()
