"""The joint model: its likelihood against brute force, cases with a known answer, and what it says.

Answers are made without chance: at each rate as many successes as expected, to the nearest whole number.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from example_ramps import CHOICE, RAMP, answer_of, ramp_of
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.calibration.joint.joint_fit import JointFit, fit_joint, simultaneous_band
from evenlight.analysis.calibration.joint.marginal_likelihood import WIDTHS, Spread, answer_tables, smoothed
from evenlight.analysis.calibration.rate_limit.conditions import Condition
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampTrial
from evenlight.method.psychometric import PsychometricFunction, yes_probability

LUMINANCES = (10.0, 25.0, 60.0, 100.0)
RELATIVE = np.geomspace(0.006, 0.12, 9)  # of the rates [1/s]
RELATIVE_THRESHOLD = 0.025
FACTORS = (0.7, 0.8, 0.9, 1.0, 1.0, 1.1, 1.2, 1.4)  # of eight people
WIDTH = 1.6


def ramps(
    who: str,
    luminance: float,
    successes: Sequence[tuple[float, int, int]],
    duration: float = 4.0,
    procedure: Procedure = Procedure.TWO_INTERVAL,
) -> list[RampTrial]:
    """Return trials: at each rate so many successes of so many."""
    one = CHOICE if procedure is Procedure.TWO_INTERVAL else RAMP
    return [
        ramp_of(luminance, rate, one, participant_id=who, trial_index=k, duration=duration,
                response=answer_of(procedure, k < yes))
        for rate, yes, total in successes
        for k in range(total)
    ]  # fmt: skip


def expected(
    who: str, luminance: float, threshold: float, total: int = 24, duration: float = 4.0
) -> list[RampTrial]:
    """Return the answers of somebody whose every share is what it should be."""
    function = PsychometricFunction(threshold, WIDTH, 0.5, 0.02)
    rates = RELATIVE * luminance
    yes = np.rint(total * yes_probability(rates, function)).astype(int)
    return ramps(
        who, luminance, [(float(r), int(y), total) for r, y in zip(rates, yes, strict=True)], duration
    )


def shown_as(factor: float, trials: Sequence[RampTrial]) -> list[RampTrial]:
    """Return trials as of a level with this brightness factor, whatever its luminance."""
    return [dataclasses.replace(trial, factor=factor) for trial in trials]


def people(
    factors: Sequence[float] = FACTORS, luminances: Sequence[float] = LUMINANCES, total: int = 24
) -> list[RampTrial]:
    """Return the answers of people whose thresholds are a share of the luminance."""
    return [
        trial
        for k, factor in enumerate(factors)
        for luminance in luminances
        for trial in expected(f"{k + 1:02d}", luminance, factor * RELATIVE_THRESHOLD * luminance, total)
    ]


def curve(fit: JointFit, luminance: Sequence[float]) -> NDArray[np.float64]:
    return fit.basis.rate(fit.basis.design(luminance) @ fit.coefficients)


def half_width(fit: JointFit) -> float:
    return float(np.mean(np.log(fit.simultaneous_upper / fit.simultaneous_lower)) / 2)


def by_brute_force(trials: Sequence[RampTrial], f: NDArray[np.float64], spread: Spread) -> float:
    """Return the marginal log-likelihood by sums over fine grids of u and v, node after node."""
    tables = answer_tables(trials)
    u = np.linspace(-6, 6, 241) * spread.participant_sd
    v = np.linspace(-6, 6, 161) * spread.level_sd
    ln_u, ln_v = (-0.5 * np.linspace(-6, 6, n) ** 2 for n in (241, 161))
    ln_u, ln_v = ln_u - special.logsumexp(ln_u), ln_v - special.logsumexp(ln_v)

    def ln_width_density(ln_width: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(-0.5 * ((ln_width - spread.width_mean) / spread.width_sd) ** 2)

    norm = special.logsumexp(ln_width_density(np.log(WIDTHS)))
    total = 0.0
    for p, who in enumerate(tables.participants):
        ln_nodes = tables.ln_weight[p] + ln_width_density(tables.ln_width[p]) - norm
        of_nodes = []
        for ln_width, lapse in zip(tables.ln_width[p], tables.lapse_rate[p], strict=True):
            ln_given_u = ln_u.copy()
            for c, level in enumerate(tables.levels):
                own = [
                    t for t in trials if t.participant_id == who and t.initial_luminance == level.luminance
                ]
                ln_threshold = f[c] + np.log(level.luminance) + u[:, None] + v
                ln_cell = np.zeros(ln_threshold.shape)
                for rate in sorted({t.rate for t in own}):
                    here = [t.success for t in own if t.rate == rate]
                    slope = 2 * np.log(19) / np.exp(ln_width)
                    rise = special.expit(slope * (np.log(rate) - ln_threshold))  # 1/2 at the threshold
                    chance = 0.5 + (0.5 - lapse) * rise
                    ln_cell += sum(here) * np.log(chance) + (len(here) - sum(here)) * np.log(1 - chance)
                ln_given_u += special.logsumexp(ln_cell + ln_v, axis=1)
            of_nodes.append(special.logsumexp(ln_given_u))
        total += float(special.logsumexp(np.array(of_nodes) + ln_nodes))
    return total


FEW = [
    *ramps("01", 10.0, [(0.1, 3, 6), (0.2, 4, 6), (0.4, 6, 6)]),
    *ramps("01", 80.0, [(0.8, 4, 6), (1.6, 5, 6), (3.2, 6, 6)]),
    *ramps("02", 10.0, [(0.1, 6, 6), (0.2, 6, 6), (0.4, 6, 6)]),  # all right: censored
    *ramps("02", 80.0, [(0.8, 2, 6), (1.6, 5, 6), (3.2, 5, 6)]),
]


@pytest.mark.parametrize("level_sd", [0.1, 0.3])
@pytest.mark.parametrize("f", [(-4.0, -3.6), (-4.53, -4.21)])
def test_the_likelihood_is_that_of_brute_force_integration(level_sd: float, f: tuple[float, float]) -> None:
    spread = Spread(0.3, level_sd, 0.5, 0.4)
    at = np.array(f)
    found = smoothed(answer_tables(FEW), level_sd).evaluate(at, spread)
    assert found.value == pytest.approx(by_brute_force(FEW, at, spread), abs=2e-3)


def test_gradient_and_curvature_are_the_differences_of_the_likelihood() -> None:
    spread, at, step = Spread(0.3, 0.15, 0.5, 0.4), np.array([-4.1, -3.9]), 1e-3
    smooth = smoothed(answer_tables(FEW), 0.15)
    found = smooth.evaluate(at, spread)
    ends = [[smooth.evaluate(at + sign * step * row, spread) for sign in (1, -1)] for row in np.eye(2)]
    values = np.array([(up.value - down.value) / (2 * step) for up, down in ends])
    gradients = np.array([(up.gradient - down.gradient) / (2 * step) for up, down in ends])
    np.testing.assert_allclose(found.gradient, values, atol=1e-3)
    np.testing.assert_allclose(found.curvature, gradients, atol=1e-2)


def test_with_many_answers_the_curve_is_the_geometric_mean_and_the_band_students_t() -> None:
    """Thresholds known, no scatter of levels: mean and t interval of eight ln(threshold)."""
    fit = fit_joint(people(total=60), RateLimitOptions(RateLimitForm.LOG_LOG, 1))
    ln_factors = np.log(FACTORS)
    truth = np.exp(ln_factors.mean()) * RELATIVE_THRESHOLD * np.array(LUMINANCES)
    np.testing.assert_allclose(curve(fit, LUMINANCES), truth, rtol=0.02)
    half = 2.365 * ln_factors.std(ddof=1) / 8**0.5  # t of 7 degrees of freedom, 97.5 %
    found = np.log(fit.pointwise_upper / fit.pointwise_lower) / 2
    middle = found[np.argmin(np.abs(fit.band_luminance - 30.0))]
    assert 0.9 * half < middle < 1.25 * half
    assert fit.width == pytest.approx(WIDTH, rel=0.1)
    # Widths that are all alike, with four people of SD 0.4 before: the error of a mean of eight ln(width).
    error = 1.96 * (4 * 0.4**2 / (8 + 4)) ** 0.5 / 8**0.5
    low, high = fit.width_range
    assert low < WIDTH < high
    assert 0.95 * error < np.log(high / low) / 2 < 1.4 * error
    factors = np.array([one.factor for one in fit.participants])
    np.testing.assert_allclose(factors, np.exp(ln_factors - ln_factors.mean()), rtol=0.06)


def test_the_simultaneous_band_holds_whole_curves_as_often_as_it_says() -> None:
    """Curves of two independent halves: each must lie within c with sqrt(0.95), so that c is 2.236."""
    halves = np.random.default_rng(1).standard_normal((40_000, 2))
    lower, upper = simultaneous_band(halves, 0.95)
    np.testing.assert_allclose(upper, special.ndtri((1 + 0.95**0.5) / 2), atol=0.04)
    np.testing.assert_allclose(lower, -upper, atol=0.04)


def test_the_simultaneous_band_is_the_wider_one_and_holds_the_curve() -> None:
    fit = fit_joint(people())
    at = fit.basis.rate(fit.basis.design(fit.band_luminance) @ fit.coefficients)
    assert (fit.simultaneous_lower <= fit.pointwise_lower).all()
    assert (fit.simultaneous_upper >= fit.pointwise_upper).all()
    assert ((fit.pointwise_lower <= at) & (at <= fit.pointwise_upper)).all()
    assert fit.band_luminance.size == 97


def test_a_participant_who_saw_everything_draws_the_curve_down() -> None:
    """Their threshold lies below the slowest rate, which is less than half of the others'."""
    others = people(FACTORS[1:6])
    keen = [
        trial
        for luminance in LUMINANCES
        for trial in ramps("99", luminance, [(float(r * luminance), 24, 24) for r in RELATIVE])
    ]
    with_them, without = fit_joint([*others, *keen]), fit_joint(others)
    assert (curve(with_them, LUMINANCES) < 0.9 * curve(without, LUMINANCES)).all()
    own = {one.participant_id: one for one in with_them.participants}["99"]
    assert own.all_alike
    assert own.ci_high < 0.6
    assert any("99" in note and "alike" in note for note in with_them.notes)


def test_answers_that_are_all_alike_are_no_basis_for_a_limit() -> None:
    everything = ramps("01", 10.0, [(0.1, 9, 9), (0.2, 9, 9)]) + ramps("02", 50.0, [(0.5, 9, 9)])
    with pytest.raises(InputError, match=r"27 of 27 ramps detected.*test slower ramps"):
        fit_joint(everything)


def test_who_says_yes_to_nothing_is_left_out_and_named() -> None:
    yes_no = Procedure.YES_NO
    counts = [(0.1, 3, 8), (0.2, 5, 8), (0.4, 8, 8)]
    trials = [
        *(t for who in ("01", "02") for t in ramps(who, 10.0, [*counts, (0.0, 1, 8)], procedure=yes_no)),
        *ramps("03", 10.0, [*counts, (0.0, 6, 8)], procedure=yes_no),
    ]
    fit = fit_joint(trials)
    assert fit.left_out == ("03",)
    assert [one.participant_id for one in fit.participants] == ["01", "02"]
    assert fit.n_trials == 48
    with pytest.raises(InputError, match="false alarms"):
        fit_joint([t for t in trials if t.participant_id == "03"])


@pytest.fixture(scope="module")
def both_durations() -> list[RampTrial]:
    """Four people; ramps of 8 s have 0.6 times the threshold rate of those of 4 s."""
    return [
        trial
        for k, factor in enumerate(FACTORS[2:6])
        for luminance in LUMINANCES
        for duration, ratio in ((4.0, 1.0), (8.0, 0.6))
        for trial in expected(
            f"{k + 1:02d}", luminance, ratio * factor * RELATIVE_THRESHOLD * luminance, duration=duration
        )
    ]


@pytest.fixture(scope="module")
def lowest(both_durations: list[RampTrial]) -> JointFit:
    return fit_joint(both_durations)


def test_the_limit_is_that_of_the_lowest_condition_and_the_others_ratio_is_found(lowest: JointFit) -> None:
    fit = lowest
    assert fit.reference == Condition(Direction.DOWN, 8.0)
    (effect,) = fit.effects
    assert effect.ratio == pytest.approx(1 / 0.6, rel=0.05)
    assert effect.ci_low < 1 / 0.6 < effect.ci_high
    assert any("whose thresholds are the lowest" in note for note in fit.notes)


def test_the_condition_can_be_chosen(both_durations: list[RampTrial], lowest: JointFit) -> None:
    chosen = fit_joint(both_durations, RateLimitOptions(ramp_duration=4.0))
    assert chosen.reference == Condition(Direction.DOWN, 4.0)
    ratio = curve(chosen, LUMINANCES) / curve(lowest, LUMINANCES)
    np.testing.assert_allclose(ratio, 1 / 0.6, rtol=0.06)


def test_one_luminance_gives_a_flat_curve_and_two_a_power_law() -> None:
    one = fit_joint(people(luminances=(50.0,)))
    assert (one.basis.degree, one.basis.luminance_range) == (0, (50.0, 50.0))
    assert np.exp(one.coefficients[0]) == pytest.approx(50 * RELATIVE_THRESHOLD, rel=0.04)
    assert one.band_luminance.tolist() == [50.0]
    assert one.simultaneous_lower[0] < np.exp(one.coefficients[0]) < one.simultaneous_upper[0]
    two = fit_joint(people(luminances=(20.0, 80.0)))
    assert (two.basis.form, two.basis.degree) == (RateLimitForm.LOG_LOG, 1)
    np.testing.assert_allclose(curve(two, [40.0]), 40 * RELATIVE_THRESHOLD, rtol=0.04)


@pytest.fixture(scope="module")
def dipping() -> list[RampTrial]:
    """Three people whose thresholds fall from 60 to 100 cd/m^2."""
    thresholds = dict(zip(LUMINANCES, (0.3, 0.9, 1.8, 1.3), strict=True))
    return [
        trial
        for k, factor in enumerate((0.9, 1.0, 1.1))
        for luminance, threshold in thresholds.items()
        for trial in expected(f"{k + 1:02d}", luminance, factor * threshold)
    ]


@pytest.mark.parametrize("form", [RateLimitForm.LOG_LOG, RateLimitForm.LN_RATE])
def test_a_monotone_curve_does_not_fall_and_its_band_is_no_wider(
    dipping: list[RampTrial], form: RateLimitForm
) -> None:
    free = fit_joint(dipping, RateLimitOptions(form, 2))
    rising = fit_joint(dipping, RateLimitOptions(form, 2, monotone=True))
    at = np.linspace(*free.basis.luminance_range, 400)
    assert (np.diff(curve(free, at)) < -1e-3).any()
    assert (np.diff(curve(rising, at)) >= -1e-4).all()
    assert any("the limit falls from" in note for note in free.notes)
    assert not any("the limit falls from" in note for note in rising.notes)
    for edge in (rising.simultaneous_lower, rising.simultaneous_upper):
        assert (np.diff(edge) >= -1e-9).all()
    assert half_width(rising) <= half_width(free) + 1e-9


def test_the_shape_is_the_one_that_predicts_the_luminances_left_out() -> None:
    """Thresholds that go with luminance are a power law; one more coefficient predicts no better."""
    luminances = (10.0, 18.0, 30.0, 45.0, 70.0, 100.0)
    law = fit_joint(people(FACTORS[2:6], luminances))
    scores = {(shape.form, shape.degree): shape for shape in law.shapes}
    assert scores[RateLimitForm.LOG_LOG, 1].chosen
    assert len(scores) == 4
    best = max(shape.score for shape in law.shapes if shape.score is not None)
    assert scores[RateLimitForm.LOG_LOG, 1].score == best
    bent = [
        trial
        for k, factor in enumerate(FACTORS[2:6])
        for luminance in luminances
        for trial in expected(f"{k + 1:02d}", luminance, factor * 0.8 * min(luminance / 25.0, 1.0) ** 0.9)
    ]
    chosen = next(shape for shape in fit_joint(bent).shapes if shape.chosen)
    assert (chosen.form, chosen.degree) != (RateLimitForm.LOG_LOG, 1)


def test_a_shape_asked_for_is_taken_whatever_the_scores_say() -> None:
    fit = fit_joint(people(), RateLimitOptions(RateLimitForm.LN_RATE, 2))
    assert (fit.basis.form, fit.basis.degree) == (RateLimitForm.LN_RATE, 2)
    assert [shape.chosen for shape in fit.shapes].count(True) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (RateLimitOptions(RateLimitForm.RATE, 2), "the joint model describes"),
        (RateLimitOptions(RateLimitForm.LOG_LOG, 4), "needs thresholds at 5 or more luminances, got 4"),
        (RateLimitOptions(ramp_duration=7.0), "no usable threshold of ramps of 7 s"),
    ],
)
def test_what_cannot_be_fitted_is_refused(options: RateLimitOptions, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit_joint(people(FACTORS[:2]), options)


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(InputError, match="degree"):
        RateLimitOptions(degree=9)
    with pytest.raises(InputError, match="between 0 and 1"):
        RateLimitOptions(band_level=1.0)


def test_the_same_answers_give_the_same_curve_and_progress_is_told() -> None:
    told: list[tuple[int, int]] = []
    trials = people(FACTORS[:3])
    first, second = (
        fit_joint(trials, report=lambda done, total: told.append((done, total))) for _ in range(2)
    )
    assert (first.simultaneous_lower == second.simultaneous_lower).all()
    assert told[:4] == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_levels_measured_again_are_simply_other_luminances() -> None:
    """The same screen at 100 and at 101 cd/m^2, of which the second is one participant's only."""
    trials = people(FACTORS[2:5])
    again = [
        dataclasses.replace(t, initial_luminance=101.0, final_luminance=101.0 - t.rate * t.duration)
        if t.participant_id == "03" and t.initial_luminance == 100.0
        else t
        for t in trials
    ]
    np.testing.assert_allclose(
        curve(fit_joint(again), LUMINANCES), curve(fit_joint(trials), LUMINANCES), rtol=0.03
    )


def test_a_display_measured_again_makes_no_new_luminance_for_the_shape() -> None:
    """Two levels, each measured twice, 1 % apart: a power law, and not the quadratic of four luminances."""
    trials = [
        trial
        for k, (low, high) in enumerate([(20.0, 80.0), (20.2, 80.8), (20.0, 80.0)])
        for factor, luminance in ((0.2, low), (0.8, high))
        for trial in shown_as(factor, expected(f"{k + 1:02d}", luminance, RELATIVE_THRESHOLD * luminance))
    ]
    fit = fit_joint(trials)
    assert (fit.basis.form, fit.basis.degree, fit.basis.luminance_range) == (
        RateLimitForm.LOG_LOG,
        1,
        pytest.approx((20.0 * 1.01**0.5, 80.0 * 1.01**0.5)),
    )
    flat = fit_joint([trial for trial in trials if trial.initial_luminance < 50])
    assert (flat.basis.degree, flat.basis.luminance_range[0]) == (0, pytest.approx(20.0 * 1.01**0.5))


def test_close_levels_of_a_design_are_no_single_level() -> None:
    """Fourteen factors, neighbours 4 % apart: a power law over a range of 1.66, and no constant."""
    close = tuple(np.geomspace(62.6, 104.0, 14).tolist())
    trials = [
        trial
        for k, factor in enumerate((0.9, 1.1))
        for luminance in close
        for trial in shown_as(luminance / 104, expected(f"{k}", luminance, factor * 0.02 * luminance, 6))
    ]
    fit = fit_joint(trials)
    assert fit.basis.degree >= 1
    ends = curve(fit, [close[0], close[-1]])
    assert ends[1] / ends[0] == pytest.approx(104.0 / 62.6, rel=0.1)


@pytest.mark.parametrize("form", [RateLimitForm.LN_RATE, RateLimitForm.LOG_LOG])
def test_a_line_asked_for_is_refused_where_there_is_one_luminance(form: RateLimitForm) -> None:
    trials = people(FACTORS[:3], (50.0,))
    with pytest.raises(InputError, match="needs thresholds at 2 or more luminances, got 1"):
        fit_joint(trials, RateLimitOptions(form, 1))
    assert fit_joint(trials, RateLimitOptions(form)).basis.form is form


def test_a_calibration_for_each_participant_costs_nothing_and_tells_nothing_more() -> None:
    """Two levels, twelve calibrations within 5 %: the tables of one calibration, and its band."""
    factors = np.linspace(0.7, 1.3, 12)
    fits, sizes = [], []
    for ratio in (1.0, 1.004):
        trials = [
            trial
            for k, factor in enumerate(factors)
            for level in (0.25, 1.0)
            for L in (100 * level * ratio**k,)
            for trial in shown_as(level, expected(f"{k:02d}", L, factor * RELATIVE_THRESHOLD * L))
        ]
        sizes.append(answer_tables(trials).ln_likelihood.shape)
        fits.append(fit_joint(trials))
    assert sizes[0] == sizes[1]
    assert half_width(fits[1]) == pytest.approx(half_width(fits[0]), rel=1e-6)
    middle = [float(one.basis.rate(one.coefficients[0])) for one in fits]
    assert middle[1] / middle[0] == pytest.approx(1.004**5.5, rel=1e-6)  # Weber: as the mean luminance


def test_answers_that_refute_a_rising_curve_keep_the_free_band_and_say_so() -> None:
    """Thresholds fall by a factor of five: no rising curve lies within the free band."""
    trials = [
        trial
        for k, factor in enumerate((0.9, 1.0, 1.1))
        for luminance, threshold in ((10, 2.0), (30, 1.0), (60, 0.6), (80, 0.5), (100, 0.4))
        for trial in expected(f"{k}", float(luminance), factor * threshold)
    ]
    free, asked = fit_joint(trials), fit_joint(trials, RateLimitOptions(monotone=True))
    assert (asked.falls_surely, free.falls_surely) == (True, False)
    assert any("speak against a curve that does not fall" in note for note in asked.notes)
    assert (asked.simultaneous_lower <= free.simultaneous_lower * (1 + 1e-9)).all()
    assert (asked.simultaneous_upper >= free.simultaneous_upper * (1 - 1e-9)).all()
