"""Visual adaptation: the cones' static and dynamic response, and the integral of their difference."""

import math

import numpy as np
import pytest
from adapting_responses import response_differences
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from evenlight.method.adaptation import (
    BLEACHING_TIME,
    NEURAL_TIME,
    ConeState,
    adapted,
    cone_response,
    difference_samples,
    half_saturation,
    state_after,
    static_response,
    steady_pigment,
)

luminances = st.floats(0.01, 1000.0)


def sigma_as_printed(A: float) -> float:
    """Hunt's half-saturation of the cones, transcribed from Pattanaik et al. (2000)."""
    k = 1 / (5 * A + 1)
    return 12.9223 * A / (k**4 * A + 0.171 * (1 - k**4) ** 2 * A ** (1 / 3))


def response_as_printed(L: float, A: float, B: float) -> float:
    """R = B L^n / (L^n + sigma^n)."""
    return B * L**0.73 / (L**0.73 + sigma_as_printed(A) ** 0.73)


@pytest.mark.slow
@given(luminances)
def test_half_saturation_is_the_printed_formula(luminance: float) -> None:
    assert half_saturation(luminance).item() == pytest.approx(sigma_as_printed(luminance), rel=1e-12)


def test_half_saturation_by_hand() -> None:
    # A = 0.2: k = 1/2, k^4 = 1/16, (15/16)^2 = 0.87890625, 0.2^(1/3) = 0.584803548:
    # 12.9223 · 0.2 / (0.0125 + 0.171 · 0.87890625 · 0.584803548) = 2.58446 / 0.10039186
    assert half_saturation(0.2).item() == pytest.approx(25.74372, rel=1e-6)
    # in bright light k vanishes: sigma tends to 12.9223 A^(2/3) / 0.171
    assert half_saturation(1e6).item() == pytest.approx(12.9223e4 / 0.171, rel=1e-9)


def test_the_darkest_adaptation_makes_no_0_by_0() -> None:
    dark = half_saturation(np.array([0.0, 1e-300, 1e-12]))
    np.testing.assert_allclose(dark, 12.9223, rtol=1e-9)
    assert static_response(0.0).item() == 0.0


@given(luminances, luminances)
def test_response_is_the_printed_formula_and_a_share(luminance: float, adaptation: float) -> None:
    state = ConeState(np.array(adaptation), np.array(0.9))
    response = cone_response(luminance, state).item()
    assert response == pytest.approx(response_as_printed(luminance, adaptation, 0.9), rel=1e-12)
    assert 0 < response < 0.9


@given(luminances)
def test_what_is_adapted_stays_adapted(luminance: float) -> None:
    state = state_after(adapted(luminance), luminance, 1000.0)
    assert state.adaptation_luminance.item() == pytest.approx(luminance, rel=1e-12)
    assert state.unbleached_pigment.item() == pytest.approx(steady_pigment(luminance).item(), rel=1e-12)


def test_the_update_solves_both_equations() -> None:
    luminance, start = 3e5, ConeState(np.array(10.0), np.array(1.0))

    def change(_: float, state: np.ndarray) -> list[float]:
        A, B = state
        return [(luminance - A) / 0.08, (1 - B) / 110 - luminance * B / (110 * 2e6)]

    solved = integrate.solve_ivp(change, (0, 60.0), [10.0, 1.0], rtol=1e-10, atol=1e-12, method="LSODA").y[
        :, -1
    ]
    state = state_after(start, luminance, 60.0)
    assert state.adaptation_luminance.item() == pytest.approx(solved[0], rel=1e-8)
    assert state.unbleached_pigment.item() == pytest.approx(solved[1], rel=1e-8)


def test_state_by_hand() -> None:
    # One time constant leaves 1/e of the way; pigment regenerates in the dark with 110 s.
    state = state_after(ConeState(np.array(100.0), np.array(0.5)), 0.0, NEURAL_TIME)
    assert state.adaptation_luminance.item() == pytest.approx(100 / math.e, rel=1e-12)
    later = state_after(ConeState(np.array(100.0), np.array(0.5)), 0.0, BLEACHING_TIME)
    assert later.unbleached_pigment.item() == pytest.approx(1 - 0.5 / math.e, rel=1e-12)


def test_bleaching_is_negligible_on_a_display() -> None:
    assert 1 - steady_pigment(100.0).item() <= 5e-5
    # A year in white light instead of a moment in the dark: the response to it changes by as little.
    fresh, worn = (ConeState(np.array(50.0), pigment) for pigment in (np.array(1.0), steady_pigment(100.0)))
    assert cone_response(100.0, worn) / cone_response(100.0, fresh) >= 1 - 5e-5
    # What is left of a difference once neural adaptation is over, after a jump from black to white: at most
    # that.
    later = state_after(adapted(0.04), 100.0, 25 * NEURAL_TIME)
    assert abs(cone_response(100.0, later) - static_response(100.0)) <= 5e-5 * static_response(100.0)


@pytest.mark.parametrize(
    ("ratio", "tolerance"),
    [(1.2, 1e-8), (2.0, 2e-8), (0.5, 2e-8), (10.0, 1e-4), (1e5, 5e-4), (1e-5, 5e-4)],
)
def test_integral_within_a_frame_is_as_exact_as_it_says(ratio: float, tolerance: float) -> None:
    for start in np.geomspace(0.01, 1000.0, 9):
        goal = start * ratio
        if not 0.01 <= goal <= 1000.1:
            continue
        for seconds in (1 / 90, 0.04, 0.2, 1.0):
            parts, weights = difference_samples(adapted(start), np.array(goal), seconds)
            assert weights.sum() == pytest.approx(seconds, rel=1e-12)
            fine = fine_integral(start, goal, seconds)
            assert weights @ parts == pytest.approx(fine, rel=tolerance)


def fine_integral(start: float, goal: float, seconds: float) -> float:
    """The same integral by 12 nodes in each of 90 stretches that grow from a hundredth of a microsecond."""
    edges = np.concatenate([[0.0], np.geomspace(1e-8, seconds, 90)])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges)[:, None] / 2
    at, weight = (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
    response = cone_response(goal, state_after(adapted(start), goal, at))
    return float(weight @ np.abs(response - static_response(goal)))


def test_the_same_stimulus_in_more_frames_has_the_same_integral() -> None:
    rng = np.random.default_rng(2)
    light, durations = np.exp(rng.normal(2.0, 0.7, (20, 30))), rng.uniform(0.02, 0.4, 20)
    whole = response_differences(light, durations).sum(axis=0)
    for pieces in (2, 7):
        cut = response_differences(np.repeat(light, pieces, axis=0), np.repeat(durations / pieces, pieces))
        np.testing.assert_allclose(cut.sum(axis=0), whole, rtol=1e-4)


def test_the_integral_does_not_tell_a_fast_change_from_a_slow_one() -> None:
    # For small changes the lag of ln A is (rate · 80 ms): its integral is 80 ms times the change Δ, at any
    # rate. Of a step the second order adds Δ / 4 = 2.6 % times f'' / f', n (1 - 2 f) of a response f with the
    # exponent n < 1. The largest lag is nearly Δ there, and 80 ms / 10 s = 1/125 of Δ in the slowest change.
    durations = np.full(900, 0.02)
    totals, largest = [], []
    for seconds in (0.02, 1.0, 10.0):
        path = 40.0 * 0.9 ** np.clip((np.arange(900) * 0.02 - 1.0) / seconds, 0, 1)
        parts = response_differences(path, durations)
        totals.append(parts.sum())
        largest.append(parts.max())
    assert max(totals) / min(totals) < 1.02
    assert largest[0] / largest[2] > 50


@given(st.lists(luminances, min_size=1, max_size=6), st.floats(0.005, 0.5))
def test_differences_lie_between_none_and_all_the_time(path: list[float], seconds: float) -> None:
    parts = response_differences(np.array(path), np.full(len(path), seconds))
    assert parts[0] == pytest.approx(0.0, abs=1e-15)  # adapted to the first frame
    assert ((parts >= 0) & (parts < seconds)).all()


def test_pixels_do_not_know_of_each_other() -> None:
    light = np.exp(np.random.default_rng(3).normal(2.0, 1.0, (6, 2, 3)))
    together = response_differences(light.astype(np.float32), np.full(6, 0.04))
    alone = response_differences(light[:, 1, 2].astype(np.float32), np.full(6, 0.04))
    np.testing.assert_allclose(together[:, 1, 2], alone, rtol=1e-12)
