"""Where a headset's eyes see the panel of text and the surfaces of videos, calculated by hand."""

import math

import numpy as np
import pytest
from turned_heads import OUTWARDS, WIDE, turned

from evenlight.hardware.presentation.headset_link import EyeFov, EyePose, Pose
from evenlight.stimuli.eyes.surfaces import FlatScreen, direction_matrix, panel_matrix, plane_matrix

SIZE, PANEL = (200, 100), (1280, 960)
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
        matrix = panel_matrix(eye, SIZE, Pose(), PANEL)
        # 31.5 mm to the side, 1.5 m ahead: a tangent of 0.021.
        seen = place(matrix, pixel_of((-side * 0.021, 0.0), fov, SIZE))
        np.testing.assert_allclose(seen, (640.0, 480.0), atol=1e-9)


def test_the_panel_is_50_degrees_wide_and_its_pixels_are_square() -> None:
    matrix = panel_matrix(EyePose(Pose(), WIDE), SIZE, Pose(), PANEL)
    edge = math.tan(math.radians(25))
    np.testing.assert_allclose(place(matrix, pixel_of((edge, 0.0), WIDE, SIZE)), (1280.0, 480.0), atol=1e-9)
    corner = pixel_of((-edge, edge * 960 / 1280), WIDE, SIZE)
    np.testing.assert_allclose(place(matrix, corner), (0.0, 0.0), atol=1e-9)


def test_an_eye_that_is_turned_outwards_sees_the_panel_farther_inwards() -> None:
    eye = EyePose(Pose(LEFT_EYE, turned(right=-5)), OUTWARDS)
    matrix = panel_matrix(eye, SIZE, Pose(), PANEL)
    tangent = math.tan(math.atan(0.021) + math.radians(5))
    seen = place(matrix, pixel_of((tangent, 0.0), OUTWARDS, SIZE))
    np.testing.assert_allclose(seen, (640.0, 480.0), atol=1e-9)


def test_the_panel_moves_with_the_head() -> None:
    still = panel_matrix(EyePose(Pose(LEFT_EYE), OUTWARDS), SIZE, Pose(), PANEL)
    # The head at (1, 2, 3) is turned to the right by 90 degrees: what was left of it is ahead of it, at -z.
    head = Pose((1.0, 2.0, 3.0), turned(right=90))
    eye = EyePose(Pose((1.0, 2.0, 3.0 - 0.0315), turned(right=90)), OUTWARDS)
    np.testing.assert_allclose(panel_matrix(eye, SIZE, head, PANEL), still, atol=1e-9)


def test_a_flat_screen_stays_where_it_is_when_the_head_moves() -> None:
    # 60 degrees wide at 3 m: its edges are 3 tan 30 to the sides. From 1 m to the right and half a metre up
    # the left edge's middle lies a metre farther left, and lower.
    screen, edge = FlatScreen(60.0), 3 * math.tan(math.radians(30))
    eye = EyePose(Pose((1.0, 0.5, 0.0)), WIDE)
    ray = ((-edge - 1) / 3, -0.5 / 3)
    seen = place(screen.matrix(eye, SIZE, (1920, 1080)), pixel_of(ray, WIDE, SIZE))
    np.testing.assert_allclose(seen, (0.0, 540.0), atol=1e-9)
    nearer = EyePose(Pose((0.0, 0.0, -1.0)), WIDE)  # a metre ahead, and so 2 m away
    seen = place(screen.matrix(nearer, SIZE, (1920, 1080)), pixel_of((edge / 2, 0.0), WIDE, SIZE))
    np.testing.assert_allclose(seen, (1920.0, 540.0), atol=1e-9)


def test_a_flat_screen_leaves_the_view_when_the_head_turns() -> None:
    for right, up, tangents in (
        (-20.0, 0.0, (math.tan(math.radians(20)), 0.0)),  # turned left: the screen's middle is to the right
        (0.0, 10.0, (0.0, -math.tan(math.radians(10)))),  # turned up: it is below
    ):
        eye = EyePose(Pose(orientation=turned(right, up)), WIDE)
        seen = place(FlatScreen().matrix(eye, SIZE, (1920, 1080)), pixel_of(tangents, WIDE, SIZE))
        np.testing.assert_allclose(seen, (960.0, 540.0), atol=1e-9)
    behind = FlatScreen().matrix(EyePose(Pose(orientation=turned(right=180)), WIDE), SIZE, (1920, 1080))
    assert (behind @ pixel_of((0.0, 0.0), WIDE, SIZE))[2] < 0


@pytest.mark.parametrize("depth", [-3.0, -4.0])
def test_a_screen_is_not_seen_from_within_or_behind(depth: float) -> None:
    eye = EyePose(Pose((0.2, 0.0, depth)), WIDE)
    assert not plane_matrix(eye, SIZE, Pose(), (3.0, 60.0), (1920, 1080)).any()


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
    matrix = direction_matrix(EyePose(Pose((5.0, 0.0, 0.0), orientation), WIDE), SIZE)
    np.testing.assert_allclose(matrix @ (100.0, 50.0, 1.0), expected, atol=1e-12)


def test_a_screen_may_be_nearly_as_wide_as_the_half_of_the_view() -> None:
    """Of a video of 3840 pixels, 161 degrees wide, an eye that sees 45 to each side sees a sixth."""
    seen = [
        place(FlatScreen(161.0).matrix(EyePose(Pose(), WIDE), SIZE, (3840, 2160)), pixel)[0]
        for pixel in (pixel_of((side, 0.0), WIDE, SIZE) for side in (-1.0, 1.0))
    ]
    half = 1920 / math.tan(math.radians(80.5))
    np.testing.assert_allclose(seen, (1920 - half, 1920 + half), atol=1e-6)
