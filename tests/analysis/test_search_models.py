"""Claims about the models of search times: what they recover, what dropping the undetected does."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from made_searches import SearchTruth, made_table
from scipy import stats
from statsmodels.regression.linear_model import WLS

from evenlight.analysis.inference.fixed_effects import FitFlag, FixedEffect
from evenlight.analysis.inference.lognormal_times import TimesFit
from evenlight.analysis.search.search_models import (
    ALL_ALIKE,
    BRIGHTNESS,
    CAPPED,
    CENSORED,
    DROPPED,
    TOO_FEW,
    VERSION,
    LocationLine,
    brightness_fit,
    effect_of,
    effects_by_location,
    effects_by_side,
    for_people_and_locations,
    informative,
    line_over_locations,
    slowing,
    treated_fits,
    version_fit,
    with_flags,
)
from evenlight.analysis.search.search_trials import BrightnessEffect, SearchTable

MARGIN = math.log(1.25)


def table(seed: int = 1, **truth: float) -> SearchTable:
    settings = {"locations": 6, **truth}
    return made_table(SearchTruth(**settings), np.random.default_rng(seed))


def version_effect(data: SearchTable) -> FixedEffect:
    return effect_of(version_fit(data), VERSION)


@functools.cache
def everything_found() -> SearchTable:
    return table(5, time_limit=1e6, version=-0.1, brightness=-1.0)


@functools.cache
def by_side() -> dict[BrightnessEffect, FixedEffect]:
    return effects_by_side(everything_found())


@functools.cache
def overall() -> TimesFit:
    return version_fit(everything_found())


def least_squares(data: SearchTable, *columns: np.ndarray) -> np.ndarray:
    """Effects on ln(time) beside those of people, places, visit and order."""
    people, spots = np.eye(17)[data.participant][:, 1:], np.eye(12)[data.spot]
    design = np.column_stack([*columns, data.visit, data.order, people, spots])
    return np.asarray(np.linalg.lstsq(design, np.log(data.times), rcond=None)[0][: len(columns)])


@pytest.mark.slow
def test_leaving_out_the_undetected_hides_half_of_an_effect_and_the_model_finds_it() -> None:
    # The case of the literature on it: a true effect of -0.25 with a quarter undetected. Five experiments.
    truth = {"middle": 22.0, "version": -0.25}
    tables = [table(seed, **truth) for seed in range(5)]
    share_lost = np.mean([1 - data.found.mean() for data in tables])
    assert 0.2 < share_lost < 0.3
    found = [version_effect(data) for data in tables]
    estimates = np.array([effect.estimate for effect in found], dtype=float)
    errors = np.array([effect.standard_error for effect in found], dtype=float)
    # The mean of five is off by at most 3.3 of its standard errors (1 in 1000).
    assert abs(estimates.mean() + 0.25) < 3.3 * errors.mean() / np.sqrt(5)
    dropped = [version_effect(data.some(data.found)).estimate or 0.0 for data in tables]
    capped = [
        version_effect(dataclasses.replace(data, found=np.ones_like(data.found))).estimate or 0.0
        for data in tables
    ]
    assert estimates.mean() < np.mean(capped) < np.mean(dropped) < 0
    assert np.mean(dropped) / estimates.mean() < 0.75


def test_if_everything_is_found_the_effects_are_those_of_least_squares() -> None:
    # Every person has each location in both versions: random people and fixed ones give nearly the same.
    data = everything_found()
    ours, x = data.ours.astype(float), data.ln_ratio
    sides = {side: effect.estimate for side, effect in by_side().items()}
    bright, dim = least_squares(data, ours * (x > 0), ours * (x < 0))
    assert sides[BrightnessEffect.BRIGHTENED] == pytest.approx(bright, abs=0.01)
    assert sides[BrightnessEffect.DIMMED] == pytest.approx(dim, abs=0.01)
    slope, version = least_squares(data, ours * x, ours)
    fit = brightness_fit(data)
    assert effect_of(fit, BRIGHTNESS).estimate == pytest.approx(slope, abs=0.03)
    assert effect_of(fit, VERSION).estimate == pytest.approx(version, abs=0.01)
    own = least_squares(data, *(ours * (data.location == k) for k in range(6)))
    np.testing.assert_allclose([e.estimate for e in effects_by_location(data).values()], own, atol=0.01)


def test_if_everything_is_found_nothing_is_biased_by_what_is_not() -> None:
    ways = treated_fits(everything_found(), overall())
    assert len({effect_of(ways[way], VERSION).estimate for way in (CENSORED, DROPPED, CAPPED)}) == 1
    assert informative(everything_found()).times.size == everything_found().times.size


def test_the_slowing_that_is_excluded_is_by_students_t() -> None:
    effect = by_side()[BrightnessEffect.DIMMED]
    p_value, largest = slowing(effect, MARGIN)
    assert effect.df == 16  # 17 people
    assert effect.estimate is not None
    assert effect.standard_error is not None
    t = (MARGIN - effect.estimate) / effect.standard_error
    assert p_value == pytest.approx(stats.t.sf(t, 16))
    assert largest is not None
    # Excluded at 5 % is just what lies beyond the largest.
    assert stats.t.sf((largest - effect.estimate) / effect.standard_error, 16) == pytest.approx(0.05)


def test_gaps_told_wrongly_can_be_counted_as_undetected() -> None:
    data = table(2, wrong=0.4)
    stricter = data.without_wrong()
    wrong = data.found & ~data.correct
    assert wrong.any()
    assert not stricter.found[wrong].any()
    np.testing.assert_array_equal(stricter.times[wrong], 30.0)
    np.testing.assert_array_equal(stricter.times[~wrong], data.times[~wrong])


def test_places_that_nobody_found_are_left_out_and_counted() -> None:
    data = table(3)
    lost = data.location == 2
    data = dataclasses.replace(
        data,
        found=data.found & ~lost,
        times=np.where(lost, data.limits, data.times),
        correct=data.found & ~lost,
    )
    assert informative(data).times.size == data.times.size - lost.sum()
    assert version_effect(data).estimate == version_effect(data.some(~lost)).estimate
    assert 2 not in effects_by_location(informative(data))


def effects(values: list[float], errors: list[float]) -> dict[int, FixedEffect]:
    return {
        k: FixedEffect(str(k), value, error, None, None, None)
        for k, (value, error) in enumerate(zip(values, errors, strict=True))
    }


def line(values: list[float], errors: list[float], x: np.ndarray) -> LocationLine:
    found = line_over_locations(effects(values, errors), x)
    assert isinstance(found, LocationLine)
    return found


X = np.array([-0.4, -0.2, 0.0, 0.1, 0.4])
ON_A_LINE = [0.05 - 0.5 * x + d for x, d in zip(X, (0.01, -0.01, 0.0, 0.01, -0.01), strict=True)]
ERRORS = [0.2, 0.1, 0.15, 0.1, 0.2]


def test_locations_that_lie_on_a_line_have_the_weighted_least_squares_of_statsmodels() -> None:
    found = line(ON_A_LINE, ERRORS, X)
    theirs = WLS(ON_A_LINE, np.column_stack([np.ones(5), X]), weights=1 / np.square(ERRORS)).fit(
        cov_type="fixed scale"
    )
    assert found.scatter == pytest.approx(0.0, abs=1e-4)
    assert tuple(found.coefficients) == pytest.approx(tuple(theirs.params))
    assert found.slope.standard_error == pytest.approx(theirs.bse[1])
    np.testing.assert_allclose(found.shrunken, theirs.fittedvalues, atol=1e-4)


def test_an_odd_location_makes_the_slope_uncertain_instead_of_certain() -> None:
    odd = [*ON_A_LINE[:-1], ON_A_LINE[-1] + 1.0]
    found, calm = line(odd, ERRORS, X), line(ON_A_LINE, ERRORS, X)
    assert found.scatter > 0.2
    assert found.slope.standard_error is not None
    assert calm.slope.standard_error is not None
    assert found.slope.standard_error > 1.5 * calm.slope.standard_error
    assert found.slope_error_without_scatter == pytest.approx(calm.slope.standard_error, rel=1e-3)


def test_the_band_is_narrowest_in_the_middle_of_the_locations() -> None:
    found = line(ON_A_LINE, [0.1] * 5, X)
    _, low, high = found.band(np.array([-0.4, float(X.mean()), 0.4]))
    width = high - low
    assert width[1] == min(width)
    # There it is that of a mean of five: Student's t with 3 degrees of freedom.
    assert width[1] == pytest.approx(2 * stats.t.ppf(0.975, 3) * 0.1 / np.sqrt(5), rel=1e-3)


def test_people_and_locations_add_their_scatters_and_share_that_of_trials() -> None:
    found = line([*ON_A_LINE[:-1], ON_A_LINE[-1] + 1.0], ERRORS, X)
    people = FixedEffect("slope", -0.4, 0.5, None, None, None)
    both = for_people_and_locations(people, found, 17)
    assert both is not None
    assert found.slope.standard_error is not None
    expected = 0.5**2 + found.slope.standard_error**2 - found.slope_error_without_scatter**2
    assert both.estimate == -0.4
    assert both.standard_error == pytest.approx(math.sqrt(expected))
    assert both.df is not None
    assert 3 <= both.df <= 19


def test_people_alone_or_few_locations_give_words_instead_of_a_line() -> None:
    assert line_over_locations(effects([0.1, 0.2, 0.3], [0.1] * 3), X[:3]) == TOO_FEW
    assert line_over_locations(effects(ON_A_LINE, ERRORS), np.zeros(5)) == ALL_ALIKE
    slope = FixedEffect("slope", -0.4, 0.5, None, None, None)
    assert for_people_and_locations(slope, line(ON_A_LINE, ERRORS, X), 1) is None


def test_a_location_without_a_number_is_left_out_of_the_line() -> None:
    every = effects([*ON_A_LINE, 9.0], [*ERRORS, 0.1])
    every[5] = FixedEffect("5", None, None, 0.3, None, 0.01, flags=(FitFlag.NO_UPPER_BOUND,))
    found = line_over_locations(every, np.append(X, 0.2))
    assert isinstance(found, LocationLine)
    assert found.locations == (0, 1, 2, 3, 4)


def test_people_who_differ_in_what_brightness_does_make_its_slope_uncertain() -> None:
    alike, different = table(7), table(7, brightness_sd=2.0)
    slopes = [effect_of(brightness_fit(informative(data)), BRIGHTNESS) for data in (alike, different)]
    errors = [slope.standard_error or 0.0 for slope in slopes]
    # 2 / sqrt(17) = 0.49 comes to what trials alone leave open.
    assert errors[1] ** 2 - errors[0] ** 2 == pytest.approx(4 / 17, rel=0.7)


def test_what_is_wrong_with_a_fit_is_said_of_each_of_its_effects() -> None:
    fit = dataclasses.replace(overall(), flags=(FitFlag.NOT_CONVERGED,))
    flagged = with_flags(fit)
    assert {effect.flags for effect in flagged.effects} == {(FitFlag.NOT_CONVERGED,)}
