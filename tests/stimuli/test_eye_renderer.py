"""Fields, images, text and surfaces in a headset's eyes: light of the definition, places by hand."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from drawn_codes import dithered_codes, image_codes
from eye_windows import (
    FRAME,
    LINEAR,
    MIDDLE,
    SEED,
    SIDE,
    Headset,
    codes_of,
    drawn_field,
    drawn_image,
    eye_images,
    target,
)
from turned_heads import OUTWARDS, turned

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.dithering import (
    luminance_of_codes,
    mean_of_codes,
    neighbouring_codes,
    thresholds_of,
)
from evenlight.stimuli.eyes.eye_renderer import EyeFieldRenderer, EyeImageRenderer
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere, Surface
from evenlight.stimuli.field_renderer import Field, FieldRenderer
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, Image, ImageRenderer
from evenlight.stimuli.renderers import field_renderer, image_renderer
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.sequence_format import on_grid

LAB = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=20.0)

ROOM = Display("room", 250.0, 0.4, 1.9, pixels_per_degree=20.0, reflected_luminance=3.0)


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    context = offscreen_context()
    yield context
    context.release()


@pytest.fixture
def headset(context: moderngl.Context) -> Headset:
    return Headset(context)


def thresholds(dither: Dither) -> np.ndarray:
    return thresholds_of(dither, (SIDE, 2 * SIDE), FRAME, SEED)


def assert_codes(codes: np.ndarray, wanted: np.ndarray) -> None:
    """Codes as numpy has them; where a threshold is at the very share, floats may fall to the other side."""
    assert np.abs(codes - wanted).max() <= 1
    assert (codes == wanted).mean() > 0.999


@pytest.mark.parametrize("dither", list(Dither))
@pytest.mark.parametrize("display", [LAB, ROOM], ids=["lab", "room"])
def test_a_fields_codes_are_those_of_the_definition(headset, display: Display, dither: Dither) -> None:
    darkest = display.black_level + display.reflected_luminance
    brightest = display.peak_luminance + display.reflected_luminance
    for luminance in (darkest, darkest + 0.05, 20.0, 57.3, 0.99 * brightest, brightest):
        codes = drawn_field(headset, Field(luminance), display, dither)
        wanted = dithered_codes(luminance, thresholds(dither), display, 8)
        assert_codes(codes, np.repeat(wanted[..., None], 3, axis=-1))


@pytest.mark.parametrize("luminance", [0.4, 3.0, 20.0, 57.3, 99.5])
def test_a_fields_mean_luminance_is_the_one_meant(headset, luminance: float) -> None:
    """Noise leaves 0.43 cd/m^2, half a step, in a pixel at most: of n = 20402, 0.43 / sqrt(n) = 0.003."""
    codes = drawn_field(headset, Field(luminance), LAB, Dither.NOISY_BIT)
    assert mean_of_codes(codes, LAB, 8) == pytest.approx(luminance, abs=0.02)
    for eye in np.split(codes, 2, axis=1):
        assert mean_of_codes(eye, LAB, 8) == pytest.approx(luminance, abs=0.02)


def test_the_eyes_have_different_noise_and_it_is_fresh_in_each_frame(headset) -> None:
    lower, share = neighbouring_codes(50.0, LAB, 8)
    chance = float(share) / 2**24
    codes = drawn_field(headset, Field(50.0), LAB, Dither.NOISY_BIT)[..., 0]
    assert set(np.unique(codes)) == {int(lower), int(lower) + 1}
    left, right = np.split(codes, 2, axis=1)
    # Of independent pixels 1 - (p^2 + (1 - p)^2) differ; of 10201, 0.5 % more or less.
    differing = 2 * chance * (1 - chance)
    assert (left != right).mean() == pytest.approx(differing, abs=0.02)
    other = drawn_field(headset, Field(50.0), LAB, Dither.NOISY_BIT, seed=3)[..., 0]
    assert (codes != other).mean() == pytest.approx(differing, abs=0.02)


@pytest.mark.parametrize("kind", ["8 bits", "10 bits", "16 bits"])
@pytest.mark.parametrize(("display", "factor"), [(LAB, 1.0), (LAB, 0.63), (ROOM, 0.81), (ROOM, 0.1)])
def test_images_of_the_eyes_are_dimmed_as_the_definition_has_it(
    headset, context, kind: str, display: Display, factor: float
) -> None:
    rng = np.random.default_rng(5)
    shape, dtype = (SIDE, SIDE, 3), np.uint8 if kind == "8 bits" else np.uint16
    frames = [rng.integers(0, np.iinfo(dtype).max + 1, shape, dtype=dtype) for _ in range(2)]
    levels = {"8 bits": 256, "10 bits": 1024, "16 bits": 65536}[kind]
    if levels == 1024:
        frames = [on_grid(frame / 65535) for frame in frames]
    whole = [frame >> 6 if levels == 1024 else frame for frame in frames]
    for dither in (Dither.NOISY_BIT, Dither.ORDERED, Dither.NONE):
        codes = drawn_image(
            headset,
            lambda _: DimmedImage(eye_images(context, *whole, levels), factor, ground=20.0),
            display,
            dither,
        )
        wanted = image_codes(np.concatenate(frames, axis=1), factor, thresholds(dither), display, 8)
        assert_codes(codes, wanted)
        tolerance = 0.02 * display.peak_luminance / 100
        means = mean_of_codes(codes, display, 8), mean_of_codes(wanted, display, 8)
        assert means[0] == pytest.approx(means[1], abs=tolerance)


@pytest.mark.parametrize("factor", [1.0, 0.72, 0.31])
def test_each_pixel_is_the_factor_times_the_frame_in_linear_light(headset, context, factor: float) -> None:
    """Rounded to the nearer of two codes, half a step of 2.2 / 255 at most remains: 1.1 / 255."""
    rng = np.random.default_rng(6)
    frames = [rng.integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8) for _ in range(2)]
    codes = drawn_image(
        headset,
        lambda _: DimmedImage(eye_images(context, *frames, 256), factor, ground=0.0),
        LAB,
        Dither.NONE,
    )
    linear = factor * (np.concatenate(frames, axis=1) / 255) ** 2.2
    assert np.abs((codes / 255) ** 2.2 - linear).max() < 2 / 255


def test_smaller_images_lie_in_the_middle_of_the_eyes_and_may_come_from_below(headset, context) -> None:
    rng = np.random.default_rng(7)
    frames = [rng.integers(0, 256, (51, 71, 3), dtype=np.uint8) for _ in range(2)]

    def turned(_: EyeImageRenderer) -> DimmedImage:
        pair = eye_images(context, *(np.ascontiguousarray(frame[::-1]) for frame in frames), 256)
        images = [Image(image.texture, 256, from_below=True) for image in pair.views]
        return DimmedImage(EyeImages(images), 1.0, ground=100.0)

    codes = drawn_image(headset, turned, LAB, Dither.NONE)
    wanted = np.full((SIDE, 2 * SIDE, 3), 255)
    for index, frame in enumerate(frames):  # 15 of 30 pixels on the left, 25 of 50 above
        wanted[25:76, index * SIDE + 15 : index * SIDE + 86] = frame
    assert (codes == wanted).all()


def test_text_is_mixed_in_light_over_fields_and_images(headset) -> None:
    """At 51 of 255 a fifth is ink: 0.8 * 100 + 0.2 * 50 = 90; over half of white, 0.8 * 50 + 10 = 50."""
    coverage = np.full((960, 1280), 51, np.uint8)
    middle = np.s_[MIDDLE - 15 : MIDDLE + 16, MIDDLE - 15 : MIDDLE + 16]
    codes = drawn_field(headset, Field(100.0, 50.0, coverage), LAB, Dither.ORDERED)
    assert luminance_of_codes(codes[middle], LAB, 8).mean() == pytest.approx(90.0, abs=0.05)
    white = np.full((8, 8, 3), 255, np.uint8)
    codes = drawn_image(
        headset,
        lambda r: DimmedImage(r.image(white), 0.5, 0.0, 50.0, coverage),
        LAB,
        Dither.ORDERED,
        FlatScreen(100.0),
    )
    assert luminance_of_codes(codes[middle], LAB, 8).mean() == pytest.approx(50.0, abs=0.05)


def test_a_picture_finer_than_the_eyes_pixels_is_averaged_in_light(headset) -> None:
    """90 degrees of 202 pixels in 101: two by two pixels of a checkerboard in each, half of white."""
    picture = np.zeros((202, 202, 3), np.uint8)
    picture[::2, ::2], picture[1::2, 1::2] = 255, 255
    codes = drawn_image(
        headset, lambda r: DimmedImage(r.image(picture), 1.0, 0.0), LAB, Dither.NONE, FlatScreen(90.0)
    )
    inner = luminance_of_codes(codes[5:-5, 5:96], LAB, 8)
    assert np.abs(inner - 50.0).max() < 0.5  # half a step


def test_from_one_frame_to_the_next_nothing_is_uploaded_or_read_back(headset, context, monkeypatch) -> None:
    calls: list[str] = []
    coverage = np.full((96, 128), 99, np.uint8)
    frame = np.full((SIDE, SIDE, 3), 200, np.uint8)
    pair = eye_images(context, frame, frame, 256)
    fields = EyeFieldRenderer(headset, LAB, Dither.NOISY_BIT)
    images = EyeImageRenderer(headset, LAB, Dither.NOISY_BIT)
    framebuffer = target(context)

    def draw(number: int) -> None:
        headset.look(turned(right=float(number)), apart=0.063)
        fields.draw(framebuffer, Field(50.0 + number, 1.0, coverage), number, 1)
        images.draw(framebuffer, DimmedImage(pair, 0.9 / number, 10.0, 1.0, coverage), number, 1)

    draw(1)
    for owner, names in (
        (moderngl.Texture, ("write", "read", "read_into", "build_mipmaps")),
        (moderngl.Buffer, ("write", "read", "read_into", "orphan")),
        (moderngl.Framebuffer, ("read", "read_into")),
        (moderngl.Context, ("texture", "buffer", "framebuffer", "program")),
    ):
        for name in names:
            called = f"{owner.__name__}.{name}"
            monkeypatch.setattr(owner, name, lambda *_, called=called, **__: calls.append(called))
    rendered = moderngl.VertexArray.render
    monkeypatch.setattr(
        moderngl.VertexArray, "render", lambda *a, **k: (calls.append("draw"), rendered(*a, **k))
    )
    draw(2)
    draw(3)
    assert calls == ["draw"] * 8  # two frames of a field and a picture, for two eyes


def test_a_screen_shows_the_left_eyes_image(context) -> None:
    rng = np.random.default_rng(8)
    frames = [rng.integers(0, 256, (SIDE, 2 * SIDE, 3), dtype=np.uint8) for _ in range(2)]
    framebuffer = target(context)
    picture = DimmedImage(eye_images(context, *frames, 256), 1.0, ground=0.0)
    ImageRenderer(context, LAB, 8, Dither.NONE).draw(framebuffer, picture)
    assert (codes_of(framebuffer) == frames[0]).all()


def test_the_factories_choose_by_the_window(headset) -> None:
    assert isinstance(field_renderer(headset, LAB, Dither.NONE), EyeFieldRenderer)
    assert isinstance(image_renderer(headset, LAB, Dither.NONE), EyeImageRenderer)
    headset.frame = None
    assert isinstance(field_renderer(headset, LAB, Dither.NONE), FieldRenderer)
    assert isinstance(image_renderer(headset, LAB, Dither.NONE), ImageRenderer)


def test_a_luminance_out_of_the_displays_reach_is_refused(headset) -> None:
    with pytest.raises(ValueError, match="luminance must be between 0 and 100"):
        drawn_field(headset, Field(101.0), LAB, Dither.NONE)


# --- eye renderer places


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
