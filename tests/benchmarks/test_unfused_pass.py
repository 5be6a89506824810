"""The one pass as expressions over whole images: against the definition, and against the compiled pass."""

from dataclasses import replace

import numpy as np
import pytest
from hard_pictures import frame_of, pictures
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.curve_definition import loss_curves_by_definition
from benchmarks.unfused_pass import UnfusedPass, visible_share
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import visible_map
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
BRIGHT_ROOM = replace(HEADSET, reflected_luminance=2.0)
FACTORS = brightness_factors()
SHAPE = (180, 320)
FRAMES = {name: frame_of(picture) for name, picture in pictures(SHAPE).items()}


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
