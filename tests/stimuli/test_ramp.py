"""The ramp: linear in luminance, and refused where the display would cut it off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.stimuli.ramp import frame_count, ramp_luminance, reachable_luminances, require_reachable

LAB = Display("lab", 100.0, 0.5, 2.2, pixels_per_degree=60.0, reflected_luminance=1.0)


def test_the_papers_ramp_is_constant_then_falls_at_its_rate_then_holds() -> None:
    times = np.arange(0, 7, 1 / 60)
    luminance = ramp_luminance(times, 100.0, 99.0, adaptation=1.0, duration=5.0)
    rates = np.diff(luminance) * 60
    ramping = (times[:-1] >= 1 - 1e-9) & (times[1:] <= 6 + 1e-9)
    np.testing.assert_allclose(rates[ramping], -0.2, atol=1e-9)  # 1 cd/m^2 in 5 s
    np.testing.assert_allclose(rates[~ramping], 0.0, atol=1e-9)
    assert luminance[0] == 100.0
    assert luminance[-1] == 99.0


@given(st.floats(0, 10), st.floats(1, 100), st.floats(1, 100), st.floats(0, 3), st.floats(0.1, 6))
def test_no_luminance_lies_beyond_the_two_ends(time, initial, final, adaptation, duration) -> None:
    luminance = float(ramp_luminance(time, initial, final, adaptation, duration))
    assert min(initial, final) - 1e-9 <= luminance <= max(initial, final) + 1e-9


def test_a_ramp_of_7_s_has_420_frames_at_60_hz_and_1007_at_143_86_hz() -> None:
    assert frame_count(7.0, 60.0) == 420
    assert frame_count(7.0, 143.86) == 1007  # 1007.02


def test_pixels_reach_black_and_white_with_the_reflected_light() -> None:
    assert reachable_luminances(0.46, LAB, Actuator.PIXELS) == (1.5, 101.0)


def test_a_backlight_dims_what_the_pixels_let_through_and_not_the_reflected_light() -> None:
    emitted = 0.5**2.2 * (100.0 - 0.5) + 0.5  # Eq. 1
    darkest, brightest = reachable_luminances(0.5, LAB, Actuator.BACKLIGHT, smallest_factor=0.1)
    assert darkest == pytest.approx(0.1 * emitted + 1.0)
    assert brightest == pytest.approx(emitted + 1.0)


@pytest.mark.parametrize(
    ("initial", "final", "actuator", "says"),
    [
        (20.0, 1.4, Actuator.PIXELS, "end beyond 1.5 cd/m"),
        (20.0, -5.0, Actuator.PIXELS, "end beyond 1.5 cd/m"),
        (101.0, 106.0, Actuator.PIXELS, "end beyond 101 cd/m"),
        (120.0, 90.0, Actuator.PIXELS, "begin beyond 101 cd/m"),
        (20.0, 5.9, Actuator.BACKLIGHT, "end beyond 6 cd/m"),  # 0.05 of 100, and 1 reflected
    ],
)
def test_a_ramp_beyond_the_display_is_refused_with_its_limit(initial, final, actuator, says) -> None:
    with pytest.raises(InputError, match=says) as refused:
        require_reachable(initial, final, 1.0, LAB, actuator, smallest_factor=0.05)
    assert "'lab'" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_ramp_to_the_very_limits_is_shown() -> None:
    require_reachable(101.0, 1.5, 1.0, LAB, Actuator.PIXELS)
    require_reachable(101.0, 6.0 - 1e-12, 1.0, LAB, Actuator.BACKLIGHT, smallest_factor=0.05)
