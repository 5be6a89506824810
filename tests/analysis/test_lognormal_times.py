"""The log-normal model of times: independent fits, exact tests in disguise, recovery and hard times."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from times_levels import TimesTruth, covers, fitted_time_effect, naive_effects, simulated_times

from evenlight.analysis.inference.fixed_effects import FitFlag, FixedEffect
from evenlight.analysis.inference.lognormal_times import CensoredTimes, fit_lognormal_times

LIMIT = 30.0
TIMES = [3.1, 12.4, 7.7, 30, 5.2, 9.9, 30, 18.3, 2.6, 30, 14.1, 6.4, 22.8, 30, 8.3, 4.9, 30, 11.2, 27.5]
TIMES += [3.8, 30, 16.6, 7.1, 13.0]


def by_hand(groups: np.ndarray) -> CensoredTimes:
    """24 times, 6 of them at the limit, with an intercept, the version, and places of 8 each."""
    times = np.array(TIMES, dtype=float)
    place = np.repeat([0, 1, 2], 8)
    design = np.column_stack([np.ones(24), np.tile([0.0, 1.0], 12), place == 1, place == 2]).astype(float)
    return CensoredTimes(times, times < LIMIT, design, ("one", "version", "second", "third"), groups)


# LogNormalAFTFitter of lifelines 0.30.3 on these data (ftol 1e-14, gtol 1e-10): mu's coefficients in the
# order of the columns, their standard errors, ln sigma, log-likelihood.
LIFELINES = [2.4982830162, 0.1079178567, -0.0297598986, 0.2433859163]
LIFELINES_ERRORS = [0.4108500721, 0.4103999179, 0.5015931584, 0.5024225034]
LIFELINES_LN_SIGMA, LIFELINES_LOG_LIKELIHOOD = -0.0249152065, -70.34271307931942


def test_where_participants_do_not_differ_the_fit_is_that_of_lifelines() -> None:
    fit = fit_lognormal_times(by_hand(np.arange(24)), profiled=())
    assert (fit.group_sd, fit.n, fit.n_groups) == (0.0, 24, 24)
    np.testing.assert_allclose([e.estimate for e in fit.effects], LIFELINES, atol=2e-5)
    np.testing.assert_allclose([e.standard_error for e in fit.effects], LIFELINES_ERRORS, rtol=1e-4)
    assert math.log(fit.residual_sd) == pytest.approx(LIFELINES_LN_SIGMA, abs=2e-5)
    assert fit.log_likelihood == pytest.approx(LIFELINES_LOG_LIKELIHOOD, abs=1e-6)


def test_an_intercept_alone_is_scipys_fit_of_censored_log_normal_times() -> None:
    data = by_hand(np.arange(24))
    alone = replace(data, design=data.design[:, :1], names=("one",))
    fit = fit_lognormal_times(alone, profiled=())
    censored = stats.CensoredData(uncensored=data.times[data.observed], right=data.times[~data.observed])
    sd, _, median = stats.lognorm.fit(censored, floc=0)
    assert fit.residual_sd == pytest.approx(sd, rel=1e-4)
    assert fit.effects[0].estimate == pytest.approx(math.log(median), abs=1e-4)


def uncensored(slope: bool, seed: int = 1) -> CensoredTimes:
    """7 people, 3 places, 2 versions, all found; people differ much, in level and in the version's effect."""
    rng = np.random.default_rng(seed)
    groups, place, version = (
        grid.ravel() for grid in np.meshgrid(np.arange(7), np.arange(3), [-0.5, 0.5], indexing="ij")
    )
    own = 0.8 * rng.standard_normal(7)[groups] + (
        1.0 * rng.standard_normal(7)[groups] * version if slope else 0
    )
    ln_time = 2.0 + 0.2 * place - 0.3 * version + own + 0.3 * rng.standard_normal(groups.size)
    design = np.column_stack([place == 0, place == 1, place == 2, version, groups % 2]).astype(float)
    names = ("first", "second", "third", "version", "odd")
    return CensoredTimes(np.exp(ln_time), np.ones(42, bool), design, names, groups, 3 if slope else None)


def person_means(data: CensoredTimes, weights: np.ndarray) -> np.ndarray:
    return np.array([np.mean((weights * np.log(data.times))[data.groups == p]) for p in range(7)])


def test_found_by_all_the_effect_that_differs_between_people_is_the_paired_t_test() -> None:
    data = uncensored(slope=True)
    effect = fit_lognormal_times(data, profiled=("version",)).effects[3]
    differences = person_means(data, np.sign(data.design[:, 3])) * 2
    expected = stats.ttest_1samp(differences, 0.0)
    assert effect.estimate == pytest.approx(differences.mean(), abs=1e-5)
    assert effect.p_value == pytest.approx(expected.pvalue, rel=1e-3)
    interval = expected.confidence_interval()
    assert (effect.ci_low, effect.ci_high) == pytest.approx((interval.low, interval.high), abs=1e-3)


def test_found_by_all_a_comparison_of_people_is_the_t_test_of_their_means() -> None:
    data = uncensored(slope=False)
    effect = fit_lognormal_times(data, profiled=("odd",)).effects[4]
    means = person_means(data, np.ones(42))
    expected = stats.ttest_ind(means[1::2], means[::2])
    assert effect.p_value == pytest.approx(expected.pvalue, rel=1e-3)


def test_found_by_all_an_effect_within_people_is_that_of_the_analysis_of_variance() -> None:
    # Least squares with a column for everybody: t with 42 - 7 - 2 - 1 degrees of freedom.
    data = uncensored(slope=False)
    fit = fit_lognormal_times(data, {"second - first": (-1, 1, 0, 0, 0)})
    people = (data.groups[:, None] == np.arange(7)).astype(float)
    design = np.column_stack([data.design[:, [1, 2, 3]], people])
    covariance = np.linalg.inv(design.T @ design)
    beta = covariance @ design.T @ np.log(data.times)
    residual = np.log(data.times) - design @ beta
    errors = np.sqrt(np.diag(covariance) * (residual @ residual) / 32)
    for effect, k in ((fit.effects[3], 2), (fit.contrasts[0], 0)):
        assert effect.df == 32
        assert effect.estimate == pytest.approx(beta[k], abs=1e-5)
        assert effect.p_value == pytest.approx(2 * stats.t.sf(abs(beta[k] / errors[k]), 32), rel=1e-3)
        half = stats.t.ppf(0.975, 32) * errors[k]
        assert (effect.ci_low, effect.ci_high) == pytest.approx((beta[k] - half, beta[k] + half), abs=1e-3)


def test_a_contrast_is_the_combination_of_the_effects_and_of_their_covariance() -> None:
    data = by_hand(np.repeat(np.arange(6), 4))
    halves = {"version at half the code": (0.0, 0.5, 0.0, 0.0)}
    both = {"third - second": (0.0, 0.0, -1.0, 1.0)}
    fit = fit_lognormal_times(data, halves | both)
    version, half = fit.effects[1], fit.contrasts[0]
    for name in ("estimate", "standard_error", "ci_low", "ci_high"):
        assert getattr(half, name) == pytest.approx(getattr(version, name) / 2, abs=1e-3)
    assert half.p_value == pytest.approx(version.p_value, abs=1e-4)
    recoded = replace(data, design=data.design @ np.diag([1.0, 1.0, 1.0, 1.0])[:, [0, 1, 3, 2]])
    recoded = replace(
        recoded, design=np.column_stack([recoded.design[:, :3], data.design[:, 2:].sum(axis=1)])
    )
    direct = fit_lognormal_times(recoded).effects[2]  # third, beside a column of second and third together
    assert fit.contrasts[1].estimate == pytest.approx(direct.estimate, abs=1e-5)
    assert (fit.contrasts[1].ci_low, fit.contrasts[1].ci_high) == pytest.approx(
        (direct.ci_low, direct.ci_high), abs=1e-3
    )


EXPERIMENTS = 40


@pytest.mark.slow
def test_the_effect_is_recovered_with_its_interval_where_capping_and_dropping_lose_it() -> None:
    # A quarter to a third is undetected. 95 % of 40 show as 33 to 40 in 999 of 1000 studies.
    rng = np.random.default_rng(12)
    truth = TimesTruth(-0.25, locations=6)
    held, estimates, naive = 0, [], []
    for _ in range(EXPERIMENTS):
        data = simulated_times(truth, rng)
        effect = fitted_time_effect(truth, data)
        held += covers(effect, truth.effect)
        estimates.append(effect.estimate)
        naive.append(naive_effects(data))
    assert held >= stats.binom.ppf(0.001, EXPERIMENTS, 0.95)
    error = np.std(estimates) / math.sqrt(EXPERIMENTS)
    assert abs(np.mean(estimates) + 0.25) < 3.3 * error
    assert error < 0.03
    capped, dropped = np.mean(naive, axis=0)
    assert np.mean(estimates) < capped - 0.03
    assert capped < dropped - 0.03


@pytest.mark.slow
def test_an_effect_that_differs_between_people_keeps_its_level_only_with_a_random_slope() -> None:
    # 5 % of 16 are at most 4 in 999 of 1000 studies. Without the slope, times of one person count as if they
    # were of many: the plain model errs in more than half.
    ignored = TimesTruth(0.0, locations=6, slope_sd=1.5)
    modelled = replace(ignored, random_slope=True)
    misses = {}
    for truth in (ignored, modelled):
        rng = np.random.default_rng(13)
        misses[truth] = sum(
            not covers(fitted_time_effect(truth, simulated_times(truth, rng)), 0.0) for _ in range(16)
        )
    assert misses[modelled] <= stats.binom.ppf(0.999, 16, 0.05)
    assert misses[ignored] > stats.binom.ppf(0.999, 16, 0.05)


def assert_none(effect: FixedEffect, flag: FitFlag) -> None:
    """An effect without any number, and why."""
    numbers = (effect.estimate, effect.standard_error, effect.ci_low, effect.ci_high, effect.p_value)
    assert numbers == (None,) * 5
    assert effect.flags == (flag,)


HARD = simulated_times(TimesTruth(-0.25, locations=3), np.random.default_rng(14))


def test_nothing_found_gives_flags_and_no_numbers() -> None:
    nothing = replace(HARD, times=np.full(102, LIMIT), observed=np.zeros(102, dtype=bool))
    fit = fit_lognormal_times(nothing, {"a": (1.0, 0.0, 0.0, 0.0)})
    assert fit.flags == (FitFlag.NOTHING_OBSERVED,)
    assert fit.log_likelihood is None
    for effect in (*fit.effects, *fit.contrasts):
        assert_none(effect, FitFlag.NOTHING_OBSERVED)


def test_a_location_that_nobody_found_runs_to_infinity_and_leaves_the_others_alone() -> None:
    lost = HARD.design[:, 2] > 0
    fit = fit_lognormal_times(
        replace(HARD, times=np.where(lost, LIMIT, HARD.times), observed=HARD.observed & ~lost)
    )
    without = replace(
        HARD,
        times=HARD.times[~lost],
        observed=HARD.observed[~lost],
        groups=HARD.groups[~lost],
        design=HARD.design[~lost][:, [0, 1, 3]],
        names=tuple(np.array(HARD.names)[[0, 1, 3]]),
    )
    assert fit.flags == (FitFlag.SEPARATED,)
    infinite = fit.effects[2]
    assert (infinite.estimate, infinite.ci_high) == (None, None)
    assert infinite.ci_low is not None
    assert infinite.ci_low > math.log(LIMIT)  # half of the people would have found it otherwise
    others = fit_lognormal_times(without)
    assert fit.effects[3].estimate == pytest.approx(others.effects[2].estimate, abs=1e-4)
    assert fit.log_likelihood == pytest.approx(others.log_likelihood, abs=1e-4)


def test_times_that_repeat_each_other_leave_no_scatter_and_no_numbers() -> None:
    ties = replace(HARD, times=np.full(102, 8.0), observed=np.ones(102, dtype=bool))
    fit = fit_lognormal_times(ties)
    assert fit.flags == (FitFlag.NO_SCATTER,)
    for effect in fit.effects:
        assert_none(effect, FitFlag.NO_SCATTER)


def test_a_time_found_exactly_at_the_limit_is_found() -> None:
    found = fit_lognormal_times(replace(HARD, observed=np.ones(102, dtype=bool)), profiled=())
    assert found.flags == ()


def test_one_participant_one_trial_of_another_and_missing_cells_are_used_as_far_as_they_go() -> None:
    def part(used: np.ndarray) -> CensoredTimes:
        return replace(
            HARD,
            times=HARD.times[used],
            observed=HARD.observed[used],
            design=HARD.design[used],
            groups=HARD.groups[used],
            slope_column=3,
        )

    alone = fit_lognormal_times(part(HARD.groups == 4))
    assert alone.flags[0] is FitFlag.ONE_PARTICIPANT
    assert (alone.group_sd, alone.slope_sd) == (0.0, None)
    used = np.ones(102, dtype=bool)
    used[1:6] = False  # one trial of the first
    used &= ~((HARD.groups == 5) & (HARD.design[:, 3] > 0))  # one version of the sixth
    some = fit_lognormal_times(part(used), profiled=("version",))
    assert (some.n, some.n_groups, some.flags) == (102 - 5 - 3, 17, ())
    assert some.effects[3].ci_low is not None
    version = fit_lognormal_times(part(HARD.design[:, 3] > 0), profiled=())
    assert version.flags == (FitFlag.NOT_ESTIMABLE,)  # the version is the sum of the locations then
    assert version.slope_sd is None


def test_a_contrast_that_the_data_do_not_determine_says_so() -> None:
    twice = replace(
        HARD, design=np.column_stack([HARD.design, HARD.design[:, 3]]), names=(*HARD.names, "again")
    )
    asked = {"difference": (0, 0, 0, 1, -1), "sum": (0, 0, 0, 1, 1)}
    fit = fit_lognormal_times(twice, asked, profiled=())
    assert_none(fit.contrasts[0], FitFlag.NOT_ESTIMABLE)
    plain = fit_lognormal_times(HARD, profiled=()).effects[3]
    assert fit.contrasts[1].estimate == pytest.approx(plain.estimate, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": np.zeros(102)}, "above 0"),
        ({"names": ("a",)}, r"shape \(102, 1\)"),
        ({"names": (), "design": np.zeros((102, 0))}, "at least one column"),
        ({"slope_column": 4}, "slope_column must be one of 4 columns, got 4"),
        ({"design": np.full((102, 4), np.inf)}, "must be finite"),
    ],
)
def test_data_that_make_no_sense_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(HARD, **change)


def test_a_contrast_of_no_effect_is_refused() -> None:
    with pytest.raises(ValueError, match="4 weights that are not all 0"):
        fit_lognormal_times(HARD, {"nothing": (0, 0, 0, 0)}, profiled=())


def test_as_many_effects_as_times_leave_no_scatter_either() -> None:
    few = replace(
        HARD,
        times=HARD.times[:3],
        observed=np.ones(3, dtype=bool),
        design=np.eye(4)[:3],
        groups=np.array([0, 1, 2]),
    )
    assert fit_lognormal_times(few).flags == (FitFlag.NO_SCATTER,)


def test_two_times_of_each_with_a_slope_of_their_own_are_still_the_paired_t_test() -> None:
    rng = np.random.default_rng(15)
    groups, version = np.repeat(np.arange(12), 2), np.tile([-0.5, 0.5], 12)
    ln_time = 2.0 + 0.5 * rng.standard_normal(12)[groups] + 0.4 * version + 0.3 * rng.standard_normal(24)
    design = np.column_stack([np.ones(24), version])
    data = CensoredTimes(np.exp(ln_time), np.ones(24, dtype=bool), design, ("one", "version"), groups, 1)
    effect = fit_lognormal_times(data).effects[1]
    expected = stats.ttest_1samp(np.diff(ln_time.reshape(12, 2))[:, 0], 0.0)
    assert effect.p_value == pytest.approx(expected.pvalue, rel=1e-3)
