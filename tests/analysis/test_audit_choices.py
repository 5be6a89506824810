"""53 % and 47 %, and the table of powers, by hand."""

import math

import numpy as np
import pytest

from evenlight.analysis.audit.choices import (
    ChosenCount,
    chance_of_being_so_even,
    chosen_counts,
    counts_printed_as,
    detectability,
    numbers_that_fit,
)
from evenlight.analysis.audit.powers import (
    line_luminance,
    nominal_line,
    refitted_line,
    sample_power,
    table_powers,
)
from evenlight.analysis.published import published


def test_the_percentages_are_nine_and_eight_of_seventeen() -> None:
    assert [(c.sequence, c.chosen, c.answers) for c in chosen_counts()] == [
        ("library", 9, 17),
        ("gym", 8, 17),
        ("living_room", 8, 17),
        ("basement", 9, 17),
    ]


def test_a_percentage_may_be_rounded_or_cut_off() -> None:
    # 2 of 3 is 66.67 %.
    assert counts_printed_as("67", 3) == counts_printed_as("66", 3) == (2,)
    assert counts_printed_as("68", 3) == ()
    # Of 300 people, 159 and 161 are 53 and 53.67 %, 158 is 52.67 %: four counts of one percentage.
    assert counts_printed_as("53", 300) == (158, 159, 160, 161)


def test_only_fifteen_seventeen_and_nineteen_people_have_both_percentages() -> None:
    # 8/15 = 53.3, 7/15 = 46.7; 10/19 = 52.6, 9/19 = 47.4.
    assert numbers_that_fit(("53", "47")) == (15, 17, 19)


def test_evenness_is_a_product_of_binomial_probabilities() -> None:
    middle = 2 * math.comb(17, 8) / 2**17
    assert chance_of_being_so_even(chosen_counts()) == pytest.approx(middle**4, rel=1e-12)
    exactly_half = ChosenCount("attic", "50", 2, 4)
    assert chance_of_being_so_even((exactly_half,)) == pytest.approx(6 / 16)


def test_d_prime_at_75_percent_is_0_954() -> None:
    # Two-alternative forced choice: d' = √2 · 0.6745.
    assert detectability(0.75) == pytest.approx(math.sqrt(2) * 0.67449, abs=1e-5)
    assert detectability(0.5) == 0.0


def test_implied_luminance_gives_the_power_back() -> None:
    for power in table_powers():
        assert 0.001858 * line_luminance(power.power) + 0.2945 == pytest.approx(power.power)


def test_full_brightness_lies_beyond_every_sample() -> None:
    full = [p for p in table_powers() if p.version == "full"]
    assert len(full) == 4
    for power in full:
        assert power.power > max(sample_power()) == 1.75
        assert power.factor_of_full == 1.0
        assert power.factor_of_samples is None
        # (1.789 - 0.2945) / 0.001858 = 804.4, (1.800 - 0.2945) / 0.001858 = 810.3
        assert 804 < power.luminance < 811


def test_the_factor_between_the_samples_is_read_on_a_straight_line_between_two() -> None:
    # 0.959 W lies between 0.80 W at 290 and 1.10 W at 440 cd/m².
    library = next(p for p in table_powers() if (p.sequence, p.version) == ("library", "baseline"))
    assert library.factor_of_samples == pytest.approx((290 + 150 * 0.159 / 0.3) / 750)
    assert library.factor_of_full == pytest.approx((0.959 - 0.2945) / (1.8 - 0.2945))
    assert library.saving == pytest.approx(1 - 0.959 / 1.8)


def test_dimmed_rows_agree_with_their_targets_between_the_samples_but_not_with_the_full_rows() -> None:
    dimmed = [p for p in table_powers() if p.version != "full"]
    assert max(abs(p.factor_of_samples - p.nominal_factor) for p in dimmed) < 0.03
    assert min(p.nominal_factor - p.factor_of_full for p in dimmed) > 0.045


def test_the_samples_give_the_printed_coefficients() -> None:
    fit = refitted_line()
    assert f"{fit.slope:.6f}" == published("power_model.slope").text
    assert f"{fit.base_power:.4f}" == published("power_model.base").text


def test_the_nominal_line_is_least_squares_by_hand() -> None:
    # Factors 0.3, 0.4, 0.5, 0.7 (mean 0.475), powers 0.646, 0.800, 0.959, 1.258 (mean 0.91575):
    # Σ(x - x̄)(P - P̄) = 0.133975, Σ(x - x̄)² = 0.0875.
    line = nominal_line()
    assert line.slope == pytest.approx(0.133975 / 0.0875)
    assert line.base == pytest.approx(0.91575 - 0.475 * 0.133975 / 0.0875)
    assert line.at_full == pytest.approx(line.base + line.slope)
    misses = np.array([0.646, 0.8, 0.959, 1.258]) - line.base - line.slope * np.array([0.3, 0.4, 0.5, 0.7])
    assert line.largest_miss == pytest.approx(np.abs(misses).max())
