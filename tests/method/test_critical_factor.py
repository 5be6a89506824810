"""A pixel's critical factor in closed form: its functions, and the bound that lets bands be skipped."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import ContrastModel, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.method.contrast.critical_factor import (
    LARGEST_LOG_RATIO,
    MASKING_RANGE,
    band_table,
    effective_sensitivity,
    threshold_table,
)
from evenlight.method.contrast.csf import contrast_sensitivity
from evenlight.method.contrast.pyramid import adaptation_luminance, gaussian_pyramid, laplacian_bands

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
MODEL = ContrastModel()


@pytest.mark.slow
@given(st.floats(*MASKING_RANGE))
def test_at_the_threshold_both_sides_are_equal(log_masking):
    """t^0.7 = 1 + m · t^0.2 at t = T(m), read from the table."""
    table = threshold_table()
    t = 2 ** np.interp(log_masking, np.linspace(*MASKING_RANGE, len(table)), table)
    assert t**0.7 / (1 + 2**log_masking * t**0.2) == pytest.approx(1, abs=2e-5)


@pytest.mark.slow
@given(st.floats(-14, 20), st.floats(-10, 20))
def test_visibility_changes_once_as_contrast_grows(log_masking, log_contrast):
    """Where t^0.7 - m · t^0.2 has reached 1 it rises: its slope is there 0.5 · m · t^0.2 + 0.7 > 0."""
    m, t = 2.0**log_masking, 2.0**log_contrast
    seen, more = ((x**0.7 > 1 + m * x**0.2) for x in (t, 1.01 * t))
    assert more or not seen


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
