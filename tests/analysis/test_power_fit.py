"""Claims about the line of power over luminance."""

import numpy as np
import pytest
from numbers_of_sets import counts_at, few_and_many

from evenlight.analysis.sweeps.power_fit import fit_line, points_of, slope_through
from evenlight.data_schema.errors import InputError

FACTORS = np.repeat(np.arange(1, 11) / 10, 3)


def test_readings_on_a_line_give_that_line_back() -> None:
    luminance = 500 * FACTORS
    fit = fit_line(points_of(luminance.tolist(), (0.3 + 0.002 * luminance).tolist(), FACTORS.tolist()))
    assert fit.base_power == pytest.approx(0.3, abs=1e-9)
    assert fit.power_per_luminance == pytest.approx(0.002, rel=1e-9)
    assert fit.r_squared == pytest.approx(1.0)
    assert fit.bend == pytest.approx(0.0, abs=1e-9)
    assert fit.is_linear


def test_the_interval_of_a_line_through_equal_weights_is_the_textbook_one() -> None:
    # One reading a level: y = 1, 2, 4 over x = 1, 2, 3. Slope 1.5, residuals 1/6, -1/3, 1/6 (sum of squares
    # 1/6, one degree of freedom), standard error sqrt(1/6/2) = 0.2887; t(0.975, 1) = 12.706.
    fit = fit_line(points_of([1.0, 2.0, 3.0], [1.0, 2.0, 4.0], [0.3, 0.6, 0.9]))
    assert fit.power_per_luminance == pytest.approx(1.5)
    assert fit.power_per_luminance_interval == pytest.approx(
        (1.5 - 12.706 * 0.288675, 1.5 + 12.706 * 0.288675), abs=1e-3
    )


def test_bright_levels_that_scatter_more_weigh_less() -> None:
    rng = np.random.default_rng(1)
    luminance = 500 * FACTORS
    power = 0.3 + 0.002 * luminance + 1e-4 * rng.standard_normal(30)
    luminance = luminance * (1 + 0.01 * rng.standard_normal(30))  # 10 mW at the top, 1 mW at the bottom
    fit = fit_line(points_of(luminance.tolist(), power.tolist(), FACTORS.tolist()))
    # Weighed by 1/b², the base has the standard error 10 mW / sqrt(sum of (1/b - mean of 1/b)²) = 0.7 mW and
    # an interval of 3 mW; without weights 6.2 mW · sqrt(1/30 + 0.55²/2.475) = 2.4 mW, and one of 10 mW.
    low, high = fit.base_power_interval
    assert low < 0.3 < high
    assert high - low < 0.005


def test_a_lack_of_fit_is_told_from_noise_by_the_repeats() -> None:
    rng = np.random.default_rng(2)
    luminance = 500 * FACTORS
    bent = 0.3 + 0.002 * luminance + 0.05 * np.sin(2 * np.pi * FACTORS)
    fit = fit_line(
        points_of(luminance.tolist(), (bent + 1e-3 * rng.standard_normal(30)).tolist(), FACTORS.tolist())
    )
    assert fit.lack_of_fit_p is not None
    assert fit.lack_of_fit_p < 1e-6
    assert not fit.is_linear


def test_a_bend_is_as_high_as_its_quadratic_over_the_chord() -> None:
    # P = L + 0.002 L² from 0 to 100: at 50 it is 55, its chord 60; the bend is -5 of 120 that are added.
    luminance = np.repeat([0.0, 25.0, 50.0, 75.0, 100.0], 2)
    power = luminance + 0.002 * luminance**2
    fit = fit_line(points_of(luminance.tolist(), power.tolist(), (luminance / 100).tolist()))
    assert fit.bend == pytest.approx(-5 / 120, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("own", "shared"),
    [(0.002, 0.0), (0.01, 0.0), (0.002, 0.01)],
    ids=["independent noise", "a noisy luminance meter", "noise that both meters see"],
)
@pytest.mark.parametrize("sweeps", few_and_many(80, 400))
def test_the_lack_of_fit_of_a_linear_panel_is_as_improbable_as_it_says(
    sweeps: int, own: float, shared: float
) -> None:
    # 4000 sweeps had 4.4 to 4.9 %. What the display itself does between readings, both see alike.
    rng = np.random.default_rng(3)
    found = []
    for _ in range(sweeps):
        light = 300 * FACTORS * (1 + shared * rng.standard_normal(30))
        read = light * (1 + own * rng.standard_normal(30))
        power = 0.2945 + 0.001858 * light
        power += np.hypot(0.001 * power, 0.0005) * rng.standard_normal(30)
        found.append(fit_line(points_of(read.tolist(), power.tolist(), FACTORS.tolist())).lack_of_fit_p)
    low, high = counts_at(0.05, sweeps)
    assert low <= np.mean(np.array(found, dtype=float) < 0.05) <= high


def test_two_levels_are_refused() -> None:
    with pytest.raises(InputError, match="needs 3 or more brightness factors"):
        fit_line(points_of([1.0, 2.0], [1.0, 2.0], [0.5, 1.0]))


def test_power_that_falls_with_luminance_is_refused() -> None:
    with pytest.raises(InputError, match="does not rise with luminance"):
        fit_line(points_of([1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [0.3, 0.6, 0.9]))


def test_a_line_through_a_given_base_is_least_squares_through_it() -> None:
    # Of y - 1 = 1, 2, 6 over x = 1, 2, 3: (1 + 4 + 18)/(1 + 4 + 9).
    assert slope_through(points_of([1.0, 2.0, 3.0], [2.0, 3.0, 7.0], [0.3, 0.6, 0.9]), 1.0) == pytest.approx(
        23 / 14
    )
