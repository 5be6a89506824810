"""How visible the rings of a search are, by the method's own contrast model (Eqs. 2 and 3).

Each place is drawn once, without a window, the ring in the middle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.assumed_effect import TIME_RATIO, AssumedEffect
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.data_schema.recordings.viewing import Version
from evenlight.experiments.chance import Purpose
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.search_stage import (
    OffscreenPainter,
    RingPicture,
    picture_side,
)
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.viewing.search_observer import (
    RingSight,
    SearchAnswer,
    SearchObserver,
    SearchPopulation,
    draw_searcher,
)
from evenlight.experiments.viewing.search_schedule import (
    VERSIONS,
    planned_search,
    search_points,
)
from evenlight.experiments.viewing.simulated_viewers import Viewing
from evenlight.method.contrast.contrast_loss import csf_contrasts
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.masking import MASKING_EXPONENT, TRANSDUCER_EXPONENT, neighbourhood_mean
from evenlight.stimuli.rings.landolt import Ring, covered, reachable_light
from evenlight.stimuli.rings.ring_scene import PRACTICE_SIZE
from evenlight.stimuli.scenes.engine.camera import Camera, focal_length_of
from evenlight.stimuli.scenes.engine.scene import Vector, direction_of

SUBSAMPLES = 4  # along each side of a pixel
SIDE = 0.05  # share by which a location is brightened or dimmed, as the analysis of a search has it


class RingViews:
    """How visible the rings of a search are, each place and factor computed once.

    The direction of a ring's gap is left out: turned by any angle, it is as visible within 12 %
    (docs/decisions/simulated-viewers.md).

    Parameters
    ----------
    painter : OffscreenPainter
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
        painter: OffscreenPainter,
        display: Display,
        actuator: Actuator = Actuator.PIXELS,
        model: ContrastModel = DEFAULT_MODEL,
    ) -> None:
        self._painter, self._display, self._actuator, self._model = painter, display, actuator, model
        self._pictures: dict[tuple[str, Vector, Ring], RingPicture] = {}
        self._visibility: dict[tuple[str, Vector, Ring, float], float] = {}

    def prepare(self, trials: Iterable[PlannedTrial]) -> None:
        """See to all rings of some trials now; the painter is not needed for them any more."""
        for planned in trials:
            self.of(planned)

    def table(self) -> list[dict[str, Any]]:
        """Return what is known of all rings seen so far, for a file."""
        return [
            {
                "scene": Path(scene).stem,
                "position_m": list(position),
                "azimuth_deg": ring.azimuth,
                "altitude_deg": ring.altitude,
                "background_luminance_cd_m2": self._pictures[scene, position, ring].background_luminance,
                "factor": factor,
                "visibility": visibility,
            }
            for (scene, position, ring, factor), visibility in self._visibility.items()
        ]

    def of(self, planned: PlannedTrial) -> RingSight:
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


def ring_visibility(
    alone: Array, in_scene: Array, factor: float, display: Display, model: ContrastModel = DEFAULT_MODEL
) -> float:
    """Return how far above its threshold a ring is in a scene: 1 at threshold.

    The ring's own contrast C in units of threshold, band by band and pixel by pixel, is that of the ring
    alone on a uniform ground. Its perceived contrast is |C|^0.7 / (1 + M), as in Eq. 3, with M the mean over
    the neighbourhood of |C'|^0.2 of all that is there, C' being the contrast of the scene with the ring. So
    the texture that the ring lies on masks it, and on a uniform ground that is the C_t of Eq. 3 itself. The
    largest counts: the method calls a pixel visible where |C_t| exceeds 1.

    Parameters
    ----------
    alone : array, (height, width)
        I, luminance emitted at b = 1 of the ring on a uniform ground [cd/m^2].
    in_scene : array, same shape
        I of the scene with the ring [cd/m^2].
    factor : float
        Brightness factor b.
    display : Display
        Its pixels per degree, and the light that it reflects.
    model : ContrastModel
        Choices of the contrast model.

    >>> lab = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
    >>> ring_visibility(np.full((16, 16), 50.0), np.full((16, 16), 50.0), 0.5, lab)
    0.0
    """
    own, all_there = (
        csf_contrasts(dimmed_luminance(emitted, factor, display), display, model)
        for emitted in (alone, in_scene)
    )
    return max(
        float((np.abs(ring) ** TRANSDUCER_EXPONENT / (1 + _masking(scene, model))).max())
        for ring, scene in zip(own, all_there, strict=True)
    )


def _masking(contrast: Array, model: ContrastModel) -> Array:
    return neighbourhood_mean(np.abs(contrast) ** MASKING_EXPONENT, model.masking)


def ring_alone(ring: Ring, background: float, side: int, display: Display) -> Array:
    """Return a ring in the middle of a uniform ground, drawn at its true size, (side, side) [cd/m^2].

    Parameters
    ----------
    ring : Ring
        The ring.
    background : float
        Luminance of the ground, emitted at b = 1 [cd/m^2].
    side : int
        Of the picture [pixels].
    display : Display
        What shows it, pixel for pixel.
    """
    fine = (np.arange(side * SUBSAMPLES) + 0.5) / SUBSAMPLES - side / 2
    gaps = fine / focal_length_of(display) / ring.gap_on_plane
    points = np.stack(np.meshgrid(gaps, -gaps), axis=-1)
    shape = (side, SUBSAMPLES, side, SUBSAMPLES)
    coverage = covered(points, ring.orientation).reshape(shape).mean(axis=(1, 3))
    return np.asarray(background * (1 + ring.contrast * coverage))


@dataclass(frozen=True, slots=True)
class SearchViewing(Viewing):
    """Ring search: answers are `SearchAnswer`."""

    views: RingViews
    time_limit: float
    population: SearchPopulation = field(default_factory=SearchPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.SEARCHER, Purpose.SEARCHES)

    def draw(self, rng: np.random.Generator) -> SearchObserver:
        """Return a participant."""
        return draw_searcher(rng, self.population)

    def answer(self, person: SearchObserver, planned: PlannedTrial, rng: np.random.Generator) -> SearchAnswer:
        """Return what comes of a search."""
        return person.answer(self.views.of(planned), self.time_limit, rng)

    def columns(self, planned: PlannedTrial) -> dict[str, Any]:
        """Return the luminance around the ring, which drawing it tells."""
        return {"background_luminance": self.views.of(planned).background_luminance}

    def prepare(self, setting: SessionSetting) -> None:
        """See all rings that a session may show, wherever in the data set its participant stands."""
        design: Any = setting.manifest.design
        self.views.prepare(
            planned_search(design, point, version, place, ORIENTATIONS[0], block)
            for point in search_points(design, setting.stimuli, setting.display, setting.rig.actuator)
            for version in VERSIONS
            for block in (0, 1)  # of practice, and of the session
            for place in (1, 2)
        )

    def truth(self, person: SearchObserver) -> dict[str, Any]:
        """Return a participant's traits."""
        names = ("slowness", "sensitivity", "guess_rate", "lapse_rate")
        return {name: getattr(person, name) for name in names}

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return how visible each ring is at each brightness factor, before the person's own sensitivity."""
        return self.views.table()

    def assumed(self, setting: SessionSetting) -> tuple[AssumedEffect, ...]:
        """Return the ratio of times to find a ring that can be found, which is everybody's.

        The geometric mean over the rings of each sequence, and of those that ours brightens or dims by more
        than a twentieth. People differ in how fast they search and how well they see, which the ratio of a
        person's own times leaves out.
        """
        design: Any = setting.manifest.design
        ratios: dict[str, list[float]] = {each.name: [] for each in setting.stimuli}
        for point in search_points(design, setting.stimuli, setting.display, setting.rig.actuator):
            lighter = point.factors[Version.OURS] / point.factors[Version.BASELINE]
            side = "brightened" if lighter > 1 + SIDE else "dimmed" if lighter < 1 - SIDE else None
            for place in (1, 2):
                ours, baseline = (
                    self.views.of(planned_search(design, point, version, place, ORIENTATIONS[0], 1))
                    for version in (Version.OURS, Version.BASELINE)
                )
                ratio = self.population.gain * math.log(baseline.visibility / ours.visibility)
                for group in (point.sequence, side):
                    if group is not None:
                        ratios.setdefault(group, []).append(ratio)
        return tuple(
            AssumedEffect(TIME_RATIO, group, math.exp(float(np.mean(own))), "1")
            for group, own in ratios.items()
            if own
        )


@contextmanager
def search_viewing(setting: SessionSetting) -> Iterator[SearchViewing]:
    """Yield what simulated participants of a search see in a setting.

    The actuator matters: where pixels make the brightness, nothing is darker than black.

    Raises
    ------
    InputError
        If the machine has no OpenGL.
    """
    design: Any = setting.manifest.design
    display = setting.display
    largest = Ring(0.0, 0.0, PRACTICE_SIZE * design.ring_gap, design.ring_contrast, ORIENTATIONS[0])
    with OffscreenPainter(display, picture_side(largest, display)) as painter:
        yield SearchViewing(RingViews(painter, display, setting.rig.actuator), design.time_limit)
