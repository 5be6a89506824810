"""Contrast sensitivity: against an independent implementation, and as an invertible function."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import SensitivityModel
from evenlight.method.contrast.csf import contrast_sensitivity

FREQUENCIES = np.array([0.1, 0.5, 1, 2, 4, 8, 16, 36.14, 60])[:, None]
LUMINANCES = np.array([1e-6, 1e-4, 0.01, 0.2, 1, 10, 104.4, 1e4])


@pytest.mark.parametrize("field_size", [5.0, 40.0, 60.0, 100.0])
def test_full_form_equals_the_one_of_colour_science(field_size):
    """With the pupil of the luminance in both blur and illuminance, as Barten (2003) combines them."""
    from colour import contrast  # takes a second to import: only the process that runs this waits for it

    pupil = contrast.pupil_diameter_Barten1999(LUMINANCES, field_size, field_size)
    expected = contrast.contrast_sensitivity_function_Barten1999(
        FREQUENCIES,
        sigma=contrast.sigma_Barten1999(0.5 / 60, 0.08 / 60, pupil),
        X_0=field_size,
        E=contrast.retinal_illuminance_Barten1999(LUMINANCES, pupil),
    )
    got = contrast_sensitivity(FREQUENCIES, LUMINANCES, field_size=field_size)
    np.testing.assert_allclose(got, expected, rtol=1e-9)


def test_authors_form_equals_colour_science_with_its_defaults_and_a_3_mm_pupil():
    from colour import contrast

    expected = contrast.contrast_sensitivity_function_Barten1999(
        FREQUENCIES, E=contrast.retinal_illuminance_Barten1999(LUMINANCES, 3.0)
    )
    got = contrast_sensitivity(FREQUENCIES, LUMINANCES, SensitivityModel.AUTHORS)
    np.testing.assert_allclose(got, expected, rtol=1e-9)


def test_simplified_form_by_hand():
    """At L = 100 and X0 = 12: (1 + 100/L)^0.08 = 2^0.08 and 144/X0² = 1."""
    f = 5.0
    area, noise = 1 + 1 + 0.64 * 25, 63 / 100**0.83 + 1 / (1 - np.exp(-0.5))
    expected = 5200 * np.exp(-0.0016 * 25 * 2**0.08) / np.sqrt(area * noise)
    got = contrast_sensitivity(f, 100.0, SensitivityModel.SIMPLIFIED, field_size=12.0)
    assert got == pytest.approx(expected, rel=1e-12)


def test_the_two_forms_of_barten_agree_where_the_simplified_one_was_fitted():
    """The 2003 paper derives one from the other; at photopic luminance they differ by a few percent."""
    f, L = np.array([1.0, 2, 4, 8, 16])[:, None], np.array([1.0, 10, 100])
    full, simple = (
        contrast_sensitivity(f, L, m) for m in (SensitivityModel.BARTEN, SensitivityModel.SIMPLIFIED)
    )
    np.testing.assert_allclose(simple, full, rtol=0.07)


@pytest.mark.parametrize("model", [m for m in SensitivityModel if m is not SensitivityModel.CASTLE])
def test_sensitivity_of_barten_never_falls_with_luminance(model):
    """The one-pass loss curves invert S over luminance, from darkness to 10^5 cd/m²."""
    L = np.logspace(-6, 5, 2000)
    S = contrast_sensitivity(FREQUENCIES, L, model)
    assert (np.diff(S, axis=1) > 0).all()


@given(st.floats(0.01, 200), st.floats(0, 1e6), st.sampled_from(SensitivityModel), st.floats(1, 120))
def test_sensitivity_is_a_finite_number_anywhere(f, L, model, field_size):
    S = contrast_sensitivity(f, L, model, field_size)
    assert np.isfinite(S)
    assert S >= 0


def test_sensitivity_in_the_dark_follows_de_vries_and_rose():
    """Where photon noise rules and the pupil is open, S grows with the square root of L."""
    S = contrast_sensitivity(2.0, np.array([1e-5, 1e-6]))
    assert S[0] / S[1] == pytest.approx(np.sqrt(10), rel=0.05)
