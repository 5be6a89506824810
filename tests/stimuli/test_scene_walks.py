"""Camera paths and walkers go over walkable ground; mouse and keys look around; cameras."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from seen_points import project

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.content.catalogue import PATHS, path_named, scene_named
from evenlight.stimuli.scenes.content.house.materials import PLINTH, STONE
from evenlight.stimuli.scenes.content.house.plan import Stairs, flight
from evenlight.stimuli.scenes.engine.camera import Camera, LookingAround, eased, steps_to
from evenlight.stimuli.scenes.engine.camera_path import check_path, on_ground, walked
from evenlight.stimuli.scenes.engine.camera_path_file import path_from_text
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Floats, Scene, direction_of
from evenlight.stimuli.sequences import WALKS

CLEARANCE = 0.2  # [m] between an eye and what it passes

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
    assert speed.max() < 2.0  # [m/s]: people stroll at 1 to 1.5 (Bohannon 1997)
    azimuths = [walk.camera(time).azimuth for time in times[::3]]
    assert np.abs((np.diff(azimuths) + 180) % 360 - 180).max() <= 45 * 0.12  # degrees in 0.12 s
    assert set(walk.places) <= {point.name for point in walk.keypoints}
    assert 30 <= walk.duration <= 240


@pytest.mark.slow
@pytest.mark.parametrize("name", WALKS)
def test_shipped_paths_keep_their_distance_from_all_there_is_in_scenes_that_a_processor_draws(name):
    walk = path_named(name)
    corners = triangles(scene_named(walk.scene).patches)
    assert len(corners) <= 250_000
    low, high = corners.min(axis=1) - CLEARANCE, corners.max(axis=1) + CLEARANCE
    for time in np.arange(0.0, walk.duration, 0.2):
        eye = walk.position(time)
        near = ((eye >= low) & (eye <= high)).all(axis=1)
        if near.any():
            assert distances(eye, corners[near]).min() >= CLEARANCE, f"{time:.1f} s, {eye}"


def triangles(patches):
    """Return the corners of all triangles, (n, 3, 3): a parallelogram is two."""
    o, a, b = patches.origin, patches.origin + patches.along, patches.origin + patches.across
    far = (a + patches.across)[~patches.triangle]
    other = np.stack([a[~patches.triangle], far, b[~patches.triangle]], axis=1)
    return np.concatenate([np.stack([o, a, b], axis=1), other])


def distances(point, corners):
    """Return how far a point is from triangles, (n,): from the plane above the inside, else an edge."""
    edges = np.roll(corners, -1, axis=1) - corners
    out = point - corners
    along = np.clip((out * edges).sum(2) / (edges**2).sum(2), 0, 1)
    from_edges = np.linalg.norm(out - along[..., None] * edges, axis=2).min(axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    inside = ((np.cross(edges, out) * normal[:, None]).sum(2) >= 0).all(axis=1)
    from_plane = np.abs((out[:, 0] * normal).sum(1)) / np.linalg.norm(normal, axis=1)
    return np.where(inside, from_plane, from_edges)


def test_the_distance_from_a_triangle_is_that_from_its_nearest_point():
    corners = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]])
    assert distances(np.array([1.0, 1, 3]), corners) == pytest.approx(3)
    assert distances(np.array([2.0, -3, 4]), corners) == pytest.approx(5)
    assert distances(np.array([-2.0, -1, 2]), corners) == pytest.approx(3)


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


# --- looking


def test_a_turn_is_slow_at_both_ends_and_never_goes_back() -> None:
    """3 s^2 - 2 s^3 has no slope at 0 and 1: a hundredth of the time does 0.0003 of the turn."""
    shares = np.array([eased(t) for t in np.linspace(0, 1, 101)])
    assert (np.diff(shares) > 0).all()
    assert shares[1] == pytest.approx(0.000298)
    np.testing.assert_allclose(shares + shares[::-1], 1.0)


def test_presses_within_a_turn_add_up() -> None:
    """Two presses 0.1 s apart: 20 degrees in all; at 0.2 s, 0.896 and 0.352 of 10 degrees."""
    looking = LookingAround(0.0, 100.0, 20.0)
    looking.turn(1, 0, now=0.0)
    looking.turn(1, 0, now=0.1)
    assert looking.direction(0.2)[0] == pytest.approx(8.96 + 3.52)
    assert looking.direction(0.35)[0] == pytest.approx(20.0)


def test_a_press_back_is_answered_at_once_at_the_limit() -> None:
    """Presses beyond the limit are not saved up."""
    looking = LookingAround(0.0, 15.0, 20.0)
    for press in range(5):
        looking.turn(-1, 0, now=float(press))
    looking.turn(1, 0, now=10.0)
    assert looking.direction(11.0) == (-5.0, 0.0)


movements = st.lists(
    st.tuples(st.booleans(), st.integers(-1, 1), st.integers(-1, 1), st.floats(-900, 900), st.floats(0, 0.4)),
    max_size=30,
)


@given(movements, st.floats(-90, 90), st.floats(1, 180))
def test_the_view_never_leaves_its_limits(moves, altitude, widest) -> None:
    looking, now = LookingAround(altitude, widest, 20.0), 0.0
    for by_key, right, up, pixels, pause in moves:
        if by_key:
            looking.turn(right, up, now)
        else:
            looking.moved(pixels, -pixels)
        now += pause
        azimuth, height = looking.direction(now)
        assert abs(azimuth) <= widest
        assert min(-60, altitude) <= height <= max(60, altitude)


@given(st.floats(-80, 80), st.floats(-40, 40))
def test_as_many_steps_as_are_told_bring_the_view_within_half_a_step(azimuth, altitude) -> None:
    right, up = steps_to(azimuth, altitude)
    looking = LookingAround(0.0, 100.0, 20.0)
    for _ in range(abs(right)):
        looking.turn(int(np.sign(right)), 0, now=0.0)
    for _ in range(abs(up)):
        looking.turn(0, int(np.sign(up)), now=0.0)
    seen = looking.direction(1.0)
    assert abs(seen[0] - azimuth) <= 5.0 + 1e-9
    assert abs(seen[1] - altitude) <= 5.0 + 1e-9


# --- scene camera

SIZE = (320, 180)


def test_a_wall_a_metre_wide_a_metre_away_covers_the_focal_length():
    # By similar triangles: width in pixels = focal length * width / distance.
    camera = Camera((0.0, 0.0, 1.5), 90.0, focal_length=200.0)
    left, right = project(camera, [[1.0, 0.5, 1.5], [1.0, -0.5, 1.5]], SIZE)
    np.testing.assert_allclose([left, right], [[160 - 100, 90], [160 + 100, 90]])


def test_the_field_of_view_ends_at_the_edges():
    camera = Camera((0.0, 0.0, 0.0), 0.0, field_of_view=80.0)
    half = math.radians(40)
    np.testing.assert_allclose(project(camera, [[math.sin(half), math.cos(half), 0]], SIZE)[0], [320, 90])


def test_what_lies_behind_has_no_place():
    assert np.isnan(project(Camera((0.0, 0.0, 0.0), 0.0), [[0.0, -1.0, 0.0]], SIZE)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 0), (37, -20), (201, 35), (300, 80)])
def test_a_lit_square_is_drawn_where_the_projection_says(azimuth, altitude):
    camera = Camera((3.0, -2.0, 1.6), azimuth, altitude, focal_length=250.0)
    ahead, right, up = direction_of(azimuth, altitude), camera.axes()[0], camera.axes()[1]
    centre = np.array(camera.position) + 4 * ahead + 0.8 * right - 0.5 * up
    half = 0.2
    model = SceneModel("square", 1)
    model.lamp([centre + half * (a * right + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))], 50.0)
    with offscreen_context() as context:
        renderer = SceneRenderer(context, model.build(), SIZE, None)
        renderer.render(camera)
        light = renderer.luminance()[..., 1]
    rows, columns = np.mgrid[:180, :320] + 0.5
    found = np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()
    np.testing.assert_allclose(found, project(camera, [centre], SIZE)[0], atol=0.5)
    # By hand: 4 m ahead, 0.8 m to the right, 0.5 m below, at a focal length of 250 pixels.
    np.testing.assert_allclose(found, [160 + 250 * 0.8 / 4, 90 + 250 * 0.5 / 4], atol=0.5)


@pytest.mark.parametrize(
    "wrong",
    [{"altitude": 91.0}, {"field_of_view": 0.0}, {"focal_length": -1.0}, {"azimuth": math.nan}],
)
def test_impossible_cameras_are_refused(wrong):
    with pytest.raises(ValueError, match="need a"):
        Camera(**({"position": (0.0, 0.0, 0.0), "azimuth": 0.0} | wrong))


def test_without_graphics_there_is_one_clear_line(monkeypatch):
    import moderngl

    def none(**options):
        raise Exception("cannot create\na context")

    monkeypatch.setattr(moderngl, "create_context", none)
    with pytest.raises(InputError, match=r"scenes need OpenGL 3.3, .*\(cannot create\): install") as refused:
        offscreen_context()
    assert "\n" not in str(refused.value)


# --- scene stairs

# Wider than deep, like steps before a terrace: 4 steps of 0.2 m by 0.25 m, from -0.8 m to 0.
WIDE = Stairs((0.0, 0.0), (2.0, 1.0), "y", (-0.8, 0.0), 4)

EAST = Stairs((0.0, 0.0), (1.0, 2.0), "x", (-0.8, 0.0), 4)


def built(stairs: Stairs, *, solid: bool) -> Scene:
    model = SceneModel("stairs", 1)
    flight(model, stairs, (STONE, PLINTH), solid=solid)
    stairs.walk(model, beside=0.3)
    return model.build()


def corners(scene: Scene, facing: tuple[float, float, float]) -> tuple[Floats, Floats]:
    """Return the lower and higher corners of all patches that face some way."""
    p = scene.patches
    chosen = (p.normals[:, 0] @ facing) > 0.99
    four = np.stack([p.origin, p.origin + p.along, p.origin + p.across, p.origin + p.along + p.across], 1)
    return four[chosen].min(axis=1), four[chosen].max(axis=1)


@pytest.mark.parametrize(("stairs", "axis"), [(WIDE, 1), (EAST, 0)])
def test_treads_rise_along_the_axis_that_is_said_also_where_the_flight_is_wider_than_deep(stairs, axis):
    _, high = corners(built(stairs, solid=True), (0, 0, 1))
    for k in range(4):  # the tread, and the riser's upper side 35 mm under it
        ends = np.isclose(high[:, axis], 0.25 * (k + 1))
        np.testing.assert_allclose(np.sort(high[ends, 2]), [-0.635 + 0.2 * k, -0.6 + 0.2 * k], atol=1e-9)


def test_the_sides_of_solid_stairs_are_closed_from_the_ground_to_each_tread():
    low, high = corners(built(WIDE, solid=True), (-1, 0, 0))
    for k in range(4):
        middle = 0.125 + 0.25 * k
        over = (low[:, 1] < middle) & (high[:, 1] > middle)
        assert low[over, 2].min() <= -0.8
        assert high[over, 2].max() == pytest.approx(-0.6 + 0.2 * k)
        # One piece ends where the next begins.
        assert sorted(high[over, 2])[0] == pytest.approx(sorted(low[over, 2])[1])


def test_one_walks_over_the_middles_of_the_treads():
    (ground,) = built(WIDE, solid=True).walkable
    assert ground.height(1.0, -0.125) == pytest.approx(-0.8)  # half a tread before the first riser
    for k in range(4):
        assert ground.height(1.0, 0.125 + 0.25 * k) == pytest.approx(-0.6 + 0.2 * k)
    assert (ground.low[0], ground.high[0]) == (0.3, 1.7)
