"""The loss at one factor, counted in strips; soft visibility and forms of loss."""

import json
from dataclasses import replace

import numpy as np
import pytest
from compute_shaders import own_context
from hard_pictures import frame_of, pictures
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.analysis.tracks.contrast_map_figure import contrast_maps
from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    LossForm,
    MaskingNeighbourhood,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.method.choices import Device
from evenlight.method.contrast import contrast_loss, critical_factor, one_factor
from evenlight.method.contrast.csf import contrast_sensitivity
from evenlight.method.contrast.detection import SLOPE, detection_probability, share_above_threshold
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import (
    brightness_factors,
    make_frame_analysis,
)
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance
from evenlight.method.contrast.masking import contrast_over_threshold, perceived_contrast
from evenlight.method.contrast.one_factor import STRIP, OneFactorLoss, counted_rows
from evenlight.method.gpu.frame_loss import GpuFrameAnalysis
from evenlight.method.preset_files import load_display

DISPLAY = load_display("varjo-xr3")


def picture(height: int, width: int, seed: int = 1) -> np.ndarray:
    """Detail at every scale, in colour, with an area of one luminance."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :])
    spectrum = np.fft.rfft2(rng.standard_normal((height, width))) / np.maximum(frequency, 1 / width)
    detail = np.fft.irfft2(spectrum, (height, width))
    gray = np.clip(0.45 + 0.2 * detail / detail.std(), 0, 1)
    pixels = np.stack([gray, gray**1.2, 0.8 * gray], axis=2)
    pixels[: height // 3, : width // 3] = 0.3
    return np.asarray((255 * pixels).round(), dtype=np.uint8)


@given(st.integers(1, 400), st.integers(1, 6), st.integers(0, 100))
def test_over_as_many_turns_as_there_are_each_row_is_counted_once(
    height: int, one_in: int, turn: int
) -> None:
    """Where too few rows are there to leave any out, all are counted at every turn."""
    times = np.zeros(height, int)
    for k in range(turn, turn + one_in):
        strips = counted_rows(height, one_in, k)
        assert strips
        for begin, end in strips:
            times[begin:end] += 1
    assert (times == (one_in if height < one_in * STRIP else 1)).all()


def test_the_mean_of_four_turns_is_what_all_rows_give(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_factor, "MANY_PIXELS", 0)
    pixels, shape = picture(96, 80), (96, 80)  # no level has rows left over
    emitted = emitted_luminance(pixels, DISPLAY).astype(np.float32)
    model = replace(DEFAULT_MODEL, band_count=2)
    strips, whole = (OneFactorLoss(shape, DISPLAY, model, one_strip_in=n) for n in (4, 1))
    turns = np.array([strips.visible_contrast(emitted, 0.3, turn) for turn in range(4)])
    assert np.ptp(turns[:, 0]) > 0
    np.testing.assert_allclose(turns.mean(axis=0), whole.visible_contrast(emitted, 0.3), rtol=1e-12)


@pytest.mark.parametrize("period", [8, 16, 32, 64, 128])
@pytest.mark.parametrize("thick", [0.25, 0.5])
def test_strips_err_no_more_than_strips_drawn_by_lot(
    monkeypatch: pytest.MonkeyPatch, period: int, thick: float
) -> None:
    """Grain in bands, which strips at equal distances see always or never.

    Of one strip drawn by lot from each four, the mean errs with an SD of σ / sqrt(parts), σ that of the four
    strips about their mean; 2.5 SD are what one draw in a hundred passes.
    """
    height, rng = 576, np.random.default_rng(period)
    on = abs(np.arange(height) % period - period / 2) < thick * period / 2
    gray = 0.4 + 0.15 * on[:, None] * rng.standard_normal((height, 64))
    emitted = emitted_luminance(np.repeat(gray[..., None], 3, axis=2).clip(0, 1), DISPLAY).astype(np.float32)
    monkeypatch.setattr(one_factor, "MANY_PIXELS", 0)
    loss = OneFactorLoss((height, 64), DISPLAY, replace(DEFAULT_MODEL, band_count=1), one_strip_in=4)
    turns = [loss.visible_contrast(emitted, 0.3, turn)[1] for turn in range(4)]
    shares = []
    for begin in range(0, height, STRIP):
        alone = [(begin, begin + STRIP)]
        monkeypatch.setattr(one_factor, "counted_rows", lambda *_, alone=alone: alone)
        shares.append(loss.visible_contrast(emitted, 0.3)[1])
    parts = np.reshape(shares, (-1, 4))
    assert parts.mean() > 0.05
    by_lot = np.sqrt(parts.var(axis=1).mean() / len(parts))
    assert np.abs(np.array(turns) - parts.mean()).max() <= 2.5 * by_lot


def test_of_some_pixels_the_share_is_theirs() -> None:
    """Whole columns of every band fall to one part or the other; a uniform part has nothing visible in it."""
    pixels, left = picture(96, 128), np.arange(128) < 64
    pixels[:, ~left] = 0.5
    emitted = emitted_luminance(pixels, DISPLAY).astype(np.float32)
    loss = OneFactorLoss((96, 128), DISPLAY, replace(DEFAULT_MODEL, band_count=4))
    whole, parts = loss.visible_contrast(emitted, 0.3), []
    for counted in (left, ~left):
        loss.count_only(np.repeat(counted[None], 96, axis=0))
        parts.append(loss.visible_contrast(emitted, 0.3))
    np.testing.assert_allclose(np.mean(parts, axis=0), whole, rtol=1e-9)
    assert parts[0][1] > 2 * parts[1][1] > 0  # where they meet


def test_small_pictures_are_counted_whole() -> None:
    pixels = picture(360, 480)
    whole, strips = (OneFactorLoss((360, 480), DISPLAY, one_strip_in=n).of(pixels, 0.3) for n in (1, 4))
    assert strips == whole


def test_what_was_not_asked_for_at_first_is_refused() -> None:
    loss = OneFactorLoss((40, 50), DISPLAY, lowest_factor=0.3)
    with pytest.raises(InputError, match=r"shape \(40, 50\), got \(50, 40\)"):
        loss.of(picture(50, 40), 0.5)
    with pytest.raises(InputError, match=r"0\.3 to 1, got 0\.2"):
        loss.of(picture(40, 50), 0.2)


# --- soft visibility

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)

BRIGHT_ROOM = replace(HEADSET, reflected_luminance=2.0)

HARD, SOFT = ContrastModel(), ContrastModel(visibility=Visibility.SOFT)

SHOWN = ContrastModel(loss=LossForm.SUPRATHRESHOLD)

FACTORS = brightness_factors(0.2, 7)

SHAPE = (72, 120)


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


@pytest.mark.slow
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
