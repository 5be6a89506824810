"""Simulated participants of artifact comparison: what changes, how it is seen, which version is chosen."""

from collections.abc import Callable

import numpy as np
import pytest
from example_tracks import example_track, header_of
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import Direction, Procedure, Response
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.viewing.brightness_changes import (
    LuminanceCourse,
    changes_in_thresholds,
    luminance_course,
)
from evenlight.experiments.viewing.comparison_observer import (
    ComparisonObserver,
    ComparisonPopulation,
    chance_of_choice,
    d_prime,
    draw_comparer,
)
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import PsychometricFunction, yes_probability
from evenlight.method.rate_limit import rate_limit_at

LIMIT = load_rate_limit("surace2025")
LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0, reflected_luminance=0.5)
EYE = SimulatedObserver(LIMIT, 1.0, {}, width=1.6, guess_rate=0.06, lapse_rate=0.0)
RATE = 25.0  # [Hz] frames


def track(times: Array, factors: Array, full: Array, display: Display = LAB) -> BrightnessTrack:
    dimmed = factors * full + display.reflected_luminance
    columns = {"times": times, "mean_luminance": dimmed, "rate_limit": 1.0, "power": 1.0}
    return example_track(factors, header=header_of(LAB), **columns)


def course_of(
    seconds: float, factor: Callable[[Array], Array], full: Callable[[Array], Array]
) -> LuminanceCourse:
    """Return the course of a video without reflections, given factor and content over time."""
    times = np.arange(round(seconds * RATE) + 1) / RATE
    dark = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    shown = track(times, factor(times), full(times) * np.ones_like(times), dark)
    return luminance_course(shown, shown.factors, dark)


def at_the_limit(times: Array, multiple: float = 1.0, start: float = 0.3, stop: float = 0.9) -> Array:
    """Return factors that swing between two values, of a content of 60 cd/m^2, at a multiple of the limit."""
    factor, way, factors = start, 1.0, []
    for step in np.diff(times, append=times[-1] + 1 / RATE):
        factors.append(factor)
        allowed = multiple * float(rate_limit_at(LIMIT, 60 * factor)) * step / 60
        way = -1.0 if factor >= stop else 1.0 if factor <= start else way
        factor = float(np.clip(factor + way * allowed, start, stop))
    return np.array(factors)


def choices_of_ours(
    who: ComparisonObserver, course: LuminanceCourse, n: int = 2000, interval: int = 1
) -> float:
    evidence = who.evidence(course)
    wanted = Response.FIRST if interval == 1 else Response.SECOND
    rng = np.random.default_rng(8)
    return sum(who.answer(evidence, interval, rng) is wanted for _ in range(n)) / n


def constant_threshold(luminance: Array, direction: Direction, span: float) -> Array:
    return np.full_like(luminance, 2.0)


def test_what_changes_the_luminance_is_shared_between_modulation_and_content_by_hand() -> None:
    # Ī from 10 to 20, b from 0.5 to 0.6, D from 5 to 12: 0.1 · 15 by the modulation, 0.55 · 10 by content.
    times, factors = np.array([0.0, 0.5]), np.array([0.5, 0.6])
    course = luminance_course(track(times, factors, np.array([10.0, 20.0])), factors, LAB)
    np.testing.assert_allclose(course.modulated, [0.0, 1.5])
    np.testing.assert_allclose(course.content, [0.0, 5.5])
    # Exposure: the mean of 5.5 and 12.5 (with reflected light) for half a second.
    np.testing.assert_allclose(course.exposure, [0.0, 4.5])


def test_a_ramp_of_five_seconds_counts_as_its_rate_over_the_threshold() -> None:
    # 3 cd/m^2/s between second 5 and 10 of a content of 100 cd/m^2, threshold 2: 1.5 in that stretch alone.
    course = course_of(15.0, lambda t: 0.3 + 0.03 * np.clip(t - 5, 0, 5), lambda t: np.full_like(t, 100.0))
    changes = changes_in_thresholds(course, constant_threshold)
    np.testing.assert_allclose(changes.modulated, [0.0, 1.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(changes.content, 0.0, atol=1e-9)


def test_a_change_is_looked_up_at_the_luminance_its_direction_and_its_span() -> None:
    asked = set()

    def thresholds(luminance: Array, direction: Direction, span: float) -> Array:
        asked.add((direction, span))
        # Rising changes are never seen; falling ones at 1 % of the luminance.
        return luminance * (0.01 if direction is Direction.DOWN else np.inf)

    # 60 to 40 cd/m^2 in 5 s: the last 1.25 s count most, from 45 to 40, at 42.5 on the mean.
    course = course_of(5.0, lambda t: 0.6 - 0.04 * t, lambda t: np.full_like(t, 100.0))
    changes = changes_in_thresholds(course, thresholds)
    assert asked == {(way, span) for way in Direction for span in (1.25, 2.5, 5.0)}
    assert changes.modulated[0] == pytest.approx(4.0 / (0.01 * 42.5), rel=1e-3)
    rising = course_of(5.0, lambda t: 0.4 + 0.04 * t, lambda t: np.full_like(t, 100.0))
    assert changes_in_thresholds(rising, thresholds).modulated[0] == 0.0


def test_a_change_that_is_taken_back_within_the_stretch_still_counts() -> None:
    # Up for 1.25 s and down for 1.25 s, 8 cd/m^2/s: no net change over 2.5 or 5 s, 4 thresholds over 1.25.
    course = course_of(
        5.0, lambda t: 0.5 + 0.08 * np.maximum(0, 1.25 - np.abs(t - 1.25)), lambda t: np.full_like(t, 100.0)
    )
    assert changes_in_thresholds(course, constant_threshold).modulated[0] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize(("seconds", "stretches"), [(1.0, 1), (5.0, 1), (6.0, 1), (7.0, 2), (60.0, 12)])
def test_a_video_is_cut_into_stretches_of_five_seconds_and_a_rest(seconds: float, stretches: int) -> None:
    course = course_of(seconds, lambda t: np.full_like(t, 0.5), lambda t: np.full_like(t, 50.0))
    assert len(changes_in_thresholds(course, constant_threshold).modulated) == stretches


def test_an_excerpt_ends_where_it_ends() -> None:
    course = course_of(
        20.0, lambda t: np.where(t < 10, 0.5, 0.5 + 0.02 * (t - 10)), lambda t: np.full_like(t, 50.0)
    )
    assert changes_in_thresholds(course, constant_threshold, seconds=10.0).modulated.max() == pytest.approx(
        0.0
    )
    assert changes_in_thresholds(course, constant_threshold).modulated.max() > 0.4


def test_evidence_is_that_of_the_two_interval_function_as_printed() -> None:
    """Φ(d'/√2) is the share of right answers of who always looks."""
    function = PsychometricFunction(3.0, 1.8, guess_rate=0.5)
    multiples = np.array([0.3, 1.0, 2.0])
    right = special.ndtr(d_prime(multiples, function) / np.sqrt(2))
    np.testing.assert_allclose(right, yes_probability(3.0 * multiples, function), rtol=1e-9)
    assert d_prime(np.array([0.0]), function)[0] == 0.0
    assert np.isfinite(d_prime(np.array([1e9]), function)).all()


def test_thresholds_are_those_of_the_same_eye_in_the_ramp_experiment() -> None:
    eye = SimulatedObserver(LIMIT, 1.3, {}, 1.5, 0.1, 0.02)
    for luminance in (15.0, 60.0, 104.0):
        for way in Direction:
            for span in (1.25, 5.0):
                own = ComparisonObserver(eye).thresholds(np.array([luminance]), way, span)
                asked = eye.function_at(luminance, Procedure.TWO_INTERVAL, way, span)
                assert own[0] == pytest.approx(asked.threshold, rel=1e-9)


def test_the_chance_of_a_choice_is_what_many_choices_give() -> None:
    rng, evidence, n = np.random.default_rng(9), np.array([0.0, 1.5, 0.3, 0.0]), 20000
    noise = rng.standard_normal((2, n, 4))
    chosen = ((evidence + noise[0]).max(axis=1) > noise[1].max(axis=1)).mean()
    assert chance_of_choice(evidence) == pytest.approx(chosen, abs=4 * np.sqrt(0.25 / n))


def test_without_any_modulation_either_version_is_chosen_as_often() -> None:
    course = course_of(40.0, lambda t: np.full_like(t, 0.5), lambda t: 30 + 20 * np.sin(t))
    for interval in (1, 2):
        share = choices_of_ours(ComparisonObserver(EYE, masking=0.5), course, interval=interval)
        assert share == pytest.approx(0.5, abs=4 * np.sqrt(0.25 / 2000))


def largest_share_of(evidence: Array) -> float:
    """Return an upper bound of how often ours is chosen, from its strongest evidence D alone.

    P(max(d' + ε) > max ε') is at most P(M' - M < D) with M, M' two maxima of n normals, and their difference
    has its mode at 0, so it is at most 1/2 + D ∫ f², f the density of one maximum.
    """
    n, x = len(evidence), np.linspace(-6, 8, 4001)
    density = n * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * special.ndtr(x) ** (n - 1)
    return float(0.5 + evidence.max() * np.trapezoid(density**2, x))


def smallest_share_of(evidence: Array) -> float:
    """Return a lower bound: that of one stretch, the strongest, against all noise of the baseline."""
    n, x = len(evidence), np.linspace(-8, 8, 4001)
    density = n * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * special.ndtr(x) ** (n - 1)
    return float(np.trapezoid(density * special.ndtr(evidence.max() - x), x))


def test_a_track_far_within_the_limit_is_chosen_little_more_often_than_the_baseline() -> None:
    course = course_of(40.0, lambda t: at_the_limit(t, 0.25), lambda t: np.full_like(t, 60.0))
    who = ComparisonObserver(EYE)
    bound = largest_share_of(who.evidence(course))
    assert bound < 0.6
    assert 0.5 <= chance_of_choice(who.evidence(course)) <= bound
    assert 0.5 - 0.045 < choices_of_ours(who, course) < bound + 0.045  # four standard errors of 2000


def test_a_track_ten_times_as_fast_as_the_limit_is_chosen_nearly_always() -> None:
    course = course_of(40.0, lambda t: at_the_limit(t, 10.0), lambda t: np.full_like(t, 60.0))
    who = ComparisonObserver(EYE)
    bound = smallest_share_of(who.evidence(course))
    assert bound > 0.95
    assert choices_of_ours(who, course) > bound - 4 * np.sqrt(bound * (1 - bound) / 2000)


def test_on_constant_content_a_track_at_the_yes_no_limit_is_told_from_the_baseline() -> None:
    """The limit is where 75 % say "yes"; with 6 % false alarms that is a d' of z(0.75) - z(0.06) = 2.2."""
    course = course_of(40.0, lambda t: at_the_limit(t, 1.0), lambda t: np.full_like(t, 60.0))
    evidence = ComparisonObserver(EYE).evidence(course)
    assert evidence.max() == pytest.approx(2.2, abs=0.4)
    assert chance_of_choice(evidence) > 0.8


def test_changes_of_the_content_hide_those_of_the_modulation() -> None:
    # Content that falls and rises by 20 %/s, as on a walk between rooms: many thresholds at any time.
    def walk(times: Array) -> Array:
        return np.asarray(60 * np.exp(-0.2 * (5 - np.abs(times % 10 - 5))))

    shown = course_of(40.0, lambda t: 0.5 + 0.1 * np.sin(t / 3), walk)
    seen, hidden = (ComparisonObserver(EYE, masking).evidence(shown) for masking in (0.0, 0.5))
    assert (hidden <= seen).all()
    assert hidden.max() < 0.5 * seen.max()
    assert chance_of_choice(hidden) < 0.6 < chance_of_choice(seen)


def test_masking_raises_the_threshold_as_told_by_hand() -> None:
    # Content of 4 thresholds, masking 0.5: sqrt(1 + 2²) = 2.24 times the threshold.
    who = ComparisonObserver(EYE, masking=0.5)
    unmasked = ComparisonObserver(EYE)
    threshold = float(who.thresholds(np.array([50.0]), Direction.DOWN, 5.0)[0])
    # Over 5 s content and modulation each fall so little that the luminance stays at 50.
    times = np.arange(126) / RATE
    fall = times * threshold
    course = LuminanceCourse(times, 50.0 * times, -fall, -4 * fall)
    only = LuminanceCourse(times, 50.0 * times, -fall / np.sqrt(5), np.zeros_like(fall))
    np.testing.assert_allclose(who.evidence(course), unmasked.evidence(only), rtol=1e-6)


def test_a_leaning_to_the_first_interval_cancels_over_both_orders() -> None:
    course = course_of(20.0, lambda t: np.full_like(t, 0.5), lambda t: np.full_like(t, 60.0))
    leaning = ComparisonObserver(EYE, bias=0.5)
    first, second = (choices_of_ours(leaning, course, interval=interval) for interval in (1, 2))
    assert first > 0.55
    assert first + second == pytest.approx(1.0, abs=8 * np.sqrt(0.25 / 2000))


def test_who_does_not_look_chooses_by_chance() -> None:
    course = course_of(40.0, lambda t: at_the_limit(t, 10.0), lambda t: np.full_like(t, 60.0))
    blind = ComparisonObserver(SimulatedObserver(LIMIT, 1.0, {}, 1.6, 0.06, lapse_rate=0.2))
    looking = chance_of_choice(blind.evidence(course))
    expected = 0.8 * looking + 0.1
    assert choices_of_ours(blind, course, 4000) == pytest.approx(expected, abs=4 * np.sqrt(0.09 / 4000))


def test_a_population_of_half_the_thresholds_sees_twice_the_change() -> None:
    course = course_of(40.0, lambda t: at_the_limit(t, 0.5), lambda t: np.full_like(t, 60.0))
    keen = SimulatedObserver(LIMIT, 0.5, {}, 1.6, 0.06, 0.0)
    ordinary, sharper = (
        changes_in_thresholds(course, ComparisonObserver(eye).thresholds).modulated for eye in (EYE, keen)
    )
    np.testing.assert_allclose(sharper, 2 * ordinary, rtol=1e-9)
    assert chance_of_choice(ComparisonObserver(keen).evidence(course)) > chance_of_choice(
        ComparisonObserver(EYE).evidence(course)
    )


def test_a_drawn_person_has_the_traits_of_the_population() -> None:
    rng = np.random.default_rng(10)
    people = ComparisonPopulation(masking=0.3)
    drawn = [draw_comparer(LIMIT, rng, people) for _ in range(1000)]
    assert {who.masking for who in drawn} == {0.3}
    # Standard error of a standard deviation of 1000: 2.2 %; four of them.
    assert np.std([who.bias for who in drawn]) == pytest.approx(people.bias_sd, rel=0.09)
    assert np.std(np.log([who.eye.sensitivity for who in drawn])) == pytest.approx(0.2, rel=0.09)
