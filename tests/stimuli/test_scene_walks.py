"""Camera paths go where they say, over walkable ground, and so does a walker who goes where he likes."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.content.catalogue import PATHS, path_named, scene_named
from evenlight.stimuli.scenes.engine.camera_path import check_path, on_ground, walked
from evenlight.stimuli.scenes.engine.camera_path_file import path_from_text
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.sequences import WALKS

POINTS = [
    {"name": "door", "time_s": 0, "position_m": [0, 0, 1.65], "azimuth_deg": 350, "altitude_deg": 0},
    {"name": "table", "time_s": 4, "position_m": [0, 3, 1.65], "azimuth_deg": 10, "altitude_deg": -10},
    {"name": "window", "time_s": 6, "position_m": [2, 3, 1.65], "azimuth_deg": 90, "altitude_deg": 0},
    {"name": "still", "time_s": 8, "position_m": [2, 3, 1.65], "azimuth_deg": 120, "altitude_deg": 0},
]


def path(points=POINTS, **change):
    said = {"scene": "house", "duration_s": 8, "keypoints": points, "places": ["table"]} | change
    return path_from_text("test", json.dumps(said))


def changed(index, **change):
    points = [dict(point) for point in POINTS]
    points[index] |= change
    return points


def rooms():
    """Two rooms with a door between them, and stairs down from the second."""
    model = SceneModel("rooms", 1)
    model.box([0, 0, -1], [1, 1, 0], Material("any", lambda rng, size: np.ones((size, size, 3)), 1.0))
    model.walkable((0, 0), (4, 4))
    model.walkable((4, 1.5), (5, 2.5))
    model.walkable((5, 0), (8, 4))
    model.walkable((8, 1), (12, 2), 0.0, slope=(-0.5, 0.0))
    model.walkable((12, 0), (15, 4), -2.0)
    return model.build()


ROOMS = rooms()


@pytest.mark.parametrize("name", WALKS)
def test_shipped_paths_pass_through_their_keypoints_at_their_times(name):
    walk = path_named(name)
    for point in walk.keypoints:
        camera = walk.camera(point.time)
        np.testing.assert_allclose(camera.position, point.position, atol=1e-9)
        turned = (camera.azimuth - point.azimuth + 180) % 360 - 180
        assert abs(turned) < 1e-6
        assert camera.altitude == pytest.approx(point.altitude, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", WALKS)
def test_shipped_paths_stay_on_walkable_ground_at_the_speed_of_people(name):
    walk = path_named(name)
    scene = scene_named(walk.scene)
    check_path(walk, scene)
    times = np.arange(0, walk.duration, 0.04)
    places = np.array([walk.position(time) for time in times])
    # Walkable ground keeps 0.3 m from walls, of which a curve may use a little.
    astray = [
        f"{t:.2f} s"
        for t, place in zip(times, places, strict=True)
        if not on_ground(tuple(place), scene, margin=0.05)
    ]
    assert not astray
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.04
    assert speed.max() < 3.0
    assert set(walk.places) <= {point.name for point in walk.keypoints}
    assert 30 <= walk.duration <= 240


def test_the_shorter_way_round_is_turned():
    # From 350 to 10 degrees: through north, never farther from it than at the start.
    for time in np.linspace(0, 4, 9):
        assert abs((path().camera(time).azimuth + 180) % 360 - 180) <= 10 + 1e-6


def test_a_repeated_keypoint_is_a_stop():
    np.testing.assert_allclose([path().position(t) for t in (6.0, 7.0, 8.0)], [[2, 3, 1.65]] * 3)


@given(st.floats(0, 8))
def test_a_path_does_not_swing_out_by_more_than_part_of_its_steps(time):
    # A centripetal curve stays near its points: within the box around them, widened by a tenth of a step.
    place = path().position(time)
    assert (place >= np.array([0, 0, 1.65]) - 0.35).all()
    assert (place <= np.array([2, 3, 1.65]) + 0.35).all()


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (changed(2, time_s=9), "'window' is outside the path: need a time from 0 to 8 s, got 9"),
        (changed(2, time_s=-1), "'window' is outside the path"),
        (changed(2, time_s=3), "in order of time"),
        (changed(3, time_s=7.5), "at the end, 8 s"),
        (changed(1, altitude_deg=95), "from -90 to 90 degrees, got 95"),
        (changed(1, name="desk"), "places that are names of keypoints, got table"),
        (POINTS[:1], "two keypoints or more, got 1"),
        ([{}], "there is no 'position_m'"),
    ],
)
def test_paths_that_cannot_be_walked_are_refused_in_a_line(points, said):
    with pytest.raises(InputError, match="camera path test: ") as refused:
        path(points)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_unknown_path_lists_the_known_ones():
    with pytest.raises(InputError, match=r"no camera path 'attic': there are basement, gym, house, library"):
        path_named("attic")
    assert all((PATHS / f"{name}.json").exists() for name in WALKS)


def test_a_keypoint_outside_the_scene_is_refused():
    walk = path(changed(1, position_m=[0, 30, 1.65]))
    with pytest.raises(
        InputError, match=r"keypoint 'table' at \(0, 30, 1.65\) m is outside the walkable ground"
    ):
        check_path(walk, ROOMS)


def test_a_walker_slides_along_a_wall():
    x, y, z = walked((3.9, 1.0, 1.65), (0.5, 0.3), ROOMS)
    assert 3.9 <= x <= 4.02
    assert (y, z) == (pytest.approx(1.3), 1.65)


def test_a_walker_passes_the_door_and_goes_down_the_stairs():
    place = (2.0, 1.8, 1.65)
    for _ in range(30):
        place = walked(place, (0.4, 0.0), ROOMS)
    # 2 + 30 * 0.4 = 14: past the stairs, two metres below.
    np.testing.assert_allclose(place, (14.0, 1.8, -0.35), atol=1e-9)
    half = walked((9.9, 1.5, 1.65 - 0.95), (0.1, 0.0), ROOMS)
    assert half == pytest.approx((10.0, 1.5, 0.65))


def test_a_walker_outside_stays_where_he_is():
    assert walked((30.0, 0.0, 1.65), (1.0, 1.0), ROOMS) == (30.0, 0.0, 1.65)


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=20))
def test_no_walk_leaves_the_ground(steps):
    place = (2.0, 2.0, 1.65)
    for step in steps:
        place = walked(place, step, ROOMS)
        assert on_ground(place, ROOMS)
