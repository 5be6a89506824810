"""Eyes in a headset look where the head does, and see panels and videos there."""

import math

import numpy as np
import pytest
from headset_frames import POSES, frame_of, projected
from scipy.spatial.transform import Rotation
from seen_points import project
from turned_heads import OUTWARDS, WIDE, turned

from evenlight.hardware.presentation.headset_views import EyeFov, EyePose, Pose, centre_pixels_per_degree
from evenlight.stimuli.eyes.eye_views import eye_views, head_direction
from evenlight.stimuli.eyes.surfaces import FlatScreen, direction_matrix, panel_matrix, plane_matrix
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


# --- eye renderer surfaces

SIZE_OF_EYE_RENDERER_SURFACES, PANEL = (200, 100), (1280, 960)

LEFT_EYE = (-0.0315, 0.0, 0.0)  # half of 63 mm to the left [m]


def pixel_of(tangents: tuple[float, float], fov: EyeFov, size: tuple[int, int]) -> np.ndarray:
    """Return where a ray of some tangents to the right and up meets the eye's picture, (x, y, 1)."""
    left, right, up, down = (math.tan(angle) for angle in (fov.left, fov.right, fov.up, fov.down))
    x = size[0] * (tangents[0] - left) / (right - left)
    return np.array([x, size[1] * (tangents[1] - up) / (down - up), 1.0])


def place(matrix: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """Return the place in the picture of a plane; it must be seen."""
    right, down, ahead = matrix @ pixel
    assert ahead > 0
    return np.array([right / ahead, down / ahead])


@pytest.mark.parametrize("fov", [WIDE, OUTWARDS])
def test_the_panels_middle_is_seen_by_each_eye_toward_the_other(fov: EyeFov) -> None:
    for side in (-1, 1):
        eye = EyePose(Pose((side * 0.0315, 0.0, 0.0)), fov)
        matrix = panel_matrix(eye, SIZE_OF_EYE_RENDERER_SURFACES, Pose(), PANEL)
        # 31.5 mm to the side, 1.5 m ahead: a tangent of 0.021.
        seen = place(matrix, pixel_of((-side * 0.021, 0.0), fov, SIZE_OF_EYE_RENDERER_SURFACES))
        np.testing.assert_allclose(seen, (640.0, 480.0), atol=1e-9)


def test_the_panel_is_50_degrees_wide_and_its_pixels_are_square() -> None:
    matrix = panel_matrix(EyePose(Pose(), WIDE), SIZE_OF_EYE_RENDERER_SURFACES, Pose(), PANEL)
    edge = math.tan(math.radians(25))
    np.testing.assert_allclose(
        place(matrix, pixel_of((edge, 0.0), WIDE, SIZE_OF_EYE_RENDERER_SURFACES)), (1280.0, 480.0), atol=1e-9
    )
    corner = pixel_of((-edge, edge * 960 / 1280), WIDE, SIZE_OF_EYE_RENDERER_SURFACES)
    np.testing.assert_allclose(place(matrix, corner), (0.0, 0.0), atol=1e-9)


def test_an_eye_that_is_turned_outwards_sees_the_panel_farther_inwards() -> None:
    eye = EyePose(Pose(LEFT_EYE, turned(right=-5)), OUTWARDS)
    matrix = panel_matrix(eye, SIZE_OF_EYE_RENDERER_SURFACES, Pose(), PANEL)
    tangent = math.tan(math.atan(0.021) + math.radians(5))
    seen = place(matrix, pixel_of((tangent, 0.0), OUTWARDS, SIZE_OF_EYE_RENDERER_SURFACES))
    np.testing.assert_allclose(seen, (640.0, 480.0), atol=1e-9)


def test_the_panel_moves_with_the_head() -> None:
    still = panel_matrix(EyePose(Pose(LEFT_EYE), OUTWARDS), SIZE_OF_EYE_RENDERER_SURFACES, Pose(), PANEL)
    # The head at (1, 2, 3) is turned to the right by 90 degrees: what was left of it is ahead of it, at -z.
    head = Pose((1.0, 2.0, 3.0), turned(right=90))
    eye = EyePose(Pose((1.0, 2.0, 3.0 - 0.0315), turned(right=90)), OUTWARDS)
    np.testing.assert_allclose(
        panel_matrix(eye, SIZE_OF_EYE_RENDERER_SURFACES, head, PANEL), still, atol=1e-9
    )


def test_a_flat_screen_stays_where_it_is_when_the_head_moves() -> None:
    # 60 degrees wide at 3 m: its edges are 3 tan 30 to the sides. From 1 m to the right and half a metre up
    # the left edge's middle lies a metre farther left, and lower.
    screen, edge = FlatScreen(60.0), 3 * math.tan(math.radians(30))
    eye = EyePose(Pose((1.0, 0.5, 0.0)), WIDE)
    ray = ((-edge - 1) / 3, -0.5 / 3)
    seen = place(
        screen.matrix(eye, SIZE_OF_EYE_RENDERER_SURFACES, (1920, 1080)),
        pixel_of(ray, WIDE, SIZE_OF_EYE_RENDERER_SURFACES),
    )
    np.testing.assert_allclose(seen, (0.0, 540.0), atol=1e-9)
    nearer = EyePose(Pose((0.0, 0.0, -1.0)), WIDE)  # a metre ahead, and so 2 m away
    seen = place(
        screen.matrix(nearer, SIZE_OF_EYE_RENDERER_SURFACES, (1920, 1080)),
        pixel_of((edge / 2, 0.0), WIDE, SIZE_OF_EYE_RENDERER_SURFACES),
    )
    np.testing.assert_allclose(seen, (1920.0, 540.0), atol=1e-9)


def test_a_flat_screen_leaves_the_view_when_the_head_turns() -> None:
    for right, up, tangents in (
        (-20.0, 0.0, (math.tan(math.radians(20)), 0.0)),  # turned left: the screen's middle is to the right
        (0.0, 10.0, (0.0, -math.tan(math.radians(10)))),  # turned up: it is below
    ):
        eye = EyePose(Pose(orientation=turned(right, up)), WIDE)
        seen = place(
            FlatScreen().matrix(eye, SIZE_OF_EYE_RENDERER_SURFACES, (1920, 1080)),
            pixel_of(tangents, WIDE, SIZE_OF_EYE_RENDERER_SURFACES),
        )
        np.testing.assert_allclose(seen, (960.0, 540.0), atol=1e-9)
    behind = FlatScreen().matrix(
        EyePose(Pose(orientation=turned(right=180)), WIDE), SIZE_OF_EYE_RENDERER_SURFACES, (1920, 1080)
    )
    assert (behind @ pixel_of((0.0, 0.0), WIDE, SIZE_OF_EYE_RENDERER_SURFACES))[2] < 0


@pytest.mark.parametrize("depth", [-3.0, -4.0])
def test_a_screen_is_not_seen_from_within_or_behind(depth: float) -> None:
    eye = EyePose(Pose((0.2, 0.0, depth)), WIDE)
    assert not plane_matrix(eye, SIZE_OF_EYE_RENDERER_SURFACES, Pose(), (3.0, 60.0), (1920, 1080)).any()


@pytest.mark.parametrize(
    ("orientation", "expected"),
    [
        (turned(), (0, 0, -1)),
        (turned(right=-90), (-1, 0, 0)),
        (turned(up=45), (0, math.sqrt(0.5), -math.sqrt(0.5))),
    ],
)
def test_the_middle_of_the_view_points_where_the_eye_does(
    orientation: tuple[float, float, float, float], expected: tuple[float, float, float]
) -> None:
    matrix = direction_matrix(
        EyePose(Pose((5.0, 0.0, 0.0), orientation), WIDE), SIZE_OF_EYE_RENDERER_SURFACES
    )
    np.testing.assert_allclose(matrix @ (100.0, 50.0, 1.0), expected, atol=1e-12)


def test_a_screen_may_be_nearly_as_wide_as_the_half_of_the_view() -> None:
    """Of a video of 3840 pixels, 161 degrees wide, an eye that sees 45 to each side sees a sixth."""
    seen = [
        place(
            FlatScreen(161.0).matrix(EyePose(Pose(), WIDE), SIZE_OF_EYE_RENDERER_SURFACES, (3840, 2160)),
            pixel,
        )[0]
        for pixel in (pixel_of((side, 0.0), WIDE, SIZE_OF_EYE_RENDERER_SURFACES) for side in (-1.0, 1.0))
    ]
    half = 1920 / math.tan(math.radians(80.5))
    np.testing.assert_allclose(seen, (1920 - half, 1920 + half), atol=1e-6)
