"""Rings: shape, light, and the places at which they lie."""

import dataclasses
import json
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.stimuli.dithering import level_luminance
from evenlight.stimuli.rings import chosen_places
from evenlight.stimuli.rings.landolt import (
    Ring,
    Surroundings,
    covered,
    gap_pixels,
    require_drawable,
    shown_contrast,
)
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
from evenlight.stimuli.scenes.engine.camera_path import CameraPath, Keypoint
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.light.seen_patches import NOTHING, met_from
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Scene, direction_of

RING = Ring(azimuth=30.0, altitude=-5.0, gap=10.0, contrast=-0.3, orientation=45)


def fine_grid(steps: int = 1001) -> tuple[np.ndarray, float]:
    """Points over a square of 6 x 6 gaps around the centre, and the area of each."""
    side = (np.arange(steps) + 0.5) / steps * 6 - 3
    return np.stack(np.meshgrid(side, side), axis=-1), (6 / steps) ** 2


def area_by_hand() -> float:
    """A ring of radii 1.5 and 2.5 less a strip 1 wide between them, in square gaps.

    The strip under a circle of radius R reaches to sqrt(R^2 - y^2); its area for |y| < 1/2 is
    sqrt(R^2 - 1/4) / 2 + R^2 asin(1 / 2R).
    """

    def strip(radius: float) -> float:
        return math.sqrt(radius**2 - 0.25) / 2 + radius**2 * math.asin(0.5 / radius)

    return math.pi * (2.5**2 - 1.5**2) - (strip(2.5) - strip(1.5))


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_the_covered_area_is_that_of_a_ring_with_a_straight_strip_cut_out(orientation) -> None:
    """The rim crosses about 6 / 0.006 points a gap of length; each is wrong by half of its area at most."""
    points, each = fine_grid()
    assert covered(points, orientation).sum() * each == pytest.approx(area_by_hand(), abs=0.01)


@pytest.mark.parametrize("orientation", ORIENTATIONS)
@pytest.mark.parametrize("radius", [1.6, 2.0, 2.4])
def test_the_gap_is_as_wide_as_the_stroke_at_every_radius(orientation, radius) -> None:
    """Counted along a line across the gap; a wedge would be half as wide again at 2.4 as at 1.6."""
    turn = math.radians(orientation)
    across = np.linspace(-0.7, 0.7, 14001)
    centre = radius * np.array([math.cos(turn), math.sin(turn)])
    line = centre + across[:, np.newaxis] * np.array([-math.sin(turn), math.cos(turn)])
    open_ = across[~covered(line, orientation) & (np.hypot(*line.T) < 2.5) & (np.hypot(*line.T) > 1.5)]
    assert open_.max() - open_.min() == pytest.approx(1.0, abs=3e-4)


def test_diameter_and_stroke_are_five_gaps_and_one() -> None:
    line = np.linspace(-3, 3, 60001)
    beside = covered(np.stack([np.zeros_like(line), line], axis=-1), orientation=0)
    assert line[beside].min() == pytest.approx(-2.5, abs=2e-4)
    assert line[beside].max() == pytest.approx(2.5, abs=2e-4)
    upper = line[beside & (line > 0)]
    assert upper.max() - upper.min() == pytest.approx(1.0, abs=3e-4)
    assert RING.diameter == 50.0


def test_the_gap_of_each_orientation_is_where_it_says() -> None:
    names = {
        0: (1, 0),
        90: (0, 1),
        180: (-1, 0),
        270: (0, -1),
        45: (1, 1),
        135: (-1, 1),
        225: (-1, -1),
        315: (1, -1),
    }
    for orientation, towards in names.items():
        point = 2 * np.array(towards) / np.hypot(*towards)
        assert not covered(point, orientation)
        assert all(covered(point, other) for other in ORIENTATIONS if other != orientation)


def test_a_gap_of_a_degree_is_as_many_pixels_as_the_display_has_in_one() -> None:
    assert gap_pixels(dataclasses.replace(RING, gap=60.0), 72.28) == pytest.approx(72.28)


def test_a_gap_under_two_pixels_is_refused_and_the_size_named_instead_is_not() -> None:
    coarse = Display("headset", 100.0, 0.0, 2.2, pixels_per_degree=7.3)
    with pytest.raises(InputError, match=r"1\.22 pixels on the display 'headset' of 7\.3 pixels") as said:
        require_drawable(RING, coarse)
    named = re.search(r"give ([0-9.]+) arcmin", str(said.value))
    assert named is not None
    smallest = float(named[1])
    assert smallest == pytest.approx(2 / 7.3 * 60, abs=0.011)
    require_drawable(dataclasses.replace(RING, gap=smallest), coarse)
    with pytest.raises(InputError):
        require_drawable(dataclasses.replace(RING, gap=smallest - 0.02), coarse)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gap": 0.0}, "gap must be above 0"),
        ({"gap": 601.0}, "at most 600 arcmin, got 601"),
        ({"contrast": 0.0}, "contrast must be -1 or more and not 0"),
        ({"contrast": -1.1}, "got -1.1"),
        ({"orientation": 30}, "one of 0, 45, 90, 135, 180, 225, 270, 315 deg, got 30"),
        ({"altitude": 91.0}, "altitude from -90 to 90"),
        ({"azimuth": math.nan}, "finite azimuth"),
    ],
)
def test_a_ring_that_cannot_be_is_refused(change, said) -> None:
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(RING, **change)


# --- ring light

LAB = Display("lab", 100.0, 0.5, 2.2, pixels_per_degree=60.0)

contrasts = st.floats(-1.0, 3.0)

backgrounds = st.floats(0.5, 100.0)

factors = st.floats(0.05, 1.0)


@pytest.mark.parametrize(
    ("contrast", "background", "factor", "left"),
    [
        (-0.5, 8.0, 0.25, -0.5),  # 2 and 1 cd/m^2
        (-0.9, 8.0, 0.25, -0.75),  # 2 and 0.2, drawn as 0.5
        (-0.5, 1.0, 0.25, 0.0),  # 0.25 and 0.125: both black
        (3.0, 1.0, 0.25, 1.0),  # 0.25, drawn as 0.5, and 1
        (3.0, 8.0, 0.25, 3.0),
    ],
)
def test_by_hand(contrast, background, factor, left) -> None:
    assert shown_contrast(contrast, background, factor, LAB, by_pixels=True) == pytest.approx(left)


@given(contrasts, backgrounds, factors)
def test_a_backlight_and_a_display_without_black_leave_the_contrast_as_it_is(
    contrast, background, factor
) -> None:
    deep = dataclasses.replace(LAB, black_level=0.0)
    assert shown_contrast(contrast, background, factor, LAB, by_pixels=False) == contrast
    assert shown_contrast(contrast, background, factor, deep, by_pixels=True) == contrast


@given(contrasts, backgrounds, factors)
def test_the_floor_takes_contrast_away_and_never_turns_it_round(contrast, background, factor) -> None:
    left = shown_contrast(contrast, background, factor, LAB, by_pixels=True)
    assert left * contrast >= 0
    assert abs(left) <= abs(contrast) + 1e-9


@pytest.mark.parametrize("factor", [1.0, 0.4, 0.1])
@pytest.mark.parametrize("level", [10, 25, 60, 200])
def test_it_is_the_contrast_that_the_renderer_draws(level, factor) -> None:
    """Two grey levels of 8 bits, dimmed and drawn as `stimuli.dithering` says; that table has the floor."""
    full, dimmed = level_luminance(256, 1.0, LAB), level_luminance(256, factor, LAB)
    asked = full[level // 2] / full[level] - 1
    drawn = dimmed[level // 2] / dimmed[level] - 1
    assert shown_contrast(asked, full[level], factor, LAB, by_pixels=True) == pytest.approx(drawn, abs=1e-9)


# --- ring places

LAB_OF_RING_PLACES = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=24.0)

EYE = Camera((0.0, 0.0, 1.5), azimuth=0.0)


def grey(_: np.random.Generator, size: int) -> np.ndarray:
    return np.full((size, size, 3), 0.5, np.float32)


def holes(_: np.random.Generator, size: int) -> np.ndarray:
    return np.full((size, size, 4), 0.5, np.float32)


@pytest.fixture(scope="module")
def room() -> Scene:
    model = SceneModel("room", seed=1)
    plain, net = Material("plain", grey, 1.0), Material("net", holes, 1.0, cutout=True)
    low, high = -4.0, 4.0
    model.quad([[low, 4, 0], [high, 4, 0], [high, 4, 3], [low, 4, 3]], plain)
    model.lamp([[4, 4, 0], [4, -4, 0], [4, -4, 3], [4, 4, 3]], 60.0)
    model.quad([[high, -4, 0], [low, -4, 0], [low, -4, 3], [high, -4, 3]], net)
    model.quad([[low, -4, 0], [high, -4, 0], [high, 4, 0], [low, 4, 0]], plain)
    model.box([0.9, 2.0, 0.0], [1.1, 2.2, 3.0], plain)
    return model.build()


def ring_towards(x: float, y: float, z: float) -> Ring:
    azimuth = math.degrees(math.atan2(x, y))
    return Ring(azimuth, math.degrees(math.atan2(z - 1.5, math.hypot(x, y))), 10.0, -0.3, 0)


@pytest.mark.slow
def test_rays_meet_the_nearest_surface_at_its_distance(room) -> None:
    """North wall at 4 m; the pillar's face at 2 m, so 2 sqrt(1 + (1/2)^2) m away; the open west."""
    directions = np.array(
        [direction_of(0, 0), direction_of(math.degrees(math.atan2(1, 2)), 0), direction_of(270, 0)]
    )
    distances, met = met_from(room.patches, EYE.position, directions)
    np.testing.assert_allclose(distances[:2], [4.0, math.sqrt(5)], rtol=1e-6)
    assert met[2] == NOTHING
    assert distances[2] == np.inf


@pytest.mark.slow
@pytest.mark.parametrize(
    ("towards", "suits"),
    [
        ((-1.0, 4.0, 1.5), True),  # the wall
        ((1.0, 2.0, 1.5), True),  # the pillar, 0.2 m wide; twice the ring's radius is 0.83 degrees, 0.03 m
        ((0.9, 2.0, 1.5), False),  # its corner: 0.08 m deep there
        ((1.1, 2.0, 1.5), False),  # its edge, half before the wall behind
        ((4.0, 0.5, 1.5), False),  # the lamp
        ((-4.0, 0.5, 1.5), False),  # the sky
        ((0.5, -4.0, 1.5), False),  # the net
        ((-1.0, 4.0, 2.98), False),  # the wall's upper edge
        ((0.0, 3.0, 0.0), True),  # the floor: its cosine is 1.5 / 3.35 = 0.45
    ],
)
def test_a_ring_lies_on_one_surface_that_neither_shines_nor_has_holes(room, towards, suits) -> None:
    assert chosen_places.lies_on_a_surface(room, EYE, ring_towards(*towards)) == suits


@pytest.mark.slow
def test_a_surface_that_is_looked_at_too_flatly_does_not_count(room) -> None:
    """From 0.2 m above the floor, the floor 1.5 m away is seen at a cosine of 0.13."""
    low = dataclasses.replace(EYE, position=(0.0, 0.0, 0.2))
    altitude = -math.degrees(math.atan2(0.2, 1.5))
    assert not chosen_places.lies_on_a_surface(room, low, Ring(340.0, altitude, 10.0, -0.3, 0))


class Lit:
    """Light that goes with the azimuth: the same to both sides, uneven beyond 30 degrees."""

    def surroundings(self, ring: Ring, position: object) -> Surroundings:
        level = 5.0 + abs(ring.azimuth)
        return Surroundings((level, level, level), 0.1 if abs(ring.azimuth) < 30 else 0.9)


def chosen(
    room: Scene, seed: int = 3
) -> tuple[chosen_places.RingPlace, chosen_places.RingPlace, chosen_places.RingPlace]:
    return chosen_places.choose_places(room, Lit(), EYE, np.random.default_rng(seed))


def angle_between(first: chosen_places.RingPlace, second: chosen_places.RingPlace) -> float:
    """Return the angle between two places, by the cosine rule on the sphere [deg]."""
    a, b = math.radians(first.altitude), math.radians(second.altitude)
    turn = math.radians(first.azimuth - second.azimuth)
    return math.degrees(math.acos(math.sin(a) * math.sin(b) + math.cos(a) * math.cos(b) * math.cos(turn)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_places_are_apart_alike_and_where_they_may_be(room, seed) -> None:
    first, second, practice = chosen(room, seed=seed)
    assert angle_between(first, second) >= 20 - 1e-9
    assert min(angle_between(practice, first), angle_between(practice, second)) >= 12 - 1e-9
    ahead = chosen_places.RingPlace(0.0, 0.0, 1.0, 0.0)
    for place in (first, second, practice):
        assert 10 <= angle_between(ahead, place) <= 45
        assert abs(place.azimuth) < 30  # evenly lit
        assert chosen_places.lies_on_a_surface(room, EYE, Ring(place.azimuth, place.altitude, 10.0, -0.3, 0))
    assert first.luminance / second.luminance == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_the_place_for_practice_suits_a_ring_of_twice_the_size(room) -> None:
    """Its surroundings reach twice as far; where light is even for small rings alone, no place suits."""
    for seed in range(4):
        practice = chosen(room, seed=seed)[2]
        assert chosen_places.lies_on_a_surface(
            room, EYE, Ring(practice.azimuth, practice.altitude, 20.0, -0.3, 0)
        )

    class UnevenForLarge(Lit):
        def surroundings(self, ring: Ring, position: object) -> Surroundings:
            around = super().surroundings(ring, position)
            return around if ring.gap < 20 else dataclasses.replace(around, variation=0.9)

    with pytest.raises(InputError, match=r"10 arcmin, 0 of them one of 20; .* 12 from both.* \d+ on no fl"):
        chosen_places.choose_places(room, UnevenForLarge(), EYE, np.random.default_rng(3))


@pytest.mark.slow
def test_the_same_seed_gives_the_same_places_and_another_one_others(room) -> None:
    assert chosen(room) == chosen(room)
    assert chosen(room) != chosen(room, seed=4)


@pytest.mark.slow
def test_where_no_three_places_are_found_one_line_says_so(room, monkeypatch) -> None:
    for rules in (
        {"APART": 100.0},
        {"PRACTICE_APART": 100.0},
        {"DARKEST": 40.0},
        {"SMALLEST_ECCENTRICITY": 80.0, "LARGEST_ECCENTRICITY": 89.0},
    ):
        said = r"room: around \(0, 0, 1\.5\) m, towards 0 degrees, .* another keypoint"
        with monkeypatch.context() as patch:
            for name, value in rules.items():
                patch.setattr(chosen_places, name, value)
            with pytest.raises(InputError, match=said):
                chosen(room)


@pytest.fixture(scope="module")
def context() -> Iterator[Any]:
    context = offscreen_context()
    yield context
    context.release()


@pytest.mark.slow
def test_in_a_picture_of_the_room_the_places_are_as_bright_as_they_say(context, room) -> None:
    """Drawn with the room's own light: read at each place's pixel, which is within the texture's evenness."""
    renderer = SceneRenderer(context, room, (240, 240), None)
    rings = RingScene(context, renderer, LAB_OF_RING_PLACES)
    for place in chosen_places.choose_places(room, rings, EYE, np.random.default_rng(1)):
        rings.draw(Camera(EYE.position, place.azimuth, place.altitude, focal_length=1375.0))
        middle = rings.pixel_values()[115:125, 115:125] / 65535
        luminance = 100 * (middle**2.2).mean()
        assert luminance == pytest.approx(place.luminance, rel=max(0.03, 2 * place.variation))


# --- ring place files

MEASURED = "basement"  # of both scenes, its scene is drawn the sooner

ROUNDING = 0.02  # [deg] the files have hundredths


def angle(first: tuple[float, float], second: tuple[float, float]) -> float:
    return math.degrees(math.acos(float(direction_of(*first) @ direction_of(*second))))


def rings_of(keypoint: KeypointRings, point: Keypoint) -> list[tuple[Ring, float]]:
    """Return the rings that may lie around a keypoint, practice's last, each with its recorded luminance."""
    azimuths = (*keypoint.azimuths, keypoint.practice_azimuth)
    altitudes = (*keypoint.altitudes, keypoint.practice_altitude)
    gaps = (chosen_places.GAP, chosen_places.GAP, PRACTICE_SIZE * chosen_places.GAP)
    rings = [
        Ring(point.azimuth + azimuth, altitude, gap, chosen_places.CONTRAST, 0)
        for azimuth, altitude, gap in zip(azimuths, altitudes, gaps, strict=True)
    ]
    return list(zip(rings, (*keypoint.luminances, keypoint.practice_luminance), strict=True))


@pytest.mark.slow
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
        assert angle(first, second) >= chosen_places.APART - ROUNDING
        assert min(angle(practice, first), angle(practice, second)) >= chosen_places.PRACTICE_APART - ROUNDING
        for ring in rings:
            eccentricity = angle((point.azimuth, point.altitude), (ring.azimuth, ring.altitude))
            assert eccentricity >= chosen_places.SMALLEST_ECCENTRICITY - ROUNDING
            assert eccentricity <= chosen_places.LARGEST_ECCENTRICITY + ROUNDING
            assert abs(ring.altitude) <= chosen_places.HIGHEST + ROUNDING
            assert chosen_places.lies_on_a_surface(scene, camera, ring), each.keypoint


@pytest.mark.slow
def test_around_its_places_a_scene_is_as_bright_and_as_even_as_was_recorded() -> None:
    """All places of one path, in the very light that they were chosen in.

    That light is computed at the first run on a machine, which takes about a minute, and stored in the cache.
    """
    path = path_named(MEASURED)
    context = offscreen_context()
    try:
        renderer = SceneRenderer(context, scene_named(path.scene), chosen_places.PICTURE_SIZE)
        scene = RingScene(context, renderer, chosen_places.DISPLAY)
        for each in ring_places(MEASURED).keypoints:
            point = path.keypoint(each.keypoint)
            for ring, recorded in rings_of(each, point):
                around = scene.surroundings(ring, point.position)
                assert around.luminance == pytest.approx(recorded, rel=0.03), each.keypoint
                assert around.luminance >= chosen_places.DARKEST * 0.97
                assert around.variation <= chosen_places.LARGEST_VARIATION * 1.03
    finally:
        context.release()


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["practice_azimuth_deg", "practice_luminance_cd_m2"])
def test_a_file_without_a_place_for_practice_is_refused(tmp_path, missing) -> None:
    content = json.loads((PATHS / f"library{SUFFIX}").read_text())
    del content["keypoints"][0][missing]
    (tmp_path / "old.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=missing):
        read_json_record(RingPlaces, tmp_path / "old.json")


@pytest.mark.slow
def test_a_path_without_rings_is_refused_with_those_that_have_some() -> None:
    with pytest.raises(InputError, match=r"no rings are searched for along 'attic'; there is basement, gym"):
        ring_places("attic")


@pytest.mark.slow
def test_at_keypoints_that_are_not_listed_rings_are_chosen_where_they_suit(room, monkeypatch) -> None:
    """From the middle of the room they do, in light of 30 cd/m^2; from right before its wall they do not."""
    monkeypatch.setattr(chosen_places, "scene_of", lambda path: room)
    monkeypatch.setattr(RingScene, "surroundings", lambda *_: Surroundings((30.0, 30.0, 30.0), 0.1))
    at = [Keypoint("far", 0.0, (0.0, 0.0, 1.5), 0.0, 0.0), Keypoint("near", 1.0, (-3.0, 3.9, 1.5), 0.0, 0.0)]
    path = CameraPath("own", "room.glb", 1.0, tuple(at))
    monkeypatch.setattr(chosen_places, "SceneRenderer", lambda *given: SceneRenderer(*given, None))
    assert [each.keypoint for each in chosen_places.places_along(path).keypoints] == ["far"]
    with pytest.raises(InputError, match=r"room: around .* take another keypoint"):
        chosen_places.places_along(dataclasses.replace(path, places=("near",)))
