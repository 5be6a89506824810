"""The cumulative-link mixed model: published and independent fits, closed forms, recovery, hard answers."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from ordinal_levels import OrdinalTruth, covered, simulated_answers
from scipy import optimize, stats
from statsmodels.miscmodels.ordinal_model import OrderedModel

from evenlight.analysis.inference.adaptive_quadrature import marginal_likelihood
from evenlight.analysis.inference.cumulative_link import (
    OrdinalData,
    OrdinalFit,
    fit_ordinal,
    ordinal_model,
)
from evenlight.analysis.inference.fixed_effects import FitFlag, FixedEffect

# Bitterness of wine, Randall (1989, Biometrical J. 31, 781), as printed in Table 1 of Christensen's tutorial
# on the R package ordinal: rows are bottles (cold and warm, each without and with contact, two of each),
# columns are nine judges.
WINE = """
2 1 2 3 2 3 1 2 1
3 2 3 2 3 2 1 2 2
3 1 3 3 4 3 2 2 3
4 3 2 2 3 2 2 3 2
4 2 5 3 3 2 2 3 3
4 3 5 2 3 4 3 3 2
5 5 4 5 3 5 2 3 4
5 4 4 3 3 4 3 4 4
"""


def wine() -> OrdinalData:
    ratings = np.array([row.split() for row in WINE.strip().splitlines()], dtype=np.int64)
    warm, contact = np.repeat([0.0, 1.0], 36), np.tile(np.repeat([0.0, 1.0], 18), 2)
    judges = np.tile(np.arange(9), 8)
    return OrdinalData(ratings.ravel() - 1, 5, np.column_stack([warm, contact]), ("warm", "contact"), judges)


# clmm(rating ~ temp + contact + (1 | judge)) of R's ordinal, with its Laplace approximation. Log-likelihood,
# standard errors and three digits of the estimates are printed in the documentation of broom's tidiers of
# clmm; the further digits (cut points, warm, contact, SD between judges) are the same fit's own.
CLMM = np.array([-1.623667056, 1.513365299, 4.228526858, 6.088772751, 3.062996800, 1.834885013, 1.131133])
CLMM_LOG_LIKELIHOOD = -81.56541
CLMM_ERRORS = (0.595, 0.513)


def test_with_one_node_the_likelihood_of_the_wine_is_that_of_clmm_and_largest_where_clmm_says() -> None:
    model = ordinal_model(wine()).padded

    def laplace(parameters: np.ndarray) -> float:
        return marginal_likelihood(model, parameters, nodes=1).value

    assert laplace(CLMM) == pytest.approx(CLMM_LOG_LIKELIHOOD, abs=1e-5)
    best = optimize.minimize(lambda p: -laplace(p), CLMM + 0.1, method="BFGS").x
    np.testing.assert_allclose(best, CLMM, atol=2e-4)  # BFGS stops at gradients of 1e-5, from differences


def test_with_the_integral_itself_the_fit_of_the_wine_is_near_that_of_clmm() -> None:
    # What the approximation neglects: 0.03 in the log-likelihood, and less than 0.01 standard errors.
    fit = fit_ordinal(wine())
    assert fit.log_likelihood == pytest.approx(CLMM_LOG_LIKELIHOOD, abs=0.05)
    np.testing.assert_allclose([e.estimate for e in fit.effects], CLMM[4:6], atol=0.01)
    np.testing.assert_allclose([e.standard_error for e in fit.effects], CLMM_ERRORS, atol=0.001)
    assert fit.group_sd == pytest.approx(CLMM[6], abs=0.01)


def test_where_participants_do_not_differ_the_fit_is_that_of_statsmodels() -> None:
    rng = np.random.default_rng(5)
    x = np.column_stack([rng.standard_normal(90), rng.integers(0, 2, 90)])
    latent = x @ [0.8, -0.6] + rng.logistic(size=90)
    responses = (latent[:, None] > [-1.5, 0.0, 1.4]).sum(axis=1)
    fit = fit_ordinal(OrdinalData(responses, 4, x, ("a", "b"), np.arange(90)))  # one answer of each
    other = OrderedModel(responses, x, distr="logit").fit(method="newton", disp=False)
    assert fit.group_sd == 0.0
    assert fit.log_likelihood == pytest.approx(other.llf, abs=1e-7)
    np.testing.assert_allclose([e.estimate for e in fit.effects], other.params[:2], atol=1e-5)
    np.testing.assert_allclose(
        fit.cut_points, other.model.transform_threshold_params(other.params)[1:-1], atol=1e-5
    )
    np.testing.assert_allclose([e.standard_error for e in fit.effects], other.bse[:2], rtol=1e-4)


def test_the_interval_of_a_share_is_where_the_binomial_likelihood_ratio_says() -> None:
    # 17 people choose once, 12 of them ours: 2 (ln L(12/17) - ln L(p)) is the critical value at both ends.
    chosen = (np.arange(17) < 12).astype(np.int64)
    intercept = fit_ordinal(OrdinalData(chosen, 2, np.zeros((17, 0)), (), np.arange(17))).intercept
    assert intercept is not None
    assert intercept.estimate == pytest.approx(math.log(12 / 5), abs=1e-6)
    assert intercept.standard_error == pytest.approx(math.sqrt(1 / 12 + 1 / 5), rel=1e-6)
    t_squared = stats.t.ppf(0.975, 16) ** 2
    critical = 17 * math.log1p(t_squared / 16)  # the small-sample correction, docs/decisions

    def ratio(logit: float) -> float:
        return 2 * float(
            stats.binom.logpmf(12, 17, 12 / 17) - stats.binom.logpmf(12, 17, 1 / (1 + math.exp(-logit)))
        )

    for end in (intercept.ci_low, intercept.ci_high):
        assert end is not None
        assert ratio(end) == pytest.approx(critical, abs=1e-3)
    corrected = math.sqrt(16 * math.expm1(ratio(0.0) / 17))
    assert intercept.p_value == pytest.approx(2 * stats.t.sf(corrected, 16), rel=1e-6)


def test_an_interval_holds_the_effects_whose_test_does_not_reject_and_p_says_the_same_of_0() -> None:
    data = simulated_answers(OrdinalTruth(1.0, slope_sd=0.8, random_slope=True), np.random.default_rng(6))
    effect = fit_ordinal(data, profiled=("version",)).effects[0]
    assert effect.ci_low is not None
    assert effect.ci_high is not None
    assert effect.p_value is not None
    assert (effect.p_value < 0.05) == (effect.ci_low > 0 or effect.ci_high < 0)
    # Measured from the interval's end, the effect is where the test just rejects: with the end as an offset,
    # taken by fitting the version's column without the effect, p is 5 %.
    model = ordinal_model(data)
    top = _largest(model.padded, np.array([]), None)
    held = _largest(model.padded, np.array([effect.ci_low]), model.n_cuts)
    t_squared = 16 * math.expm1(2 * (top - held) / 17)
    assert 2 * stats.t.sf(math.sqrt(t_squared), 16) == pytest.approx(0.05, abs=2e-4)


def _largest(model, value: np.ndarray, index: int | None) -> float:
    """Return the largest log-likelihood by scipy's own search, with a parameter held at a value."""

    def cost(free: np.ndarray) -> tuple[float, np.ndarray]:
        full = free if index is None else np.insert(free, index, value)
        found = marginal_likelihood(model, full)
        gradient = found.gradient if index is None else np.delete(found.gradient, index)
        return -found.value, -gradient

    size = model.n_parameters - value.size
    start = np.concatenate([[-2.0, -0.5, 0.5, 2.0], np.zeros(size - 7), [0.8, 0.1, 0.5]])
    return -float(optimize.minimize(cost, start, jac=True, method="BFGS").fun)


def test_a_version_that_differs_between_participants_is_recovered_with_its_interval() -> None:
    # 30 experiments: an interval that covers in 95 % does so in 24 to 30 of them, in 999 of 1000 studies.
    truth = OrdinalTruth(1.0, slope_sd=0.8, random_slope=True)
    held, estimates = covered(truth, 30, seed=7)
    assert held >= stats.binom.ppf(0.001, 30, 0.95)
    error = np.std(estimates) / math.sqrt(30)
    # The maximum of the likelihood lies away from 0 by about 6 %: five cut points and effects of 136 answers.
    assert abs(np.mean(estimates) - 1.06) < 3 * error + 0.06


def test_choices_between_two_versions_are_recovered_with_the_interval_of_their_intercept() -> None:
    truth = OrdinalTruth(0.85, tested="intercept", group_sd=0.5)
    held, estimates = covered(truth, 40, seed=8)
    assert held >= stats.binom.ppf(0.001, 40, 0.95)
    assert np.median(estimates) == pytest.approx(
        0.85, abs=4 * 0.32 / math.sqrt(40)
    )  # SD as 4 answers of 17 allow


@pytest.mark.real_time
def test_a_fit_with_intervals_takes_less_than_a_second_of_one_core() -> None:
    data = simulated_answers(OrdinalTruth(0.5, slope_sd=0.8, random_slope=True), np.random.default_rng(9))
    start = time.process_time()
    fit_ordinal(data)
    assert time.process_time() - start < 1.0


ANSWERS = simulated_answers(OrdinalTruth(1.0, random_slope=True), np.random.default_rng(10))
VERSION = ANSWERS.design[:, 0]


def assert_numbers(effect: FixedEffect) -> None:
    """An effect with all its numbers, in order, and no flag."""
    assert effect.flags == ()
    assert effect.estimate is not None
    assert effect.ci_low is not None
    assert effect.ci_high is not None
    assert effect.p_value is not None
    assert effect.ci_low < effect.estimate < effect.ci_high
    assert 0 <= effect.p_value <= 1


def assert_none(effect: FixedEffect, flag: FitFlag) -> None:
    """An effect without any number, and why."""
    numbers = (effect.estimate, effect.standard_error, effect.ci_low, effect.ci_high, effect.p_value)
    assert numbers == (None,) * 5
    assert effect.flags == (flag,)


def only_version(responses: np.ndarray, slope: int | None = None) -> OrdinalFit:
    return fit_ordinal(OrdinalData(responses, 5, VERSION[:, None], ("version",), ANSWERS.groups, slope))


def test_answers_that_are_all_alike_give_flags_and_no_numbers() -> None:
    fit = fit_ordinal(replace(ANSWERS, responses=np.full(136, 2)))
    assert fit.flags == (FitFlag.NO_VARIATION,)
    assert fit.log_likelihood is None
    for effect in fit.effects:
        assert_none(effect, FitFlag.NO_VARIATION)


@pytest.mark.parametrize("slope", [None, 0])
def test_complete_separation_gives_an_interval_with_one_end_and_a_tiny_p(slope: int | None) -> None:
    fit = only_version(np.where(VERSION > 0, 3, 2), slope)
    effect = fit.effects[0]
    assert set(fit.flags) == {FitFlag.SEPARATED, FitFlag.UNUSED_CATEGORIES}
    assert (effect.estimate, effect.standard_error, effect.ci_high) == (None, None, None)
    assert effect.ci_low is not None
    assert effect.ci_low > 2
    assert effect.p_value is not None
    assert effect.p_value < 1e-6
    assert effect.flags == (FitFlag.NO_UPPER_BOUND,)
    # Without any participant effect the likelihood at infinity is 1, and at 0 it is (1/2)^136.
    assert fit.log_likelihood == pytest.approx(0.0, abs=1e-6)


def test_one_sequence_rated_the_best_by_everybody_leaves_the_other_effects_their_numbers() -> None:
    second = ANSWERS.design[:, 1] > 0
    fit = fit_ordinal(replace(ANSWERS, responses=np.where(second, 4, ANSWERS.responses)))
    assert fit.flags == (FitFlag.SEPARATED,)
    assert_numbers(fit.effects[0])
    assert fit.effects[1].flags == (FitFlag.NO_UPPER_BOUND,)
    assert fit.effects[1].estimate is None


def test_a_participant_who_always_answers_the_same_is_one_of_many() -> None:
    fit = fit_ordinal(replace(ANSWERS, responses=np.where(ANSWERS.groups == 3, 4, ANSWERS.responses)))
    assert_numbers(fit.effects[0])


def test_participants_who_each_always_answer_the_same_are_infinitely_far_apart() -> None:
    fit = only_version(ANSWERS.groups % 5)
    assert FitFlag.NOT_CONVERGED in fit.flags
    assert fit.group_sd == math.inf
    assert fit.effects[0].estimate == pytest.approx(0.0, abs=1e-4)


def test_one_participant_is_described_and_nothing_is_said_of_others() -> None:
    own = ANSWERS.groups == 0
    first = OrdinalData(
        np.array([2, 1, 1, 3, 2, 2, 0, 1]),
        5,
        ANSWERS.design[own][:, :1],
        ("version",),
        ANSWERS.groups[own],
        0,
    )
    fit = fit_ordinal(first)
    assert FitFlag.ONE_PARTICIPANT in fit.flags
    assert (fit.group_sd, fit.slope_sd, fit.n_groups) == (0.0, None, 1)
    assert_numbers(fit.effects[0])


def test_a_participant_with_one_trial_and_missing_cells_are_used_as_far_as_they_go() -> None:
    used = np.ones(136, dtype=bool)
    used[1:8] = False  # one answer of the first participant
    used &= ~((ANSWERS.groups == 5) & (VERSION > 0))  # one version only of the sixth
    fit = fit_ordinal(
        replace(
            ANSWERS,
            responses=ANSWERS.responses[used],
            design=ANSWERS.design[used],
            groups=ANSWERS.groups[used],
        )
    )
    assert (fit.n, fit.n_groups, fit.flags) == (136 - 7 - 4, 17, ())
    assert_numbers(fit.effects[0])


def test_a_version_that_nobody_saw_is_no_effect_and_no_failure() -> None:
    used = VERSION > 0
    fit = fit_ordinal(
        replace(
            ANSWERS,
            responses=ANSWERS.responses[used],
            design=ANSWERS.design[used],
            groups=ANSWERS.groups[used],
        )
    )
    assert fit.flags == (FitFlag.NOT_ESTIMABLE,)
    assert_none(fit.effects[0], FitFlag.NOT_ESTIMABLE)
    assert_numbers(fit.effects[1])


def test_a_column_given_twice_has_no_effect_of_its_own_and_changes_nothing_else() -> None:
    once = fit_ordinal(ANSWERS, profiled=())
    twice = fit_ordinal(
        replace(
            ANSWERS,
            design=np.column_stack([ANSWERS.design, ANSWERS.design[:, 3]]),
            names=(*ANSWERS.names, "fourth again"),
        ),
        profiled=(),
    )
    assert twice.log_likelihood == pytest.approx(once.log_likelihood, abs=1e-9)
    assert twice.effects[:3] == once.effects[:3]
    for effect in twice.effects[3:]:
        assert_none(effect, FitFlag.NOT_ESTIMABLE)


def test_unused_categories_are_left_out_and_said() -> None:
    spread_out = fit_ordinal(replace(ANSWERS, responses=2 * ANSWERS.responses, n_categories=9), profiled=())
    assert spread_out.flags == (FitFlag.UNUSED_CATEGORIES,)
    assert replace(spread_out, flags=()) == fit_ordinal(ANSWERS, profiled=())


def test_two_participants_have_a_far_wider_interval_than_their_standard_error_says() -> None:
    # One degree of freedom, t = 12.7: the ratio that rejects is 2 ln(1 + 12.7²) = 10.2. Were the logarithm of
    # the likelihood a parabola, the ends were its root, 3.2 standard errors, away; it is flatter than one.
    used = ANSWERS.groups < 2
    fit = fit_ordinal(
        OrdinalData(
            np.array([1, 2, 2, 3, 0, 3, 1, 2, 2, 3, 1, 3, 1, 1, 2, 4]),
            5,
            VERSION[used][:, None],
            ("version",),
            ANSWERS.groups[used],
            0,
        )
    )
    effect = fit.effects[0]
    assert effect.df == 1
    assert effect.ci_low is not None
    assert effect.ci_high is not None
    assert effect.standard_error is not None
    root = math.sqrt(2 * math.log1p(stats.t.ppf(0.975, 1) ** 2))
    assert effect.ci_high - effect.ci_low > 2 * root * effect.standard_error


def test_the_same_answers_in_another_order_and_with_other_labels_give_the_same_fit() -> None:
    order = np.random.default_rng(11).permutation(136)
    shuffled = replace(
        ANSWERS,
        responses=ANSWERS.responses[order],
        design=ANSWERS.design[order],
        groups=(40 - 2 * ANSWERS.groups)[order],
    )
    fit, other = fit_ordinal(ANSWERS, profiled=()), fit_ordinal(shuffled, profiled=())
    np.testing.assert_allclose(
        [e.estimate for e in fit.effects], [e.estimate for e in other.effects], atol=1e-6
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n_categories": 1}, "at least 2 categories, got 1"),
        ({"n_categories": 3}, "responses must lie in 0 to 2"),
        ({"names": ("a",)}, r"shape \(136, 1\)"),
        ({"slope_column": 9}, "slope_column must be one of 4 columns, got 9"),
        ({"design": np.full((136, 4), np.nan)}, "must be finite"),
    ],
)
def test_data_that_make_no_sense_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(ANSWERS, **change)


def test_any_few_answers_give_numbers_in_order_or_flags_and_no_warning() -> None:
    rng = np.random.default_rng(16)
    for case in range(6):
        n, k = int(rng.integers(1, 10)), int(rng.integers(1, 3))
        design, groups = rng.choice([-0.5, 0.0, 1.0], (n, k)), rng.integers(0, 3, n)
        slope = 0 if case % 2 else None
        data = OrdinalData(rng.integers(0, 3, n), 3, design, ("a", "b")[:k], groups, slope)
        fit = fit_ordinal(data)
        for effect in fit.effects:
            low, high = effect.ci_low, effect.ci_high
            assert effect.flags or None not in (effect.estimate, low, high, effect.p_value)
            assert low is None or effect.estimate is None or low <= effect.estimate
            assert high is None or effect.estimate is None or effect.estimate <= high
