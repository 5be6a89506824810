"""The rows of the one pass: thresholds and sensitivities as power series, pixels that are not looked up."""

import dataclasses

import numpy as np
import pytest
from hard_pictures import frame_of, pictures

from evenlight.data_schema.contrast_model import DEFAULT_MODEL, MaskingNeighbourhood
from evenlight.data_schema.display import Display
from evenlight.method.contrast.band_shares import contrast_tables
from evenlight.method.contrast.critical_factor import band_table, effective_sensitivity
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.masking import neighbourhood_mean
from evenlight.method.contrast.one_pass import (
    BLOCK,
    FactorTables,
    contrast_row,
    count_band,
    expanded,
    power_series,
    reduced,
    threshold_row,
)
from evenlight.method.contrast.pyramid import counted_frequencies

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
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
