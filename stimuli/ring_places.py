"""Where rings are put: places around a keypoint that lie on a surface and are evenly lit.

Decision (docs/decisions/landolt-rings.md): a place is drawn at random among the directions that are far
enough from the first view, and near enough. It counts if a ring there, with all that its contrast is measured
against, lies on one surface that does not shine itself, and if that is evenly bright. Of those found, the
two are taken that are most alike in luminance. A third is for practice: one that suits the larger ring of
practice as well, away from both, and as much like them in luminance as there is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.landolt import GAPS_IN_DIAMETER, Ring
from evenlight.stimuli.ring_place_files import PRACTICE_SIZE
from evenlight.stimuli.ring_scene import RingScene
from evenlight.stimuli.scene_rays import NOTHING, seen_along
from evenlight.stimuli.scenes.camera import Camera
from evenlight.stimuli.scenes.scene import Floats, Scene, direction_of

DRAWS = 600  # directions that are looked at
ENOUGH = 24  # places that are found suitable before two are chosen
AROUND = 12  # rays around a place
STEEPEST = 0.25  # cosine of the angle at which a surface is looked at
NEAREST = 0.4  # [m]
DECIMALS = 2  # of an angle [deg]: a quarter of a pixel at 24 pixels per degree


@dataclass(frozen=True, slots=True)
class PlaceRules:
    """What is asked of the places of rings.

    Attributes
    ----------
    smallest_eccentricity, largest_eccentricity : float
        From the first direction of view [deg].
    highest : float
        Altitude, up or down [deg].
    apart : float
        Least angle between the two places [deg].
    practice_apart : float
        Least angle from both of them to the place for practice [deg].
    gap : float
        Of the rings [arcmin].
    contrast : float
        Of the rings, for whether the display can show them.
    largest_variation : float
        Standard deviation of the luminance around a place, over its mean.
    darkest : float
        Least mean luminance around a place at full brightness [cd/m^2].
    """

    smallest_eccentricity: float = 10.0
    largest_eccentricity: float = 45.0
    highest: float = 35.0
    apart: float = 20.0
    practice_apart: float = 12.0
    gap: float = 10.0
    contrast: float = -0.3
    largest_variation: float = 0.25
    darkest: float = 0.3


@dataclass(frozen=True, slots=True)
class RingPlace:
    """A direction in which a ring may be shown.

    Attributes
    ----------
    azimuth, altitude : float
        In the scene: clockwise from north, and up [deg].
    luminance : float
        Mean luminance I around it at full brightness [cd/m^2].
    variation : float
        Standard deviation of that luminance over its mean.
    """

    azimuth: float
    altitude: float
    luminance: float
    variation: float


def choose_places(
    scene: Scene, rings: RingScene, camera: Camera, rules: PlaceRules, rng: np.random.Generator
) -> tuple[RingPlace, RingPlace, RingPlace]:
    """Return three places of rings around a point of a scene: two of the session, and one for practice.

    The light of the last one is that around a ring of practice, `PRACTICE_SIZE` times as large.

    Parameters
    ----------
    scene : Scene
        The scene.
    rings : RingScene
        Draws it.
    camera : Camera
        The point, and the first direction of view.
    rules : PlaceRules
        What is asked of the places.
    rng : Generator
        Draws the directions.

    Raises
    ------
    InputError
        If no three are found.
    """
    larger = replace(rules, gap=PRACTICE_SIZE * rules.gap)
    found: list[RingPlace] = []
    roomy: list[RingPlace] = []
    for azimuth, altitude in _directions(camera, rules, rng):
        place = _suitable((scene, rings), camera, (azimuth, altitude), rules)
        if place is None:
            continue
        found.append(place)
        place = _suitable((scene, rings), camera, (azimuth, altitude), larger)
        roomy += [place] if place is not None else []
        if len(found) >= ENOUGH and (chosen := _three(found, roomy, rules)) is not None:
            return chosen
    chosen = _three(found, roomy, rules)
    if chosen is None:
        x, y, z = camera.position
        raise InputError(
            f"{scene.name}: around ({x:g}, {y:g}, {z:g}) m, towards {camera.azimuth:g} degrees, {len(found)} "
            f"of {DRAWS} directions suit a ring of {rules.gap:g} arcmin, {len(roomy)} of them one of "
            f"{larger.gap:g}; two that are {rules.apart:g} degrees apart are needed, and a larger one "
            f"{rules.practice_apart:g} from both: take another keypoint, or one with larger even surfaces "
            "around it"
        )
    return chosen


def lies_on_a_surface(scene: Scene, camera: Camera, ring: Ring) -> bool:
    """Return whether a ring, out to twice its radius, lies on one flat surface that does not shine.

    Foliage, nets and other surfaces with holes do not count, nor does what is seen at a grazing angle.
    """
    patches, rays = scene.patches, _rays(ring)
    distance, met = seen_along(patches, camera.position, rays[:1])
    if not _is_sound(scene, met) or distance[0] < NEAREST:
        return False
    normal = np.cross(patches.along[met[0]], patches.across[met[0]])
    towards_eye = -rays @ normal / np.linalg.norm(normal)
    if (towards_eye < STEEPEST).any():
        return False
    distances, met = seen_along(patches, camera.position, rays[1:])
    on_plane = distance[0] * towards_eye[0] / towards_eye[1:]
    # What is around it may stand out from the surface by no more than the ring's radius.
    radius = distance[0] * ring.gap_on_plane * GAPS_IN_DIAMETER / 2
    return _is_sound(scene, met) and bool((np.abs(distances - on_plane) <= radius).all())


def _is_sound(scene: Scene, met: NDArray[np.int64]) -> bool:
    """Return whether all rays met surfaces without holes that do not shine themselves."""
    if (met == NOTHING).any():
        return False
    holes = [scene.materials[kind].cutout for kind in scene.patches.material[met]]
    return not (any(holes) or scene.patches.emission[met].any())


def _rays(ring: Ring) -> Floats:
    """Return the directions of a ring's middle and of points on twice its radius, and half of that."""
    right, up, ahead = Camera((0.0, 0.0, 0.0), ring.azimuth, ring.altitude).axes()
    turns = 2 * np.pi * np.arange(AROUND)[:, np.newaxis] / AROUND
    radius = np.where(np.arange(AROUND) % 3 == 0, 0.5, 1.0)[:, np.newaxis]
    radius = radius * GAPS_IN_DIAMETER * ring.gap_on_plane
    around = ahead + radius * (np.cos(turns) * right + np.sin(turns) * up)
    rays = np.concatenate([ahead[np.newaxis], around])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _directions(camera: Camera, rules: PlaceRules, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return directions at random, evenly over the visual field where rings may lie [deg]."""
    least, most = np.cos(np.radians([rules.largest_eccentricity, rules.smallest_eccentricity]))
    ahead = rng.uniform(least, most, DRAWS)
    turn = rng.uniform(0, 2 * np.pi, DRAWS)
    aside = np.sqrt(1 - ahead**2)
    x, y, z = (np.stack([aside * np.cos(turn), aside * np.sin(turn), ahead], axis=1) @ camera.axes()).T
    # Rounded before they are looked at: the file that keeps them has no more decimals.
    azimuths = np.degrees(np.arctan2(x, y)).round(DECIMALS)
    altitudes = np.degrees(np.arcsin(np.clip(z, -1, 1))).round(DECIMALS)
    within = np.abs(altitudes) <= rules.highest
    return list(zip(azimuths[within].tolist(), altitudes[within].tolist(), strict=True))


def _suitable(
    drawn: tuple[Scene, RingScene], camera: Camera, direction: tuple[float, float], rules: PlaceRules
) -> RingPlace | None:
    """Return a direction as a place, with its light; None if a ring would not suit it.

    It must lie on a surface that is neither too dark, nor too uneven, nor out of the display's reach.
    """
    scene, rings = drawn
    ring = Ring(*direction, rules.gap, rules.contrast, 0)
    if not lies_on_a_surface(scene, camera, ring):
        return None
    around = rings.surroundings(ring, camera.position)
    if around.luminance < rules.darkest or around.variation > rules.largest_variation:
        return None
    if not rings.can_show(ring, around):
        return None
    return RingPlace(ring.azimuth, ring.altitude, around.luminance, around.variation)


def _three(
    places: list[RingPlace], roomy: list[RingPlace], rules: PlaceRules
) -> tuple[RingPlace, RingPlace, RingPlace] | None:
    """Return the two places most alike, and of those for practice the one most like them; None without."""
    pair = _pair(places, rules.apart)
    if pair is None:
        return None
    near = math.cos(math.radians(rules.practice_apart))
    level = math.log(pair[0].luminance)
    third = min(
        (place for place in roomy if all(_towards(place) @ _towards(other) <= near for other in pair)),
        key=lambda place: abs(math.log(place.luminance) - level),
        default=None,
    )
    return None if third is None else (*pair, third)


def _pair(places: list[RingPlace], apart: float) -> tuple[RingPlace, RingPlace] | None:
    """Return the two places most alike in luminance that are far enough apart; None if there are none."""
    if not places:
        return None
    towards = np.array([_towards(place) for place in places])
    brightness = np.log([place.luminance for place in places])
    unlike = np.abs(brightness[:, np.newaxis] - brightness)
    unlike[towards @ towards.T > math.cos(math.radians(apart))] = np.inf
    first, second = np.unravel_index(np.argmin(unlike), unlike.shape)
    return (places[first], places[second]) if unlike[first, second] < np.inf else None


def _towards(place: RingPlace) -> Floats:
    """Return the direction of a place, a unit vector."""
    return direction_of(place.azimuth, place.altitude)
