"""Loss curves from compute shaders: against the definition in float64, and the pass on the processor."""

import dataclasses

import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import fractal, frame_of, pictures
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import (
    BandFrequency,
    ContrastModel,
    MaskingNeighbourhood,
    PixelToLuminance,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import channel_means, emitted_luminance
from evenlight.method.contrast.pyramid import band_frequencies, level_shapes
from evenlight.method.gpu import one_pass
from evenlight.method.gpu.frame_loss import GpuFrameAnalysis

pytestmark = pytest.mark.slow

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
OLED = Display("oled", 600.0, 0.0, 2.2, pixels_per_degree=60.0)
BRIGHT_ROOM = dataclasses.replace(HEADSET, reflected_luminance=2.0)
FACTORS = brightness_factors(0.2, 7)
MODEL = ContrastModel()


def on_gpu(shape, display=HEADSET, model=MODEL, factors=FACTORS):
    """The analysis in shaders."""
    return GpuFrameAnalysis(shape, display, model, factors, own_context())


def defined(frame, display=HEADSET, model=MODEL, factors=FACTORS):
    """The loss by definition."""
    emitted = emitted_luminance(frame, display, model.pixel_to_luminance)
    return loss_curves_by_definition(emitted, factors, display, model)


@pytest.mark.parametrize("display", [HEADSET, OLED, BRIGHT_ROOM], ids=["headset", "oled", "bright room"])
def test_curves_equal_the_definition_to_a_thousandth(display):
    analysis, errors = on_gpu((72, 120), display), {}
    for name, picture in pictures((72, 120)).items():
        frame = frame_of(picture)
        errors[name] = np.abs(analysis.of(frame).loss - defined(frame, display)).max()
    assert max(errors.values()) < 1e-3, errors


@pytest.mark.parametrize(
    "model",
    [
        ContrastModel(pixel_to_luminance=PixelToLuminance.LUMA_FIRST),
        ContrastModel(band_frequency=BandFrequency.CENTROID, band_count=3),
        ContrastModel(sensitivity=SensitivityModel.SIMPLIFIED, field_size=20.0, epsilon=0.1),
        ContrastModel(masking=MaskingNeighbourhood.WITHOUT_CENTRE),
        ContrastModel(visibility=Visibility.POSITIVE_ONLY),
    ],
    ids=["luma first", "centroid", "simplified", "without centre", "positive only"],
)
def test_every_choice_has_its_shader(model):
    colour = np.stack([fractal((61, 83), 1.0, seed) for seed in range(3)], axis=2)
    frame = np.rint(255 * np.clip(0.4 + 0.2 * colour, 0, 1)).astype(np.uint8)
    np.testing.assert_allclose(
        on_gpu((61, 83), model=model).of(frame).loss, defined(frame, model=model), atol=1e-3
    )


@pytest.mark.parametrize("factors", [np.linspace(0.005, 1, 9), np.array([0.3, 0.31, 0.9, 1.0])])
def test_any_knots_will_do(factors):
    frame = frame_of(pictures((66, 80))["photograph"])
    loss = on_gpu((66, 80), factors=factors).of(frame).loss
    np.testing.assert_allclose(loss, defined(frame, factors=factors), atol=1e-3)


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


@pytest.mark.parametrize("display", [HEADSET, OLED])
@pytest.mark.parametrize("value", [0, 1, 77, 255])
@pytest.mark.parametrize("shape", [(8, 8), (9, 13), (65, 31)])
def test_a_uniform_frame_shows_and_loses_nothing(shape, value, display):
    """Of any colour: contrast is 0 to the last bit, or rounding would be raised to its 0.2th power."""
    result = on_gpu(shape, display).of(np.full((*shape, 3), (value, 255 - value, 200), np.uint8))
    assert result.visible_contrast == 0
    assert not result.loss.any()


@pytest.mark.parametrize("order", list(PixelToLuminance))
def test_a_uniform_area_has_no_contrast_beside_a_lively_one(order):
    """What is visible in the whole is what the definition sees, though two thirds are of one colour."""
    frame = np.full((60, 90, 3), (13, 200, 77), np.uint8)
    frame[:, :30] = np.random.default_rng(5).integers(0, 256, (60, 30, 3))
    model = ContrastModel(pixel_to_luminance=order)
    np.testing.assert_allclose(
        on_gpu((60, 90), model=model).of(frame).loss, defined(frame, model=model), atol=1e-3
    )


@pytest.mark.parametrize(("peak", "black"), [(1e4, 1e-4), (1e4, 0.0), (0.01, 1e-4), (1.0, 0.0)])
def test_extreme_luminances_follow_the_definition(peak, black):
    display = Display("any", peak, black, 2.2, pixels_per_degree=60.0)
    frame = frame_of(np.random.default_rng(2).random((48, 48)) ** 8)
    result = on_gpu((48, 48), display).of(frame)
    assert np.isfinite(result.loss).all()
    np.testing.assert_allclose(result.loss, defined(frame, display), atol=1e-3)


@settings(deadline=None, max_examples=20)
@given(arrays(np.uint8, (12, 9, 3)))
def test_curves_fall_within_0_and_1_to_0_undimmed(frame):
    loss = on_gpu((12, 9)).of(frame).loss
    assert loss[-1] == 0
    assert (np.diff(loss) <= 0).all()
    assert loss[0] <= 1


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32, np.float32, np.float64])
def test_every_kind_of_pixel_value_is_converted_as_the_definition_does(dtype):
    picture = np.random.default_rng(6).random((23, 31, 3))  # an odd number of bytes in all
    top = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
    frame = (picture * top).astype(dtype)
    result = on_gpu((23, 31)).of(frame)
    assert result.mean_luminance == pytest.approx(emitted_luminance(frame, HEADSET).mean(), rel=1e-6)
    np.testing.assert_allclose(result.channel_means, channel_means(frame, HEADSET.gamma), rtol=1e-6)
    np.testing.assert_allclose(result.loss, defined(frame), atol=1e-3)


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


def test_bands_that_cannot_be_seen_count_as_empty():
    """At 400 pixels per degree the finest band is at 200 cpd; at 10000 no band can be seen."""
    frame = frame_of(np.random.default_rng(0).random((64, 64)))
    for density in (400.0, 10000.0):
        fine = dataclasses.replace(HEADSET, pixels_per_degree=density)
        np.testing.assert_allclose(on_gpu((64, 64), fine).of(frame).loss, defined(frame, fine), atol=1e-3)


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
