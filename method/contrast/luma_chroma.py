"""Luminance straight from the Y, Cb, Cr of a file, without an image of R, G, B between them.

The R, G, B whose light is taken are those of FFmpeg's exact conversion to 8 bits, to the last bit: chroma is
interpolated linearly, in 16ths of a code, and the matrix is of whole numbers
(docs/decisions/light-of-planes.md). So planes give the same luminance as pixels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from evenlight.data_schema.frame import LumaChroma
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS
from evenlight.method.contrast.one_pass import compiled

_SHIFT = 17  # bits after the point: 13 of the matrix, 4 of chroma
_MIDDLE = 16 * 128  # chroma of gray
_R, _G, _B = (np.float32(w) for w in LUMINANCE_WEIGHTS)


def matrix_of(picture: LumaChroma) -> tuple[int, ...]:
    """Return the matrix to R, G, B in whole numbers, as FFmpeg rounds them (ITU-T H.273, section 8.3).

    It is the code of black, and the gains of Y, of Cr in R, of Cb in B, and of Cr and Cb in G.

    >>> gray = np.full((2, 2), 128, np.uint8)
    >>> matrix_of(LumaChroma((gray, gray, gray), (0.299, 0.114), True, (False, False), gray.copy))
    (0, 131072, 11485, 14516, -5850, -2819)
    """
    weight_red, weight_blue = picture.luma_weights
    red, blue = 2 * (1 - weight_red), 2 * (1 - weight_blue)
    green = 1 - weight_red - weight_blue
    gains = []
    for share in (red, blue, -red * weight_red / green, -blue * weight_blue / green):
        limited = round(abs(share) * 2**16 * 255 / 224)
        gain = limited * 224 // 255 if picture.full_range else limited
        gains.append(((gain if share > 0 else -gain) + 4) >> 3)
    luma = 2**16 if picture.full_range else 2**16 * 255 // 219
    return 0 if picture.full_range else 16, 16 * ((luma + 4) >> 3), *gains


def plane_in_memory(plane: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int, tuple[int, int]]:
    """Return a plane's memory in one row, how far its rows lie apart, and its size.

    So all planes are of one type for the compiler, whatever padding their rows have.

    >>> plane_in_memory(np.arange(6, dtype=np.uint8).reshape(2, 3)[:, :2])
    (array([0, 1, 2, 3, 4], dtype=uint8), 3, (2, 2))
    """
    if plane.strides[1] != 1 or plane.strides[0] < plane.shape[1]:
        plane = np.ascontiguousarray(plane)
    (rows, columns), stride = plane.shape, plane.strides[0]
    memory = as_strided(plane, ((rows - 1) * stride + columns,), (1,), writeable=False)
    return memory, stride, (rows, columns)


@compiled
def convert_planes(planes: Any, amid: Any, matrix: Any, light: Any, luminance: Any) -> Any:
    """Fill `luminance` with I of Y, Cb and Cr; return the sums of the linear R, G and B channels.

    `planes` are as of `plane_in_memory`; `amid` as of the picture; `light` is the linear value of each code
    of R, G or B, luminance of black, and from there to the peak.
    """
    (luma, stride, _), blue, red = planes
    linear, black, span = light
    code_of_black, gain, cr_in_red, cb_in_blue, cr_in_green, cb_in_green = matrix
    height, width = luminance.shape
    down = np.empty(blue[2][1] + 2, np.int32)
    cb, cr = np.empty(width + 1, np.int32), np.empty(width + 1, np.int32)
    codes = np.empty((3, width), np.uint8)
    red_sum = green_sum = blue_sum = 0.0
    for i in range(height):
        interpolate_chroma(blue, i, height, amid, down, cb)
        interpolate_chroma(red, i, height, amid, down, cr)
        row, out = luma[i * stride : i * stride + width], luminance[i]
        for j in range(width):
            y = np.int32((np.int32(row[j]) - np.int32(code_of_black)) * np.int32(gain))
            y += np.int32(1 << (_SHIFT - 1))
            r = np.int32(y + cr[j] * np.int32(cr_in_red)) >> np.int32(_SHIFT)
            g = np.int32(y + cr[j] * np.int32(cr_in_green) + cb[j] * np.int32(cb_in_green))
            g = g >> np.int32(_SHIFT)
            b = np.int32(y + cb[j] * np.int32(cb_in_blue)) >> np.int32(_SHIFT)
            codes[0, j] = np.uint8(min(max(r, np.int32(0)), np.int32(255)))
            codes[1, j] = np.uint8(min(max(g, np.int32(0)), np.int32(255)))
            codes[2, j] = np.uint8(min(max(b, np.int32(0)), np.int32(255)))
        for j in range(width):
            r_light, g_light, b_light = linear[codes[0, j]], linear[codes[1, j]], linear[codes[2, j]]
            red_sum += r_light
            green_sum += g_light
            blue_sum += b_light
            out[j] = black + span * (_R * r_light + _G * g_light + _B * b_light)
    return red_sum, green_sum, blue_sum


@compiled
def interpolate_chroma(plane: Any, i: Any, height: Any, amid: Any, down: Any, row: Any) -> None:
    """Fill `row` with row i of a plane of chroma at every pixel, in 16ths of a code from gray.

    `down` is scratch, two cells wider than the plane; `row` is one cell wider than the picture. A sample
    stands for one or two pixels each way; beyond the picture's edge the last one goes on.
    """
    samples, stride, (rows, columns) = plane
    own, other, near, far = np.int32(4), np.int32(0), i, i
    if rows < height:
        near = i // 2
        far = min(max(near + (1 if i % 2 else -1), 0), rows - 1)
        other = np.int32(1) if amid[0] else np.int32(2 * (i % 2))
        own = np.int32(4) - other
    here = samples[near * stride : near * stride + columns]
    there = samples[far * stride : far * stride + columns]
    for k in range(columns):
        down[k + 1] = own * np.int32(here[k]) + other * np.int32(there[k])
    down[0], down[columns + 1] = down[1], down[columns]
    width = row.size - 1
    if columns == width:
        for j in range(width):
            row[j] = np.int32(4) * down[j + 1] - np.int32(_MIDDLE)
    elif amid[1]:
        for k in range(columns):
            row[2 * k] = down[k] + np.int32(3) * down[k + 1] - np.int32(_MIDDLE)
            row[2 * k + 1] = np.int32(3) * down[k + 1] + down[k + 2] - np.int32(_MIDDLE)
    else:
        for k in range(columns):
            row[2 * k] = np.int32(4) * down[k + 1] - np.int32(_MIDDLE)
            row[2 * k + 1] = np.int32(2) * (down[k + 1] + down[k + 2]) - np.int32(_MIDDLE)
