"""The one pass as expressions over whole images: against the definition, and against the compiled pass."""

from dataclasses import replace

import numpy as np
import pytest
from hard_pictures import frame_of, pictures
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks import unfused_pass
from benchmarks.curve_definition import loss_curves_by_definition
from benchmarks.unfused_pass import UnfusedPass, visible_share
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import visible_map
from evenlight.method.contrast.critical_factor import MASKING_RANGE, effective_sensitivity
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance
from evenlight.method.contrast.masking import MASKING_EXPONENT, neighbourhood_mean
from evenlight.method.contrast.pyramid import counted_frequencies

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
BRIGHT_ROOM = replace(HEADSET, reflected_luminance=2.0)
FACTORS = brightness_factors()
SHAPE = (180, 320)
FRAMES = {name: frame_of(picture) for name, picture in pictures(SHAPE).items()}


@given(st.floats(MASKING_RANGE[0], MASKING_RANGE[1]))
def test_at_the_threshold_both_sides_are_equal(log_masking):
    """t^0.7 = 1 + m · t^0.2 at t = T(m), read from the table."""
    t = 2 ** np.interp(log_masking, *unfused_pass._thresholds())
    assert t**0.7 / (1 + 2**log_masking * t**0.2) == pytest.approx(1, abs=1e-8)


@pytest.mark.parametrize("black", [0.0, 0.2])
def test_the_tables_of_sensitivity_are_exact_to_2e_8_octaves(black):
    display = replace(HEADSET, black_level=black)
    tables = UnfusedPass(SHAPE, display, FACTORS)
    log_e = np.random.default_rng(0).uniform(tables._log_e[0], tables._log_e[-1], 1000)
    for f, log_s in zip(counted_frequencies(SHAPE, display, DEFAULT_MODEL), tables._log_s, strict=True):
        expected = np.log2(effective_sensitivity(f, np.exp2(log_e), display, DEFAULT_MODEL))
        np.testing.assert_allclose(np.interp(log_e, tables._log_e, log_s), expected, rtol=0, atol=2e-8)
        np.testing.assert_allclose(np.interp(expected, log_s, tables._log_e), log_e, rtol=0, atol=2e-8)


@pytest.mark.parametrize("display", [HEADSET, BRIGHT_ROOM], ids=["headset", "bright room"])
@pytest.mark.parametrize("name", ["photograph", "black letters", "lit windows"])
def test_nothing_is_approximated_where_neighbours_are_compared_at_the_very_factor(name, display):
    """Pixel by pixel the map of the definition, up to rounding of 1e-6 at the threshold.

    The large band is compared at the middle of the range of log b, the others at the middle of an eighth.
    """
    frame, log_factor = FRAMES[name], np.log2(0.3)
    emitted = emitted_luminance(frame, display)
    expected = visible_map(dimmed_luminance(emitted, 0.3, display), display)
    for part, reference in ((0.5, 0), (4.5 / 8, 3)):
        factors = np.array([2 ** (log_factor / part), 1.0])
        bands = UnfusedPass(SHAPE, display, factors).log_critical_factors(frame)
        for critical, visible in zip(bands, expected, strict=True):
            if (len(critical) == 1) == (reference == 0):
                differs = (critical[reference] < log_factor) != visible
                assert (np.abs(critical[reference][differs] - log_factor) < 1e-6).all()
                assert visible.any()


@pytest.mark.parametrize("display", [HEADSET, BRIGHT_ROOM], ids=["headset", "bright room"])
@pytest.mark.parametrize("name", ["photograph", "dark scene"])
def test_it_follows_the_definition_to_a_thousandth(name, display):
    emitted = emitted_luminance(FRAMES[name], display)
    loss = UnfusedPass(SHAPE, display, FACTORS).loss(FRAMES[name])
    expected = loss_curves_by_definition(emitted, FACTORS[::16], display)
    np.testing.assert_allclose(loss[::16], expected, atol=1e-3)
    assert expected[0] > 0.05


class _Bounds(UnfusedPass):
    """Critical factors with every rounding of single precision to the same side: a bound of what it may give.

    A ratio r, the difference of two luminances over a third of about their size, may be wrong by 2^-21: eight
    roundings of float32 just below 1. Logarithms, in tables or not, are below 16 and rounded to 2^-21; there
    are some ten of them, tables included, and 2^-17 is sixteen. A pixel's own contrast and its neighbours'
    are taken as wrong in opposite directions, which is the worst for masking.
    """

    more_visible = True

    def _log_critical(self, log_ratio, log_around, reference, log_s):
        way = 1 if self.more_visible else -1
        own, others = (np.exp2(log_ratio) + sign * way * 2.0**-21 for sign in (1, -1))
        log_own, log_others = (np.log2(np.maximum(ratio, 2.0**-1000)) for ratio in (own, others))
        sensitivity = np.interp(log_around + reference, self._log_e, log_s)
        mean = neighbourhood_mean(np.exp2(MASKING_EXPONENT * (log_others + sensitivity)))
        log_masking = np.log2(mean) - MASKING_EXPONENT * (log_own + sensitivity)
        threshold = np.interp(log_masking, self._log_m, self._log_threshold)
        emitted = np.interp(threshold - log_own - way * 2.0**-17, log_s, self._log_e, -np.inf, np.inf)
        return emitted - log_around


class _FewestVisible(_Bounds):
    more_visible = False


def visible_contrast(way, frame):
    """C_v at each knot."""
    bands = way(SHAPE, HEADSET, FACTORS).log_critical_factors(frame)
    return np.mean([visible_share(band, np.log2(FACTORS)) for band in bands], axis=0)


def outside(frame, visible):
    """By how much a curve of C_v lies beyond what single precision may give, at the worst knot."""
    least, most = visible_contrast(_FewestVisible, frame), visible_contrast(_Bounds, frame)
    assert (most - least).max() < 2e-4  # one pixel of 240 in the fifth of seven bands is 6e-4
    return max((visible - most).max(), (least - visible).max())


@pytest.mark.parametrize("name", ["photograph", "high dynamic range", "edge of the shade"])
def test_the_compiled_pass_differs_from_double_precision_by_rounding_alone(name):
    frame = FRAMES[name]
    compiled = FrameAnalysis(SHAPE, HEADSET, DEFAULT_MODEL, FACTORS).of(frame)
    visible = (1 - compiled.loss) * compiled.visible_contrast
    assert outside(frame, visible) < 1e-12


def test_another_reference_factor_is_more_than_rounding(monkeypatch):
    frame = FRAMES["edge of the shade"]
    assert outside(frame, visible_contrast(UnfusedPass, frame)) <= 0
    with monkeypatch.context() as changed:
        changed.setattr(unfused_pass, "REFERENCES", 1)
        wrong = visible_contrast(UnfusedPass, frame)
    assert outside(frame, wrong) > 1e-4


def test_single_precision_rounds_every_image_and_stays_within_the_bounds():
    def single(*of):
        return UnfusedPass(*of, precision=np.float32)

    bands = single(SHAPE, HEADSET, FACTORS).log_critical_factors(FRAMES["photograph"])
    assert {image.dtype for band in bands for image in band} == {np.dtype(np.float32)}
    assert outside(FRAMES["photograph"], visible_contrast(single, FRAMES["photograph"])) < 1e-12


knots = st.lists(st.floats(-3, -0.01), min_size=1, max_size=5, unique=True).map(
    lambda logs: np.array([*sorted(logs), 0.0])
)


@given(st.integers(1, 3).flatmap(lambda n: arrays(np.float64, (n, 6), elements=st.floats(-4, 1))), knots)
def test_the_share_is_that_of_the_critical_factors_below_each_knot(log_critical, log_factors):
    n = len(log_critical)
    expected = []
    for log_factor in log_factors:
        way = 1 - log_factor / log_factors[0]
        expected.append(np.mean(log_critical[min(int(way * n), n - 1)] < log_factor))
    np.testing.assert_allclose(visible_share(log_critical, log_factors), np.maximum.accumulate(expected))


def test_an_area_of_one_luminance_shows_nothing_and_a_band_beyond_the_eye_is_left_out():
    plain = UnfusedPass((64, 64), HEADSET, FACTORS)
    assert not plain.loss(np.full((64, 64, 3), 100, np.uint8)).any()
    sharp = UnfusedPass((64, 64), replace(HEADSET, pixels_per_degree=300.0), FACTORS)
    frame = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    finest, *_, coarsest = sharp.log_critical_factors(frame)
    assert np.isposinf(finest).all()
    assert not np.isposinf(coarsest).all()
