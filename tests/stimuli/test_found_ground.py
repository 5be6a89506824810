"""Where one may walk in a scene of one's own is found: not through walls and tables, but up stairs."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.experiments.playback.walk import Walker, start_in, write_path
from evenlight.stimuli.scenes.content.catalogue import path_named, scene_named, scene_to_walk
from evenlight.stimuli.scenes.engine.camera_path import on_ground, walked
from evenlight.stimuli.scenes.engine.light.found_ground import found_ground
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.scene import Scene, Vector
from evenlight.stimuli.scenes.gltf.gltf_export import glb_of
from evenlight.stimuli.scenes.gltf.gltf_file import read_gltf
from evenlight.stimuli.scenes.gltf.gltf_scene import scene_from_gltf

GREY = Material("grey", lambda rng, size: np.full((size, size, 3), 0.5, np.float32), 1.0)
EYE = 1.65
TOLD = (0.15, 0.25)  # [m] that are kept from walls
TABLE = (2.0, 2.0, 0.0), (3.5, 3.0, 0.75)
Box = tuple[Vector, Vector]


def room(*boxes: Box, height: float = 2.8) -> SceneModel:
    """6 m by 5 m between walls of 0.2 m, with a lamp under a ceiling that one could stand on, too."""
    model = SceneModel("room", 1)
    for low, high in (
        ((-0.2, -0.2, -0.2), (6.2, 5.2, 0.0)),
        ((-0.2, -0.2, height), (6.2, 5.2, height + 0.2)),
        ((-0.2, -0.2, 0.0), (6.2, 0.0, height)),
        ((-0.2, 5.0, 0.0), (6.2, 5.2, height)),
        ((-0.2, 0.0, 0.0), (0.0, 5.0, height)),
        ((6.0, 0.0, 0.0), (6.2, 5.0, height)),
        *boxes,
    ):
        model.box(low, high, GREY)
    model.lamp([(2, 2, height - 0.1), (2, 3, height - 0.1), (3, 3, height - 0.1), (3, 2, height - 0.1)], 60.0)
    return model


def with_ground(model: SceneModel, *eyes: Vector) -> Scene:
    scene = model.build()
    return replace(scene, walkable=(found_ground(scene, eyes),))


def after(place: Vector, step: tuple[float, float], scene: Scene) -> Vector:
    for _ in range(200):
        place = walked(place, step, scene)
    return place


@pytest.mark.parametrize(
    ("step", "axis", "edge"),
    [((0.1, 0.0), 0, 6.0), ((0.0, 0.1), 1, 5.0), ((-0.1, 0.0), 0, 3.5), ((0.0, -0.1), 1, 0.0)],
)
def test_a_walker_stops_before_walls_and_a_table(step, axis, edge):
    """From beside the table, which is west."""
    reached = after((4.5, 2.5, EYE), step, with_ground(room(TABLE)))
    assert TOLD[0] - 0.01 <= abs(reached[axis] - edge) <= TOLD[1] + 0.05
    assert reached[2] == pytest.approx(EYE, abs=1e-4)


@pytest.mark.parametrize(("gap", "passed"), [(0.3, False), (0.7, True)])
@pytest.mark.parametrize("thick", [0.1, 0.0])
def test_a_doorway_lets_a_body_through_and_a_gap_does_not(gap, passed, thick):
    """Walls of no thickness, too: what is seen of them from above is nothing."""
    model, at = room(), 3.0
    for south, north in ((0.0, 1.0), (1.0 + gap, 5.0)):
        if thick:
            model.box((at, south, 0.0), (at + thick, north, 2.8), GREY)
        else:
            model.quad([(at, south, 0), (at, north, 0), (at, north, 2.8), (at, south, 2.8)], GREY)
    scene = with_ground(model, (1.5, 1.0 + gap / 2, EYE))
    assert (after((1.5, 1.0 + gap / 2, EYE), (0.1, 0.0), scene)[0] > 4.0) == passed


def test_stairs_lead_to_the_next_storey_and_a_ledge_does_not():
    """14 steps of 0.2 m by 0.25 m go up to 2.8 m, the floor above; the ledge is as high as two of them."""
    stairs = [((1.5 + 0.25 * k, 0.0, 0.0), (1.75 + 0.25 * k, 1.4, 0.2 * (k + 1))) for k in range(14)]
    above = [((0.0, 2.0, 2.6), (6.0, 5.0, 2.8)), ((5.0, 0.0, 2.6), (6.0, 2.0, 2.8))]
    ledge = (0.0, 3.0, 0.0), (2.0, 5.0, 0.4)
    scene = with_ground(room(*stairs, *above, ledge, height=5.6), (0.7, 0.7, EYE))
    assert scene.walkable[0].heights(4.0, 3.0) == pytest.approx([2.8, 0.0], abs=1e-3)
    assert scene.walkable[0].heights(1.0, 4.0) == pytest.approx([2.8], abs=1e-3)
    upstairs = after((0.7, 0.7, EYE), (0.1, 0.0), scene)
    assert upstairs == pytest.approx((5.8, 0.7, 2.8 + EYE), abs=0.1)
    half_way = walked(
        (1.2, 0.7, EYE), (2.0, 0.0), scene
    )  # to 3.2 m: the seventh step ends at 3.25 m, 1.4 m up
    assert half_way == pytest.approx((3.2, 0.7, 1.4 + EYE), abs=0.1)
    assert after((1.0, 2.5, EYE), (0.0, 0.1), scene)[1] < 3.0


def test_a_walk_begins_in_the_middle_of_the_floor_under_the_roof():
    """The roof is larger. Table and walls are 2.5 m apart at most: nothing is over 1.25 m from all."""
    x, y, floor = with_ground(room(TABLE)).walkable[0].middle
    beyond = [max(low - at, at - high, 0) for at, low, high in zip((x, y), *TABLE, strict=False)]
    assert min(x, y, 6 - x, 5 - y, math.hypot(*beyond)) >= 0.9
    assert floor == pytest.approx(0.0, abs=1e-4)


def test_ground_is_found_around_the_first_eye_in_the_scene_whatever_was_before():
    """A camera may come from 200 m outside."""
    scene = with_ground(room(), (200.0, 2.0, EYE), (3.0, 2.0, EYE))
    assert on_ground((3.0, 2.0, EYE), scene)


def test_an_eye_a_hair_beside_stated_ground_stands_on_it(tmp_path):
    beside = {"low_m": [2.01, 1.0], "high_m": [5.0, 4.0], "floor_m": 0.0}
    scene, path = scene_to_walk(path_in(tmp_path, walkable=[beside]))
    eye = replace(path.keypoints[0], position=(2.0, 2.0, 1.5))
    assert start_in(scene, replace(path, keypoints=(eye, path.keypoints[1]))).position == (2.0, 2.0, EYE)


def test_ground_of_a_steep_slope_is_refused(tmp_path):
    steep = {"low_m": [0, 0], "high_m": [1, 1], "floor_m": 0.0, "slope": [30, 0]}
    with pytest.raises(InputError, match="walkable 1: need slopes of 1 at most"):
        path_named(path_in(tmp_path, walkable=[steep]))


def test_without_a_floor_one_line_says_what_is_one():
    model = SceneModel("wall", 1)
    model.quad([(0, 0, 0), (3, 0, 0), (3, 0, 3), (0, 0, 3)], GREY)
    with pytest.raises(InputError, match=r"wall: found no floor to walk on: .* `walkable` in a camera path"):
        found_ground(model.build())


def path_in(folder: Path, **more: object) -> str:
    (folder / "room.glb").write_bytes(glb_of(room(TABLE).build()))
    points = [
        {"name": name, "time_s": time, "position_m": at, "azimuth_deg": 90, "altitude_deg": 0}
        for name, time, at in (("outside", 0, [9, 9, 9]), ("inside", 1, [1, 1, 1.5]))
    ]
    file = folder / "walk.json"
    file.write_text(json.dumps({"scene": "room.glb", "duration_s": 1, "keypoints": points} | more))
    return str(file)


def test_a_walk_on_a_path_begins_at_its_first_keypoint_over_ground_and_its_way_is_one(tmp_path, monkeypatch):
    told: list[str] = []
    monkeypatch.setattr("evenlight.stimuli.scenes.content.catalogue.note", told.append)
    file = path_in(tmp_path)
    scene, path = scene_to_walk(file)
    walker = start_in(scene, path)
    assert walker == Walker(pytest.approx((1.0, 1.0, EYE), abs=1e-4), 90.0)
    assert told == ["walk: keypoints that are not over the ground to walk on: outside"]
    (tmp_path / "ways").mkdir()
    write_path(tmp_path / "ways" / "way.json", file, [(0.0, walker), (1.0, walker)], path)
    again = path_named(str(tmp_path / "ways" / "way.json"))
    assert Path(again.scene).samefile(tmp_path / "room.glb")
    assert json.loads((tmp_path / "ways" / "way.json").read_text())["scene"] == "../room.glb"


def test_ground_that_a_path_states_counts_in_place_of_what_is_found(tmp_path):
    stated = {"low_m": [4, 0], "high_m": [6, 5], "floor_m": 0.5, "slope": [0.1, 0]}
    scene, path = scene_to_walk(path_in(tmp_path, walkable=[stated]))
    assert scene.walkable[0].heights(5, 1) == pytest.approx([0.6])
    assert start_in(scene, path).position == pytest.approx((5.0, 2.5, 0.6 + EYE))
    with pytest.raises(InputError, match="walkable 1: need low_m below high_m"):
        path_named(path_in(tmp_path, walkable=[stated | {"high_m": [4, 5]}]))


@pytest.mark.slow
def test_in_the_house_as_a_file_ground_is_found_where_it_is_said_to_be(tmp_path):
    """The rest lies nearer to furniture and shrubs than is kept here: 8 % of the rectangles."""
    (tmp_path / "house.glb").write_bytes(glb_of(scene_named("house")))
    scene = scene_from_gltf(read_gltf(tmp_path / "house.glb"))
    said, walk = scene_named("house").walkable, path_named("house")
    ground = found_ground(scene, [point.position for point in walk.keypoints])
    found = []
    for rectangle in said:
        across, up = (np.arange(a + 0.05, b, 0.1) for a, b in zip(rectangle.low, rectangle.high, strict=True))
        found += [
            any(abs(floor - rectangle.height(x, y)) < 0.25 for floor in ground.heights(x, y))
            for x in across
            for y in up
        ]
    assert np.mean(found) >= 0.9
    scene = replace(scene, walkable=(ground,))
    times = np.arange(0, walk.duration, 0.1)
    assert np.mean([on_ground(tuple(walk.position(time)), scene) for time in times]) >= 0.95
