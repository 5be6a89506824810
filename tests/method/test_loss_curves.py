"""Loss curves of videos, the rows of the one pass, and critical factors."""

import dataclasses

import numpy as np
import pytest
from hard_pictures import frame_of, pictures
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    MaskingNeighbourhood,
    SensitivityModel,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.band_shares import contrast_tables
from evenlight.method.contrast.critical_factor import (
    LARGEST_LOG_RATIO,
    MASKING_RANGE,
    band_table,
    effective_sensitivity,
    threshold_table,
)
from evenlight.method.contrast.csf import contrast_sensitivity
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import (
    analyze_frames,
    brightness_factors,
)
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.masking import neighbourhood_mean
from evenlight.method.contrast.one_pass import (
    BLOCK,
    FactorTables,
    contrast_row,
    count_band,
    exp2,
    expanded,
    log2,
    power_series,
    reduced,
    threshold_row,
)
from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    counted_frequencies,
    gaussian_pyramid,
    laplacian_bands,
)

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)

FACTORS = brightness_factors(0.2, 7)


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


# --- pass rows

OLED = Display("oled", 600.0, 0.0, 2.2, pixels_per_degree=60.0)

BRIGHT_ROOM = dataclasses.replace(HEADSET, reflected_luminance=2.0)

DISPLAYS = pytest.mark.parametrize(
    "display", [HEADSET, OLED, BRIGHT_ROOM], ids=["headset", "oled", "bright room"]
)

SHAPE = (72, 100)

FRAMES = {name: frame_of(picture) for name, picture in pictures(SHAPE).items()}

NOTHING_LEFT_OUT = np.float32(-1000.0)


def thresholds(log_contrast, masking):
    """`threshold_row` of the middle row of five, from contrasts of a picture of whole blocks."""
    width = log_contrast.shape[1]
    padded = np.pad(np.exp2(np.float32(0.2) * log_contrast), ((0, 0), (2, 2)))
    sums = sum(padded[:, k : k + width] for k in range(5)).astype(np.float32)
    columns = (1 / neighbourhood_counts(width)).astype(np.float32)
    x, itself = np.empty(width, np.float32), masking is MaskingNeighbourhood.WITH_CENTRE
    threshold_row(
        log_contrast[2], sums, columns, (np.float32(1 / 5), (itself, np.float32(1)), NOTHING_LEFT_OUT), x
    )
    return x.astype(np.float64)


def neighbourhood_counts(width):
    j = np.arange(width)
    return np.minimum(j + 2, width - 1) - np.maximum(j - 2, 0) + 1


@pytest.mark.parametrize("masking", list(MaskingNeighbourhood))
def test_at_the_threshold_both_sides_of_the_masking_equation_are_equal(masking):
    """T^0.7 = 1 + m T^0.2, m by definition; where m is below 21.6, as it is for all that can be visible."""
    log_contrast = np.random.default_rng(0).normal(0, 3, (5, 2 * BLOCK)).astype(np.float32)
    power = np.exp2(0.2 * log_contrast.astype(np.float64))
    m = (neighbourhood_mean(power, masking) / power)[2]
    T = np.exp2(thresholds(log_contrast, masking))
    usual = m < 21.6
    assert usual.mean() > 0.95
    np.testing.assert_allclose((T**0.7 / (1 + m * T**0.2))[usual], 1, rtol=4e-6)
    assert (T[~usual] > 475).all()  # at T = 475 and m = 21.6 the left side is 74.7, the right one 75.1


def test_a_block_of_faint_contrast_has_no_threshold():
    log_contrast = np.full((5, 2 * BLOCK), -3, np.float32)
    log_contrast[2, BLOCK + 7] = 1
    x = np.empty(2 * BLOCK, np.float32)
    sums, columns = np.ones((5, 2 * BLOCK), np.float32), np.full(2 * BLOCK, 0.2, np.float32)
    threshold_row(log_contrast[2], sums, columns, (np.float32(0.2), (True, np.float32(1)), np.float32(0)), x)
    assert np.isposinf(x[:BLOCK]).all()
    assert np.isfinite(x[BLOCK:]).all()


@DISPLAYS
def test_the_series_of_sensitivity_errs_no_more_than_it_says(display):
    for f in (0.5, 4.0, 32.0):
        band = band_table(f, 0.2, display, DEFAULT_MODEL)
        steps = np.linspace(-0.5, 0.5, 101, dtype=np.float32)
        log_e = np.interp(steps, [-0.5, 0.5], band.log_luminance_range)
        expected = np.log2(effective_sensitivity(f, np.exp2(log_e), display, DEFAULT_MODEL))
        series = np.array([power_series(band.log_sensitivity_series, x) for x in steps])
        assert np.abs(series - expected).max() < band.series_error + 1e-5
        # A display without black has a bend at 1e-6 cd/m^2, 30 octaves below its peak.
        assert band.series_error < (0.2 if display.black_level == 0 else 1e-4)


@DISPLAYS
def test_a_row_of_contrast_is_that_of_the_definition(display):
    """|C| = r s(b L_a), Eq. 2, also where the series would err: there the table is read."""
    rng, f, factor = np.random.default_rng(1), 4.0, 0.5
    fine, low, seen = np.exp2(rng.uniform(-1, 6, (3, BLOCK))).astype(np.float32)
    rows, power = np.zeros((4, BLOCK), np.float32), np.zeros(BLOCK + 4, np.float32)
    to = contrast_tables(band_table(f, 0.2, display, DEFAULT_MODEL), DEFAULT_MODEL, (fine, seen), factor)
    contrast_row(fine, low, seen, to, (*rows, power, np.zeros(BLOCK, np.int32)))
    fine, low, seen = (x.astype(np.float64) for x in (fine, low, seen))
    r, s = np.abs(fine - low) / seen, effective_sensitivity(f, factor * seen, display, DEFAULT_MODEL)
    np.testing.assert_allclose(rows[0], np.log2(r), rtol=0, atol=1e-5)
    np.testing.assert_allclose(rows[1], np.log2(seen), rtol=0, atol=1e-5)
    np.testing.assert_allclose(rows[2], np.log2(r * s), rtol=0, atol=1.5e-4)
    np.testing.assert_allclose(rows[3], np.convolve((r * s) ** 0.2, np.ones(5), "same"), rtol=1e-4)


@DISPLAYS
@pytest.mark.parametrize("references", [1, 8])
@pytest.mark.parametrize("name", ["photograph", "high dynamic range", "edge of the shade"])
def test_pixels_that_are_not_looked_up_are_counted_as_if_they_were(name, references, display):
    """With sensitivities that could rise without bound, the critical factor of every pixel is looked up."""
    fine = emitted_luminance(FRAMES[name], display).astype(np.float32)
    coarse = reduced(fine)
    around = expanded(reduced(coarse), *coarse.shape)
    band = band_table(
        float(counted_frequencies(SHAPE, display, DEFAULT_MODEL)[0]), 0.2, display, DEFAULT_MODEL
    )
    cells, visible = 64, []
    for steepest in (band.steepest, 1e6):
        tables = FactorTables(
            log_luminance=band.log_luminance,
            log_faintest=np.float32(band.log_sensitivity_range[0]),
            log_span=np.float32(np.ptp(band.log_sensitivity_range)),
            steepest=np.float32(steepest),
            log_lowest_factor=np.float32(np.log2(0.2)),
            counts=np.zeros((references, cells + 2), np.int32),
        )
        to_contrast = contrast_tables(band, DEFAULT_MODEL, (fine, around))
        count_band(fine, coarse, around, (to_contrast, tables, (True, np.float32(1))))
        step = cells // references
        within = [slice(k * step, (k + 1) * step + 1) for k in range(references)]
        visible.append([row.cumsum()[part] for row, part in zip(tables.counts, within, strict=True)])
    np.testing.assert_array_equal(*visible)
    assert 0 < visible[0][-1][-1] < fine.size


def test_what_fills_up_a_row_does_not_count_on_a_display_far_darker_than_it():
    """A row is filled up with 1 cd/m²; a power series would run away there, far beyond its range."""
    dim = dataclasses.replace(OLED, peak_luminance=1e-6)
    picture = np.random.default_rng(2).random((16, 20, 1)) * np.ones(3)
    result = FrameAnalysis((16, 20), dim, DEFAULT_MODEL, np.array([0.2, 1.0])).of(picture)
    assert result.visible_contrast <= 1


# --- critical factor

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)

MODEL = ContrastModel()


@pytest.mark.slow
@given(st.floats(*MASKING_RANGE))
def test_at_the_threshold_both_sides_are_equal(log_masking):
    """t^0.7 = 1 + m · t^0.2 at t = T(m), read from the table."""
    table = threshold_table()
    t = 2 ** np.interp(log_masking, np.linspace(*MASKING_RANGE, len(table)), table)
    assert t**0.7 / (1 + 2**log_masking * t**0.2) == pytest.approx(1, abs=2e-5)


@pytest.mark.parametrize("reflected", [0.0, 2.0, 500.0])
@pytest.mark.parametrize("black", [0.0, 0.1])
@pytest.mark.parametrize("f", [0.5, 4.0, 36.0])
def test_the_inverse_of_sensitivity_gives_the_luminance_back(f, black, reflected):
    display = dataclasses.replace(LAB, black_level=black, reflected_luminance=reflected)
    table = band_table(f, 0.2, display, MODEL)
    e = np.geomspace(0.2 * max(black, 1e-6), 100.0, 300)
    log_s = np.log2(effective_sensitivity(f, e, display, MODEL))
    steps = np.linspace(*table.log_sensitivity_range, len(table.log_luminance))
    # A factor is wrong by as much as e is: 0.3 % at most, where at 0.5 cpd and 100 cd/m² S hardly rises.
    np.testing.assert_allclose(np.interp(log_s, steps, table.log_luminance), np.log2(e), atol=np.log2(1.003))
    steps = np.linspace(*table.log_luminance_range, len(table.log_sensitivity))
    np.testing.assert_allclose(np.interp(np.log2(e), steps, table.log_sensitivity), log_s, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("sensitivity", [S for S in SensitivityModel if S is not SensitivityModel.CASTLE])
@pytest.mark.parametrize("peak", [0.5, 100.0, 1e4])
@pytest.mark.parametrize("reflected", [0.0, 10.0])
def test_effective_sensitivity_rises_on_every_display(sensitivity, peak, reflected):
    """S rises with L (test_csf), and e / (e + L_refl + ε) with e: so each pixel has one critical factor."""
    display = Display("any", peak, 0.0, 2.2, 60.0, reflected_luminance=reflected)
    model = ContrastModel(sensitivity=sensitivity)
    assert all(band_table(f, 0.01, display, model).rises for f in (0.3, 0.5, 2.0, 8.0, 30.0, 60.0))


def test_without_reflections_effective_sensitivity_is_sensitivity():
    e = np.array([1.0, 100.0])
    expected = contrast_sensitivity(4.0, e)
    np.testing.assert_allclose(effective_sensitivity(4.0, e, LAB, MODEL), expected, rtol=2e-6)  # ε


@pytest.mark.parametrize("shape", [(8, 8), (8, 9), (9, 9), (10, 11), (12, 16), (17, 13)])
def test_no_image_has_a_larger_ratio_than_the_bound(shape):
    """|ΔL| and L_a are sums over pixels, L_a with weights >= 0: their ratio is largest for a single pixel."""
    largest = 0.0
    for lit in np.ndindex(shape):
        image = np.zeros(shape)
        image[lit] = 1.0
        gaussian = gaussian_pyramid(image, 3)
        band, adaptation = laplacian_bands(gaussian[:2])[0], adaptation_luminance(gaussian, 0)
        assert not band[adaptation == 0].any()
        largest = max(largest, (np.abs(band)[adaptation > 0] / adaptation[adaptation > 0]).max())
    assert np.log2(largest) < LARGEST_LOG_RATIO


def test_a_band_beyond_acuity_cannot_be_seen():
    """At 130 cpd even S · 2^8 is below threshold at 100 cd/m²; at 30 cpd it is not."""
    assert contrast_sensitivity(130.0, 101.0) * 2**LARGEST_LOG_RATIO < 1
    assert not band_table(130.0, 0.2, LAB, MODEL).can_be_seen
    assert band_table(30.0, 0.2, LAB, MODEL).can_be_seen
