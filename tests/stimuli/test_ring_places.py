"""Places of rings: on a surface, evenly lit, apart, alike; in a room whose every wall is known.

The room is a box seen from its middle: the north wall is plain, the east wall a lamp, the south wall a net,
the west open to the sky, and a pillar stands before the north wall.
"""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from example_scripts import example_script

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.rings.landolt import Ring, Surroundings
from evenlight.stimuli.rings.ring_scene import NOTHING, RingScene, seen_along
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Scene, direction_of

pytestmark = pytest.mark.slow

ring_places = example_script("choose_ring_places")

LAB = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=24.0)
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


def test_rays_meet_the_nearest_surface_at_its_distance(room) -> None:
    """North wall at 4 m; the pillar's face at 2 m, so 2 sqrt(1 + (1/2)^2) m away; the open west."""
    directions = np.array(
        [direction_of(0, 0), direction_of(math.degrees(math.atan2(1, 2)), 0), direction_of(270, 0)]
    )
    distances, met = seen_along(room.patches, EYE.position, directions)
    np.testing.assert_allclose(distances[:2], [4.0, math.sqrt(5)], rtol=1e-6)
    assert met[2] == NOTHING
    assert distances[2] == np.inf


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
    assert ring_places.lies_on_a_surface(room, EYE, ring_towards(*towards)) == suits


def test_a_surface_that_is_looked_at_too_flatly_does_not_count(room) -> None:
    """From 0.2 m above the floor, the floor 1.5 m away is seen at a cosine of 0.13."""
    low = dataclasses.replace(EYE, position=(0.0, 0.0, 0.2))
    altitude = -math.degrees(math.atan2(0.2, 1.5))
    assert not ring_places.lies_on_a_surface(room, low, Ring(340.0, altitude, 10.0, -0.3, 0))


class Lit:
    """Light that goes with the azimuth: the same to both sides, uneven beyond 30 degrees."""

    def surroundings(self, ring: Ring, position: object) -> Surroundings:
        level = 5.0 + abs(ring.azimuth)
        return Surroundings((level, level, level), 0.1 if abs(ring.azimuth) < 30 else 0.9)


def chosen(
    room: Scene, seed: int = 3
) -> tuple[ring_places.RingPlace, ring_places.RingPlace, ring_places.RingPlace]:
    return ring_places.choose_places(room, Lit(), EYE, np.random.default_rng(seed))


def angle_between(first: ring_places.RingPlace, second: ring_places.RingPlace) -> float:
    """Return the angle between two places, by the cosine rule on the sphere [deg]."""
    a, b = math.radians(first.altitude), math.radians(second.altitude)
    turn = math.radians(first.azimuth - second.azimuth)
    return math.degrees(math.acos(math.sin(a) * math.sin(b) + math.cos(a) * math.cos(b) * math.cos(turn)))


@pytest.mark.parametrize("seed", range(4))
def test_the_places_are_apart_alike_and_where_they_may_be(room, seed) -> None:
    first, second, practice = chosen(room, seed=seed)
    assert angle_between(first, second) >= 20 - 1e-9
    assert min(angle_between(practice, first), angle_between(practice, second)) >= 12 - 1e-9
    ahead = ring_places.RingPlace(0.0, 0.0, 1.0, 0.0)
    for place in (first, second, practice):
        assert 10 <= angle_between(ahead, place) <= 45
        assert abs(place.azimuth) < 30  # evenly lit
        assert ring_places.lies_on_a_surface(room, EYE, Ring(place.azimuth, place.altitude, 10.0, -0.3, 0))
    assert first.luminance / second.luminance == pytest.approx(1.0, abs=0.1)


def test_the_place_for_practice_suits_a_ring_of_twice_the_size(room) -> None:
    """Its surroundings reach twice as far; where light is even for small rings alone, no place suits."""
    for seed in range(4):
        practice = chosen(room, seed=seed)[2]
        assert ring_places.lies_on_a_surface(
            room, EYE, Ring(practice.azimuth, practice.altitude, 20.0, -0.3, 0)
        )

    class UnevenForLarge(Lit):
        def surroundings(self, ring: Ring, position: object) -> Surroundings:
            around = super().surroundings(ring, position)
            return around if ring.gap < 20 else dataclasses.replace(around, variation=0.9)

    with pytest.raises(InputError, match=r"suit a ring of 10 arcmin, 0 of them one of 20; .* 12 from both"):
        ring_places.choose_places(room, UnevenForLarge(), EYE, np.random.default_rng(3))


def test_the_same_seed_gives_the_same_places_and_another_one_others(room) -> None:
    assert chosen(room) == chosen(room)
    assert chosen(room) != chosen(room, seed=4)


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
                patch.setattr(ring_places, name, value)
            with pytest.raises(InputError, match=said):
                chosen(room)


@pytest.fixture(scope="module")
def context() -> Iterator[Any]:
    context = offscreen_context()
    yield context
    context.release()


def test_in_a_picture_of_the_room_the_places_are_as_bright_as_they_say(context, room) -> None:
    """Drawn with the room's own light: read at each place's pixel, which is within the texture's evenness."""
    renderer = SceneRenderer(context, room, (240, 240), None)
    rings = RingScene(context, renderer, LAB)
    for place in ring_places.choose_places(room, rings, EYE, np.random.default_rng(1)):
        rings.draw(Camera(EYE.position, place.azimuth, place.altitude, focal_length=1375.0))
        middle = rings.pixel_values()[115:125, 115:125] / 65535
        luminance = 100 * (middle**2.2).mean()
        assert luminance == pytest.approx(place.luminance, rel=max(0.03, 2 * place.variation))
