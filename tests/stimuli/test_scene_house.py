"""The house: textures join themselves, rooms are there and lit as said, nothing blocks the paths."""

from __future__ import annotations

import numpy as np
import pytest
from scene_places import place_at

from evenlight.stimuli.scenes.camera import EYE_HEIGHT, Camera
from evenlight.stimuli.scenes.camera_path import CameraPath, path_named
from evenlight.stimuli.scenes.graphics import offscreen_context
from evenlight.stimuli.scenes.house import materials
from evenlight.stimuli.scenes.house.house import house
from evenlight.stimuli.scenes.renderer import SceneRenderer
from evenlight.stimuli.scenes.scene import Floats, Material, Scene

pytestmark = pytest.mark.slow

PATHS = ("living_room", "basement", "house")
CLEARANCE = 0.2  # [m] that an eye keeps from everything
SIZE = 128  # of the textures [pixels]
REC_709 = np.array([0.2126, 0.7152, 0.0722])
MATERIALS = {m.name: m for m in vars(materials).values() if isinstance(m, Material)}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return house(1)


@pytest.mark.parametrize("name", MATERIALS)
def test_a_texture_is_an_albedo_whose_opposite_edges_meet(name):
    material = MATERIALS[name]
    picture = material.texture(np.random.default_rng(4), SIZE)
    assert picture.shape == (SIZE, SIZE, 4 if material.cutout else 3)
    assert picture.dtype == np.float32
    assert picture.min() >= 0
    assert picture.max() <= 1
    for turned in (picture, picture.swapaxes(0, 1)):
        steps = np.abs(np.diff(turned, axis=0)).mean(axis=(1, 2))
        # From the last row to the first is no larger a step than some step within the picture.
        assert np.abs(turned[0] - turned[-1]).mean() <= 1.1 * steps.max()


@pytest.mark.parametrize("name", ["grass", "books", "rug", "mill painting"])
def test_a_texture_is_the_same_for_the_same_seed_and_another_for_another(name):
    first, again, other = (MATERIALS[name].texture(np.random.default_rng(seed), SIZE) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).mean() > 0.001


def test_the_same_seed_builds_the_same_house(scene):
    again = house(1)
    for column in ("origin", "along", "across", "uvs", "tint", "material"):
        np.testing.assert_array_equal(getattr(again.patches, column), getattr(scene.patches, column))


def test_another_seed_keeps_the_walls_and_rearranges_the_books(scene):
    other = house(2)
    names = [material.name for material in scene.materials]

    def pieces(of: Scene, name: str) -> Floats:
        chosen = of.patches.material == [m.name for m in of.materials].index(name)
        return of.patches.origin[chosen]

    assert {m.name for m in other.materials} == set(names)
    np.testing.assert_array_equal(pieces(other, "hall wall"), pieces(scene, "hall wall"))
    books = pieces(other, "books"), pieces(scene, "books")
    assert books[0].shape != books[1].shape or np.abs(books[0] - books[1]).max() > 0.01


def test_the_house_is_light_enough_to_draw_in_software(scene):
    triangles = int((2 - scene.patches.triangle).sum())
    assert triangles <= 250_000


def test_every_room_has_its_name_and_is_passed(scene):
    passed = {
        place_at(scene, np.array(path_named(name).camera(t).position))
        for name in PATHS
        for t in np.arange(0, path_named(name).duration, 0.5)
    }
    rooms = {
        "garden",
        "front garden",
        "terrace",
        "porch",
        "living room",
        "kitchen",
        "hallway",
        "stairs",
        "basement",
    }
    assert rooms <= {place.name for place in scene.places}
    assert rooms <= passed


@pytest.mark.parametrize("name", PATHS)
def test_an_eye_on_the_path_keeps_its_distance_from_everything(scene, name):
    path = path_named(name)
    eyes = np.array([path.camera(t).position for t in np.arange(0, path.duration, 0.2)])
    nearest = _clearance(scene, eyes)
    worst = int(nearest.argmin())
    assert nearest[worst] >= CLEARANCE, f"{nearest[worst]:.2f} m at {0.2 * worst:.1f} s, {eyes[worst]}"


def _clearance(scene: Scene, eyes: Floats) -> Floats:
    """Return each eye's distance from the nearest patch, or 0.5 m where none is nearer."""
    p = scene.patches
    corners = np.stack(
        [p.origin, p.origin + p.along, p.origin + p.across, p.origin + p.along + p.across], axis=1
    )
    corners[p.triangle, 3] = p.origin[p.triangle]
    low, high = corners.min(axis=1) - 0.5, corners.max(axis=1) + 0.5
    found = np.full(len(eyes), 0.5)
    for k, eye in enumerate(eyes):
        near = np.flatnonzero(((low <= eye) & (eye <= high)).all(axis=1))
        for n in near:
            found[k] = min(
                found[k], _distance(eye - p.origin[n], p.along[n], p.across[n], bool(p.triangle[n]))
            )
    return found


def _distance(point: Floats, along: Floats, across: Floats, triangle: bool) -> float:
    """Return a point's distance from a parallelogram or triangle at the origin."""
    edges = np.stack([along, across], axis=1)
    (s, t), *_ = np.linalg.lstsq(edges, point, rcond=None)
    if s >= 0 and t >= 0 and (s + t <= 1 if triangle else s <= 1 and t <= 1):
        return float(np.linalg.norm(point - edges @ [s, t]))
    ends = [(0 * along, along), (0 * along, across)]
    ends += [(along, across)] if triangle else [(along, along + across), (across, along + across)]
    return min(_to_segment(point, start, stop) for start, stop in ends)


def _to_segment(point: Floats, start: Floats, stop: Floats) -> float:
    share = np.clip((point - start) @ (stop - start) / ((stop - start) @ (stop - start)), 0, 1)
    return float(np.linalg.norm(point - start - share * (stop - start)))


def test_the_distance_from_a_parallelogram_by_hand():
    along, across = np.array([2.0, 0, 0]), np.array([0, 1.0, 0])
    assert _distance(np.array([1.5, 0.9, 0.3]), along, across, triangle=False) == pytest.approx(0.3)
    assert _distance(np.array([5.0, 5.0, 0.0]), along, across, triangle=False) == pytest.approx(
        5.0
    )  # 3, 4, 5
    assert _distance(np.array([2.0, 1.0, 0.0]), along, across, triangle=True) == pytest.approx(2 / 5**0.5)


@pytest.fixture(scope="module")
def luminances(scene) -> dict[str, float]:
    """Return the mean luminance [cd/m^2] of the frames at all keypoints, as shown.

    In the light that is kept for all who draw the house: another would take as long again.
    """
    renderer = SceneRenderer(offscreen_context(), scene, (160, 90))
    shown = {}
    for path in (path_named(name) for name in PATHS[:2]):
        for point in path.keypoints:
            renderer.render(_camera(path, point.time))
            renderer.encode()
            light = (renderer.pixel_values() / 65535) ** 2.2 * 100
            shown[f"{path.name}: {point.name}"] = float(light.mean(axis=(0, 1)) @ REC_709)
    return shown


def _camera(path: CameraPath, moment: float) -> Camera:
    return path.camera(moment)


@pytest.mark.parametrize(
    ("view", "low", "high"),
    [
        ("living_room: garden", 20, 80),
        ("basement: porch", 15, 80),
        ("living_room: living room", 4, 40),
        ("living_room: kitchen", 4, 40),
        ("living_room: hallway", 1, 12),
        ("basement: basement", 0.3, 3),
        ("basement: laundry", 0.3, 3),
    ],
)
def test_outdoors_is_bright_rooms_are_lit_and_the_basement_is_dim(luminances, view, low, high):
    assert low <= luminances[view] <= high


def test_sunlit_outdoors_and_the_basement_differ_by_1_5_log_units(luminances):
    dim = np.mean([luminances[f"basement: {name}"] for name in ("basement", "jars", "laundry")])
    assert np.log10(luminances["basement: front garden"] / dim) >= 1.5


@pytest.mark.parametrize("name", PATHS[:2])
def test_the_mean_luminance_varies_by_a_log_unit_along_each_path(luminances, name):
    along = [light for view, light in luminances.items() if view.startswith(name)]
    assert np.log10(max(along) / min(along)) >= 1


def test_eyes_are_at_eye_height_on_the_ground_floor(scene):
    for point in path_named("living_room").keypoints:
        if place_at(scene, np.array(point.position)) in ("living room", "kitchen", "hallway"):
            assert point.position[2] == pytest.approx(EYE_HEIGHT)
