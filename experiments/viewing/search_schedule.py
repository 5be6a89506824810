"""The order of the searches: each keypoint once in each version, counterbalanced over participants."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchDesign
from evenlight.data_schema.recordings.viewing import Version
from evenlight.experiments.chance import Purpose, drawn_halves, drawn_row, generator_for, williams_row
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.method.contrast.luminance import displayed_luminance
from evenlight.stimuli.rings.chosen_places import APART
from evenlight.stimuli.rings.landolt import Ring, Surroundings, painted, require_drawable, shown_contrast
from evenlight.stimuli.rings.ring_scene import PRACTICE_SIZE, KeypointRings, ring_places
from evenlight.stimuli.scenes.content.catalogue import path_named
from evenlight.stimuli.scenes.engine.camera import HIGHEST, Camera, focal_length_of
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.graphics import PEAK
from evenlight.stimuli.scenes.engine.scene import direction_of
from evenlight.stimuli.sequence_format import ENCODING_GAMMA

LONGEST_DIFFERENCE = 1.0  # [s] between a camera path and its track
VERSIONS = (Version.OURS, Version.BASELINE)
LEAST_SHARE = 0.9  # of the contrast asked for that is to leave the display


def relative_azimuth(azimuth: float, first: float) -> float:
    """Return an azimuth from a first direction of view, in [-180, 180) [deg].

    >>> relative_azimuth(350.0, 10.0)
    -20.0
    """
    return round((azimuth - first + 180.0) % 360.0 - 180.0, 9)


@dataclass(frozen=True, slots=True)
class SearchPoint:
    """A keypoint as a search uses it: where it and its rings lie, how bright each version is there."""

    # camera path, point on it, scene or the file of the path through it
    sequence: str
    keypoint: str
    scene: str
    camera: Camera  # where from, and the first direction of view
    rings: KeypointRings  # the places of its rings
    factors: Mapping[Version, float]  # brightness factor of each version there


def search_points(
    design: SearchDesign,
    stimuli: Sequence[LoadedStimulus],
    display: Display,
    actuator: Actuator = Actuator.PIXELS,
) -> tuple[SearchPoint, ...]:
    """Return the keypoints of a search.

    Parameters
    ----------
    design : SearchDesign
        Which keypoints.
    stimuli : sequence of LoadedStimulus
        The brightness tracks of its sequences.
    display : Display
        Whose resolution everything's size follows.
    actuator : Actuator
        What makes the brightness.

    Raises
    ------
    InputError
        If there is no such keypoint, a track is not as long as its path, a ring's gap would be too small for
        the display, or less than `LEAST_SHARE` of its contrast would be left where it is dimmed.
    """
    require_drawable(Ring(0.0, 0.0, design.ring_gap, design.ring_contrast, ORIENTATIONS[0]), display)
    for stimulus in stimuli:
        _require_whole_path(stimulus)
    points = [
        _point(path_named(stimulus.path), rings, stimulus, display)
        for stimulus in stimuli
        for rings in ring_places(stimulus.path).keypoints
        if not design.keypoints or f"{stimulus.name}/{rings.keypoint}" in design.keypoints
    ]
    for point in points:
        _require_reached(design, point)
        _require_contrast(design, point, display)
        if actuator is Actuator.PIXELS:
            _require_contrast_dimmed(design, point, display)
    found = {f"{point.sequence}/{point.keypoint}" for point in points}
    for wanted in design.keypoints:
        if wanted not in found:
            path = wanted.partition("/")[0]
            (of,) = (stimulus.path for stimulus in stimuli if stimulus.name == path)
            known = ", ".join(rings.keypoint for rings in ring_places(of).keypoints)
            raise InputError(f"keypoint {wanted!r}: the path {path} has {known} for a search")
    return tuple(points)


def _require_whole_path(stimulus: LoadedStimulus) -> None:
    """Refuse a track that is not as long as its path: of an excerpt, or of something else."""
    track, walk = stimulus.stimulus.duration, path_named(stimulus.path).duration
    if abs(track - walk) > LONGEST_DIFFERENCE:
        raise InputError(
            f"{stimulus.folder}: its track lasts {track:g} s, and the path {stimulus.name} {walk:g} s; "
            "make a track of the whole path"
        )


def _require_reached(design: SearchDesign, point: SearchPoint) -> None:
    """Refuse places of rings that the view does not turn to, or that are as good as one."""
    rings, of = point.rings, f"{point.sequence}/{point.keypoint}: its places of rings"
    aside = max(map(abs, (*rings.azimuths, rings.practice_azimuth)))
    up = max(map(abs, (*rings.altitudes, rings.practice_altitude)))
    if aside > design.field_of_view or up > HIGHEST:
        need = f"azimuths of {design.field_of_view:g} and altitudes of {HIGHEST:g} degrees at most"
        raise InputError(f"{of} lie farther off than the view turns; need {need}")
    first, second = map(direction_of, rings.azimuths, rings.altitudes)
    if first @ second > math.cos(math.radians(APART - 0.01)):
        raise InputError(f"{of} are too near to each other; need two that are {APART:g} degrees apart")


def _require_contrast(design: SearchDesign, point: SearchPoint, display: Display) -> None:
    """Refuse a contrast that the display cannot show where a ring is to lie."""
    ring = Ring(0.0, 0.0, design.ring_gap, design.ring_contrast, ORIENTATIONS[0])
    for shown in _backgrounds(point, display):
        try:
            painted(ring, Surroundings((shown,) * 3, 0.0), display)
        except InputError as error:
            raise InputError(f"at the keypoint {point.sequence}/{point.keypoint}: {error}") from None


def _require_contrast_dimmed(design: SearchDesign, point: SearchPoint, display: Display) -> None:
    """Refuse a contrast of which too little is left where pixels dim the ring."""
    wanted, black = design.ring_contrast, display.black_level
    darkest = min(_backgrounds(point, display))
    for version, factor in point.factors.items():
        left = shown_contrast(wanted, darkest, factor, display, by_pixels=True)
        if left / wanted >= LEAST_SHARE:
            continue
        # A dark ring at black has the contrast black / (b · I) - 1; towards 0, so that what is named will do.
        least = math.ceil((black / (factor * darkest) - 1) / LEAST_SHARE * 100) / 100
        milder = f"give one from {least:g} to 0, " if wanted < 0 and least < 0 else ""
        raise InputError(
            f"ring_contrast: at the keypoint {point.sequence}/{point.keypoint} the version {version.value} "
            f"(b = {factor:.3g}) dims the light around a ring to {factor * darkest:.3g} cd/m^2, and the "
            f"pixels of {display.name!r} make no less than {black:g}: of the contrast {wanted:g}, {left:.2g} "
            f"would be left; {milder}name keypoints without this one, or take a rig that dims its backlight"
        )


def _backgrounds(point: SearchPoint, display: Display) -> list[float]:
    """Return the luminance around each ring of a keypoint, that of practice the last [cd/m^2]."""
    # As the scene is encoded, so it is shown: scenes are made for a peak of 100 cd/m^2.
    made = np.array([*point.rings.luminances, point.rings.practice_luminance]) / PEAK
    shown = displayed_luminance(made ** (1 / ENCODING_GAMMA), display) - display.reflected_luminance
    return [float(each) for each in shown]


def _point(path: CameraPath, rings: KeypointRings, stimulus: LoadedStimulus, display: Display) -> SearchPoint:
    keypoint = path.keypoint(rings.keypoint)
    times = stimulus.track.times
    frame = max(int((times <= keypoint.time + 1e-9).sum()) - 1, 0)
    camera = Camera(
        keypoint.position, keypoint.azimuth, keypoint.altitude, focal_length=focal_length_of(display)
    )
    factors = {version: float(stimulus.factors(version)[frame]) for version in VERSIONS}
    scene = stimulus.path if stimulus.path.endswith(".json") else path.scene
    return SearchPoint(stimulus.name, keypoint.name, scene, camera, rings, factors)


def search_order(
    design: SearchDesign, points: Sequence[SearchPoint], seed: int, order_index: int
) -> tuple[PlannedTrial, ...]:
    """Return the trials of a participant: two blocks, each with every keypoint once.

    In the first block half of the keypoints, drawn, have the brightness of ours and the rest that of the
    baseline, in the second block the other way round. A keypoint's ring lies at one of its two places in the
    first block and at the other in the second, so that nobody searches twice at the same place. Over four
    participants each version of a keypoint comes first and second, at either place, equally often. The order
    within a block is a row, drawn, of a Williams square; the gap's direction is drawn, each of the eight as
    often as possible.

    Parameters
    ----------
    design : SearchDesign
        How the rings look.
    points : sequence of SearchPoint
        Where.
    seed, order_index : int
        Of the session, and the participant's place in the data set.
    """
    n = len(points)
    orientations = _orientations(2 * n, seed, order_index)
    row, halves = (
        drawn_row(n, order_index, design.order_seed),
        drawn_halves(n, order_index, design.order_seed, 2),
    )
    chance = generator_for(design.order_seed, order_index // 4, Purpose.RING_PLACES)
    places = chance.permutation(n) + order_index // 2
    trials: list[PlannedTrial] = []
    for block in (1, 2):
        for k in williams_row(n, row + (block - 1) * (n // 2)):
            version = VERSIONS[int(halves[block - 1, k])]
            place = 1 + int(places[k] + block) % 2
            trials.append(planned_search(design, points[k], version, place, orientations[len(trials)], block))
    return tuple(trials)


def search_practice(
    design: SearchDesign, points: Sequence[SearchPoint], seed: int, order_index: int
) -> tuple[PlannedTrial, ...]:
    """Return trials for practice: keypoints drawn at random, with a ring of twice the size.

    A ring for practice lies at its keypoint's third place, where none lies in the session.
    """
    chance = generator_for(seed, order_index, Purpose.EXCERPTS)
    rounds = -(-design.practice_trials // len(points))  # each once before any comes twice
    chosen = [points[int(k)] for _ in range(rounds) for k in chance.permutation(len(points))]
    orientations = _orientations(design.practice_trials, seed, order_index, practice=1)
    return tuple(
        planned_search(design, point, VERSIONS[(k + order_index) % 2], 1, orientations[k], 0)
        for k, point in enumerate(chosen[: design.practice_trials])
    )


def planned_search(
    design: SearchDesign, point: SearchPoint, version: Version, place: int, orientation: int, block: int
) -> PlannedTrial:
    """Return the trial of a keypoint, a version, a place of its ring and a direction of the gap.

    In practice, block 0, the ring is larger, and lies at the keypoint's third place.
    """
    rings, practice = point.rings, block == 0
    azimuth, altitude = rings.azimuths[place - 1], rings.altitudes[place - 1]
    if practice:
        azimuth, altitude = rings.practice_azimuth, rings.practice_altitude
    ring = Ring(
        azimuth=point.camera.azimuth + azimuth,
        altitude=altitude,
        gap=design.ring_gap * (PRACTICE_SIZE if practice else 1),
        contrast=design.ring_contrast,
        orientation=orientation,
    )
    shown = {"ring": ring, "scene": point.scene, "camera": point.camera}
    return PlannedTrial(
        shown,
        sequence=point.sequence,
        keypoint=point.keypoint,
        version=version,
        factor=point.factors[version],
        ring_place=place,
        ring_azimuth=relative_azimuth(ring.azimuth, point.camera.azimuth),
        ring_altitude=ring.altitude,
        ring_gap=ring.gap,
        ring_contrast=ring.contrast,
        ring_orientation=ring.orientation,
        block=block,
        practice=practice,
    )


def _orientations(n: int, seed: int, order_index: int, practice: int = 0) -> list[int]:
    """Return n directions of the gap: each of the eight once before any comes twice."""
    chance = generator_for(seed, order_index, Purpose.ORIENTATIONS, practice)
    rounds = -(-n // len(ORIENTATIONS))
    return [ORIENTATIONS[int(k)] for _ in range(rounds) for k in chance.permutation(len(ORIENTATIONS))][:n]
