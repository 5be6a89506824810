"""Hard cases of light: darkness, glare, no contrast, no sensitivity, odd sizes, pixels that are no numbers.

Each test runs the naive form first, transcribed from the formula, and shows what goes wrong with it.
"""

import math

import numpy as np
import pytest
from scipy import ndimage

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.method.adaptation import half_saturation
from evenlight.method.contrast.contrast_loss import contrast_loss, visible_contrast
from evenlight.method.contrast.critical_factor import band_table
from evenlight.method.contrast.csf import contrast_sensitivity, optical_blur, pupil_diameter
from evenlight.method.contrast.frame_light import convert_integers
from evenlight.method.contrast.loss_curves import (
    analyze_frames,
    brightness_factors,
)
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.masking import perceived_contrast
from evenlight.method.contrast.one_pass import expanded, reduced
from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    gaussian_pyramid,
    laplacian_bands,
)
from evenlight.method.contrast.pyramid import (
    expanded as expanded_level,
)

KERNEL = np.array([0.05, 0.25, 0.4, 0.25, 0.05])  # Burt & Adelson with a = 0.4


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


def naive_band(image: np.ndarray) -> np.ndarray:
    """The finest Laplacian band as in a textbook: sums of weights times pixels, in the image's precision."""
    weights = KERNEL.astype(image.dtype)
    smooth = image
    for axis in (0, 1):
        smooth = ndimage.correlate1d(smooth, weights, axis, mode="mirror")
    spread = np.zeros_like(image)
    spread[::2, ::2] = smooth[::2, ::2]
    twice = 2 * weights
    for axis in (0, 1):
        spread = sum(w * np.roll(spread, k - 2, axis) for k, w in enumerate(twice))
    return image - spread


def test_rounding_noise_in_a_flat_frame_masks_nothing() -> None:
    flat = np.full((32, 32), 97.123, np.float32)
    noise = float(np.abs(naive_band(flat)[4:-4, 4:-4]).max()) / 97.123
    assert 1e-8 < noise < 1e-6  # a rounding error or two of float32 ...
    assert (200 * noise) ** 0.2 > 0.1  # ... and masks all the same, at a sensitivity of 200
    coarse = reduced(flat)
    assert not (flat - expanded(coarse, 32, 32)).any()
    assert not any(band.any() for band in laplacian_bands(gaussian_pyramid(flat.astype(np.float64), 4)))


@pytest.mark.slow
@pytest.mark.parametrize("picture", [np.zeros((16, 16)), np.full((9, 8), 0.5), np.ones((8, 13))])
def test_a_frame_without_contrast_has_nothing_to_lose(picture) -> None:
    display = lab()
    emitted = emitted_luminance(np.repeat(picture[:, :, None], 3, axis=2), display)
    seen, dimmed = visible_contrast(emitted, display), visible_contrast(0.5 * emitted, display)
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.abs(1 - np.divide(dimmed, seen)))  # Eq. 5 as printed: 0 / 0
    curves = curves_of(picture, display)
    assert curves.visible_contrast[0] == 0
    assert not curves.loss.any()
    assert contrast_loss(emitted, 0.5, display) == 0


@pytest.mark.slow
@pytest.mark.parametrize("height", [1e-7, 1e-3, 0.1, 0.5])
def test_one_odd_pixel_in_a_flat_frame(height) -> None:
    picture = np.full((24, 24), 0.5)
    picture[11, 12] += height
    display = lab()
    bands = laplacian_bands(gaussian_pyramid(100.0 * picture**2.2, 3))
    with np.errstate(divide="ignore"):
        assert np.isinf(np.log2(np.abs(bands[0]))).any()  # where the band is 0, log contrast is no number
    found = curves_of(picture, display).loss[0]
    np.testing.assert_allclose(found, by_definition(picture, display), atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("peak", [1e-6, 1e-4, 1e-2, 1e4, 1e6])
def test_dim_and_glaring_displays_agree_with_the_definition(peak) -> None:
    rng = np.random.default_rng(1)
    picture = np.kron(rng.random((8, 20)), np.ones((4, 5))) * rng.random((32, 100))
    picture[:, :50] = 0  # black without a black level
    gaussian = gaussian_pyramid(peak * picture**2.2, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        naive = laplacian_bands(gaussian)[0] / adaptation_luminance(gaussian, 0)
    assert np.isnan(naive).any()  # Eq. 2 without its epsilon: 0 / 0
    display = lab(peak)
    curves = curves_of(picture, display)
    np.testing.assert_allclose(curves.loss[0], by_definition(picture, display), atol=1e-3)
    assert curves.mean_luminance[0] == pytest.approx((picture**2.2).mean() * peak, rel=1e-5)


def test_a_table_of_sensitivity_over_ten_octaves_of_luminance() -> None:
    dark = 0.05
    right = contrast_sensitivity(4.0, dark)
    steps = np.linspace(1e-6, 1e4, 4096)  # equal steps of luminance: the first one is 2.4 cd/m^2 long
    naive = np.interp(dark, steps, contrast_sensitivity(4.0, steps))
    assert naive < right / 2
    table = band_table(4.0, 0.2, lab(1e4), DEFAULT_MODEL)
    place = np.linspace(*table.log_luminance_range, len(table.log_sensitivity))
    ours = 2.0 ** np.interp(np.log2(dark), place, table.log_sensitivity)
    assert ours == pytest.approx(right, rel=1e-4)


def test_values_of_luminance_below_all_floats_stay_numbers() -> None:
    tiny = 1e-310 * np.random.default_rng(2).random((16, 16))  # denormal: 1 / tiny overflows
    with np.errstate(over="ignore"):
        assert np.isinf(1 / tiny).all()
    curves = curves_of(tiny, lab())
    assert np.isfinite(curves.loss).all()
    assert not curves.loss.any()
    assert np.isfinite(visible_contrast(tiny, lab()))


def test_sensitivity_at_high_frequency_has_a_logarithm() -> None:
    with np.errstate(divide="ignore"):
        assert np.log2(np.exp(-2 * np.pi**2 * optical_blur(2.0) ** 2 * 5000.0**2)) == -np.inf
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
    with np.errstate(divide="ignore"):
        naive_noise = np.float64(3e-8) / (1 - np.exp(-((1e-9 / 7.0) ** 2)))
    assert naive_noise == np.inf  # S would be 0 for every f below 5e-8
    tiny = np.array([1e-12, 1e-9, 1e-6])
    per_frequency = contrast_sensitivity(tiny, 50.0) / tiny
    np.testing.assert_allclose(per_frequency, per_frequency[0], rtol=1e-6)
    assert contrast_sensitivity(0.0, [1e-6, 50.0]).tolist() == [0.0, 0.0]


def test_the_pupil_in_the_dark() -> None:
    with np.errstate(divide="ignore"):
        assert np.log10(np.float64(0.0)) == -np.inf  # what the pupil's formula begins with
    assert np.all(np.diff(pupil_diameter(np.geomspace(1e-6, 1e6, 50))) < 0)
    dark = contrast_sensitivity(2.0, [0.0, 1e-9, 1e-6])
    assert dark.tolist() == [dark[2]] * 3  # held at the darkest luminance that the eye sees
    assert 0 < dark[0] < contrast_sensitivity(2.0, 1e-4)


def test_cones_in_the_dark() -> None:
    def as_printed(A: float) -> float:
        k = 1 / (5 * A + 1)
        return 12.9223 * A / (k**4 * A + 0.171 * (1 - k**4) ** 2 * A ** (1 / 3))

    with pytest.raises(ZeroDivisionError):
        as_printed(0.0)
    assert half_saturation(0.0) == 12.9223
    dark = np.array([1e-300, 1e-30, 1e-16, 1e-9, 1e-6])
    np.testing.assert_allclose(half_saturation(dark), 12.9223, rtol=1e-4)
    for A in (1e-3, 1.0, 1e4):  # where nothing cancels, the formula as printed is right
        assert half_saturation(A) == pytest.approx(as_printed(A), rel=1e-12)


@pytest.mark.parametrize("shape", [(8, 8), (9, 8), (8, 9), (15, 17), (16, 33)])
def test_sizes_a_pixel_off_a_power_of_two(shape) -> None:
    image = np.random.default_rng(4).random(shape)
    half = image[::2, ::2]
    if shape[0] % 2 or shape[1] % 2:  # each pixel twice: a row too many
        assert np.repeat(np.repeat(half, 2, 0), 2, 1).shape != shape
    gaussian = gaussian_pyramid(image, 4)
    collapsed = gaussian[-1]
    for band in reversed(laplacian_bands(gaussian)):
        collapsed = band + expanded_level(collapsed, band.shape)
    np.testing.assert_allclose(collapsed, image, atol=1e-14)
    np.testing.assert_allclose(curves_of(image, lab()).loss[0], by_definition(image, lab()), atol=1e-3)


def test_masking_of_no_contrast_and_of_absurd_contrast() -> None:
    with np.errstate(invalid="ignore", divide="ignore"):
        assert np.isnan(np.float64(0.0) ** 0.7 / np.float64(0.0) ** 0.2)  # C_t as a ratio of powers
    assert not perceived_contrast(np.zeros((5, 5))).any()
    assert np.isfinite(perceived_contrast(np.full((5, 5), 1e300))).all()
    assert np.isfinite(perceived_contrast(np.full((5, 5), 5e-324))).all()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, -0.001, 1.001])
def test_pixel_values_that_are_none_are_refused(bad) -> None:
    pixels = np.full((16, 16, 3), 0.5)
    pixels[3, 4, 1] = bad
    with np.errstate(invalid="ignore"):
        index = (pixels[3, 4, 1] * 65535).astype(np.int64)
    assert not 0 <= index <= 65535  # as the index of a table it lies outside: compiled, it reads on
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
    assert np.array_equal(one, one.astype(np.float64))  # where 1 is white
    kinds = (one, one.astype(np.float64), one.astype(np.uint16))
    frames = [Frame(0.04 * k, 0.04, pixels) for k, pixels in enumerate(kinds)]
    found = analyze_frames(frames, "made", lab(gamma=1.0)).mean_luminance
    np.testing.assert_allclose(found, [100 / 255, 100, 100 / 65535], rtol=1e-5)


def test_the_sum_of_more_pixels_than_float32_can_count() -> None:
    side = 4100  # squared, a little above 2^24
    assert np.float32(2**24) + np.float32(1) == np.float32(2**24)  # a sum in float32 stops here
    assert np.cumsum(np.ones(side * side, np.float32))[-1] == 2**24
    white = np.full((side, side, 3), 255, np.uint8)
    linear = np.ones(256, np.float32)
    luminance = np.empty((side, side), np.float32)
    sums = convert_integers(white, linear, np.float32(0), np.float32(1), luminance)
    assert sums == (side**2,) * 3
    assert float(luminance.mean(dtype=np.float64)) == pytest.approx(1.0, abs=1e-7)
