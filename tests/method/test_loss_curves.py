"""Loss curves in one pass: against the definition, on hard frames, and over the frames of a video."""

import dataclasses

import numpy as np
import pytest
from hard_pictures import fractal, frame_of, pictures
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    BandFrequency,
    ContrastModel,
    MaskingNeighbourhood,
    PixelToLuminance,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.contrast_loss import visible_contrast
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import (
    analyze_frames,
    brightness_factors,
)
from evenlight.method.contrast.luminance import channel_means, dimmed_luminance, emitted_luminance
from evenlight.method.contrast.one_pass import exp2, log2

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
OLED = Display("oled", 600.0, 0.0, 2.2, pixels_per_degree=60.0)
BRIGHT_ROOM = dataclasses.replace(HEADSET, reflected_luminance=2.0)
FACTORS = brightness_factors(0.2, 7)


def loss_error(frame, display, model=DEFAULT_MODEL, factors=FACTORS):
    """Largest difference of the one-pass loss from the definition, over the factors."""
    shape = frame.shape[:2]
    emitted = emitted_luminance(frame, display, model.pixel_to_luminance)
    fast = FrameAnalysis(shape, display, model, factors).of(frame).loss
    return np.abs(fast - loss_curves_by_definition(emitted, factors, display, model)).max()


@pytest.mark.slow
@pytest.mark.parametrize("display", [HEADSET, OLED, BRIGHT_ROOM], ids=["headset", "oled", "bright room"])
def test_one_pass_equals_the_definition_to_a_thousandth(display):
    errors = {name: loss_error(frame_of(picture), display) for name, picture in pictures().items()}
    assert max(errors.values()) < 1e-3, errors


@pytest.mark.parametrize("lowest", [0.5, 0.05, 0.005])
def test_any_lowest_factor_will_do(lowest):
    frame = frame_of(pictures()["photograph"])
    assert loss_error(frame, HEADSET, factors=brightness_factors(lowest, 6)) < 1e-3


@pytest.mark.parametrize(
    "model",
    [
        ContrastModel(pixel_to_luminance=PixelToLuminance.LUMA_FIRST),
        ContrastModel(band_frequency=BandFrequency.CENTROID),
        ContrastModel(band_frequency=BandFrequency.AUTHORS, sensitivity=SensitivityModel.AUTHORS),
        ContrastModel(sensitivity=SensitivityModel.SIMPLIFIED, field_size=20.0, epsilon=0.1),
        ContrastModel(masking=MaskingNeighbourhood.WITHOUT_CENTRE),
        ContrastModel(visibility=Visibility.POSITIVE_ONLY, band_count=4),
    ],
)
def test_every_choice_has_its_one_pass(model):
    colour = np.stack([fractal((128, 160), 1.0, seed) for seed in range(3)], axis=2)
    frame = np.rint(255 * np.clip(0.4 + 0.2 * colour, 0, 1)).astype(np.uint8)
    assert FrameAnalysis(frame.shape[:2], HEADSET, model, FACTORS).in_one_pass
    assert loss_error(frame, HEADSET, model) < 1e-3


def test_visible_contrast_itself_equals_the_definition():
    frame = frame_of(pictures()["photograph"])
    fast = FrameAnalysis(frame.shape[:2], HEADSET, ContrastModel(), FACTORS).of(frame)
    dimmed = dimmed_luminance(emitted_luminance(frame, HEADSET), 1.0, HEADSET)
    assert fast.visible_contrast == pytest.approx(visible_contrast(dimmed, HEADSET), abs=1e-4)


@settings(deadline=None, max_examples=60)
@given(
    arrays(np.uint8, st.tuples(st.integers(8, 13), st.integers(8, 13), st.just(3))),
    st.sampled_from([HEADSET, OLED, BRIGHT_ROOM]),
)
def test_curves_fall_within_0_and_1_to_0_undimmed(frame, display):
    loss = FrameAnalysis(frame.shape[:2], display, ContrastModel(), FACTORS).of(frame).loss
    assert loss[-1] == 0
    assert (np.diff(loss) <= 0).all()
    assert loss[0] <= 1


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(arrays(np.uint8, (12, 9, 3)))
def test_rows_and_columns_are_treated_alike(frame):
    """Up to one pixel at the very threshold: of 12 in the coarser of the two bands."""
    upright, turned = (
        FrameAnalysis(f.shape[:2], HEADSET, ContrastModel(), FACTORS).of(f).visible_contrast
        for f in (frame, frame.swapaxes(0, 1))
    )
    assert upright == pytest.approx(turned, abs=1 / 12)


@pytest.mark.parametrize("display", [HEADSET, OLED, BRIGHT_ROOM])
@pytest.mark.parametrize("value", [0, 1, 128, 255])
@pytest.mark.parametrize("shape", [(8, 8), (9, 13), (65, 8)])
def test_a_uniform_frame_shows_and_loses_nothing(shape, value, display):
    analysis = FrameAnalysis(shape, display, ContrastModel(), FACTORS)
    result = analysis.of(np.full((*shape, 3), value, np.uint8))
    assert result.visible_contrast == 0
    assert not result.loss.any()


@pytest.mark.parametrize("black", [0.0, 1e-4, 0.2])
@pytest.mark.parametrize("peak", [1.0, 1e4])
@pytest.mark.parametrize("shape", [(8, 8), (9, 13), (33, 20)])
def test_one_bright_pixel_is_visible_and_follows_the_definition(shape, peak, black):
    display = Display("any", peak, black, 2.2, pixels_per_degree=60.0)
    frame = np.zeros((*shape, 3), np.uint8)
    frame[shape[0] // 2, shape[1] // 2] = 255
    result = FrameAnalysis(shape, display, ContrastModel(), FACTORS).of(frame)
    assert 0 < result.visible_contrast <= 1
    # Few pixels, many alike by symmetry: what may differ is whether one of them has crossed its threshold.
    expected = loss_curves_by_definition(emitted_luminance(frame, display), FACTORS, display)
    assert (np.abs(result.loss - expected) < 1e-3).mean() > 0.8
    assert np.isfinite(result.loss).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_every_kind_of_pixel_value_is_converted_as_the_definition_does(dtype):
    picture = np.random.default_rng(6).random((24, 31, 3))
    top = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
    frame = (picture * top).astype(dtype)
    result = FrameAnalysis((24, 31), HEADSET, ContrastModel(), FACTORS).of(frame)
    assert result.mean_luminance == pytest.approx(emitted_luminance(frame, HEADSET).mean(), rel=1e-6)
    np.testing.assert_allclose(result.channel_means, channel_means(frame, HEADSET.gamma), rtol=1e-6)


def test_bands_that_cannot_be_seen_count_as_empty():
    """At 400 pixels per degree the finest band is at 200 cpd: no contrast can be visible there."""
    fine = dataclasses.replace(HEADSET, pixels_per_degree=400.0)
    assert loss_error(frame_of(np.random.default_rng(0).random((64, 64))), fine) < 1e-3


def test_where_one_pass_does_not_hold_the_definition_is_used():
    """The authors' sensitivity is taken at the mean of a level, and reflections depend on each pixel."""
    model, frame = (
        ContrastModel(sensitivity=SensitivityModel.AUTHORS),
        frame_of(np.random.default_rng(0).random((16, 16))),
    )
    analysis = FrameAnalysis((16, 16), BRIGHT_ROOM, model, FACTORS)
    assert not analysis.in_one_pass
    expected = loss_curves_by_definition(emitted_luminance(frame, BRIGHT_ROOM), FACTORS, BRIGHT_ROOM, model)
    np.testing.assert_allclose(analysis.of(frame).loss, expected, atol=1e-12)


@settings(deadline=None)  # the first call compiles
@given(st.floats(-120, 120, width=32))
def test_fast_logarithm_and_power(x):
    """Error of either: a few units of the last place of a float32."""
    power = exp2(np.float32(x))
    assert power == pytest.approx(2.0**x, rel=4e-7)
    assert log2(power) == pytest.approx(np.log2(float(power)), abs=4e-7 + 2e-7 * abs(x))


def video(*pictures):
    """Frames of 0.1 s."""
    return [Frame(0.1 * i, 0.1, frame_of(picture)) for i, picture in enumerate(pictures)]


def test_a_video_gives_a_curve_per_frame():
    rng = np.random.default_rng(7)
    frames = video(rng.random((12, 16)), np.zeros((12, 16)), rng.random((12, 16)))
    curves = analyze_frames(iter(frames), "clip", HEADSET, factors=FACTORS)
    np.testing.assert_array_equal(curves.factors, FACTORS)
    np.testing.assert_allclose(curves.times, [0, 0.1, 0.2])
    np.testing.assert_allclose(curves.durations, 0.1)
    assert curves.mean_luminance[1] == pytest.approx(HEADSET.black_level)
    assert curves.visible_contrast[1] == 0
    for i in (0, 2):
        alone = FrameAnalysis((12, 16), HEADSET, ContrastModel(), FACTORS).of(frames[i].pixel_values)
        np.testing.assert_array_equal(curves.loss[i], alone.loss)


def test_knots_are_the_default_ones_unless_given():
    curves = analyze_frames(video(np.eye(8)), "clip", HEADSET)
    np.testing.assert_array_equal(curves.factors, brightness_factors())
    assert curves.factors[0] == 0.2


def test_a_frame_like_the_one_before_is_not_analysed_again(monkeypatch):
    analysed = []
    analyse = FrameAnalysis.of
    monkeypatch.setattr(FrameAnalysis, "of", lambda self, p: (analysed.append(p), analyse(self, p))[1])
    still, moved = np.eye(8), np.eye(8)[::-1]
    curves = analyze_frames(video(still, still, moved, still), "clip", HEADSET)
    assert len(analysed) == 3
    assert curves.n_frames == 4
    np.testing.assert_array_equal(curves.loss[0], curves.loss[1])


def test_a_source_may_fill_the_same_array_again():
    def refilled():
        pixels = np.empty((8, 8, 3), np.uint8)
        for value in (0, 255):
            pixels[:] = value
            yield Frame(value / 255, 1.0, pixels)

    curves = analyze_frames(refilled(), "clip", HEADSET)
    np.testing.assert_allclose(curves.mean_luminance, [0.2, 104.4], rtol=1e-6)


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([], "clip: holds no frame"),
        (video(np.zeros((7, 20))), "clip: frames are 20 x 7 pixels; need at least 8 x 8"),
        (video(np.zeros((8, 8)), np.zeros((8, 9))), "clip: frame 1 has 9 x 8 pixels, the one before 8 x 8"),
    ],
)
def test_what_cannot_be_analysed_is_refused(frames, message):
    with pytest.raises(InputError, match=message):
        analyze_frames(frames, "clip", HEADSET)


@pytest.mark.parametrize("factors", [[0.5], [0.0, 1.0], [0.5, 0.4, 1.0], [0.2, 0.9]])
def test_knots_that_do_not_rise_to_1_are_refused(factors):
    with pytest.raises(ValueError, match="factors must rise"):
        analyze_frames(video(np.eye(8)), "clip", HEADSET, factors=factors)
