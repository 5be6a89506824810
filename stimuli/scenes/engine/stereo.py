"""Draws a scene for the views of a headset, frame by frame, from what was given to the graphics card once.

All of the scene is drawn, whatever hides it: to find out would mean to wait for a picture of the depth, and
to write anew what is drawn, for each eye of each frame. An eye's picture is drawn at once, not in tiles, with
several samples of each pixel by the graphics card.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from evenlight.stimuli.scenes.engine.antialiasing import EYES, Antialiasing
from evenlight.stimuli.scenes.engine.camera import View
from evenlight.stimuli.scenes.engine.renderer import GraphicsScene, SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Quality, Scene
from evenlight.stimuli.scenes.engine.vertices import BLENDED, HOLED, SOLID, kinds_of

if TYPE_CHECKING:
    import moderngl


class WholeScene(GraphicsScene):
    """A scene of which everything is drawn: what is solid first, what others show through last."""

    def __init__(
        self, context: moderngl.Context, scene: Scene, quality: Quality | None, samples: int
    ) -> None:
        super().__init__(context, scene, quality, samples)
        kinds = kinds_of(scene)
        self._all = [np.flatnonzero(kinds == kind) for kind in (SOLID, HOLED, BLENDED)]
        self._middles = self._faces.corners[self._all[BLENDED]].mean(axis=1)
        self._write(*self._all)

    def choose(self, camera: View, size: tuple[int, int], antialiasing: Antialiasing) -> None:
        """Leave everything to be drawn, what others show through from the farthest to the nearest."""
        self._sample_as(antialiasing)
        if len(self._middles):
            far = np.linalg.norm(self._middles - camera.position, axis=1)
            self._write(*self._all[:BLENDED], self._all[BLENDED][np.argsort(-far)])


class StereoRenderer:
    """Draws one scene into a picture for each view, of some widths and heights [pixels].

    Nothing is read back for a frame; where surfaces show others through, what is drawn is sorted anew for
    each view, and uploaded.

    Attributes
    ----------
    eyes : list of SceneRenderer
        Of each view, with its picture, left and right first; all draw from the same upload of the scene.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        sizes: Sequence[tuple[int, int]],
        quality: Quality | None = Quality.FINE,
    ) -> None:
        samples = EYES.possible(context.max_samples).samples
        whole = WholeScene(context, scene, quality, samples)
        self.eyes = [SceneRenderer(context, whole, size, antialiasing=EYES) for size in sizes]

    def render(self, views: Sequence[View]) -> None:
        """Draw the linear RGB luminance that is seen in each view [cd/m^2]."""
        for eye, view in zip(self.eyes, views, strict=True):
            eye.render(view)

    def encode(self) -> None:
        """Draw the codes of all pictures, 0 to 1023, into `codes` of each."""
        for eye in self.eyes:
            eye.encode()
