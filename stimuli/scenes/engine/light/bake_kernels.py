"""The loops of the bake over reflected light, for a range of samples each, so that threads share the work.

Each sample's sums are made in a fixed order by one thread, so that the light is the same each time.
Light is counted as the luminance of white paper at a sample, facing along its normal.
"""

from __future__ import annotations

import math

import numpy as np

from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.scenes.engine.light.ray_tree import DEPTH, nearest

NOTHING, BACK = -1, -2  # a ray that reached the sky; one that met the back of a surface
UNDERGROUND = -0.2  # z of directions in which an open ray must have started below the ground
BURIED = 0.03  # [m] where most rays end this near, something lies on the surface
UNLIKE = 0.5  # natural log of light: beyond it, neighbours are on two sides of an edge, not noisy
OFFSET = np.float32(0.004)  # [m] rays start this far in front of a surface


@compiled_loop(error_model="numpy")
def hashed(value, salt):
    """Return a number in [0, 1) that looks random."""
    # Products of 32-bit numbers have 64 bits here: they are cut back each time.
    x = np.uint32(
        np.uint32(value) * np.uint32(747796405) + np.uint32(salt) * np.uint32(2891336453) + np.uint32(1)
    )
    x = np.uint32(((x >> ((x >> np.uint32(28)) + np.uint32(4))) ^ x) * np.uint32(277803737))
    x = np.uint32((x >> np.uint32(22)) ^ x)
    return np.float64(x >> np.uint32(8)) / 16777216.0


@compiled_loop(error_model="numpy")
def radical_inverse(k):
    """Return the binary digits of k behind the point, reversed."""
    x = np.uint32(k)
    x = (x << np.uint32(16)) | (x >> np.uint32(16))
    x = ((x & np.uint32(0x55555555)) << np.uint32(1)) | ((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1))
    x = ((x & np.uint32(0x33333333)) << np.uint32(2)) | ((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2))
    x = ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4)) | ((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4))
    x = ((x & np.uint32(0x00FF00FF)) << np.uint32(8)) | ((x & np.uint32(0xFF00FF00)) >> np.uint32(8))
    return np.float64(x) / 4294967296.0


@compiled_loop(error_model="numpy")
def upright_to(nx, ny, nz):
    """Return a unit vector at right angles to another (Duff et al. 2017)."""
    sign = 1.0 if nz >= 0 else -1.0
    a = -1.0 / (sign + nz)
    return 1.0 + sign * nx * nx * a, sign * nx * ny * a, -sign * nx


@compiled_loop(nogil=True, error_model="numpy")
def gather(begin, end, tree, charts, windows, place, normal, own, both, sky, hits, open_, near):
    """Trace rays from every sample, spread as the cosine law weighs them.

    Parameters
    ----------
    tree : RayTree
        The scene.
    charts : tuple
        Columns, rows and first texel of each patch, its unit normal, and the sample of each texel.
    windows : array, (w, 4, 3)
        Openings whose sky light is summed by `through_windows` instead.
    place, normal : arrays, (n, 3)
        Of the samples.
    own : array, (n,)
        Patch of each sample.
    both : array of bool, (n,)
        Whether it sees to both sides.
    sky : tuple
        Luminance at the zenith and at the horizon, (3,) each, and the exponent between them.
    hits : array of int32, (n, rays)
        Filled with the sample next to where each ray ended, `NOTHING` or `BACK`.
    open_ : array, (n, 3)
        Filled with the light of the sky.
    near : array, (n, 2)
        Filled with the harmonic mean of the rays' lengths [m], and the share that shows a sample is buried.
    """
    rays, stack = hits.shape[1], np.empty((2, DEPTH))
    for i in range(begin, end):
        u0, v0 = hashed(i, 1), hashed(i, 2)
        inverse, buried = 0.0, 0
        tx, ty, tz = upright_to(normal[i, 0], normal[i, 1], normal[i, 2])
        bx = normal[i, 1] * tz - normal[i, 2] * ty
        by = normal[i, 2] * tx - normal[i, 0] * tz
        bz = normal[i, 0] * ty - normal[i, 1] * tx
        for j in range(rays):
            u, v = (j + 0.5) / rays + u0, radical_inverse(j) + v0
            u -= math.floor(u)
            v -= math.floor(v)
            r, angle, up = math.sqrt(u), 2 * math.pi * v, math.sqrt(1 - u)
            if both[i] and j % 2 == 1:
                up = -up
            a, b = r * math.cos(angle), r * math.sin(angle)
            dx = np.float32(a * tx + b * bx + up * normal[i, 0])
            dy = np.float32(a * ty + b * by + up * normal[i, 1])
            dz = np.float32(a * tz + b * bz + up * normal[i, 2])
            shift = OFFSET if up > 0 else -OFFSET
            ox = np.float32(place[i, 0] + shift * normal[i, 0])
            oy = np.float32(place[i, 1] + shift * normal[i, 1])
            oz = np.float32(place[i, 2] + shift * normal[i, 2])
            k, far, s, t = nearest(tree, ox, oy, oz, dx, dy, dz, own[i], i * rays + j, stack)
            if k < 0:
                hits[i, j] = NOTHING
                if dz < UNDERGROUND:
                    buried += 1
                elif not _through_any(windows, ox, oy, oz, dx, dy, dz):
                    share = max(np.float64(dz), 0.0) ** sky[2]
                    for c in range(3):
                        open_[i, c] += (sky[1][c] + share * (sky[0][c] - sky[1][c])) / rays
                continue
            inverse += 1 / max(np.float64(far), 0.01)
            p = tree.patch[k]
            behind = dx * charts[3][p, 0] + dy * charts[3][p, 1] + dz * charts[3][p, 2] > 0
            if behind and tree.coverage[k] >= 1:
                hits[i, j] = BACK
                buried += 1
            else:
                buried += far < BURIED
                column = int(s * (charts[0][p] - 1) + 0.5)
                row = int(t * (charts[1][p] - 1) + 0.5)
                hits[i, j] = charts[4][charts[2][p] + row * charts[0][p] + column]
        near[i, 0] = rays / max(inverse, 1e-6)
        near[i, 1] = buried / rays


@compiled_loop(error_model="numpy")
def _through_any(windows, ox, oy, oz, dx, dy, dz):
    """Return whether a ray goes through one of the windows."""
    for w in range(len(windows)):
        x, y, z = windows[w, 0]
        ax, ay, az = windows[w, 1, 0] - x, windows[w, 1, 1] - y, windows[w, 1, 2] - z
        bx, by, bz = windows[w, 3, 0] - x, windows[w, 3, 1] - y, windows[w, 3, 2] - z
        px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
        det = ax * px + ay * py + az * pz
        if det == 0:
            continue
        cx, cy, cz = ox - x, oy - y, oz - z
        s = (cx * px + cy * py + cz * pz) / det
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        t = (dx * qx + dy * qy + dz * qz) / det
        if 0 <= s <= 1 and 0 <= t <= 1 and (bx * qx + by * qy + bz * qz) / det > 0:
            return True
    return False


@compiled_loop(nogil=True, error_model="numpy")
def bounce(begin, end, hits, sent, received):
    """Set the light that each sample receives from those that its rays met.

    `sent` and `received`: (n, 3), what the samples' surfaces send out and what arrives.
    """
    rays = hits.shape[1]
    for i in range(begin, end):
        red = green = blue = 0.0
        for j in range(rays):
            k = hits[i, j]
            if k >= 0:
                red += sent[k, 0]
                green += sent[k, 1]
                blue += sent[k, 2]
        received[i, 0], received[i, 1], received[i, 2] = red / rays, green / rays, blue / rays


@compiled_loop(nogil=True, error_model="numpy")
def smooth(begin, end, columns, rows, start, step, triangle, reach, good, raw, out):
    """Blur the light of each chart where things are far, not where they are near, and fill what is buried.

    Parameters
    ----------
    columns, rows, start : arrays of int, (p,)
        The charts.
    step : array, (p, 2)
        Distance of texels along and across [m].
    triangle : array of bool, (p,)
        Charts that are left as they are.
    reach : array, (t,)
        How far the light around a texel may be mixed [m].
    good : array of bool, (t,)
        Texels that are not buried.
    raw, out : arrays, (t, 3)
        Light before and after.
    """
    for p in range(begin, end):
        first, wide, high = start[p], columns[p], rows[p]
        some = good[first : first + wide * high].any()
        for row in range(high):
            for column in range(wide):
                i = first + row * wide + column
                if triangle[p] or not some or wide * high == 1:
                    out[i] = raw[i]
                    continue
                span, sigma = (3, reach[i]) if good[i] else (max(wide, high), 1.0)
                total = 0.0
                red = green = blue = 0.0
                for r in range(max(row - span, 0), min(row + span + 1, high)):
                    for c in range(max(column - span, 0), min(column + span + 1, wide)):
                        k = first + r * wide + c
                        if not good[k]:
                            continue
                        across, down = (c - column) * step[p, 0], (r - row) * step[p, 1]
                        squared = across * across + down * down
                        if good[i]:
                            step_up = math.log((raw[k].sum() + 1e-3) / (raw[i].sum() + 1e-3)) / UNLIKE
                            weight = math.exp(-squared / (2 * sigma * sigma + 1e-6) - step_up * step_up)
                        else:
                            weight = 1 / (squared + 1e-4) ** 4
                        total += weight
                        red += weight * raw[k, 0]
                        green += weight * raw[k, 1]
                        blue += weight * raw[k, 2]
                out[i, 0], out[i, 1], out[i, 2] = red / total, green / total, blue / total
