"""Soft visibility and forms of loss: by hand, by definition, and in one pass over the pixels."""

import json
from dataclasses import replace

import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import frame_of, pictures

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.analysis.tracks.contrast_map_figure import contrast_maps
from evenlight.data_schema.contrast_model import ContrastModel, LossForm, MaskingNeighbourhood, Visibility
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.method.choices import Device
from evenlight.method.contrast import contrast_loss, critical_factor
from evenlight.method.contrast.csf import contrast_sensitivity
from evenlight.method.contrast.detection import SLOPE, detection_probability, share_above_threshold
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import (
    brightness_factors,
    make_frame_analysis,
)
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance
from evenlight.method.contrast.masking import contrast_over_threshold, perceived_contrast
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.gpu.frame_loss import GpuFrameAnalysis
from evenlight.method.preset_files import load_contrast_model

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
OLED = Display("oled", 600.0, 0.0, 2.2, pixels_per_degree=60.0)
BRIGHT_ROOM = replace(HEADSET, reflected_luminance=2.0)
HARD, SOFT = ContrastModel(), ContrastModel(visibility=Visibility.SOFT)
SHOWN = ContrastModel(loss=LossForm.SUPRATHRESHOLD)
FACTORS = brightness_factors(0.2, 7)
SHAPE = (72, 120)
HARD_CASES = ["dark scene", "black letters", "faint letters", "edge of the shade", "stars"]


def loss_error(picture, display, model, factors=FACTORS):
    """Largest difference of the one-pass loss from the definition, over the factors."""
    frame = frame_of(picture)
    fast = FrameAnalysis(frame.shape[:2], display, model, factors).of(frame).loss
    emitted = emitted_luminance(frame, display)
    return np.abs(fast - loss_curves_by_definition(emitted, factors, display, model)).max()


def test_the_probability_of_detection_by_hand():
    # ρ^β is 0, 1, 2, 4: the probability not to detect it is 1, 1/2, 1/4, 1/16.
    over_threshold = np.array([0.0, 1.0, 2.0, 4.0]) ** (1 / SLOPE)
    np.testing.assert_allclose(detection_probability(over_threshold), [0, 1 / 2, 3 / 4, 15 / 16])


@pytest.mark.parametrize("neighbourhood", MaskingNeighbourhood)
def test_divided_by_its_contrast_over_threshold_a_pattern_is_just_visible(neighbourhood):
    band = np.random.default_rng(1).normal(0, 20, (6, 9))
    over_threshold = contrast_over_threshold(band, neighbourhood)
    for (i, j), size in np.ndenumerate(over_threshold):
        just = perceived_contrast(band / size, neighbourhood)[i, j]
        assert abs(just) == pytest.approx(1, rel=1e-9)
    visible = np.abs(perceived_contrast(band, neighbourhood)) > 1
    np.testing.assert_array_equal(over_threshold > 1, visible)


def test_no_contrast_is_detected_nowhere_and_shows_nothing():
    nothing = contrast_over_threshold(np.zeros((5, 5)))
    assert not detection_probability(nothing).any()
    assert not share_above_threshold(nothing).any()


@pytest.mark.parametrize("display", [HEADSET, BRIGHT_ROOM], ids=["dark room", "bright room"])
def test_suprathreshold_contrast_is_what_is_physically_there_less_its_threshold(display):
    emitted = np.random.default_rng(2).uniform(0.2, 100, (16, 16))
    luminance = dimmed_luminance(emitted, 0.5, display)
    counted = contrast_loss.counted_map(luminance, display, SHOWN)
    contrasts = contrast_loss.csf_contrasts(luminance, display, SHOWN)
    for shown, C, (band, around, S) in zip(
        counted, contrasts, contrast_loss._bands(luminance, display, SHOWN), strict=True
    ):
        threshold = np.abs(C) / contrast_over_threshold(C) / S  # as a contrast |ΔL| / L_a
        bounded = np.abs(band) <= around - display.reflected_luminance
        expected = np.maximum(0, np.abs(band) / (around + SHOWN.epsilon) - threshold)
        np.testing.assert_allclose(shown[bounded], expected[bounded], atol=1e-12)
        assert shown.max() <= 1


def test_forms_of_loss_by_hand():
    assert contrast_loss.loss_of(0.1, 0.4) == pytest.approx(0.75)
    assert contrast_loss.loss_of(0.1, 0.4, LossForm.SUPRATHRESHOLD) == pytest.approx(0.75)
    assert contrast_loss.loss_of(0.1, 0.4, LossForm.ABSOLUTE) == pytest.approx(0.3)


@pytest.mark.parametrize("display", [OLED, BRIGHT_ROOM], ids=["oled", "bright room"])
@pytest.mark.parametrize("model", [SOFT, SHOWN], ids=["soft", "suprathreshold"])
def test_one_pass_equals_the_definition_to_a_thousandth(model, display):
    shown = pictures(SHAPE)
    errors = {name: loss_error(shown[name], display, model) for name in HARD_CASES}
    assert max(errors.values()) < 1e-3, errors


@pytest.mark.parametrize("model", [SOFT, SHOWN], ids=["soft", "suprathreshold"])
def test_so_it_does_where_a_band_of_many_pixels_is_counted_once(model):
    assert loss_error(pictures()["photograph"], HEADSET, model, np.array([0.05, 0.3, 1.0])) < 1e-3


@pytest.mark.parametrize("picture", ["photograph", "black letters"])
def test_where_sensitivity_falls_with_luminance_one_pass_still_does(picture, monkeypatch):
    def falling(f, L, *_):
        return contrast_sensitivity(f, L) / (1 + np.asarray(L) / 30)

    for module in (critical_factor, contrast_loss):
        monkeypatch.setattr(module, "contrast_sensitivity", falling)
    tables = critical_factor.band_tables(SHAPE, 0.2, HEADSET, HARD)
    assert not any(table.rises for table in tables)
    # This falls as 1 / L, steeper than any published function.
    for model, error in (
        (HARD, 1e-3),
        (ContrastModel(visibility=Visibility.POSITIVE_ONLY), 1e-3),
        (SOFT, 2e-3),
    ):
        assert loss_error(pictures(SHAPE)[picture], HEADSET, model) < error


def test_between_knots_soft_curves_have_no_stairs():
    """Linear interpolation between the 65 knots, against the definition: a step is one pixel of 30 or so."""
    frame, knots = frame_of(pictures(SHAPE)["photograph"]), brightness_factors()
    between = np.sqrt(knots[:-1] * knots[1:])[::8]
    emitted, errors = emitted_luminance(frame, HEADSET), {}
    for model in (HARD, SOFT):
        loss = FrameAnalysis(SHAPE, HEADSET, model, knots).of(frame).loss
        defined = loss_curves_by_definition(emitted, between, HEADSET, model)
        errors[model.visibility] = np.abs(np.interp(between, knots, loss) - defined).max()
    assert errors[Visibility.SOFT] < 2e-4
    assert errors[Visibility.SOFT] < errors[Visibility.BOTH_POLARITIES] / 3


def test_the_graphics_processor_leaves_degrees_of_visibility_to_the_processor():
    for model, name in ((SOFT, "soft"), (SHOWN, "suprathreshold")):
        with pytest.raises(InputError, match=f"{name!r}.*use the processor"):
            GpuFrameAnalysis((16, 16), HEADSET, model, FACTORS, own_context())
        assert make_frame_analysis((16, 16), HEADSET, model, FACTORS, Device.AUTO).device is Device.CPU


def test_a_map_of_lost_contrast_shows_what_is_rather_detected_than_not():
    frame = frame_of(pictures(SHAPE)["photograph"])
    hard, soft, shown = (contrast_maps(frame, [(0.3, None)], HEADSET, m)[0] for m in (HARD, SOFT, SHOWN))
    np.testing.assert_array_equal(soft.lost, hard.lost)
    assert hard.lost.any()
    emitted = emitted_luminance(frame, HEADSET)
    for found, model in ((soft, SOFT), (shown, SHOWN)):
        assert found.loss == pytest.approx(contrast_loss.contrast_loss(emitted, 0.3, HEADSET, model))


def test_curves_of_models_without_the_later_choices_stay_usable():
    """Their files hold the hash of a model that had no such choices."""
    later = ("loss", "masking_strength", "threshold")
    before = {key: value for key, value in mapping_from_record(HARD).items() if key not in later}
    assert sha256_of_record(HARD) == sha256_of_bytes(json.dumps(before, sort_keys=True).encode())
    assert len({sha256_of_record(ContrastModel(loss=form)) for form in LossForm}) == len(LossForm)


@pytest.mark.parametrize("name", [name for name in MEASURES if name != "relative"])
def test_every_measure_has_a_preset(name):
    assert load_contrast_model(name) == MEASURES[name]
