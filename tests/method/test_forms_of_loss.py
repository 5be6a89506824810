"""The loss in its four forms is the definition: in one pass or at one factor, compiled or in shaders."""

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import fractal, frame_of, pictures
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    BandFrequency,
    ContrastModel,
    LossForm,
    MaskingNeighbourhood,
    PixelToLuminance,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import visible_contrast
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import channel_means, dimmed_luminance, emitted_luminance
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.gpu.frame_loss import GpuFrameAnalysis, GpuLoss

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
OLED = Display("oled", 600.0, 0.0, 2.2, pixels_per_degree=60.0)
BRIGHT_ROOM = replace(HEADSET, reflected_luminance=2.0)
DISPLAYS = {"headset": HEADSET, "oled": OLED, "bright room": BRIGHT_ROOM}
FACTORS = brightness_factors(0.2, 7)
SHAPE = (72, 120)
SOFT = ContrastModel(visibility=Visibility.SOFT)
SHOWN = ContrastModel(loss=LossForm.SUPRATHRESHOLD)


@functools.lru_cache(64)
def analysis(kind, shape, display, model, factors):
    """Return what finds the losses of frames of one shape; its tables serve for many of them."""
    if kind is FrameAnalysis:
        return FrameAnalysis(shape, display, model, np.array(factors))
    if kind is GpuFrameAnalysis:
        return GpuFrameAnalysis(shape, display, model, np.array(factors), own_context())
    if kind is OneFactorLoss:
        return OneFactorLoss(shape, display, model, lowest_factor=factors[0])
    own = own_context()
    return own.run(lambda: GpuLoss(own.context, shape, display, model, lowest_factor=factors[0]))


def made(kind, frame, display, model, factors):
    return analysis(kind, frame.shape[:2], display, model, tuple(np.asarray(factors).tolist()))


def one_pass(*frame_and_choices):
    return made(FrameAnalysis, *frame_and_choices).of(frame_and_choices[0]).loss


def one_pass_in_shaders(*frame_and_choices):
    return made(GpuFrameAnalysis, *frame_and_choices).of(frame_and_choices[0]).loss


def one_factor(frame, display, model, factors):
    loss = made(OneFactorLoss, frame, display, model, factors)
    return np.array([loss.of(frame, float(b)).loss for b in factors])


def one_factor_in_shaders(frame, display, model, factors):
    loss = made(GpuLoss, frame, display, model, factors)
    return own_context().run(lambda: np.array([loss.of(frame, float(b)).loss for b in factors]))


FORMS = (one_pass, one_pass_in_shaders, one_factor, one_factor_in_shaders)
each_form = pytest.mark.parametrize(
    "form",
    FORMS,
)
of_a_pass = pytest.mark.parametrize("form", [one_pass, one_pass_in_shaders])


def defined(frame, display=HEADSET, model=DEFAULT_MODEL, factors=FACTORS):
    emitted = emitted_luminance(frame, display, model.pixel_to_luminance)
    return loss_curves_by_definition(emitted, factors, display, model)


def error_of(form, frame, display=HEADSET, model=DEFAULT_MODEL, factors=FACTORS):
    """Largest difference of a form from the definition, over the factors."""
    return np.abs(form(frame, display, model, factors) - defined(frame, display, model, factors)).max()


@pytest.mark.parametrize("display", DISPLAYS.values(), ids=DISPLAYS)
def test_every_picture_has_the_loss_of_the_definition_to_a_thousandth(display):
    factors, errors = FACTORS[[0, 3, 6]], {}
    for name, picture in pictures(SHAPE).items():
        frame = frame_of(picture)
        expected = defined(frame, display, factors=factors)
        for form in FORMS:
            found = form(frame, display, DEFAULT_MODEL, factors)
            errors[name, form.__name__] = np.abs(found - expected).max()
    assert max(errors.values()) < 1e-3, errors


@pytest.mark.parametrize("model", [DEFAULT_MODEL, SOFT, SHOWN], ids=["hard", "soft", "suprathreshold"])
def test_so_it_is_where_a_band_of_many_pixels_is_counted_once(model):
    """Bands of many pixels are compared at eight factors, others at one."""
    for name in ("photograph", "edge of the shade"):
        assert (
            error_of(one_pass, frame_of(pictures()[name]), HEADSET, model, np.array([0.05, 0.3, 1.0])) < 1e-3
        )


@pytest.mark.parametrize("display", [OLED, BRIGHT_ROOM], ids=["oled", "bright room"])
@pytest.mark.parametrize("model", [SOFT, SHOWN], ids=["soft", "suprathreshold"])
def test_so_it_is_of_hard_pictures_where_visibility_is_soft_or_contrast_counts(model, display):
    shown = pictures(SHAPE)
    for name in ("dark scene", "black letters", "faint letters", "edge of the shade", "stars"):
        assert error_of(one_pass, frame_of(shown[name]), display, model) < 1e-3, name


@pytest.mark.parametrize(
    "choice",
    [{}, {"masking": MaskingNeighbourhood.WITHOUT_CENTRE}, {"masking_strength": 0.0},
     {"masking_strength": 2.5}, {"threshold": 2.0}],
    ids=str,
)  # fmt: skip
def test_masking_is_the_same_in_every_form_to_a_few_pixels(choice):
    """2e-4 of a loss is a few of the 8640 pixels of the finest band; a choice that is passed over is 1e-2."""
    frames = [frame_of(pictures(SHAPE)[name]) for name in ("photograph", "black letters", "faint letters")]
    model, factors = ContrastModel(**choice), np.array([0.2, 0.4, 0.7, 1.0])
    for frame in frames:
        for form in FORMS:
            assert error_of(form, frame, HEADSET, model, factors) < 2e-4
    told = [np.abs(defined(f, factors=factors) - defined(f, HEADSET, model, factors)).max() for f in frames]
    assert max(told) > 1e-2 or not choice


@each_form
@pytest.mark.parametrize("size", [(8, 8), (9, 8), (8, 9), (15, 17), (9, 31), (61, 47), (90, 160)])
def test_pictures_of_any_size_follow_the_definition(form, size):
    """Also a pixel off a power of two."""
    frame = frame_of(np.random.default_rng(4).random(size))
    assert error_of(form, frame, factors=FACTORS[[0, 3, 6]]) < (2e-4 if form is one_factor else 1e-3)


CHOICES = [
    {"pixel_to_luminance": PixelToLuminance.LUMA_FIRST},
    {"band_frequency": BandFrequency.CENTROID, "band_count": 3},
    {"band_frequency": BandFrequency.AUTHORS},
    {"sensitivity": SensitivityModel.SIMPLIFIED, "field_size": 5.0, "epsilon": 1.0},
    {"masking": MaskingNeighbourhood.WITHOUT_CENTRE},
    {"visibility": Visibility.POSITIVE_ONLY, "band_count": 4},
    {"masking_strength": 0.0},
    {"masking_strength": 2.5},
    {"threshold": 2.0},
]
OF_THE_PROCESSOR = [
    {"loss": LossForm.ABSOLUTE},
    {"sensitivity": SensitivityModel.AUTHORS},
    {"visibility": Visibility.SOFT},
    {"visibility": Visibility.SOFT, "masking": MaskingNeighbourhood.WITHOUT_CENTRE},
    {"loss": LossForm.SUPRATHRESHOLD},
    {"loss": LossForm.SUPRATHRESHOLD, "visibility": Visibility.POSITIVE_ONLY},
]


@pytest.mark.parametrize(
    "choice",
    CHOICES + OF_THE_PROCESSOR,
    ids=lambda choice: "-".join(str(getattr(value, "value", value)) for value in choice.values()),
)
@pytest.mark.parametrize("reflected", [0.0, 2.0])
def test_every_choice_of_the_model_is_kept_in_every_form(choice, reflected):
    """And each matters here: no form could agree by passing over it."""
    colour = np.stack([fractal((48, 72), 1.0, seed) for seed in range(3)], axis=2)
    frame = np.rint(255 * np.clip(0.4 + 0.2 * colour, 0, 1)).astype(np.uint8)
    frame[:16, :24] = (13, 200, 77)  # an area of one colour has no contrast beside a lively one
    model, display = ContrastModel(**choice), replace(HEADSET, reflected_luminance=reflected)
    factors = FACTORS[[0, 3, 6]]
    expected = defined(frame, display, model, factors)
    for form in FORMS if choice in CHOICES else (one_pass, one_factor):
        np.testing.assert_allclose(form(frame, display, model, factors), expected, atol=6e-4)
    if not reflected:  # what fell back on the definition would agree with it
        assert FrameAnalysis((48, 72), display, model, factors).in_one_pass
        assert np.abs(defined(frame, display, factors=factors) - expected).max() > 8e-4


@each_form
@pytest.mark.parametrize("factors", [brightness_factors(0.005, 6), np.array([0.3, 0.31, 0.9, 1.0])])
def test_any_factors_will_do(form, factors):
    for name in ("photograph", "edge of the shade"):
        assert error_of(form, frame_of(pictures((66, 80))[name]), factors=factors) < 1e-3


@of_a_pass
@pytest.mark.parametrize("name", ["photograph", "black letters", "faint letters"])
def test_visible_contrast_itself_is_that_of_the_definition(form, name):
    frame = frame_of(pictures(SHAPE)[name])
    found = whole_pass(SHAPE, on_gpu=form is not one_pass)(frame)
    dimmed = dimmed_luminance(emitted_luminance(frame, HEADSET), 1.0, HEADSET)
    assert found.visible_contrast == pytest.approx(visible_contrast(dimmed, HEADSET), abs=2e-4)


@each_form
@settings(deadline=None, max_examples=15)
@given(arrays(np.uint8, (9, 13, 3)), st.sampled_from(list(DISPLAYS.values())))
def test_loss_falls_within_0_and_1_to_0_undimmed(form, frame, display):
    loss = form(frame, display, DEFAULT_MODEL, FACTORS[[0, 3, 6]])
    assert loss[-1] == 0
    assert ((loss >= 0) & (loss <= 1)).all()
    if "pass" in form.__name__:
        assert (np.diff(loss) <= 0).all()


@each_form
@pytest.mark.parametrize("shape", [(9, 13), (65, 31)])
def test_a_uniform_frame_loses_nothing(form, shape):
    """Of any colour: contrast is 0 to the last bit, or rounding would be raised to its 0.2th power."""
    for display, value in ((HEADSET, 0), (HEADSET, 1), (HEADSET, 77), (BRIGHT_ROOM, 255), (OLED, 0)):
        frame = np.full((*shape, 3), (value, 255 - value, 200), np.uint8)
        assert not form(frame, display, DEFAULT_MODEL, FACTORS[[0, 6]]).any()


@of_a_pass
@pytest.mark.parametrize(("peak", "black"), [(1e4, 1e-4), (1e4, 0.0), (0.01, 1e-4), (1.0, 0.0)])
def test_extreme_luminances_follow_the_definition(form, peak, black):
    display = Display("any", peak, black, 2.2, pixels_per_degree=60.0)
    frame = frame_of(np.random.default_rng(2).random((48, 48)) ** 8)
    assert error_of(form, frame, display) < 1e-3


@pytest.mark.parametrize("black", [0.0, 1e-4, 0.2])
@pytest.mark.parametrize("peak", [1.0, 1e4])
@pytest.mark.parametrize("shape", [(8, 8), (33, 20)])
def test_one_bright_pixel_is_visible_and_follows_the_definition(shape, peak, black):
    display = Display("any", peak, black, 2.2, pixels_per_degree=60.0)
    frame = np.zeros((*shape, 3), np.uint8)
    frame[shape[0] // 2, shape[1] // 2] = 255
    result = FrameAnalysis(shape, display, DEFAULT_MODEL, FACTORS).of(frame)
    assert 0 < result.visible_contrast <= 1
    # Few pixels, many alike by symmetry: what may differ is whether one of them has crossed its threshold.
    assert (np.abs(result.loss - defined(frame, display)) < 1e-3).mean() > 0.8
    assert np.isfinite(result.loss).all()


@each_form
@pytest.mark.parametrize("density", [400.0, 10000.0])
def test_bands_that_cannot_be_seen_count_as_empty(form, density):
    """At 400 pixels per degree the finest band is at 200 cpd; at 10000 no band can be seen."""
    fine = replace(HEADSET, pixels_per_degree=density)
    assert error_of(form, frame_of(np.random.default_rng(0).random((64, 64))), fine) < 1e-3


def whole_pass(shape: tuple[int, int], on_gpu: bool) -> Callable:
    arguments = (shape, HEADSET, DEFAULT_MODEL, FACTORS)
    return (GpuFrameAnalysis(*arguments, own_context()) if on_gpu else FrameAnalysis(*arguments)).of


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("on_gpu", [False, True])
def test_every_kind_of_pixel_value_is_converted_as_the_definition_does(on_gpu, dtype):
    picture = np.random.default_rng(6).random((23, 31, 3))  # an odd number of bytes in all
    top = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
    frame = (picture * top).astype(dtype)
    result = whole_pass((23, 31), on_gpu)(frame)
    emitted = emitted_luminance(frame, HEADSET)
    assert result.mean_luminance == pytest.approx(emitted.mean(), rel=1e-6)
    np.testing.assert_allclose(result.channel_means, channel_means(frame, HEADSET.gamma), rtol=1e-6)
    np.testing.assert_allclose(result.loss, defined(frame), atol=1e-3)
    at_one = OneFactorLoss((23, 31), HEADSET).of(frame, 0.4)
    assert at_one.loss == pytest.approx(defined(frame, factors=np.array([0.4, 1.0]))[0], abs=1e-3)
    assert at_one.mean_luminance == pytest.approx(emitted.mean(), rel=1e-5)


def test_where_one_pass_does_not_hold_the_definition_is_used():
    """The authors' sensitivity is taken at the mean of a level, and reflections depend on each pixel."""
    model = ContrastModel(sensitivity=SensitivityModel.AUTHORS)
    frame = frame_of(np.random.default_rng(0).random((16, 16)))
    for display, in_one_pass in ((HEADSET, True), (BRIGHT_ROOM, False)):
        analysis = FrameAnalysis((16, 16), display, model, FACTORS)
        assert analysis.in_one_pass is in_one_pass
    np.testing.assert_allclose(analysis.of(frame).loss, defined(frame, BRIGHT_ROOM, model), atol=1e-12)
