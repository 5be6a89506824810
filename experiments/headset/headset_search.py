"""A ring search in a headset: the head turns and moves freely, the stick turns the room by steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from evenlight.experiments.sessions.search_stage import (
    ANGLE_DECIMALS,
    LookedAt,
    SearchPlayer,
    SearchTracker,
)
from evenlight.experiments.stage import SearchView
from evenlight.stimuli.eyes.eye_views import eye_views, head_direction
from evenlight.stimuli.image_renderer import EyeImages, Image
from evenlight.stimuli.rings.landolt import LEVELS_16
from evenlight.stimuli.rings.ring_scene import StereoRings
from evenlight.stimuli.scenes.content.catalogue import scene_searched
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer

if TYPE_CHECKING:
    from evenlight.experiments.sessions.search_stage import Presses
    from evenlight.experiments.showing import Screen
    from evenlight.hardware.presentation.headset_window import HeadsetWindow
    from evenlight.stimuli.renderers import AnyFieldRenderer


class HeadsetSearchPlayer(SearchPlayer):
    """Shows searches in a headset.

    Parameters
    ----------
    showing : Screen
        What is shown on.
    fields : EyeFieldRenderer
        Draws what comes before a scene.
    presses : callable
        Returns the keys pressed since the last call, or raises `PausePressed`.
    headset : HeadsetWindow
        Whose eyes see it.
    """

    def __init__(
        self, showing: Screen, fields: AnyFieldRenderer, presses: Presses, headset: HeadsetWindow
    ) -> None:
        super().__init__(showing, fields, presses, lambda: None)
        self._headset = headset
        self._rings: dict[str, StereoRings] = {}

    def prepare(self, name: str) -> None:
        """Make a scene ready, where it is not yet: its light is computed, or read from the cache."""
        if name not in self._rings:
            context, scene = self._headset.context(), scene_searched(name)
            pictures = StereoRenderer(context, scene, self._headset.view_sizes())
            self._rings[name] = StereoRings(context, pictures, scene, self._on.display)

    def _looked_at(self, view: SearchView) -> LookedAt:
        self.prepare(view.scene)
        return SceneInHeadset(self._rings[view.scene], view, self._headset)


class SceneInHeadset:
    """A scene with a ring in it, as both eyes see it; it is drawn for each refresh, for a head never rests.

    `view` has the ring, and where the head is as the session begins.
    """

    def __init__(self, rings: StereoRings, view: SearchView, headset: HeadsetWindow) -> None:
        self._rings, self._camera, self._headset = rings, view.camera, headset
        self._painted = rings.paint(view.ring, view.camera.position)
        self.image: Image | EyeImages = EyeImages([Image(eye.texture, LEVELS_16 + 1) for eye in rings.eyes])
        self.background_luminance = self._painted.surroundings.luminance

    def draw(self, searching: SearchTracker, now: float) -> tuple[float, float]:
        """Draw what is seen, and return in which direction the head points: from the first, and up [deg].

        Steps of the stick turn the room at once: a room that glides by makes people sick. Up and down goes
        the head alone.
        """
        turned, _ = searching.direction(math.inf)
        frame = self._headset.eyes()
        self._rings.draw(
            eye_views(frame, self._camera.position, self._camera.azimuth + turned), self._painted
        )
        azimuth, altitude = head_direction(frame.head)
        return round(turned + azimuth, ANGLE_DECIMALS), round(altitude, ANGLE_DECIMALS)
