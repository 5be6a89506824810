"""Eyes in a headset look where the head does: by hand, and against the rotations of SciPy."""

import math

import numpy as np
import pytest
from headset_frames import POSES, frame_of, projected
from scipy.spatial.transform import Rotation
from seen_points import project

from evenlight.hardware.presentation.headset_link import EyePose, centre_pixels_per_degree
from evenlight.stimuli.eyes.eye_views import eye_views, head_direction
from evenlight.stimuli.scenes.engine.camera import FAR_FOR_EYES, NEAR, Camera, EyeView

SIZE = (640, 480)
HERE = (3.0, -2.0, 1.65)


def in_scene(points, azimuth: float) -> np.ndarray:
    """Return points of OpenXR's axes in the scene's: x east, y north, z up; seen from `HERE`."""
    x, y, z = np.asarray(points, dtype=float).T
    level = np.stack([x, -z, y], axis=1)
    return np.asarray(HERE + Rotation.from_euler("z", -azimuth, degrees=True).apply(level))


def pixels(points, eye: EyePose) -> np.ndarray:
    """Return where an eye sees points of OpenXR's axes, from the definitions of pose and angles."""
    seen = Rotation.from_quat(eye.pose.orientation).inv().apply(np.asarray(points) - eye.pose.position)
    across, up = seen[:, 0] / -seen[:, 2], seen[:, 1] / -seen[:, 2]
    left, right, above, below = np.tan([eye.fov.left, eye.fov.right, eye.fov.up, eye.fov.down])
    return np.stack(
        [(across - left) / (right - left) * SIZE[0], (above - up) / (above - below) * SIZE[1]], axis=1
    )


def test_a_point_a_metre_ahead_is_shifted_by_half_the_eye_distance():
    # Straight ahead of the left eye is at -tan l / (tan r - tan l) of the width; the point lies to the right.
    point = in_scene([[0.0, 0.0, -1.0]], azimuth=0.0)
    left, right = (projected(view, point, SIZE)[0] for view in eye_views(frame_of(), HERE, 0.0))
    span = math.tan(0.9) + math.tan(0.7)
    assert left[0] == pytest.approx((math.tan(0.9) + 0.0315) / span * 640)
    assert right[0] == pytest.approx((math.tan(0.7) - 0.0315) / span * 640)
    assert left[1] == right[1] == pytest.approx(math.tan(0.75) / (math.tan(0.75) + math.tan(0.85)) * 480)


@pytest.mark.parametrize("azimuth", [0.0, 130.0])
@pytest.mark.parametrize("pose", POSES)
def test_points_appear_where_pose_and_angles_say(pose, azimuth):
    frame = frame_of(POSES[pose], place=(0.2, -0.1, 0.3))
    points = np.random.default_rng(4).uniform([-0.5, -0.5, -4], [0.5, 0.5, -1.5], (20, 3))
    views = eye_views(frame, HERE, azimuth)
    for view, eye in zip(views, frame.eyes, strict=True):
        np.testing.assert_allclose(projected(view, in_scene(points, azimuth), SIZE), pixels(points, eye))


def test_a_head_that_turns_left_looks_north_west_and_one_that_nods_back_looks_up():
    """The directions in words: what no sign of a rotation can get wrong twice."""
    left = eye_views(frame_of(POSES["30 to the left"]), HERE, 0.0)[0]
    np.testing.assert_allclose(left.forward, [-0.5, math.sqrt(0.75), 0], atol=1e-12)
    up = eye_views(frame_of(POSES["20 up"]), HERE, 90.0)[0]
    np.testing.assert_allclose(
        up.forward, [math.cos(math.radians(20)), 0, math.sin(math.radians(20))], atol=1e-12
    )
    rolled = eye_views(frame_of(POSES["15 to the left shoulder"]), HERE, 0.0)[0]
    assert rolled.right[2] == pytest.approx(math.sin(math.radians(15)))  # the right ear is up
    assert rolled.up[0] == pytest.approx(-math.sin(math.radians(15)))


def test_the_head_s_place_is_added_to_the_headset_s_in_the_scene():
    """Half a metre to the right of one who faces east is half a metre south."""
    one, _ = eye_views(frame_of(place=(0.5, 0.25, -1.0), eye_distance=0.0), HERE, 90.0)
    np.testing.assert_allclose(one.position, [3.0 + 1.0, -2.0 - 0.5, 1.65 + 0.25])


def test_the_matrix_puts_points_where_the_projection_does_and_depth_from_near_to_far():
    view, _ = eye_views(frame_of(Rotation.from_euler("yxz", [30, 20, 15], degrees=True)), HERE, 70.0)
    depths = np.array([NEAR, 1.0, 20.0, FAR_FOR_EYES])
    aside = np.array([0.0, 0.2, -0.4, 0.3])
    points = (
        np.array(view.position) + depths[:, None] * view.forward + (depths * aside)[:, None] * view.up
    ) + (depths * 0.25)[:, None] * view.right
    clip = np.column_stack([points, np.ones(4)]) @ view.matrix(SIZE).T
    x, y, z = (clip[:, :3] / clip[:, 3:]).T
    np.testing.assert_allclose(
        np.stack([(x + 1) / 2 * 640, (1 - y) / 2 * 480], axis=1), projected(view, points, SIZE)
    )
    assert z[[0, 3]] == pytest.approx([-1.0, 1.0])
    assert (NEAR, FAR_FOR_EYES) == (0.05, 200.0)


def test_with_even_edges_an_eye_sees_what_a_camera_does():
    camera = Camera(HERE, 25.0, -10.0, focal_length=500.0)
    right, up, forward = (tuple(axis.tolist()) for axis in camera.axes())
    eye = EyeView(HERE, right, up, forward, camera.tangents(SIZE))
    points = HERE + 3 * camera.axes()[2] + np.random.default_rng(1).uniform(-1, 1, (9, 3))
    np.testing.assert_allclose(projected(eye, points, SIZE), project(camera, points, SIZE))
    np.testing.assert_allclose(eye.matrix(SIZE)[[0, 1, 3]], camera.matrix(SIZE)[[0, 1, 3]], atol=1e-12)


def test_what_lies_behind_an_eye_has_no_place():
    view, _ = eye_views(frame_of(), HERE, 0.0)
    assert np.isnan(projected(view, in_scene([[0.0, 0.0, 1.0]], 0.0), SIZE)).all()


@pytest.mark.parametrize(
    ("pose", "azimuth", "altitude"),
    [("30 to the left", -30.0, 0.0), ("20 up", 0.0, 20.0), ("15 to the left shoulder", 0.0, 0.0)],
)
def test_the_direction_of_a_head_is_azimuth_and_altitude(pose, azimuth, altitude):
    head = frame_of(POSES[pose]).head
    assert head_direction(head) == pytest.approx((azimuth, altitude), abs=1e-9)


def test_pixels_per_degree_are_those_straight_ahead():
    """As a difference of projections: a hundredth of a degree to both sides of straight ahead."""
    frame = frame_of(eye_distance=0.0)
    small = math.radians(0.01)
    points = in_scene([[math.sin(a), 0, -math.cos(a)] for a in (-small, small)], 0.0)
    for view, eye in zip(eye_views(frame, HERE, 0.0), frame.eyes, strict=True):
        first, second = projected(view, points, SIZE)
        assert centre_pixels_per_degree(eye.fov, 640) == pytest.approx((second[0] - first[0]) / 0.02)
