"""The rate limit's fit: interpolation, conditioning, pooling over participants, and thresholds left out."""

import dataclasses

import numpy as np
import pytest
from example_ramps import THRESHOLD

from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import RateLimitFit, fit_points, fit_thresholds
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.method.preset_files import load_display
from evenlight.method.rate_limit import rate_limit_at

DISPLAY = Display("bench", 104.4, 0.2, 1.95, 72.28)
WHITE = (20.9, 41.8, 62.6, 83.5, 104.4)
BOTH = (4.6, 9.2, 13.9, 18.5, 23.1, *WHITE)
WEBER = RateLimitOptions(RateLimitForm.LOG_LOG, degree=1)


def threshold(
    participant: str, luminance: float, rate: float, se: float = 0.1, flag: ThresholdFlag = ThresholdFlag.NONE
) -> Threshold:
    ends = rate * np.exp([-1.96 * se, 1.96 * se])
    return dataclasses.replace(
        THRESHOLD, participant_id=participant, luminance=luminance, threshold=rate, ci_low=ends[0],
        ci_high=ends[1], standard_error_ln=se, flag=flag,
    )  # fmt: skip


def people(sensitivities: list[float], luminances: tuple[float, ...] = BOTH) -> list[Threshold]:
    """Participants who detect 3 %/s of any luminance, times their own factor, without error."""
    return [
        threshold(f"{p:02d}", L, 0.03 * L * own) for p, own in enumerate(sensitivities) for L in luminances
    ]


def rates_at(fit: RateLimitFit, luminance: tuple[float, ...]) -> list[float]:
    return [float(rate) for rate in rate_limit_at(fit.limit, luminance)]


# ------------------------------------------------------------------ points


def test_a_quartic_on_five_points_meets_them_all_and_says_that_it_cannot_be_judged() -> None:
    rates = (0.7, 1.5, 1.6, 2.9, 2.6)
    fit = fit_points(WHITE, rates, DISPLAY)
    assert rates_at(fit, WHITE) == pytest.approx(rates, rel=1e-12)
    assert fit.residual_df == 0
    assert fit.residual_sd is None
    assert fit.limit.band_luminance == ()
    assert any("cannot tell whether its shape is right" in note for note in fit.notes)


@pytest.mark.parametrize("luminances", [WHITE, BOTH[2:], BOTH])
def test_the_quartic_is_well_conditioned_where_monomials_are_not(luminances: tuple[float, ...]) -> None:
    fit = fit_points(luminances, 0.03 * np.array(luminances), DISPLAY)
    assert fit.limit.condition_number is not None
    assert fit.limit.condition_number < 5
    assert np.linalg.cond(np.vander(luminances, 5)) > 1e8


def test_four_luminances_are_too_few_for_degree_four() -> None:
    with pytest.raises(InputError, match=r"5 or more luminances, got 4.*a lower `degree`"):
        fit_points([10, 20, 20, 40, 80], [0.3, 0.6, 0.6, 1.2, 2.4], DISPLAY, RateLimitOptions(degree=4))


def test_the_band_is_that_of_a_textbook_straight_line() -> None:
    # y = 5 + z + residuals (+1, -2, +1)/10 at z = -1, 0, 1: s² = 0.06/1, Var(z) = s² (1/3 + z²/2); one
    # residual degree of freedom: t(0.975) = 12.7062. The rate is never below 0.
    line = RateLimitOptions(RateLimitForm.RATE, degree=1)
    fit = fit_points([10, 50, 90], [5 - 1 + 0.1, 5 - 0.2, 5 + 1 + 0.1], DISPLAY, line)
    z = (np.array(fit.limit.band_luminance) - 50) / 40
    half = 12.7062 * np.sqrt(0.06 * (1 / 3 + z**2 / 2))
    np.testing.assert_allclose(fit.limit.band_upper, 5 + z + half, rtol=1e-5)
    np.testing.assert_allclose(fit.limit.band_lower, np.maximum(0, 5 + z - half), rtol=1e-4)


def test_webers_law_is_a_line_of_slope_one_in_log_log() -> None:
    fit = fit_points(BOTH, 0.03 * np.array(BOTH), DISPLAY, WEBER)
    between = tuple(np.geomspace(BOTH[0], BOTH[-1], 20))
    assert rates_at(fit, between) == pytest.approx([0.03 * L for L in between], rel=1e-12)
    assert fit.monotone


def test_a_fall_within_the_range_is_reported_where_it_is() -> None:
    # Rate = 2 - z²: rises to the middle, 50 cd/m², falls from there.
    parabola = RateLimitOptions(RateLimitForm.RATE, degree=2)
    fit = fit_points([10, 30, 50, 70, 90], [1, 1.75, 2, 1.75, 1], DISPLAY, parabola)
    ((low, high),) = fit.falling
    assert (low, high) == pytest.approx((50, 90), abs=0.2)
    assert not fit.monotone
    assert any(
        "Implausible: the limit falls from 50 to 90 cd/m^2; try `evenlight fit --monotone`" in note
        for note in fit.notes
    )


@pytest.mark.parametrize("bend", [0.005, 0.02])
def test_only_a_fall_of_more_than_a_hundredth_is_reported(bend: float) -> None:
    # Rate = 1 - bend z²: falls by the share `bend` over the upper half of the range.
    parabola = RateLimitOptions(RateLimitForm.RATE, degree=2)
    rates = [1 - bend, 1 - bend / 4, 1, 1 - bend / 4, 1 - bend]
    assert fit_points([10, 30, 50, 70, 90], rates, DISPLAY, parabola).monotone == (bend < 0.01)


def test_only_a_fall_over_more_than_a_fiftieth_of_the_range_is_reported() -> None:
    # ln(rate) = -12.5 (z - m)²: falls from m to 1, (1 - m)/2 of the range: 1.5 and 2.5 %; by 1.1 and 3 %.
    parabola = RateLimitOptions(degree=2)
    z = np.linspace(-1, 1, 5)
    for peak, told in ((0.97, False), (0.95, True)):
        fit = fit_points(50 + 40 * z, np.exp(-12.5 * (z - peak) ** 2), DISPLAY, parabola)
        assert bool(fit.falling) is told


def test_a_polynomial_of_the_rate_that_touches_zero_is_reported() -> None:
    # Rate = 3 z² - 0.05 through four points: below 0 about the middle, where no threshold was measured.
    options = RateLimitOptions(RateLimitForm.RATE, degree=2)
    fit = fit_points([10, 30, 70, 90], [2.95, 0.7, 0.7, 2.95], DISPLAY, options)
    assert any("to 0 or below" in note for note in fit.notes)
    assert (rate_limit_at(fit.limit, np.linspace(10, 90, 200)) >= 0).all()


def test_equal_thresholds_give_a_flat_limit_without_a_band_to_speak_of() -> None:
    fit = fit_points(BOTH, [2.0] * 10, DISPLAY)
    assert rates_at(fit, BOTH) == pytest.approx([2.0] * 10, rel=1e-12)
    assert fit.monotone
    assert fit.limit.band_upper == pytest.approx(fit.limit.band_lower, rel=1e-9)


def test_the_degree_is_bounded() -> None:
    with pytest.raises(InputError, match="degree of the rate limit must lie in 0 to 8, got 9"):
        RateLimitOptions(degree=9)


@pytest.mark.parametrize("form", list(RateLimitForm))
def test_a_high_degree_must_leave_two_luminances_to_judge_it_by(form: RateLimitForm) -> None:
    # Nine coefficients and two luminances over: 11, one more than there are.
    with pytest.raises(InputError, match="degree 8 needs thresholds at 11 or more luminances, got 10"):
        fit_thresholds(people([0.8, 1.2]), DISPLAY, RateLimitOptions(form, degree=8))


def test_a_high_degree_that_the_thresholds_do_not_tie_down_is_refused() -> None:
    # Thresholds known to a factor of e^2 each and two participants: t(0.975, df = 1) = 12.7, so that the band
    # reaches over e^(2 · 12.7 · 2/sqrt(2)) where a participant's level is on its own; 100 is e^4.6.
    rows = [dataclasses.replace(row, standard_error_ln=2.0) for row in people([0.8, 1.2])]
    with pytest.raises(InputError, match=r"degree 7 is not known .* choose the degree 4 or lower"):
        fit_thresholds(rows, DISPLAY, RateLimitOptions(degree=7))


# ------------------------------------------------------------------ participants


def test_participants_who_differ_by_a_factor_give_the_curve_of_the_geometric_mean() -> None:
    fit = fit_thresholds(people([0.5, 1.0, 2.0]), DISPLAY, WEBER)
    assert rates_at(fit, BOTH) == pytest.approx([0.03 * L for L in BOTH], rel=1e-6)
    # Their ln factors are -ln 2, 0, ln 2: sample variance (ln 2)²; of each participant's mean, known to
    # 0.1/sqrt(10) and without other scatter, σ_u² = (ln 2)² - 0.001.
    assert fit.participant_sd == pytest.approx(np.sqrt(np.log(2) ** 2 - 0.001), rel=1e-4)
    assert fit.residual_sd == pytest.approx(0.0, abs=1e-3)


def test_the_band_of_a_curve_follows_the_number_of_participants() -> None:
    # At the mean of the design, Var = (σ_u² + se²/10)/3 = (ln 2)²/3, and t(0.975, df = 2) = 4.30265.
    fit = fit_thresholds(people([0.5, 1.0, 2.0]), DISPLAY, RateLimitOptions(degree=0))
    ratio = fit.limit.band_upper[0] / rates_at(fit, (BOTH[0],))[0]
    spread = fit.residual_sd
    assert spread is not None
    variance = np.log(2) ** 2 / 3  # ANOVA: the mean square between participants over all values
    assert np.log(ratio) == pytest.approx(4.30265 * np.sqrt(variance), rel=1e-3)


def test_one_participant_gives_a_curve_and_no_band_for_others() -> None:
    """The curve meets each threshold; their own errors, 10 %, say nothing of how people differ."""
    fit = fit_thresholds(people([1.0], WHITE), DISPLAY)
    assert rates_at(fit, WHITE) == pytest.approx([0.03 * L for L in WHITE], rel=1e-9)
    assert fit.limit.band_luminance == fit.limit.band_upper == ()
    assert fit.participant_sd is None
    assert any("One participant" in note and "no band" in note for note in fit.notes)


def test_thresholds_that_are_the_priors_or_the_criterions_are_left_out_and_counted() -> None:
    good = people([0.8, 1.2])
    wild = [
        threshold("02", L, 50.0, flag=flag)
        for L, flag in zip(
            BOTH, [ThresholdFlag.ALL_NO, ThresholdFlag.ALL_YES, ThresholdFlag.FALSE_ALARMS] * 3, strict=False
        )
    ]
    with_wild, without = (fit_thresholds(rows, DISPLAY, WEBER) for rows in (good + wild, good))
    assert with_wild.limit.coefficients == without.limit.coefficients
    assert len(with_wild.excluded) == 9
    assert any(
        "9 of 29 thresholds are left out (3 all_yes, 3 all_no, 3 false_alarms)" in n for n in with_wild.notes
    )


@pytest.mark.parametrize(
    ("flag", "side"),
    [
        (ThresholdFlag.ALL_YES, "the limit is too high, on the unsafe side"),
        (ThresholdFlag.ALL_NO, "the limit is too low, on the safe side"),
    ],
)
def test_what_is_left_out_draws_the_limit_to_a_side_that_is_named(flag: ThresholdFlag, side: str) -> None:
    """Who sees every ramp has a threshold below all rates; without such people the mean is higher."""
    lost = [threshold("09", L, 50.0, flag=flag) for L in BOTH]
    notes = " ".join(fit_thresholds(people([0.8, 1.2]) + lost, DISPLAY, WEBER).notes)
    assert side in notes
    assert ("unsafe" in notes) == (flag is ThresholdFlag.ALL_YES)


def test_separated_and_out_of_range_thresholds_stay_in_with_their_wide_error() -> None:
    rows = people([1.0, 1.0, 1.0])
    flags = (ThresholdFlag.SEPARATED, ThresholdFlag.BELOW_RANGE, ThresholdFlag.ABOVE_RANGE)
    rows[:3] = [
        dataclasses.replace(row, flag=flag, standard_error_ln=0.5)
        for row, flag in zip(rows[:3], flags, strict=True)
    ]
    assert len(fit_thresholds(rows, DISPLAY).used) == 30


@pytest.mark.parametrize(
    ("flag", "advice"),
    [
        (ThresholdFlag.ALL_NO, "test faster ramps"),
        (ThresholdFlag.ABOVE_RANGE, "test faster ramps"),
        (ThresholdFlag.ALL_YES, "test slower ramps"),
        (ThresholdFlag.BELOW_RANGE, "test slower ramps"),
    ],
)
def test_thresholds_that_mostly_lie_outside_the_rates_tested_give_no_limit(
    flag: ThresholdFlag, advice: str
) -> None:
    rows = people([0.8, 1.2])
    half = [dataclasses.replace(row, flag=flag) for row in rows[:10]] + rows[10:]
    fit_thresholds(half, DISPLAY, WEBER)
    most = [dataclasses.replace(half[10], flag=flag) if i == 10 else row for i, row in enumerate(half)]
    with pytest.raises(InputError, match=rf"11 of 20 .*\(11 {flag.value}\).*{advice}$"):
        fit_thresholds(most, DISPLAY, WEBER)


def test_thresholds_left_out_are_named_where_too_few_levels_remain() -> None:
    rows = [dataclasses.replace(row, flag=ThresholdFlag.FALSE_ALARMS) for row in people([1.0])]
    with pytest.raises(InputError, match=r"got 0: 10 of 10 thresholds are left out \(10 false_alarms\)"):
        fit_thresholds(rows, DISPLAY)


def test_all_thresholds_equal() -> None:
    rows = [threshold(f"{p:02d}", L, 2.0) for p in range(3) for L in BOTH]
    fit = fit_thresholds(rows, DISPLAY)
    assert rates_at(fit, BOTH) == pytest.approx([2.0] * 10, rel=1e-9)
    assert fit.monotone


def test_linear_interpolation_of_the_band_errs_by_less_than_a_thousandth() -> None:
    fit = fit_thresholds(people([0.8, 1.0, 1.3]), DISPLAY)
    limit = fit.limit
    middle = (np.array(limit.band_luminance[1:]) + limit.band_luminance[:-1]) / 2
    linear = np.interp(middle, limit.band_luminance, rate_limit_at(limit, limit.band_luminance))
    np.testing.assert_allclose(linear, rate_limit_at(limit, middle), rtol=1e-3)


def test_rates_that_no_eye_has_are_refused_in_one_line() -> None:
    luminance = np.array([5.0, 10.0, 20.0, 40.0, 60.0, 80.0])
    with pytest.raises(InputError, match="the answers give no usable rate limit"):
        fit_points(luminance, np.full(6, 1e30), load_display("varjo-xr3"))
