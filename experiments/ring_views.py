"""How the rings of a search are seen: each place is drawn once, without a window, the ring in the middle."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.rig import Actuator
from evenlight.experiments.ring_visibility import ring_alone, ring_visibility
from evenlight.experiments.search_observer import RingSight
from evenlight.experiments.search_schedule import PlannedSearch
from evenlight.method.luminance import emitted_luminance
from evenlight.stimuli.landolt import GAPS_IN_DIAMETER, Ring, gap_pixels
from evenlight.stimuli.ring_light import reachable_light
from evenlight.stimuli.scenes.camera import Camera
from evenlight.stimuli.scenes.scene import Vector, direction_of
from evenlight.stimuli.viewing_geometry import focal_length_of

if TYPE_CHECKING:
    import moderngl

    from evenlight.stimuli.ring_scene import RingScene

SIDE = 4  # of a picture, in diameters of its ring: beyond, nothing changes its visibility
SMALLEST_SIDE, LARGEST_SIDE = 64, 1024  # [pixels]


@dataclass(frozen=True, slots=True, eq=False)
class RingPicture:
    """A ring and what is around it, the ring in the middle.

    Attributes
    ----------
    in_scene : array, (side, side)
        I, luminance emitted at b = 1 [cd/m^2].
    background_luminance : float
        Mean luminance around the ring, of which its contrast is a share [cd/m^2].
    """

    in_scene: Array
    background_luminance: float


class RingPainter(Protocol):
    """Makes the pictures of rings."""

    def picture(self, scene: str, position: Vector, ring: Ring) -> RingPicture:
        """Return a ring in a scene, seen from a position [m]."""


class OffscreenPainter(AbstractContextManager["OffscreenPainter"]):
    """Draws rings in their scenes, without a window.

    Parameters
    ----------
    display : Display
        What shows them, pixel for pixel.
    side : int
        Of the pictures that are drawn, at least: `picture_side` of the largest ring, where that is known. A
        scene that is open for smaller pictures takes long to be opened for larger ones [pixels].

    Raises
    ------
    InputError
        If the machine has no OpenGL.
    """

    def __init__(self, display: Display, side: int = 0) -> None:
        from evenlight.stimuli.scenes.offscreen import offscreen_context

        self._display, self._side = display, side
        self._context: moderngl.Context = offscreen_context()
        self._scenes: dict[str, RingScene] = {}

    def picture(self, scene: str, position: Vector, ring: Ring) -> RingPicture:
        """Return a ring in a scene, seen from a position [m]."""
        needed = picture_side(ring, self._display)
        drawn = self._scene(scene, max(needed, self._side))
        painted = drawn.paint(ring, position)
        camera = Camera(position, ring.azimuth, ring.altitude, focal_length=focal_length_of(self._display))
        drawn.draw(camera, painted)
        edge = (drawn.size[0] - needed) // 2
        seen = drawn.pixel_values()[edge : edge + needed, edge : edge + needed]
        return RingPicture(emitted_luminance(seen, self._display), painted.surroundings.luminance)

    def __exit__(self, *_: object) -> None:
        self._scenes.clear()
        self._context.release()

    def _scene(self, name: str, side: int) -> RingScene:
        """Return what draws a scene into pictures of some size or larger."""
        from evenlight.stimuli.ring_scene import RingScene
        from evenlight.stimuli.scenes.renderer import SceneRenderer
        from evenlight.stimuli.scenes.scenes import scene_named

        if name not in self._scenes or self._scenes[name].size[0] < side:
            renderer = SceneRenderer(self._context, scene_named(name), (side, side))
            self._scenes[name] = RingScene(self._context, renderer, self._display)
        return self._scenes[name]


def picture_side(ring: Ring, display: Display) -> int:
    """Return how large the picture of a ring is, each way [pixels].

    >>> lab = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
    >>> picture_side(Ring(0.0, 0.0, gap=10.0, contrast=-0.3, orientation=90), lab)
    200
    """
    side = SIDE * GAPS_IN_DIAMETER * gap_pixels(ring, display.pixels_per_degree)
    return 2 * math.ceil(min(max(side, SMALLEST_SIDE), LARGEST_SIDE) / 2)


class RingViews:
    """How visible the rings of a search are, each place and factor reckoned once.

    The direction of a ring's gap is left out: turned by any angle, it is as visible within 12 %
    (docs/decisions/simulated-viewers.md).

    Parameters
    ----------
    painter : RingPainter
        Makes their pictures.
    display : Display
        What shows them.
    actuator : Actuator
        What makes the brightness; pixels show nothing darker than the display's black.
    model : ContrastModel
        Choices of the contrast model.
    """

    def __init__(
        self,
        painter: RingPainter,
        display: Display,
        actuator: Actuator = Actuator.PIXELS,
        model: ContrastModel = DEFAULT_MODEL,
    ) -> None:
        self._painter, self._display, self._actuator, self._model = painter, display, actuator, model
        self._pictures: dict[tuple[str, Vector, Ring], RingPicture] = {}
        self._visibility: dict[tuple[str, Vector, Ring, float], float] = {}

    def prepare(self, trials: Iterable[PlannedSearch]) -> None:
        """See to all rings of some trials now; the painter is not needed for them any more."""
        for planned in trials:
            self.of(planned)

    def table(self) -> list[dict[str, Any]]:
        """Return what is known of all rings seen so far, for a file."""
        return [
            {
                "scene": scene,
                "position_m": list(position),
                "azimuth_deg": ring.azimuth,
                "altitude_deg": ring.altitude,
                "background_luminance_cd_m2": self._pictures[scene, position, ring].background_luminance,
                "factor": factor,
                "visibility": visibility,
            }
            for (scene, position, ring, factor), visibility in self._visibility.items()
        ]

    def of(self, planned: PlannedSearch) -> RingSight:
        """Return how the ring of a trial is seen."""
        ring = replace(planned.ring, orientation=0)
        place = (planned.scene, planned.camera.position, ring)
        if place not in self._pictures:
            self._pictures[place] = self._painter.picture(*place)
        picture, key = self._pictures[place], (*place, planned.factor)
        if key not in self._visibility:
            self._visibility[key] = self._visible(picture, ring, planned.factor)
        return RingSight(
            visibility=self._visibility[key],
            eccentricity=angle_between(planned.camera, planned.ring),
            orientation=planned.ring.orientation,
            background_luminance=picture.background_luminance,
        )

    def _visible(self, picture: RingPicture, ring: Ring, factor: float) -> float:
        """Return how far above its threshold a ring is, dimmed as the display dims it."""
        alone = ring_alone(ring, picture.background_luminance, len(picture.in_scene), self._display)
        in_scene = picture.in_scene
        if self._actuator is Actuator.PIXELS:
            alone, in_scene = (reachable_light(light, factor, self._display) for light in (alone, in_scene))
        return ring_visibility(alone, in_scene, factor, self._display, self._model)


def angle_between(camera: Camera, ring: Ring) -> float:
    """Return how far a ring lies from where a camera looks [deg].

    >>> ring = Ring(azimuth=30.0, altitude=0.0, gap=10.0, contrast=-0.3, orientation=0)
    >>> round(angle_between(Camera((0.0, 0.0, 1.65), azimuth=350.0), ring), 6)
    40.0
    """
    looks = direction_of(camera.azimuth, camera.altitude)
    towards = direction_of(ring.azimuth, ring.altitude)
    across = float(np.linalg.norm(np.cross(looks, towards)))
    return math.degrees(math.atan2(across, float(looks @ towards)))
