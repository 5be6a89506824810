"""Draws a Landolt ring into what both eyes of a headset see, on the surface that it lies on."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.stimuli.rings.landolt import PaintedRing, Ring
from evenlight.stimuli.rings.ring_scene import RingScene
from evenlight.stimuli.scenes.engine.camera import View
from evenlight.stimuli.scenes.engine.scene import Floats, Patches, Scene, Vector, direction_of
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer

if TYPE_CHECKING:
    import moderngl

NOTHING = -1  # in place of a patch: the sky


class StereoRings:
    """A scene whose pictures, one for each eye, have a ring in them.

    Parameters
    ----------
    context : moderngl.Context
        That of the renderer.
    pictures : StereoRenderer
        Draws the scene.
    scene : Scene
        The scene.
    display : Display
        The headset's.

    Attributes
    ----------
    eyes : (RingScene, RingScene)
        Left and right: their `texture` holds what the eye sees.
    """

    def __init__(
        self, context: moderngl.Context, pictures: StereoRenderer, scene: Scene, display: Display
    ) -> None:
        self._scene = scene
        left, right = (RingScene(context, eye, display) for eye in pictures.eyes)
        self.eyes = left, right

    def paint(self, ring: Ring, position: Vector) -> PaintedRing:
        """Return a ring with the light that it has at a place, and its distance, seen from a position [m].

        Raises
        ------
        InputError
            If the display does not reach its luminance.
        """
        direction = direction_of(ring.azimuth, ring.altitude)
        distance = float(seen_along(self._scene.patches, position, direction[None])[0][0])
        return replace(self.eyes[0].paint(ring, position), seen_from=position, distance=distance)

    def draw(self, views: tuple[View, View], painted_ring: PaintedRing | None = None) -> None:
        """Draw what both eyes see, and the ring in it if one is given, into `texture` of each."""
        for eye, view in zip(self.eyes, views, strict=True):
            eye.draw(view, painted_ring)


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
