"""The places of rings that come with the camera paths: where the rules want them, in today's scenes."""

import json
import math

import pytest
from example_scripts import example_script

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.ring_scene import (
    PATHS,
    PRACTICE_SIZE,
    SUFFIX,
    KeypointRings,
    RingPlaces,
    RingScene,
    ring_places,
)
from evenlight.stimuli.scenes.content.catalogue import path_named, scene_named
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.camera_path import Keypoint
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import direction_of

pytestmark = pytest.mark.slow

rules = example_script("choose_ring_places")

MEASURED = "basement"  # of both scenes, its scene is drawn the sooner
ROUNDING = 0.02  # [deg] the files have hundredths


def angle(first: tuple[float, float], second: tuple[float, float]) -> float:
    return math.degrees(math.acos(float(direction_of(*first) @ direction_of(*second))))


def rings_of(keypoint: KeypointRings, point: Keypoint) -> list[tuple[Ring, float]]:
    """Return the rings that may lie around a keypoint, practice's last, each with its recorded luminance."""
    azimuths = (*keypoint.azimuths, keypoint.practice_azimuth)
    altitudes = (*keypoint.altitudes, keypoint.practice_altitude)
    gaps = (rules.GAP, rules.GAP, PRACTICE_SIZE * rules.GAP)
    rings = [
        Ring(point.azimuth + azimuth, altitude, gap, rules.CONTRAST, 0)
        for azimuth, altitude, gap in zip(azimuths, altitudes, gaps, strict=True)
    ]
    return list(zip(rings, (*keypoint.luminances, keypoint.practice_luminance), strict=True))


@pytest.mark.parametrize("name", PAPER_SEQUENCES)
def test_every_keypoint_of_a_search_has_three_places_that_a_ring_can_lie_at(name) -> None:
    """If a scene or a path has changed: python examples/choose_ring_places.py NAME."""
    path = path_named(name)
    scene = scene_named(path.scene)
    keypoints = ring_places(name).keypoints
    assert [each.keypoint for each in keypoints] == list(path.places)
    for each in keypoints:
        point = path.keypoint(each.keypoint)
        camera = Camera(point.position, point.azimuth, point.altitude)
        rings = [ring for ring, _ in rings_of(each, point)]
        first, second, practice = ((ring.azimuth, ring.altitude) for ring in rings)
        assert angle(first, second) >= rules.APART - ROUNDING
        assert min(angle(practice, first), angle(practice, second)) >= rules.PRACTICE_APART - ROUNDING
        for ring in rings:
            eccentricity = angle((point.azimuth, point.altitude), (ring.azimuth, ring.altitude))
            assert eccentricity >= rules.SMALLEST_ECCENTRICITY - ROUNDING
            assert eccentricity <= rules.LARGEST_ECCENTRICITY + ROUNDING
            assert abs(ring.altitude) <= rules.HIGHEST + ROUNDING
            assert rules.lies_on_a_surface(scene, camera, ring), each.keypoint


def test_around_its_places_a_scene_is_as_bright_and_as_even_as_was_recorded() -> None:
    """All places of one path, in the very light that they were chosen in.

    That light is computed at the first run on a machine, which takes about a minute, and stored in the cache.
    """
    path = path_named(MEASURED)
    context = offscreen_context()
    try:
        renderer = SceneRenderer(context, scene_named(path.scene), rules.PICTURE_SIZE)
        scene = RingScene(context, renderer, rules.DISPLAY)
        for each in ring_places(MEASURED).keypoints:
            point = path.keypoint(each.keypoint)
            for ring, recorded in rings_of(each, point):
                around = scene.surroundings(ring, point.position)
                assert around.luminance == pytest.approx(recorded, rel=0.03), each.keypoint
                assert around.luminance >= rules.DARKEST * 0.97
                assert around.variation <= rules.LARGEST_VARIATION * 1.03
    finally:
        context.release()


@pytest.mark.parametrize("missing", ["practice_azimuth_deg", "practice_luminance_cd_m2"])
def test_a_file_without_a_place_for_practice_is_refused(tmp_path, missing) -> None:
    content = json.loads((PATHS / f"library{SUFFIX}").read_text())
    del content["keypoints"][0][missing]
    (tmp_path / "old.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=missing):
        read_json_record(RingPlaces, tmp_path / "old.json")


def test_a_path_without_rings_is_refused_with_those_that_have_some() -> None:
    with pytest.raises(InputError, match=r"no rings are searched for along 'attic'; there is basement, gym"):
        ring_places("attic")
