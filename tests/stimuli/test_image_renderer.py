"""Dimmed images: the shader draws numpy's codes in every pixel, and their mean is the luminance meant."""

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
import pytest
from drawn_codes import dithered_codes, image_codes

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.stimuli.dithering import (
    GRID,
    hashed,
    level_luminance,
    levels_of,
    luminance_of_codes,
    mean_of_codes,
    thresholds_of,
)
from evenlight.stimuli.image_renderer import DimmedImage, Image, ImageRenderer
from evenlight.stimuli.sequence_format import on_grid

LAB = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
ROOM = Display("room", 250.0, 0.4, 1.9, pixels_per_degree=60.0, reflected_luminance=3.0)
WINDOW, VIDEO = (97, 63), (61, 38)  # one margin odd: 18 pixels to each side, 12 above and 13 below
LEFT, TOP = 18, 12
SEED = 2**32 - 2


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    context = moderngl.create_context(standalone=True, backend="egl", require=330)
    yield context
    context.release()


def video_frame(kind: str, size: tuple[int, int] = VIDEO) -> np.ndarray:
    """Return a frame of noise that holds the lowest and the highest level."""
    rng = np.random.default_rng(5)
    shape = (size[1], size[0], 3)
    if kind == "8 bits":
        frame: np.ndarray = rng.integers(0, 256, shape, dtype=np.uint8)
    elif kind == "10 bits":
        frame = on_grid(rng.random(shape))
    elif kind == "16 bits":
        frame = rng.integers(0, 65536, shape, dtype=np.uint16)
    else:
        frame = rng.random(shape, dtype=np.float32)
    frame[0, 0], frame[0, 1] = 0, 1 if frame.dtype.kind == "f" else np.iinfo(frame.dtype).max
    return frame


def drawn(
    context: moderngl.Context, picture: Any, display: Display, dither: Dither, bits: int = 8
) -> np.ndarray:
    """Return the codes drawn, row 0 on top; `picture` makes what is drawn with a renderer."""
    renderer = ImageRenderer(context, display, bits, dither)
    target = context.renderbuffer(WINDOW, 4, dtype="f1" if bits == 8 else "f4")
    framebuffer = context.framebuffer([target])
    renderer.draw(framebuffer, picture(renderer), frame=7, seed=SEED)
    dtype = "f1" if bits == 8 else "f4"
    read = np.frombuffer(
        framebuffer.read(components=3, dtype=dtype, alignment=1), "u1" if bits == 8 else "f4"
    )
    codes = read.reshape(WINDOW[1], WINDOW[0], 3)[::-1]
    return np.rint(codes * (1.0 if bits == 8 else 1023.0)).astype(int)


def thresholds(dither: Dither) -> np.ndarray:
    return thresholds_of(dither, WINDOW[::-1], 7, SEED)


def expected(frame: np.ndarray, factor: float, ground: float, display: Display, dither: Dither, bits: int):
    """The window by the definition: emitted by Eq. 1, times b, plus reflected light; pixel by pixel."""
    unit = frame / (1.0 if frame.dtype.kind == "f" else np.iinfo(frame.dtype).max)
    if frame.dtype.kind == "f":
        unit = np.rint(unit * 65535).astype(np.float64) / 65535
    if levels_of(frame)[1] == 1024:
        unit = np.rint(unit * 1023) / 1023
    emitted = unit**display.gamma * (display.peak_luminance - display.black_level) + display.black_level
    black = display.black_level + display.reflected_luminance
    luminance = np.full((WINDOW[1], WINDOW[0], 3), ground)
    dimmed = np.maximum(factor * emitted + display.reflected_luminance, black)
    luminance[TOP : TOP + VIDEO[1], LEFT : LEFT + VIDEO[0]] = dimmed
    return dithered_codes(luminance, thresholds(dither)[..., None], display, bits)


@pytest.mark.parametrize("kind", ["8 bits", "10 bits", "16 bits", "floats"])
@pytest.mark.parametrize("bits", [8, 10])
def test_the_shader_draws_the_codes_of_the_definition_in_every_pixel(context, kind: str, bits: int) -> None:
    frame = video_frame(kind)
    for display, dither, factor in [
        (LAB, Dither.NOISY_BIT, 0.37),
        (ROOM, Dither.NOISY_BIT, 0.81),
        (ROOM, Dither.ORDERED, 0.5),
        (LAB, Dither.NONE, 1.0),
    ]:
        codes = drawn(
            context, lambda r, b=factor: DimmedImage(r.image(frame), b, ground=20.0), display, dither, bits
        )
        wanted = expected(frame, factor, 20.0, display, dither, bits)
        assert (codes == wanted).all()


@pytest.mark.parametrize("dither", list(Dither))
def test_undimmed_the_codes_are_the_videos_own(context, dither: Dither) -> None:
    """At b = 1 the luminance of a level is that of the code of the same number: no noise is left."""
    frame = video_frame("8 bits")
    for display in (LAB, ROOM):
        codes = drawn(context, lambda r: DimmedImage(r.image(frame), 1.0, ground=50.0), display, dither)
        assert (codes[TOP : TOP + VIDEO[1], LEFT : LEFT + VIDEO[0]] == frame).all()
    deep = video_frame("10 bits")
    codes = drawn(context, lambda r: DimmedImage(r.image(deep), 1.0, ground=50.0), ROOM, dither, bits=10)
    assert (codes[TOP : TOP + VIDEO[1], LEFT : LEFT + VIDEO[0]] == np.rint(deep / 65535 * 1023)).all()


@pytest.mark.parametrize("factor", [0.2, 0.55, 0.999])
def test_the_mean_luminance_of_a_dimmed_frame_is_the_factor_times_what_it_emits(factor: float) -> None:
    """Noise leaves at most half a step in each pixel and channel: over n pixels, sum(w) / 2 step / sqrt(n).

    Steps are at most 0.861 cd/m^2 below white of 100; 0.43 / sqrt(256 * 144) = 0.00224, and four of those
    hold in 99.99 % of the frames.
    """
    frame = np.clip(video_frame("8 bits", (256, 144)), 20, 255)  # above the display's black when dimmed
    codes = image_codes(frame, factor, thresholds_of(Dither.NOISY_BIT, (144, 256), 3, 4), LAB, 8)
    wanted = factor * emitted_luminance(frame, LAB).mean()
    bound = 4 * 0.861 / 2 / np.sqrt(256 * 144)
    assert mean_of_codes(codes, LAB, 8) == pytest.approx(wanted, abs=bound)
    by_hand = luminance_of_codes(codes, LAB, 8) @ [0.2126, 0.7152, 0.0722]
    assert mean_of_codes(codes, LAB, 8) == pytest.approx(by_hand.mean(), rel=1e-12)


def test_gray_stays_gray_under_noise() -> None:
    gray = np.repeat(video_frame("8 bits")[..., :1], 3, axis=-1)
    codes = image_codes(gray, 0.6, thresholds_of(Dither.NOISY_BIT, gray.shape[:2], 1, 2), LAB, 8)
    assert (codes == codes[..., :1]).all()


def test_nothing_is_drawn_darker_than_the_displays_black() -> None:
    """ROOM's black is 0.4 cd/m^2, and 3 reflected: b times it cannot be drawn, so levels below are black."""
    luminance = level_luminance(256, 0.25, ROOM)
    emitted = (np.arange(256) / 255) ** 1.9 * 249.6 + 0.4
    dark = 0.25 * emitted < 0.4
    assert 0 < dark.sum() < 20
    assert (luminance[dark] == 3.4).all()
    np.testing.assert_allclose(luminance[~dark], 0.25 * emitted[~dark] + 3.0, rtol=1e-12)


def test_a_texture_that_was_drawn_from_below_is_turned_over(context) -> None:
    frame = video_frame("8 bits")
    size = VIDEO

    def turned(_: ImageRenderer) -> DimmedImage:
        rows = np.concatenate([frame[::-1], np.zeros_like(frame[..., :1])], axis=-1).astype(np.uint16)
        return DimmedImage(
            Image(context.texture(size, 4, rows.tobytes(), alignment=1, dtype="u2"), 256, True), 0.7, 9.0
        )

    codes = drawn(context, turned, ROOM, Dither.ORDERED)
    assert (codes == expected(frame, 0.7, 9.0, ROOM, Dither.ORDERED, 8)).all()


def test_text_over_an_image_covers_its_share_of_the_light(context) -> None:
    """Where the text covers all there is ink, where nothing the image; between, one of the two by chance."""
    frame = video_frame("8 bits")
    coverage = np.zeros(WINDOW[::-1], np.uint8)
    coverage[:20], coverage[20:40] = 255, 128
    codes = drawn(
        context, lambda r: DimmedImage(r.image(frame), 0.5, 10.0, 80.0, coverage), LAB, Dither.NOISY_BIT
    )
    bare = expected(frame, 0.5, 10.0, LAB, Dither.NOISY_BIT, 8)
    ink = dithered_codes(80.0, thresholds(Dither.NOISY_BIT), LAB, 8)[..., None]
    columns, rows = np.meshgrid(np.arange(WINDOW[0]), np.arange(WINDOW[1]))
    chance = hashed(columns, rows, 7, SEED + 1) >> np.uint32(8)
    shown = (chance < np.round(coverage / 255 * 2**24))[..., None]
    assert (codes == np.where(shown, ink, bare)).all()
    assert 0.45 < shown[20:40].mean() < 0.55  # 1940 pixels, half of 128 / 255: 0.5 +- 0.011


def test_of_an_image_larger_than_the_window_the_middle_is_shown(context) -> None:
    """4 columns and 2 rows more than 97 x 63: 2 and 1 of them on each side are left out."""
    frame = np.random.default_rng(5).integers(0, 256, (WINDOW[1] + 2, WINDOW[0] + 4, 3)).astype(np.uint8)
    codes = drawn(context, lambda r: DimmedImage(r.image(frame), 1.0, 10.0), LAB, Dither.NONE)
    middle = drawn(context, lambda r: DimmedImage(r.image(frame[1:-1, 2:-2]), 1.0, 10.0), LAB, Dither.NONE)
    assert (codes == middle).all()
    assert np.ptp(codes) > 200


def test_what_a_10_bit_file_holds_is_known_and_other_16_bits_are_not_rounded() -> None:
    assert (levels_of(np.tile(GRID[:, None, None], 3))[0][:, 0, 0] == np.arange(1024)).all()
    assert (on_grid(np.arange(1024) / 1023) == GRID).all()
    odd = np.tile(GRID[:, None, None], 3)
    odd[500, 0, 1] += 1
    levels, count = levels_of(odd)
    assert count == 65536
    assert levels is odd
