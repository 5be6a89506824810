"""Compute shaders: pyramids, loss curves and the loss at one factor, as on the processor."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import frame_of, pictures
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import (
    ContrastModel,
    PixelToLuminance,
    SensitivityModel,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.pyramid import band_frequencies, gaussian_pyramid, level_shapes
from evenlight.method.gpu import one_pass
from evenlight.method.gpu.frame_loss import GpuFrameAnalysis, GpuLoss
from evenlight.method.gpu.pyramid import SUM_WORDS, FrameTexture, GpuPyramid, packed, sums_of

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)

LEVELS = 5


def levels_of(frame, order):
    """The levels of a frame, and the sums of its channels, from the memory of the graphics processor."""
    own = own_context()

    def made(context):
        pyramid = GpuPyramid(context, frame.shape[:2], HEADSET, order, LEVELS)
        results = context.buffer(bytes(4 * SUM_WORDS))
        pyramid.fill(packed(frame), results)
        context.finish()
        cells = np.frombuffer(pyramid.buffer.read(), np.float32)
        parts = zip(pyramid.begins, pyramid.begins[1:], pyramid.shapes, strict=False)
        levels = [cells[first:last].reshape(shape) for first, last, shape in parts]
        return levels, sums_of(np.frombuffer(results.read(), np.uint32))

    return own.run(made, own.context)


@pytest.mark.parametrize("order", list(PixelToLuminance))
@pytest.mark.parametrize("shape", [(37, 70), (64, 33), (16, 200)])
def test_levels_and_sums_are_those_of_the_definition(shape, order):
    frame = np.random.default_rng(3).integers(0, 256, (*shape, 3), dtype=np.uint8)
    emitted = emitted_luminance(frame, HEADSET, order)
    levels, sums = levels_of(frame, order)
    for level, expected in zip(levels, gaussian_pyramid(emitted, LEVELS), strict=True):
        np.testing.assert_allclose(level, expected, rtol=3e-6)
    np.testing.assert_allclose(0.2 + 104.2 * sums[3] / emitted.size, emitted.mean(), rtol=1e-6)


@pytest.mark.parametrize("order", list(PixelToLuminance))
def test_one_colour_stays_one_luminance_to_the_last_bit(order):
    """Masking takes contrasts to the power 0.2, which makes 0.04 of rounding noise of 1e-7."""
    for value in range(0, 256, 17):
        frame = np.full((35, 52, 3), (value, 255 - value, 77), np.uint8)
        levels, _ = levels_of(frame, order)
        assert len({float(cell) for level in levels for cell in np.unique(level)}) == 1


# --- gpu curves

FACTORS = brightness_factors(0.2, 7)

MODEL = ContrastModel()


def on_gpu(shape, display=HEADSET, model=MODEL, factors=FACTORS):
    """The analysis in shaders."""
    return GpuFrameAnalysis(shape, display, model, factors, own_context())


def defined(frame, display=HEADSET, model=MODEL, factors=FACTORS):
    """The loss by definition."""
    emitted = emitted_luminance(frame, display, model.pixel_to_luminance)
    return loss_curves_by_definition(emitted, factors, display, model)


@pytest.mark.parametrize("shape", [(132, 130), (66, 80)], ids=["many pixels", "few pixels"])
def test_neighbours_are_compared_at_the_same_factors_as_on_the_processor(shape):
    """Where luminance jumps, it matters at which: taken at 1, losses here would be off by 3e-3 and 2e-4."""
    frame, factors = frame_of(pictures(shape)["edge of the shade"]), brightness_factors(0.005, 9)
    on_processor = FrameAnalysis(shape, HEADSET, MODEL, factors).of(frame).loss
    np.testing.assert_allclose(on_gpu(shape, factors=factors).of(frame).loss, on_processor, atol=5e-5)


# 141 wide and high: tiles of 28 that end inside, and a last row of one pixel; and frames smaller than a tile.
@settings(deadline=None, max_examples=12)
@given(
    st.tuples(st.integers(8, 64), st.integers(8, 64)) | st.just((141, 141)) | st.just((8, 8)),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.02, 0.2, 1.0]),
)
def test_all_sizes_agree_with_the_processor(shape, seed, contrast):
    """But for one pixel at its very threshold, which two roundings may see differently."""
    picture = 0.5 + contrast * (np.random.default_rng(seed).random(shape) - 0.5)
    ours, theirs = (
        a.of(frame_of(picture)) for a in (on_gpu(shape), FrameAnalysis(shape, HEADSET, MODEL, FACTORS))
    )
    n_bands = len(band_frequencies(shape, HEADSET))
    one_pixel = 1 / (n_bands * np.prod(level_shapes(shape)[n_bands - 1]))
    visible, expected = ((1 - found.loss) * found.visible_contrast for found in (ours, theirs))
    np.testing.assert_allclose(visible, expected, atol=1.001 * one_pixel)


def test_means_of_many_pixels_keep_their_digits():
    """A frame of 2 million white pixels: sums in float32 would stop growing, or lose a hundred of them."""
    white = np.full((1024, 2048, 3), 255, np.uint8)
    white[0, 0] = 0
    result = on_gpu((1024, 2048), model=ContrastModel(band_count=1)).of(white)
    np.testing.assert_allclose(result.channel_means, 1 - 1 / white[..., 0].size, rtol=1e-9)


def test_a_frame_gives_the_same_curve_whatever_came_before():
    analysis = on_gpu((40, 56))
    first, second = (frame_of(np.random.default_rng(k).random((40, 56))) for k in range(2))
    alone = analysis.of(first)
    analysis.of(second)
    again = analysis.of(first)
    np.testing.assert_array_equal(alone.loss, again.loss)
    assert (alone.visible_contrast, alone.mean_luminance) == (again.visible_contrast, again.mean_luminance)


def test_analyses_that_share_their_programs_do_not_disturb_one_another():
    """Other displays and sizes take the same programs, with values of their own before each run."""
    oled = dataclasses.replace(HEADSET, name="oled", peak_luminance=600.0, black_level=0.0, gamma=2.6)
    setups = (((72, 120), HEADSET), ((72, 120), oled), ((60, 80), HEADSET))
    analyses = [on_gpu(*setup) for setup in setups]
    frames = [frame_of(pictures(shape)["photograph"]) for shape, _ in setups]
    for _ in range(2):
        for analysis, frame, (_, display) in zip(analyses, frames, setups, strict=True):
            np.testing.assert_allclose(analysis.of(frame).loss, defined(frame, display), atol=1e-3)
    compiled = len(own_context().context.extra)
    again = on_gpu((40, 60), oled)
    again.of(frames[0][:40, :60])
    assert len(own_context().context.extra) == compiled


def test_the_dispatch_may_have_several_rows(monkeypatch):
    """As large frames need it: here three groups in a row, and some at the end that have nothing to do."""
    frame = frame_of(np.random.default_rng(1).random((70, 100)))
    in_one_row = on_gpu((70, 100)).of(frame)
    monkeypatch.setattr(one_pass, "_ACROSS", 3)
    np.testing.assert_array_equal(on_gpu((70, 100)).of(frame).loss, in_one_row.loss)


@pytest.mark.parametrize(
    ("model", "factors", "words"),
    [
        (ContrastModel(sensitivity=SensitivityModel.AUTHORS), FACTORS, "got 'authors'; or use the processor"),
        (MODEL, brightness_factors(0.2, 1025), "at most 1024 factors, got 1025"),
    ],
)
def test_what_only_the_processor_computes_is_refused(model, factors, words):
    with pytest.raises(InputError, match=words):
        on_gpu((16, 16), model=model, factors=factors)


# --- gpu loss

SHAPE = (72, 120)

FRAME = frame_of(pictures(SHAPE)["photograph"])


def in_context(test: Callable[..., None]) -> None:
    """Run what needs the context in its thread."""
    own = own_context()
    own.run(test, own.context)


def texture(context, values, dtype):
    """A texture of an array, (height, width, channels)."""
    height, width, channels = values.shape
    return context.texture((width, height), channels, np.ascontiguousarray(values), alignment=1, dtype=dtype)


def levels(context, frame):
    """An 8-bit frame as a texture of levels."""
    return FrameTexture(texture(context, frame, "u1"))


def as_defined(frame, factor, display=HEADSET):
    """The loss by definition."""
    return contrast_loss(emitted_luminance(frame, display), factor, display)


@pytest.mark.parametrize("kind", ["u1", "u2 of ten bits", "four channels", "array", "array of floats"])
def test_all_textures_of_a_frame_give_its_loss(kind):
    def test(context):
        ten = (
            np.random.default_rng(1).integers(0, 1024, (*SHAPE, 3), dtype=np.uint16)
            if "ten" in kind
            else None
        )
        unit = FRAME / 255 if ten is None else ten / 1023
        if kind == "array":
            frame = FRAME
        elif kind == "array of floats":
            frame = unit.astype(np.float32)
        elif kind == "u1":
            frame = levels(context, FRAME)
        elif kind == "four channels":
            four = np.concatenate([FRAME, np.full((*SHAPE, 1), 255, np.uint8)], axis=2)
            frame = levels(context, four)
        else:
            frame = FrameTexture(texture(context, ten, "u2"), levels=1024)
        seen = GpuLoss(context, SHAPE, HEADSET).of(frame, 0.4)
        assert seen.loss == pytest.approx(as_defined(unit, 0.4), abs=1e-3)
        assert seen.mean_luminance == pytest.approx(emitted_luminance(unit, HEADSET).mean(), rel=1e-5)

    in_context(test)


def test_a_drawn_frame_is_turned_over():
    """Rows of textures that were drawn to count from below; every other row is another pyramid."""

    def test(context):
        loss = GpuLoss(context, SHAPE, HEADSET)
        upright = loss.of(levels(context, FRAME), 0.3)
        turned = dataclasses.replace(levels(context, FRAME[::-1]), from_below=True)
        assert loss.of(turned, 0.3) == upright
        assert loss.of(dataclasses.replace(turned, from_below=False), 0.3) != upright

    in_context(test)


def test_what_is_not_a_number_is_dark_and_what_is_too_bright_is_the_peak():
    """What a renderer may leave behind; it must not spread over the pyramid."""

    def test(context):
        odd = (FRAME / 255).astype(np.float32)
        usual = odd.copy()
        for pixel, strange, meant in (
            (3, np.nan, 0),
            (40, np.inf, 1),
            (77, -np.inf, 0),
            (90, 7.0, 1),
            (99, -1, 0),
        ):
            odd[pixel % 72, pixel], usual[pixel % 72, pixel] = strange, meant
        loss = GpuLoss(context, SHAPE, HEADSET)
        seen, expected = (loss.of(values, 0.4) for values in (odd, usual))
        assert np.isfinite(seen.loss)
        assert seen == expected

    in_context(test)


def test_answers_come_in_the_order_of_the_questions():
    """One frame late, as a live loop asks: each answer is to its own frame and factor."""

    def test(context):
        loss = GpuLoss(context, SHAPE, HEADSET)
        frames = [frame_of(picture) for picture in list(pictures(SHAPE).values())[:4]]
        factors = [0.3, 0.5, 0.7, 0.4]
        at_once = [loss.of(levels(context, f), b) for f, b in zip(frames, factors, strict=True)]
        late = []
        loss.start(levels(context, frames[0]), factors[0])
        for frame, factor in zip(frames[1:], factors[1:], strict=True):
            loss.start(levels(context, frame), factor)
            late.append(loss.result())
        late.append(loss.result())
        assert late == at_once

    in_context(test)


def test_too_much_at_once_and_nothing_at_all_are_refused():
    def test(context):
        loss = GpuLoss(context, (8, 8), HEADSET, lowest_factor=0.3)
        frame = np.zeros((8, 8, 3), np.uint8)
        with pytest.raises(ValueError, match="no frame is under way"):
            loss.result()
        with pytest.raises(InputError, match=r"the factor must lie in 0\.3 to 1, got 0\.29"):
            loss.start(frame, 0.29)
        with pytest.raises(InputError, match=r"expected a frame of the shape \(8, 8\), got \(8, 9\)"):
            loss.start(np.zeros((8, 9, 3), np.uint8), 0.5)
        loss.start(frame, 0.5)
        with pytest.raises(ValueError, match="1 of the frames before are under way"):
            loss.of(frame, 0.5)
        loss.start(frame, 0.5)
        with pytest.raises(ValueError, match="2 frames are under way"):
            loss.start(frame, 0.5)

    in_context(test)


def test_textures_that_cannot_be_read_are_refused():
    def test(context):
        small = FrameTexture(context.texture((8, 9), 3, dtype="u1"))
        with pytest.raises(InputError, match="the texture has 8 x 9 pixels; need 8 x 8"):
            GpuLoss(context, (8, 8), HEADSET).of(small, 0.5)
        with pytest.raises(ValueError, match="need a texture of three or more channels"):
            FrameTexture(context.texture((8, 8), 1, dtype="u1"))
        with pytest.raises(ValueError, match="got 3 of f2"):
            FrameTexture(context.texture((8, 8), 3, dtype="f2"))
        authors = ContrastModel(sensitivity=SensitivityModel.AUTHORS)
        with pytest.raises(InputError, match="got 'authors'"):
            GpuLoss(context, (8, 8), HEADSET, authors)

    in_context(test)
