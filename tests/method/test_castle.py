"""castleCSF's achromatic sensitivity: as its formula is printed, as measured, and where it ends."""

import math

import numpy as np
import pytest

from benchmarks.curve_definition import loss_curves_by_definition
from evenlight.data_schema.contrast_model import ContrastModel, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.method.contrast.csf import castle_sensitivity, contrast_sensitivity
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.luminance import emitted_luminance

CASTLE = SensitivityModel.CASTLE


def sensitivity_as_printed(f, L, area):
    """Ashraf et al. (2024): sustained and transient mechanism at 0 Hz, transcribed term by term."""

    def mechanism(peak, peak_frequency, bandwidth, drop, area_0, f_0):
        parabola = 10 ** (-((math.log10(f) - math.log10(peak_frequency)) ** 2) / 2**bandwidth)
        if f < peak_frequency and parabola < 1 - drop:
            parabola = 1 - drop
        integrated = area_0 / (1 + (f / f_0) ** 2)
        return peak * parabola * math.sqrt(integrated / (1 + integrated / area)) * f

    rise = 56.4947 * (1 + 7.54726 / L) ** -0.144532
    sustained_peak = rise * (1 - (1 + 5.58341e-07 / L) ** -9.66862e9)
    sustained_frequency = 1.78119 * (1 + 91.5718 / L) ** -0.256682
    sustained = mechanism(sustained_peak, sustained_frequency, 0.000213047, 0.100207, 157.103, 0.702338)
    transient = mechanism(2748.09 * L**0.193434, 0.000316696, 2.6761, 0.000241177, 3.81611, 3.01389)
    preferred = 4.7036 + 2.41482 * math.log10(L)  # [Hz]
    response = math.exp(-((preferred**0.1898) ** 2) / 0.0844836)  # of the transient one at 0 Hz
    return sustained + response * transient


@pytest.mark.parametrize("f", [0.25, 0.5, 1.0, 4.0, 16.0, 40.0])
@pytest.mark.parametrize("L", [0.1, 1.0, 30.0, 500.0, 5000.0])
@pytest.mark.parametrize("area", [1.0, math.pi * 1.5**2, 250.0])
def test_equals_the_formula_as_printed(f, L, area):
    """But for the transient mechanism at 0 Hz, and for rounding in 1 + 5.6e-7 / L to the power of 1e10."""
    assert castle_sensitivity(f, L, area) == pytest.approx(sensitivity_as_printed(f, L, area), rel=2e-5)


# Spatial frequency [cpd], area [deg²] and sensitivity at 50 cd/m² (D65): Rovamo, Luntinen & Näsänen (1993) as
# tabled by castleCSF's authors, data_aggregated_merged.csv of their repository (MIT), release 0.2.0.
ROVAMO = [
    (0.25, 14.43, 83.93), (0.25, 241.9, 249.3), (0.5, 3.996, 69.15), (0.5, 61.46, 201.3), (1, 1, 63.57),
    (1, 14.98, 204.9), (1, 241.9, 546.6), (2, 0.963, 112.0), (2, 14.59, 322.3), (4, 0.9632, 245.5),
    (4, 15.50, 387.2), (8, 0.8940, 255.0), (8, 13.65, 402.2), (16, 0.9267, 73.94), (16, 3.647, 61.22),
    (32, 0.2383, 9.630),
]  # fmt: skip


def test_is_as_near_to_measured_sensitivities_as_its_authors_publish():
    """For this data set they report 2.8 to 3.25 dB of error, after a factor of 1.54 to 1.66 for its people.

    Reports 2, 3 and 5 of castleCSF's project page. Here are 16 of 50 points: half a dB is left for that.
    """
    f, area, measured = np.array(ROVAMO).T
    decibel = 20 * np.log10(measured / castle_sensitivity(f, 50.0, area))
    assert 20 * np.log10(1.54) - 0.5 < decibel.mean() < 20 * np.log10(1.66) + 0.5
    assert decibel.std() < 3.25 + 0.5


# log10 S of an achromatic pattern, 0 Hz, σ = 1.5°: csf_lut_weber_fixed_size.json of ColorVideoVDP 0.5.7, MIT.
# Columns are spatial frequencies [cpd], rows background luminances [cd/m²]. It is another fit of castleCSF.
LUT_FREQUENCIES = [0.530, 0.990, 2.808, 6.463, 18.325, 34.246]
LUT = {
    0.0829: [1.472, 1.557, 1.314, 0.693, -0.606, -1.612],
    2.1945: [1.712, 1.992, 2.072, 1.711, 0.735, -0.076],
    58.0966: [1.880, 2.165, 2.485, 2.316, 1.580, 0.912],
    603.178: [1.924, 2.191, 2.555, 2.419, 1.727, 1.085],
}


def test_agrees_with_another_fit_better_than_either_agrees_with_the_data():
    """3.59 dB is the error that the paper reports over all 18 data sets."""
    ours = np.log10([castle_sensitivity(LUT_FREQUENCIES, L) for L in LUT])
    decibel = 20 * (np.array(list(LUT.values())) - ours)
    assert np.sqrt(np.mean(decibel**2)) < 3.59


def test_at_no_frequency_is_nothing_to_be_seen_and_absurd_ones_are_never_seen():
    np.testing.assert_array_equal(contrast_sensitivity([0.0, 1e200], 100.0, CASTLE), [0.0, 0.0])


def test_below_its_darkest_luminance_sensitivity_stays_as_it_is_there():
    np.testing.assert_array_equal(
        contrast_sensitivity(2.0, [0.0, 1e-9, 1e-3], CASTLE), [castle_sensitivity(2.0, 1e-3)] * 3
    )


def test_the_field_of_view_does_not_enter():
    near, far = (contrast_sensitivity(1.0, 50.0, CASTLE, field_size) for field_size in (5.0, 60.0))
    assert near == far == castle_sensitivity(1.0, 50.0, math.pi * 1.5**2)


def test_coarse_detail_may_be_seen_better_when_dimmed():
    """At 0.7 cpd the peak of the curve passes by near 9 cd/m²: brighter, sensitivity is up to 10 % lower."""
    bright, dim = castle_sensitivity(0.7, [30.0, 10.0])
    assert dim > bright > 0.9 * dim


def test_loss_curves_follow_a_sensitivity_that_falls():
    """One pass over all factors inverts what rises; where it does not, the curve is still as defined."""
    lab = Display("lab", 3000.0, 0.1, 2.2, pixels_per_degree=4.0)
    pixels = np.random.default_rng(3).uniform(0.2, 1, (24, 32, 1)) * np.ones(3)
    model, knots = ContrastModel(sensitivity=CASTLE), np.array([0.05, 0.3, 1.0])
    one_pass = FrameAnalysis((24, 32), lab, model, knots).of(pixels).loss
    defined = loss_curves_by_definition(emitted_luminance(pixels, lab), knots, lab, model)
    np.testing.assert_allclose(one_pass, defined, atol=1e-3)
    assert defined[0] > 0
