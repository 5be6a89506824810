"""Numbers of Barten's contrast sensitivity function as colour-science 0.4 prints them (its docstrings)."""

import numpy as np
import pytest

from evenlight.data_schema.contrast_model import SensitivityModel
from evenlight.method.contrast.csf import (
    contrast_sensitivity,
    optical_blur,
    pupil_diameter,
    retinal_illuminance,
)


def test_pupil_at_100_cd_m2_and_60_degrees():
    assert pupil_diameter(100.0, 60.0) == pytest.approx(2.7931307, abs=5e-8)


def test_blur_of_a_pupil_of_2_1_mm():
    assert optical_blur(2.1) == pytest.approx(0.0087911, abs=1e-7)


def test_retinal_illuminance_of_100_cd_m2_through_2_1_mm():
    assert retinal_illuminance(100.0, 2.1) == pytest.approx(330.4115803, abs=5e-8)


def test_sensitivity_at_4_cpd_with_all_its_defaults():
    """Its defaults are E of 20 cd/m² through 2.1 mm; ours for the same E: the luminance that 3 mm needs."""
    illuminance = retinal_illuminance(20.0, 2.1)
    luminance = illuminance / retinal_illuminance(1.0, 3.0)
    sensitivity = contrast_sensitivity(4.0, luminance, SensitivityModel.AUTHORS)
    assert sensitivity == pytest.approx(360.8691122, abs=5e-7)


# Half and a fifth of the luminance 100, 10 and 1 cd/m² at 2, 8 and 16 cpd: S(bL)/S(L), from an independent
# evaluation of the formula (two or three digits).
@pytest.mark.parametrize(
    ("factor", "L", "ratios"),
    [
        (0.5, 1.0, (0.775, 0.746, 0.728)),
        (0.5, 10.0, (0.864, 0.772, 0.756)),
        (0.5, 100.0, (0.959, 0.836, 0.814)),
        (0.2, 1.0, (0.536, 0.499, 0.471)),
        (0.2, 10.0, (0.671, 0.538, 0.513)),
        (0.2, 100.0, (0.873, 0.628, 0.592)),
    ],
)
def test_what_dimming_does_to_sensitivity(factor, L, ratios):
    f = np.array([2.0, 8.0, 16.0])
    got = contrast_sensitivity(f, factor * L) / contrast_sensitivity(f, L)
    np.testing.assert_allclose(got, ratios, atol=6e-4)
