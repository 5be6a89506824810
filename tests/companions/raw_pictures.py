"""R, G, B of pictures as FFmpeg lays them out in raw files, in NumPy by the formulas of ITU-T H.273."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WEIGHTS = {  # ITU-T H.273, table 4: K_R, K_B
    "bt709": (0.2126, 0.0722), "smpte170m": (0.299, 0.114), "bt470bg": (0.299, 0.114),
    "smpte240m": (0.212, 0.087), "fcc": (0.30, 0.11), "bt2020nc": (0.2627, 0.0593),
}  # fmt: skip
# Pixels a sample, down and across.
SHARES = {"420": (2, 2), "422": (1, 2), "411": (1, 4), "410": (4, 4), "440": (2, 1)}
BITS = {"rgb444le": (4, 4, 4), "rgb555le": (5, 5, 5), "rgb565le": (5, 6, 5), "rgb8": (3, 3, 2)}
PACKED = {
    "rgb24": "rgb", "bgr24": "bgr", "rgba": "rgba", "bgra": "bgra", "argb": "argb", "bgr0": "bgr.",
    "0rgb": ".rgb", "rgb48": "rgb", "rgba64": "rgba",
}  # fmt: skip
PLANAR = re.compile(r"(yuv|yuva|yuvj|gbr|gbra|gray|ya)(4\d\d)?p?(\d+)?")


@dataclass(frozen=True)
class Layout:
    """How the pictures of a film lie in a raw file, and what their values mean.

    Attributes
    ----------
    kind : str
        FFmpeg's name of the pixel format.
    width, height : int
        Of the picture [pixels].
    matrix, limits : str
        FFmpeg's names of the colour matrix and of the range.
    left : bool
        Whether a sample of chroma that stands for pixels side by side lies on the first, else amid them.
    woven : bool
        Whether the rows are those of two fields in turn, each with chroma of its own.
    """

    kind: str
    width: int
    height: int
    matrix: str
    limits: str
    left: bool
    woven: bool

    def rgb(self, content: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return R, G, B in [0, 1], (height, width, 3), of a picture's bytes, over black."""
        shape, name = (self.height, self.width), self.kind
        if name == "pal8":
            indices, palette = np.split(content, [self.width * self.height])
            return _over_black(palette.reshape(256, 4)[indices.reshape(shape)][..., [2, 1, 0, 3]] / 255)
        if name in ("monob", "monow"):
            bits = np.unpackbits(content.reshape(self.height, -1), axis=1)[:, : self.width]
            return _gray(bits if name == "monob" else 1.0 - bits)
        if name in BITS:
            tops = 2 ** np.array(BITS[name]) - 1
            codes = content.view("<u2" if name.endswith("le") else "u1").reshape(shape)[..., None]
            return (codes >> np.array([sum(BITS[name][k:]) for k in (1, 2, 3)]) & tops) / tops
        if name in ("yuyv422", "nv12"):
            return self._of_bytes_in_turn(content)
        order = {"le": "<u2", "be": ">u2"}.get(name[-2:])
        name = name if order is None else name[:-2]
        values = content if order is None else content.view(order)
        if name in PACKED:
            places = [PACKED[name].index(channel) for channel in "rgba" if channel in PACKED[name]]
            return _over_black(values.reshape(*shape, -1)[..., places] / np.iinfo(values.dtype).max)
        return self._of_planes(values, *PLANAR.fullmatch(name).groups())

    def _of_bytes_in_turn(self, content):
        luma_first = content[: self.width * self.height]
        if self.kind == "nv12":
            parts = [luma_first, *content[luma_first.size :].reshape(-1, 2).T]
            return self._of_planes(np.concatenate(parts), "yuv", "420", None)
        parts = [content[0::2], content[1::4], content[3::4]]
        return self._of_planes(np.concatenate(parts), "yuv", "422", None)

    def _of_planes(self, values, family, chroma, depth):
        shape, bits = (self.height, self.width), int(depth or 8)
        top, is_luma = 2**bits - 1, family.startswith("yuv")
        if self.limits == "pc" or not (is_luma or self.limits == "tv"):
            black, span, chroma_span = 0, top, top
        else:
            black, span, chroma_span = (code * 2 ** (bits - 8) for code in (16, 219, 224))
        if family == "ya":
            luma, alpha = values.reshape(*shape, 2).transpose(2, 0, 1)
            return _gray(np.clip((luma - black) / span, 0, 1) * alpha / top)
        shares = SHARES.get(chroma, (1, 1))
        small = tuple(-(-side // share) for side, share in zip(shape, shares, strict=True))
        sizes = {"gray": [shape], "gbr": [shape] * 3}.get(family.removesuffix("a"), [shape, small, small])
        sizes = sizes + [shape] * family.endswith("a")
        ends = np.cumsum([height * width for height, width in sizes])
        planes = [
            p.reshape(size).astype(float) for p, size in zip(np.split(values, ends), sizes, strict=False)
        ]
        if family == "gray":
            return _gray(np.clip((planes[0] - black) / span, 0, 1))
        if is_luma:
            luma = (planes[0] - black) / span
            blue, red = (
                (self._whole(plane, shares) - 2 ** (bits - 1)) / chroma_span for plane in planes[1:3]
            )
            rgb = np.clip(from_luma(luma, blue, red, *self.weights()), 0, 1)
        else:
            rgb = np.stack([planes[2], planes[0], planes[1]], axis=-1) / top
        return rgb * planes[3][..., None] / top if family.endswith("a") else rgb

    def weights(self) -> tuple[float, float]:
        """Return K_R and K_B; without a tag, players take BT.709 for high definition, BT.601 else."""
        large = self.width >= 1280 or self.height > 576
        return WEIGHTS.get(self.matrix, WEIGHTS["bt709" if large else "smpte170m"])

    def _whole(self, plane, shares):
        """Interpolate chroma linearly; of fields, it lies 1/4 below their rows or above (H.262, 6.1.1.8)."""
        down, across = shares
        amid = 0.0 if self.left else 0.5
        plane = _at(plane, (np.arange(self.width) + amid) / across - amid, axis=1)
        if not (self.woven and down == 2):
            return _at(plane, (np.arange(self.height) + 0.5) / down - 0.5, axis=0)
        whole = np.empty((self.height, self.width))
        for field, below in ((0, 0.25), (1, 0.75)):
            rows = np.arange(len(whole[field::2]))
            whole[field::2] = _at(plane[field::2], (rows - below) / down, axis=0)
        return whole


def from_luma(luma, blue, red, weight_red, weight_blue):
    """Return R, G, B of Y' in [0, 1] and of Cb and Cr in [-1/2, 1/2] (H.273, 8.3)."""
    red = luma + 2 * (1 - weight_red) * red
    blue = luma + 2 * (1 - weight_blue) * blue
    green = (luma - weight_red * red - weight_blue * blue) / (1 - weight_red - weight_blue)
    return np.stack([red, green, blue], axis=-1)


def _at(plane, places, axis):
    places = np.clip(places, 0, plane.shape[axis] - 1)
    low = np.floor(places).astype(int)
    share = np.expand_dims(places - low, 1 - axis)
    high = np.minimum(low + 1, plane.shape[axis] - 1)
    return np.take(plane, low, axis) * (1 - share) + np.take(plane, high, axis) * share


def _gray(values):
    return np.repeat(np.asarray(values, dtype=float)[..., None], 3, axis=-1)


def _over_black(channels):
    return channels[..., :3] * channels[..., 3:] if channels.shape[-1] == 4 else channels
