"""Text and surfaces of videos in a headset's eyes, at the pixels calculated by hand."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from eye_windows import LINEAR, MIDDLE, SIDE, Headset, drawn_field, drawn_image
from turned_heads import OUTWARDS, turned

from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere, Surface
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.image_renderer import DimmedImage
from evenlight.stimuli.scenes.engine.graphics import offscreen_context

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    context = offscreen_context()
    yield context
    context.release()


@pytest.fixture
def headset(context: moderngl.Context) -> Headset:
    return Headset(context)


def centre_of_text(codes: np.ndarray) -> tuple[float, float]:
    """Return the middle of the dark pixels of an eye's picture, from its upper left corner [pixels]."""
    rows, columns = np.nonzero(codes[..., 0] < 50)
    return float(columns.mean()) + 0.5, float(rows.mean()) + 0.5


def test_text_is_in_front_of_both_eyes_at_its_distance(headset) -> None:
    """40 pixels of the panel are 40 / 1280 of 2 tan 25: 0.0291 of the 2.0 that the eye sees, 1.5 pixels.

    So a square of 400 has its middle where the panel's is: at a tangent of 0.021, which is 1.06 pixels.
    """
    coverage = np.zeros((960, 1280), np.uint8)
    coverage[280:680, 440:840] = 255
    headset.look(apart=0.063)
    codes = drawn_field(headset, Field(100.0, 1.0, coverage), LINEAR, Dither.NONE)
    for index, side in enumerate((1, -1)):
        x, y = centre_of_text(codes[:, index * SIDE : (index + 1) * SIDE])
        assert x == pytest.approx(SIDE / 2 * (1 + side * 0.021), abs=0.5)
        assert y == pytest.approx(SIDE / 2, abs=0.1)


def test_text_high_and_left_on_the_panel_is_seen_there_and_moves_with_the_head(headset) -> None:
    coverage = np.zeros((960, 1280), np.uint8)
    coverage[160:320, 320:480] = 255  # its middle is 240 pixels left of the panel's, and 240 above
    scale = 2 * math.tan(math.radians(25)) / 1280
    left, right, up, down = (
        math.tan(edge) for edge in (OUTWARDS.left, OUTWARDS.right, OUTWARDS.up, OUTWARDS.down)
    )
    place = (-240 * scale - left) / (right - left) * SIDE, (240 * scale - up) / (down - up) * SIDE
    for orientation in (turned(), turned(right=70), turned(up=-30)):
        headset.look(orientation, fov=OUTWARDS)
        codes = drawn_field(headset, Field(100.0, 1.0, coverage), LINEAR, Dither.NONE)
        for eye in np.split(codes, 2, axis=1):
            assert centre_of_text(eye) == pytest.approx(place, abs=0.5)


def test_a_flat_screen_has_its_corners_where_its_field_of_view_ends(headset) -> None:
    """60 degrees wide, half as high, of 90: tan 30 of half a picture, 50.5 pixels, is 29.16, and 14.58.

    So the pixels 27 to the sides and 13 up or down are within by more than one, and 30 and 15 are outside.
    """
    picture = np.zeros((40, 80, 3), np.uint8)
    top, bottom, left, right = slice(0, 10), slice(30, 40), slice(0, 10), slice(70, 80)
    corners = [(top, left, -1, -1), (top, right, -1, 1), (bottom, left, 1, -1), (bottom, right, 1, 1)]
    colours = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)]
    for (rows, columns, _, _), colour in zip(corners, colours, strict=True):
        picture[rows, columns] = colour
    screen = FlatScreen(60.0)
    codes = drawn_image(
        headset, lambda r: DimmedImage(r.image(picture), 1.0, ground=200.0), LINEAR, Dither.NONE, screen
    )
    for eye in np.split(codes, 2, axis=1):
        for (_, _, down, across), colour in zip(corners, colours, strict=True):
            assert eye[MIDDLE + 13 * down, MIDDLE + 27 * across].tolist() == list(colour)
            assert (eye[MIDDLE + 15 * down, MIDDLE + 27 * across] == 200).all()
            assert (eye[MIDDLE + 13 * down, MIDDLE + 30 * across] == 200).all()


@pytest.mark.parametrize(
    ("orientation", "span", "place"),
    [
        (turned(), 360.0, (32, 16)),  # of 64 by 32 pixels: straight ahead is the middle
        (turned(right=-90), 360.0, (16, 16)),  # left: a quarter less
        (turned(up=45), 360.0, (32, 8)),  # up: halfway to the top
        (turned(), 180.0, (32, 16)),
        (turned(right=45), 180.0, (48, 16)),
    ],
)
def test_directions_are_at_their_longitude_and_latitude(headset, orientation, span: float, place) -> None:
    picture = np.zeros((32, 64, 3), np.uint8)
    picture[..., 0], picture[..., 1] = 4 * np.arange(64), 8 * np.arange(32)[:, None]  # linear in the place
    headset.look(orientation, apart=0.063)
    codes = drawn_image(
        headset, lambda r: DimmedImage(r.image(picture), 1.0, 50.0), LINEAR, Dither.NONE, Sphere(span)
    )
    for eye in np.split(codes, 2, axis=1):
        wanted = 4 * (place[0] - 0.5), 8 * (place[1] - 0.5), 0
        np.testing.assert_allclose(eye[MIDDLE, MIDDLE], wanted, atol=1)


def test_a_sphere_is_closed_behind_and_half_a_one_is_open(headset) -> None:
    """Straight behind lie the last column and the first: half of 252 and of 0."""
    picture = np.zeros((32, 64, 3), np.uint8)
    picture[..., 0] = 4 * np.arange(64)
    headset.look(turned(right=180))

    def drawn(span: float) -> np.ndarray:
        picture_of = lambda r: DimmedImage(r.image(picture), 1.0, 50.0)  # noqa: E731 # short
        return drawn_image(headset, picture_of, LINEAR, Dither.NONE, Sphere(span))

    assert drawn(360.0)[MIDDLE, MIDDLE, 0] == pytest.approx(126, abs=1)
    assert (drawn(180.0) == 50).all()


@pytest.mark.parametrize("surface", [FlatScreen(70.0, side_by_side=True), Sphere(180.0, side_by_side=True)])
def test_side_by_side_each_eye_sees_its_half_up_to_the_edge(headset, surface: Surface) -> None:
    picture = np.zeros((20, 60, 3), np.uint8)
    picture[:, :30, 0], picture[:, 30:, 1] = 255, 255
    codes = drawn_image(
        headset, lambda r: DimmedImage(r.image(picture), 1.0, 0.0), LINEAR, Dither.NONE, surface
    )
    left, right = np.split(codes, 2, axis=1)
    assert left[MIDDLE, MIDDLE].tolist() == [255, 0, 0]
    assert right[MIDDLE, MIDDLE].tolist() == [0, 255, 0]
    assert not left[..., 1].any()
    assert not right[..., 0].any()


def test_a_half_of_a_video_fills_the_screen_with_square_pixels(headset) -> None:
    """A half of 30 by 30 is as high as wide: 60 degrees both ways, tan 30 of 50.5, 29.16 pixels."""
    picture = np.full((30, 60, 3), 255, np.uint8)
    codes = drawn_image(
        headset,
        lambda r: DimmedImage(r.image(picture), 1.0, 0.0),
        LINEAR,
        Dither.NONE,
        FlatScreen(60.0, side_by_side=True),
    )
    for eye in np.split(codes, 2, axis=1):
        assert (eye[MIDDLE, :, 0] > 127).sum() == (eye[:, MIDDLE, 0] > 127).sum() == 59  # 29 to both sides
