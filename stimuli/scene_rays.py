"""What one sees in some directions from a point of a scene: how far away it is, and which surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.scene import Floats, Patches, Vector

NOTHING = -1  # in place of a patch: the sky


def seen_along(patches: Patches, position: Vector, directions: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return what rays from a point meet first.

    Parameters
    ----------
    patches : Patches
        The surfaces; their back sides are met too.
    position : (float, float, float)
        Where the rays start [m].
    directions : array, (m, 3)
        Their unit vectors.

    Returns
    -------
    distance : array, (m,)
        To what is met [m]; infinite for nothing.
    patch : array of int, (m,)
        Which patch that is; `NOTHING` for none.
    """
    distances, met = np.full(len(directions), np.inf), np.full(len(directions), NOTHING)
    to_eye = np.asarray(position) - patches.origin
    q = np.cross(to_eye, patches.along)
    for k, direction in enumerate(np.asarray(directions, dtype=float)):
        # Moller & Trumbore (1997), for parallelograms and their halves.
        p = np.cross(direction, patches.across)
        determinant = np.einsum("ij,ij->i", patches.along, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = np.einsum("ij,ij->i", to_eye, p) / determinant
            t = q @ direction / determinant
            distance = np.einsum("ij,ij->i", patches.across, q) / determinant
            inside = (s >= 0) & (t >= 0) & np.where(patches.triangle, s + t <= 1, (s <= 1) & (t <= 1))
            distance = np.where(inside & (distance > 0), distance, np.inf)
        nearest = int(np.argmin(distance))
        if distance[nearest] < np.inf:
            distances[k], met[k] = distance[nearest], nearest
    return distances, met
