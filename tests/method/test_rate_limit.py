"""The rate of the modulation, and the limit at any luminance."""

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.method.choices import LimitCurve
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import (
    allowed_rate,
    largest_rate_ratio,
    modulation_rate,
    rate_limit_at,
    require_same_display,
)


def test_the_relative_rate_is_held_below_the_measured_luminances() -> None:
    limit = load_rate_limit("surace2025")
    lowest = limit.luminance_range[0]
    below = np.array([lowest / 2, lowest / 100, lowest / 1e6])
    np.testing.assert_allclose(
        rate_limit_at(limit, below) / below, rate_limit_at(limit, lowest) / lowest, rtol=1e-12
    )


def test_the_rate_is_held_above_the_measured_luminances_where_the_quartic_would_turn_over() -> None:
    limit = load_rate_limit("surace2025")
    highest = limit.luminance_range[1]
    assert rate_limit_at(limit, 1e4) == pytest.approx(float(rate_limit_at(limit, highest)), rel=1e-12)


def test_zero_luminance_may_not_change() -> None:
    assert rate_limit_at(load_rate_limit("surace2025"), 0.0) == 0.0


def test_a_line_in_log_log_is_a_power_law() -> None:
    # ln rate = ln 0.03 + ln L on [1, 100]: z runs from -1 to 1, ln L = ln 10 · (1 + z).
    coefficients = (float(np.log(0.03) + np.log(10)), float(np.log(10)))
    limit = RateLimit("p", "d", "", RateLimitForm.LOG_LOG, coefficients, (1.0, 100.0))
    np.testing.assert_allclose(rate_limit_at(limit, [1.0, 7.0, 100.0]), [0.03, 0.21, 3.0], rtol=1e-12)


def test_a_polynomial_of_the_rate_never_goes_below_zero() -> None:
    limit = RateLimit("p", "d", "", RateLimitForm.RATE, (0.0, 1.0), (1.0, 3.0))  # rate = L - 2
    assert rate_limit_at(limit, [1.0, 2.5]).tolist() == [0.0, 0.5]


def test_the_safe_curve_is_the_lower_edge_of_the_band() -> None:
    limit = load_rate_limit("surace2025")
    luminance = np.linspace(*limit.luminance_range, 50)
    assert (rate_limit_at(limit, luminance, LimitCurve.SAFE) < rate_limit_at(limit, luminance)).all()


def test_a_limit_without_band_has_no_safe_curve() -> None:
    limit = RateLimit("five points", "d", "", RateLimitForm.RATE, (1.0,), (1.0, 3.0))
    with pytest.raises(InputError, match="'five points' has no band"):
        rate_limit_at(limit, 2.0, LimitCurve.SAFE)


def test_a_limit_fitted_on_another_display_is_refused() -> None:
    other = Display("desk", 350.0, 0.3, 2.2, 40.0)
    with pytest.raises(InputError, match="fitted on the display 'varjo-xr3', not on 'desk'"):
        require_same_display(load_rate_limit("surace2025"), other)


def test_the_same_panel_at_another_distance_keeps_its_limit() -> None:
    panel = load_display("varjo-xr3")
    nearer = Display("x", panel.peak_luminance, panel.black_level, panel.gamma, panel.pixels_per_degree / 2)
    require_same_display(load_rate_limit("surace2025"), nearer)


# --- modulation


def test_only_the_modulation_counts_not_a_cut_in_the_content() -> None:
    rate = modulation_rate(np.array([0.5, 0.5]), np.array([1.0, 100.0]), np.array([0.04, 0.04]))
    assert rate.tolist() == [0.0, 0.0]


def test_rate_of_a_step_by_hand() -> None:
    # The factor rises by 0.1 on frames of 20 and 40 cd/m^2: 0.1 · 30 cd/m^2 within 0.5 s is 6 cd/m^2/s.
    rate = modulation_rate(np.array([0.4, 0.5]), np.array([20.0, 40.0]), np.array([0.5, 0.1]))
    assert rate[0] == pytest.approx(6.0)


def test_the_lower_limit_of_the_two_ends_counts() -> None:
    allowed = allowed_rate(np.array([0.5, 1.0]), np.array([10.0, 10.0]), lambda luminance: 0.03 * luminance)
    assert allowed[0] == pytest.approx(0.03 * 5.0)


def test_no_change_is_allowed_even_where_the_limit_is_zero() -> None:
    assert largest_rate_ratio(np.array([0.0, 0.0]), np.array([0.0, 0.0])) == 0.0


def test_a_change_where_the_limit_is_zero_is_infinitely_too_fast() -> None:
    assert largest_rate_ratio(np.array([1e-9]), np.array([0.0])) == np.inf
