"""Numbers that look random and points that are spread evenly, for the bake's rays."""

from __future__ import annotations

import numba
import numpy as np

OFFSET = np.float32(0.004)  # [m] rays start this far in front of a surface


@numba.njit(cache=True, error_model="numpy")
def hashed(value, salt):
    """Return a number in [0, 1) that looks random."""
    # Products of 32-bit numbers have 64 bits here: they are cut back each time.
    x = np.uint32(
        np.uint32(value) * np.uint32(747796405) + np.uint32(salt) * np.uint32(2891336453) + np.uint32(1)
    )
    x = np.uint32(((x >> ((x >> np.uint32(28)) + np.uint32(4))) ^ x) * np.uint32(277803737))
    x = np.uint32((x >> np.uint32(22)) ^ x)
    return np.float64(x >> np.uint32(8)) / 16777216.0


@numba.njit(cache=True, error_model="numpy")
def radical_inverse(k):
    """Return the binary digits of k behind the point, reversed."""
    x = np.uint32(k)
    x = (x << np.uint32(16)) | (x >> np.uint32(16))
    x = ((x & np.uint32(0x55555555)) << np.uint32(1)) | ((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1))
    x = ((x & np.uint32(0x33333333)) << np.uint32(2)) | ((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2))
    x = ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4)) | ((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4))
    x = ((x & np.uint32(0x00FF00FF)) << np.uint32(8)) | ((x & np.uint32(0xFF00FF00)) >> np.uint32(8))
    return np.float64(x) / 4294967296.0


@numba.njit(cache=True, error_model="numpy")
def upright_to(nx, ny, nz):
    """Return a unit vector at right angles to another (Duff et al. 2017)."""
    sign = 1.0 if nz >= 0 else -1.0
    a = -1.0 / (sign + nz)
    return 1.0 + sign * nx * nx * a, sign * nx * ny * a, -sign * nx
