"""Hard cases of light: darkness, glare, no contrast, no sensitivity, pixels that are no numbers."""

import math

import numpy as np
import pytest

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.contrast_loss import visible_contrast
from evenlight.method.contrast.critical_factor import band_table
from evenlight.method.contrast.csf import contrast_sensitivity, pupil_diameter
from evenlight.method.contrast.frame_light import convert_integers
from evenlight.method.contrast.loss_curves import (
    analyze_frames,
    brightness_factors,
)
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.masking import perceived_contrast
from evenlight.method.contrast.one_pass import expanded, reduced
from evenlight.method.contrast.pyramid import (
    gaussian_pyramid,
    laplacian_bands,
)


def lab(peak: float = 100.0, **others: float) -> Display:
    given = {"black_level": 0.0, "gamma": 2.2, "pixels_per_degree": 60.0} | others
    return Display("lab", peak, **given)


def curves_of(picture: np.ndarray, display: Display):
    """Loss curves of one gray picture."""
    pixels = np.repeat(np.asarray(picture, dtype=np.float64)[:, :, None], 3, axis=2)
    return analyze_frames([Frame(0.0, 0.04, pixels)], "made", display)


def by_definition(picture: np.ndarray, display: Display) -> np.ndarray:
    pixels = np.repeat(np.asarray(picture, dtype=np.float64)[:, :, None], 3, axis=2)
    return loss_curves_by_definition(emitted_luminance(pixels, display), brightness_factors(), display)


def test_rounding_noise_in_a_flat_frame_masks_nothing() -> None:
    flat = np.full((32, 32), 97.123, np.float32)
    coarse = reduced(flat)
    assert not (flat - expanded(coarse, 32, 32)).any()
    assert not any(band.any() for band in laplacian_bands(gaussian_pyramid(flat.astype(np.float64), 4)))


def test_a_table_of_sensitivity_over_ten_octaves_of_luminance() -> None:
    dark = 0.05
    right = contrast_sensitivity(4.0, dark)
    table = band_table(4.0, 0.2, lab(1e4), DEFAULT_MODEL)
    place = np.linspace(*table.log_luminance_range, len(table.log_sensitivity))
    ours = 2.0 ** np.interp(np.log2(dark), place, table.log_sensitivity)
    assert ours == pytest.approx(right, rel=1e-4)


def test_values_of_luminance_below_all_floats_stay_numbers() -> None:
    tiny = 1e-310 * np.random.default_rng(2).random((16, 16))  # denormal: 1 / tiny overflows
    curves = curves_of(tiny, lab())
    assert np.isfinite(curves.loss).all()
    assert not curves.loss.any()
    assert np.isfinite(visible_contrast(tiny, lab()))


def test_sensitivity_at_high_frequency_has_a_logarithm() -> None:
    for frequency in (60.0, 500.0, 5000.0):
        table = band_table(frequency, 0.2, lab(1e4), DEFAULT_MODEL)
        assert np.isfinite(table.log_sensitivity).all()
        assert np.isfinite(table.log_luminance).all()
    assert not table.can_be_seen
    finest = lab(1e4, pixels_per_degree=1e4)
    picture = np.random.default_rng(3).random((16, 16))
    np.testing.assert_array_equal(curves_of(picture, finest).loss[0], by_definition(picture, finest))


def test_sensitivity_at_low_frequency_falls_in_proportion() -> None:
    # For small x, 1 - exp(-x) is x, and S goes as the square root of it: as f. Written so, x = 1e-18 is lost.
    tiny = np.array([1e-12, 1e-9, 1e-6])
    per_frequency = contrast_sensitivity(tiny, 50.0) / tiny
    np.testing.assert_allclose(per_frequency, per_frequency[0], rtol=1e-6)
    assert contrast_sensitivity(0.0, [1e-6, 50.0]).tolist() == [0.0, 0.0]


def test_the_pupil_in_the_dark() -> None:
    assert np.all(np.diff(pupil_diameter(np.geomspace(1e-6, 1e6, 50))) < 0)
    dark = contrast_sensitivity(2.0, [0.0, 1e-9, 1e-6])
    assert dark.tolist() == [dark[2]] * 3  # held at the darkest luminance that the eye sees
    assert 0 < dark[0] < contrast_sensitivity(2.0, 1e-4)


def test_masking_of_no_contrast_and_of_absurd_contrast() -> None:
    assert not perceived_contrast(np.zeros((5, 5))).any()
    assert np.isfinite(perceived_contrast(np.full((5, 5), 1e300))).all()
    assert np.isfinite(perceived_contrast(np.full((5, 5), 5e-324))).all()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, -0.001, 1.001])
def test_pixel_values_that_are_none_are_refused(bad) -> None:
    pixels = np.full((16, 16, 3), 0.5)
    pixels[3, 4, 1] = bad
    with pytest.raises(ValueError, match=r"the frame at 1 s needs pixel values in \[0, 1\], got"):
        Frame(1.0, 0.04, pixels)


@pytest.mark.parametrize(
    "pixels",
    [np.ones((16, 16)), np.ones((16, 16, 1)), np.ones((16, 16, 4)), np.ones((16, 16, 3), np.int64)],
)
def test_pixel_arrays_of_another_shape_or_kind_are_refused(pixels) -> None:
    with pytest.raises(ValueError, match=r"needs pixel values of shape \(height, width, 3\), uint8"):
        Frame(0.0, 0.04, pixels)


def test_equal_numbers_of_different_kinds_are_different_frames() -> None:
    one = np.ones((8, 8, 3), np.uint8)  # 1 of 255: all but black
    kinds = (one, one.astype(np.float64), one.astype(np.uint16))
    frames = [Frame(0.04 * k, 0.04, pixels) for k, pixels in enumerate(kinds)]
    found = analyze_frames(frames, "made", lab(gamma=1.0)).mean_luminance
    np.testing.assert_allclose(found, [100 / 255, 100, 100 / 65535], rtol=1e-5)


def test_the_sum_of_more_pixels_than_float32_can_count() -> None:
    side = 4100  # squared, a little above 2^24
    white = np.full((side, side, 3), 255, np.uint8)
    linear = np.ones(256, np.float32)
    luminance = np.empty((side, side), np.float32)
    sums = convert_integers(white, linear, np.float32(0), np.float32(1), luminance)
    assert sums == (side**2,) * 3
    assert float(luminance.mean(dtype=np.float64)) == pytest.approx(1.0, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("height", [1e-7, 1e-3, 0.1, 0.5])
def test_one_odd_pixel_in_a_flat_frame(height) -> None:
    picture = np.full((24, 24), 0.5)
    picture[11, 12] += height
    found = curves_of(picture, lab()).loss[0]
    np.testing.assert_allclose(found, by_definition(picture, lab()), atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("peak", [1e-6, 1e-4, 1e-2, 1e4, 1e6])
def test_dim_and_glaring_displays_agree_with_the_definition(peak) -> None:
    rng = np.random.default_rng(1)
    picture = np.kron(rng.random((8, 20)), np.ones((4, 5))) * rng.random((32, 100))
    picture[:, :50] = 0  # black without a black level: Eq. 2 without its epsilon is 0 / 0
    curves = curves_of(picture, lab(peak))
    np.testing.assert_allclose(curves.loss[0], by_definition(picture, lab(peak)), atol=1e-3)
    assert curves.mean_luminance[0] == pytest.approx((picture**2.2).mean() * peak, rel=1e-5)
