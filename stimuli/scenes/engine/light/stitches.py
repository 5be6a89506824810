"""Light that goes on evenly where flat patches lie side by side in one plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evenlight.stimuli.scenes.engine.light.bake_kernels import UNLIKE
from evenlight.stimuli.scenes.engine.scene import Floats, Patches

if TYPE_CHECKING:
    from evenlight.stimuli.scenes.engine.light.bake import Charts, Texels

NEAR = 0.002  # [m] neighbours touch, and planes are the same


def stitched(patches: Patches, charts: Charts, texels: Texels, light: Floats) -> Floats:
    """Return the light of texels, (t, 3), at edges the mean of both sides, unless a shadow ends there."""
    counts, at = np.column_stack([charts.columns, charts.rows]), np.column_stack([texels.column, texels.row])
    normals, edges = patches.normals, np.stack([patches.along, patches.across], axis=2)
    lit = (np.abs(np.diff(normals, axis=1)).max(axis=(1, 2)) < 1e-9) & (counts.prod(axis=1) > 1)
    lit &= ~patches.triangle & ~patches.emission.any(axis=1)
    planes = np.column_stack([normals[:, 0], (normals[:, 0] * patches.origin).sum(axis=1)])
    plane = np.unique(np.rint(planes / NEAR), axis=0, return_inverse=True)[1].ravel()
    last = counts[texels.patch] - 1
    edge = np.flatnonzero(lit[texels.patch] & ((last > 0) & ((at == 0) | (at == last))).any(axis=1))
    own, share = texels.patch[edge], np.where(last > 0, at / np.maximum(last, 1), 0.5)[edge]
    place = patches.origin[own] + (edges[own] @ share[..., None])[..., 0]
    found = [(np.zeros(0, dtype=np.int64), np.zeros((0, 4), dtype=np.int64), np.zeros((0, 4)))]
    for b in np.flatnonzero(lit).tolist():
        among = np.flatnonzero((plane[own] == plane[b]) & (own != b))
        on = (place[among] - patches.origin[b]) @ np.linalg.pinv(edges[b]).T
        near = (np.abs(on - 0.5) < 0.5 + NEAR / np.linalg.norm(edges[b], axis=0)).all(axis=1)
        on = on[near].clip(0, 1) * (counts[b] - 1)
        corners = np.floor(on).astype(int)[:, None] + list(np.ndindex(2, 2))
        shares = np.maximum(1 - np.abs(corners - on[:, None]), 0).prod(axis=2)
        cells = np.minimum(corners, counts[b] - 1) @ [1, counts[b, 0]]
        found.append((edge[among][near], texels.start[b] + cells, shares))
    i, cells, shares = (np.concatenate(one) for one in zip(*found, strict=True))
    for _ in range(3):  # once is not enough, as texels of neighbours are not at the same places
        other = (light[cells] * shares[..., None]).sum(axis=1)
        alike = np.abs(np.log((other.sum(axis=1) + 1e-3) / (light[i].sum(axis=1) + 1e-3))) < UNLIKE
        np.add.at(sums := light.copy(), i[alike], other[alike])
        light = sums / (1 + np.bincount(i[alike], minlength=len(light)))[:, None]
    return light
