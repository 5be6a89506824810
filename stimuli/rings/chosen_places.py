"""Where rings are put: places around a keypoint that lie on a surface and are evenly lit.

Decision (docs/decisions/landolt-rings.md): a place is drawn at random among the directions that are far
enough from the first view, and near enough. It counts if a ring there, with all that its contrast is measured
against, lies on one surface that does not shine itself, and if that is evenly bright. Of those found, the
two are taken that are most alike in luminance. A third is for practice: one that suits the larger ring of
practice as well, away from both, and as much like them in luminance as there is.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.rings.landolt import GAPS_IN_DIAMETER, Ring, painted
from evenlight.stimuli.rings.ring_scene import PLACES, PRACTICE_SIZE, KeypointRings, RingPlaces, RingScene
from evenlight.stimuli.scenes.content.catalogue import scene_of
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.graphics import PEAK, offscreen_context
from evenlight.stimuli.scenes.engine.light.seen_patches import NOTHING, met_from
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Floats, Scene, direction_of, stream
from evenlight.stimuli.sequence_format import ENCODING_GAMMA

DRAWS = 600  # directions that are looked at
ENOUGH = 24  # places that are found suitable before two are chosen
AROUND = 12  # rays around a place
STEEPEST = 0.25  # cosine of the angle at which a surface is looked at
NEAREST = 0.4  # [m]
DECIMALS = 2  # of an angle [deg]: a quarter of a pixel at 24 pixels per degree
SEED = 1
# What scenes are made for, at a headset's resolution; other displays show the same places.
DISPLAY = Display("scenes", PEAK, 0.0, ENCODING_GAMMA, pixels_per_degree=24.0)
PICTURE_SIZE = (96, 96)  # [pixels]: twice the radius of practice's ring is 40 pixels from the middle
# What is asked of places. Angles in degrees, from the first direction of view.
SMALLEST_ECCENTRICITY, LARGEST_ECCENTRICITY = 10.0, 45.0
HIGHEST = 35.0  # altitude, up or down
APART, PRACTICE_APART = 20.0, 12.0  # at least: the two places, and the one for practice from both
GAP = 10.0  # of the rings [arcmin]
CONTRAST = -0.3  # of the rings, for whether the display can show them
LARGEST_VARIATION = 0.25  # of the luminance around a place: standard deviation over mean
DARKEST = 0.3  # least mean luminance around a place at full brightness [cd/m^2]


class RingPlace(NamedTuple):
    """A direction in which a ring may be shown [deg], and the light around it at full brightness."""

    azimuth: float  # in the scene, clockwise from north
    altitude: float
    luminance: float  # mean I [cd/m^2]
    variation: float  # standard deviation of that luminance over its mean


Three = tuple[RingPlace, RingPlace, RingPlace]  # two of the session, and one for practice


def places_along(path: CameraPath, seed: int = SEED) -> RingPlaces:
    """Return the places of rings at the keypoints that a path lists for a search, else at all that suit one.

    Each keypoint has chance of its own, so that a new one leaves the others as they are.

    Raises
    ------
    InputError
        If around one that is listed, or around all, no three places are found.
    """
    scene, chosen, refused = scene_of(path), list[KeypointRings](), list[InputError]()
    with offscreen_context() as context:
        rings = RingScene(context, SceneRenderer(context, scene, PICTURE_SIZE), DISPLAY)
        for name in dict.fromkeys(path.places or (point.name for point in path.keypoints)):
            point = path.keypoint(name)
            camera = Camera(point.position, point.azimuth, point.altitude)
            try:
                places = choose_places(scene, rings, camera, stream(seed, f"{path.name}/{name}"))
                chosen.append(_in_file(name, point.azimuth, places))
            except InputError as error:
                refused.append(error)
    if refused and (path.places or not chosen):
        raise refused[0]
    return RingPlaces(path.name, seed, tuple(chosen))


def choose_places(scene: Scene, rings: RingScene, camera: Camera, rng: np.random.Generator) -> Three:
    """Return three places of rings around a camera's first direction of view.

    The light of the last one is that around a ring of practice, `PRACTICE_SIZE` times as large.

    Raises
    ------
    InputError
        If no three are found.
    """
    found, roomy, unfit = list[RingPlace](), list[RingPlace](), Counter[str]()
    for direction in _directions(camera, rng):
        place = _suitable((scene, rings), camera, direction, GAP)
        if isinstance(place, str):
            unfit[place] += 1
            continue
        found.append(place)
        place = _suitable((scene, rings), camera, direction, PRACTICE_SIZE * GAP)
        roomy += [] if isinstance(place, str) else [place]
        if len(found) >= ENOUGH and (chosen := _three(found, roomy)) is not None:
            return chosen
    chosen = _three(found, roomy)
    if chosen is None:
        x, y, z = camera.position
        why = ", ".join(f"{count} {reason}" for reason, count in unfit.most_common())
        raise InputError(
            f"{scene.name}: around ({x:g}, {y:g}, {z:g}) m, towards {camera.azimuth:g} degrees, {len(found)} "
            f"of {DRAWS} directions suit a ring of {GAP:g} arcmin, {len(roomy)} of them one of "
            f"{PRACTICE_SIZE * GAP:g}; two that are {APART:g} degrees apart are needed, "
            f"and a larger one {PRACTICE_APART:g} from both: take another keypoint, or one with larger even "
            f"surfaces of {DARKEST:g} cd/m^2 and more around it; the other directions: {why or 'none'}"
        )
    return chosen


def lies_on_a_surface(scene: Scene, camera: Camera, ring: Ring) -> bool:
    """Return whether a ring, out to twice its radius, lies on one flat surface that does not shine.

    Panes, foliage and nets do not count, nor does what is seen at a grazing angle.
    """
    patches, rays = scene.patches, _rays(ring)
    distances, met = met_from(patches, camera.position, rays)
    through = np.array([material.cutout or material.blended for material in scene.materials])
    if (met == NOTHING).any() or through[patches.material[met]].any() or patches.emission[met].any():
        return False
    normal = np.cross(patches.along[met[0]], patches.across[met[0]])
    towards_eye = -rays @ normal / np.linalg.norm(normal)
    if distances[0] < NEAREST or (towards_eye < STEEPEST).any():
        return False
    on_plane = distances[0] * towards_eye[0] / towards_eye
    # What is around it may stand out from the surface by no more than the ring's radius.
    radius = distances[0] * ring.gap_on_plane * GAPS_IN_DIAMETER / 2
    return bool((np.abs(distances - on_plane) <= radius).all())


def _rays(ring: Ring) -> Floats:
    right, up, ahead = Camera((0.0, 0.0, 0.0), ring.azimuth, ring.altitude).axes()
    turns = 2 * np.pi * np.arange(AROUND)[:, np.newaxis] / AROUND
    radius = np.where(np.arange(AROUND) % 3 == 0, 0.5, 1.0)[:, np.newaxis]
    radius = radius * GAPS_IN_DIAMETER * ring.gap_on_plane
    around = ahead + radius * (np.cos(turns) * right + np.sin(turns) * up)
    rays = np.concatenate([ahead[np.newaxis], around])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _directions(camera: Camera, rng: np.random.Generator) -> list[tuple[float, float]]:
    least, most = np.cos(np.radians([LARGEST_ECCENTRICITY, SMALLEST_ECCENTRICITY]))
    ahead = rng.uniform(least, most, DRAWS)
    turn = rng.uniform(0, 2 * np.pi, DRAWS)
    aside = np.sqrt(1 - ahead**2)
    x, y, z = (np.stack([aside * np.cos(turn), aside * np.sin(turn), ahead], axis=1) @ camera.axes()).T
    # Rounded before they are looked at: the file that keeps them has no more decimals.
    azimuths = np.degrees(np.arctan2(x, y)).round(DECIMALS)
    altitudes = np.degrees(np.arcsin(np.clip(z, -1, 1))).round(DECIMALS)
    within = np.abs(altitudes) <= HIGHEST
    return list(zip(azimuths[within].tolist(), altitudes[within].tolist(), strict=True))


def _suitable(
    drawn: tuple[Scene, RingScene], camera: Camera, direction: tuple[float, float], gap: float
) -> RingPlace | str:
    """Return the place of a ring in a direction, or why none can be there."""
    scene, rings = drawn
    ring = Ring(*direction, gap, CONTRAST, 0)
    if not lies_on_a_surface(scene, camera, ring):
        return "on no flat surface without light of its own"
    around = rings.surroundings(ring, camera.position)
    if around.luminance < DARKEST:
        return f"in less than {DARKEST:g} cd/m^2"
    if around.variation > LARGEST_VARIATION:
        return "in uneven light"
    try:
        painted(ring, around, DISPLAY)
    except InputError:
        return "out of the display's reach"
    return RingPlace(ring.azimuth, ring.altitude, around.luminance, around.variation)


def _three(places: list[RingPlace], roomy: list[RingPlace]) -> Three | None:
    pair = _pair(places, APART)
    if pair is None:
        return None
    near = math.cos(math.radians(PRACTICE_APART))
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
    return direction_of(place.azimuth, place.altitude)


def _in_file(name: str, ahead: float, places: Three) -> KeypointRings:
    azimuths = [round((place.azimuth - ahead + 180) % 360 - 180, DECIMALS) for place in places]
    altitudes = [round(place.altitude, DECIMALS) for place in places]
    luminances = [round(place.luminance, 3) for place in places]
    return KeypointRings(
        keypoint=name,
        azimuths=tuple(azimuths[:PLACES]),
        altitudes=tuple(altitudes[:PLACES]),
        luminances=tuple(luminances[:PLACES]),
        practice_azimuth=azimuths[PLACES],
        practice_altitude=altitudes[PLACES],
        practice_luminance=luminances[PLACES],
    )
