"""Simulated participants: their truth, and that their answers follow it."""

import math

import numpy as np
import pytest

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.ramp import Direction, Procedure, Response
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.ramp.ramp_observer import (
    ObserverPopulation,
    SimulatedObserver,
    draw_observer,
)
from evenlight.experiments.ramp.ramp_plan import RampCondition, RampLevel, planned_ramp
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.rate_limit import rate_limit_at

LIMIT = load_rate_limit("surace2025")
LUMINANCES = (104.4, 41.8, 20.9)  # of the white screen at factors 1, 0.4, 0.2


def observer(sensitivity: float = 1.0) -> SimulatedObserver:
    return SimulatedObserver(LIMIT, sensitivity, {}, width=1.6, guess_rate=0.1, lapse_rate=0.05)


def ramp(
    luminance: float,
    rate: float,
    interval: int | None = None,
    direction: Direction = Direction.DOWN,
    duration: float = 5.0,
) -> PlannedTrial:
    level = RampLevel("white", 1.0, luminance)
    return planned_ramp(
        level, RampCondition("white", direction, duration), rate, ramp_interval=interval, block=1
    )


def share(who: SimulatedObserver, planned: PlannedTrial, answer: Response, n: int = 4000) -> float:
    rng = np.random.default_rng(5)
    return sum(who.answer(planned, rng) is answer for _ in range(n)) / n


def share_of_yes(who: SimulatedObserver, luminance: float, rate: float) -> float:
    return share(who, ramp(luminance, rate), Response.YES)


def test_the_median_participant_has_the_published_thresholds() -> None:
    # The authors' fitted curve: 0.807 at 23.4 and 2.787 at 104.4 cd/m².
    assert observer().threshold_at(23.4) == pytest.approx(0.807, abs=5e-4)
    assert observer(1.5).threshold_at(104.4) == pytest.approx(1.5 * 2.787, abs=1e-3)


def test_answers_follow_the_psychometric_function() -> None:
    # At the threshold 75 % but for lapses: 0.10 + 0.85 · 0.65 / 0.90. Without a change the guess rate, far
    # above one minus the lapse rate; four standard errors of 4000 answers are at most 0.029.
    who = observer()
    threshold = who.threshold_at(60.0)
    assert share_of_yes(who, 60.0, threshold) == pytest.approx(0.714, abs=0.029)
    assert share_of_yes(who, 60.0, 0.0) == pytest.approx(0.10, abs=0.019)
    assert share_of_yes(who, 60.0, 100 * threshold) == pytest.approx(0.95, abs=0.014)


@pytest.mark.slow
def test_of_two_intervals_75_percent_are_right_at_a_lower_threshold() -> None:
    who = observer()
    function = who.function_at(60.0, Procedure.TWO_INTERVAL)
    assert function.threshold < who.threshold_at(60.0)
    # Lapses of 5 % in yes/no: half of them are right by chance, 0.5 + 0.475 / 2 at the threshold.
    for interval, right in ((1, Response.FIRST), (2, Response.SECOND)):
        at_threshold = ramp(60.0, function.threshold, interval)
        assert share(who, at_threshold, right) == pytest.approx(0.7375, abs=0.028)
        assert share(who, ramp(60.0, 100.0 * function.threshold, interval), right) == pytest.approx(
            0.975, abs=0.01
        )


def test_a_threshold_lies_between_a_constant_rate_and_a_constant_amount_of_change() -> None:
    # duration^-0.5: four times the duration, half the rate, twice the amount.
    who = observer()
    assert who.threshold_at(60.0, duration=20.0) == pytest.approx(who.threshold_at(60.0) / 2)
    by_rate, by_amount = (SimulatedObserver(LIMIT, 1.0, {}, 1.6, 0.1, 0.05, share) for share in (0.0, 1.0))
    assert by_rate.threshold_at(60.0, duration=20.0) == pytest.approx(by_rate.threshold_at(60.0))
    assert by_amount.threshold_at(60.0, duration=20.0) == pytest.approx(by_amount.threshold_at(60.0) / 4)


def test_rising_luminance_is_seen_a_little_less_well() -> None:
    who = observer()
    assert who.threshold_at(60.0, Direction.UP) == pytest.approx(1.1 * who.threshold_at(60.0))
    rate = who.threshold_at(60.0)
    assert share(who, ramp(60.0, rate, direction=Direction.UP), Response.YES) < 0.75
    assert share(who, ramp(60.0, rate, duration=10.0), Response.YES) > 0.8


def test_an_answer_depends_on_seed_participant_and_trial_alone() -> None:
    who, planned = observer(), ramp(60.0, observer().threshold_at(60.0))

    def answers(seed: int, order_index: int, trials: range) -> list[Response]:
        return [
            who.answer(planned, generator_for(seed, order_index, Purpose.ANSWERS, trial)) for trial in trials
        ]

    assert answers(1, 0, range(50))[30:] == answers(1, 0, range(30, 50))
    assert answers(1, 0, range(50)) != answers(1, 1, range(50))
    assert answers(1, 0, range(50)) != answers(2, 0, range(50))


def test_a_population_has_the_spread_it_states() -> None:
    rng = np.random.default_rng(11)
    people = ObserverPopulation(level_sd=0.0)
    drawn = [draw_observer(LIMIT, (50.0,), rng, people) for _ in range(2000)]
    # Standard error of a standard deviation: σ / sqrt(2 n) = 1.6 %; four of them.
    assert np.std(np.log([o.sensitivity for o in drawn])) == pytest.approx(0.2, rel=0.064)
    assert np.std(np.log([o.width for o in drawn])) == pytest.approx(0.3, rel=0.064)
    assert np.median([o.width for o in drawn]) == pytest.approx(1.6, rel=0.04)
    assert np.mean([o.guess_rate for o in drawn]) == pytest.approx(2 / 30, rel=0.07)
    assert np.mean([o.lapse_rate for o in drawn]) == pytest.approx(1.5 / 61.5, rel=0.08)


@pytest.fixture(scope="module")
def population() -> list[SimulatedObserver]:
    rng = np.random.default_rng(13)
    return [draw_observer(LIMIT, LUMINANCES, rng) for _ in range(2000)]


def thresholds_of(people: list[SimulatedObserver], luminance: float, procedure: Procedure) -> Array:
    return np.array([who.function_at(luminance, procedure).threshold for who in people])


def test_a_two_interval_threshold_depends_on_the_eye_and_not_on_the_criterion(
    population: list[SimulatedObserver],
) -> None:
    two = thresholds_of(population, LUMINANCES[0], Procedure.TWO_INTERVAL)
    eyes = np.array([who.sensitivity * who.level_factors[LUMINANCES[0]] for who in population])
    np.testing.assert_allclose(two / eyes, two[0] / eyes[0], rtol=1e-12)  # the median person's, for everybody


def test_the_criterion_is_independent_of_the_eye_and_adds_its_scatter_to_yes_no(
    population: list[SimulatedObserver],
) -> None:
    # Independent traits: variances add up. A correlation of 2000 has a standard error of 0.022.
    eye, criterion = (
        np.log([getattr(who, name) for who in population]) for name in ("sensitivity", "caution")
    )
    assert abs(np.corrcoef(eye, criterion)[0, 1]) < 4 * 0.0224
    levels = ObserverPopulation().level_sd
    yes_no = np.log(thresholds_of(population, LUMINANCES[0], Procedure.YES_NO))
    expected = math.sqrt(np.var(eye) + np.var(criterion) + levels**2)
    assert np.std(yes_no) == pytest.approx(expected, rel=0.064)
    two = np.log(thresholds_of(population, LUMINANCES[0], Procedure.TWO_INTERVAL))
    assert np.std(two) < np.std(yes_no)


def test_who_says_yes_readily_has_the_lower_yes_no_threshold_with_the_same_eye(
    population: list[SimulatedObserver],
) -> None:
    # d' at 75 % "yes", z(0.75) - z(γ), is 2.6 for false alarms of 3 %, 2.2 for the median 6 %, 2.0 for 10 %.
    ready = [who.caution for who in population if who.guess_rate > 0.1]
    reluctant = [who.caution for who in population if who.guess_rate < 0.03]
    assert np.median(ready) < 1 < np.median(reluctant)


def test_the_median_yes_no_threshold_is_the_published_limit_to_five_percent(
    population: list[SimulatedObserver],
) -> None:
    # The criterion scatters upwards more than downwards, so that who is the median in each trait is not
    # quite the median of the thresholds: those lie 2 % higher. Three standard errors of 2000 are 3 %.
    for luminance in LUMINANCES:
        median = np.median(thresholds_of(population, luminance, Procedure.YES_NO))
        assert median == pytest.approx(float(rate_limit_at(LIMIT, luminance)), rel=0.05)


def test_95_percent_of_the_yes_no_thresholds_are_what_studies_of_dimming_report(
    population: list[SimulatedObserver],
) -> None:
    """1.5 %/s of the initial luminance (Hu & Davis 2016: 7.4 % in 5 s) to 8.5 %/s (Knau 2000: 0.24 log)."""
    relative = [
        thresholds_of(population, luminance, Procedure.YES_NO) / luminance for luminance in LUMINANCES
    ]
    low, high = np.quantile(relative, [0.025, 0.975])
    assert 0.015 < low < high < 0.085


def test_levels_scatter_beyond_a_participants_own_factor() -> None:
    rng = np.random.default_rng(12)
    people = ObserverPopulation(participant_sd=0.0, level_sd=0.1)
    luminances = tuple(np.linspace(10, 100, 400))
    who = draw_observer(LIMIT, luminances, rng, people)
    assert who.sensitivity == 1.0
    # Standard error of a standard deviation of 400: 3.5 %; four of them.
    assert np.std(np.log(list(who.level_factors.values()))) == pytest.approx(0.1, rel=0.14)
