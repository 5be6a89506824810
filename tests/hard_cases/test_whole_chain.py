"""The whole chain, from pixels to the summary of a track, for any small video, display, limit and budget.

What must hold of every result holds here; changes that should change nothing do not.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, TrackHeader
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import LimitCurve, ModulatedLuminance, SolverName
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.optimizer.evaluate import (
    RunRecord,
    SolverAnswer,
    no_worse_than_constant,
    summarize,
    track_of,
)
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import Problem, is_feasible, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import make_solver
from evenlight.method.power import power
from evenlight.method.rate_limit import largest_rate_ratio, scalar_rate_limit

PICTURES = {
    "flat": lambda x, y, rng: np.full(x.shape, rng.random()),
    "black": lambda x, y, rng: np.zeros(x.shape),
    "white": lambda x, y, rng: np.ones(x.shape),
    "noise": lambda x, y, rng: rng.random(x.shape),
    "gradient": lambda x, y, rng: x / x.max() * rng.random(),
    "checks": lambda x, y, rng: ((x // 2 + y // 2) % 2).astype(float),
    "dot": lambda x, y, rng: (x == 4) & (y == 4),
    "rounding noise": lambda x, y, rng: 0.5 + 1e-7 * rng.standard_normal(x.shape),
    "denormal": lambda x, y, rng: 1e-310 * rng.random(x.shape),
    "edge": lambda x, y, rng: np.where(x < 4, 0.05, 0.9),
}


@dataclass(frozen=True)
class Case:
    """A video on a display, a rate limit, a power model, and where in the possible range the budget lies."""

    frames: tuple[Frame, ...]
    display: Display
    limit: RateLimit
    panel: PowerModel
    unit: BudgetUnit
    budget_place: float
    lowest_factor: float
    modulated: ModulatedLuminance


def frames_of(
    kinds: list[str], durations: list[float], shape: tuple[int, int], seed: int
) -> tuple[Frame, ...]:
    """Frames of the given pictures; "again" repeats the one before."""
    rng = np.random.default_rng(seed)
    eight_bits = bool(rng.random() < 0.5)  # all frames of one kind, as in a file
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]]
    frames, time, picture = [], 0.0, np.zeros(shape)
    for kind, duration in zip(kinds, durations, strict=True):
        if kind != "again":
            picture = np.clip(np.asarray(PICTURES[kind](x, y, rng), dtype=np.float64), 0, 1)
        pixels = np.repeat(picture[:, :, None], 3, axis=2)
        frames.append(
            Frame(time, duration, np.round(pixels * 255).astype(np.uint8) if eight_bits else pixels)
        )
        time += duration
    return tuple(frames)


@st.composite
def videos(draw: st.DrawFn) -> tuple[Frame, ...]:
    kinds = draw(st.lists(st.sampled_from([*PICTURES, "again"]), min_size=1, max_size=12))
    steady = draw(st.sampled_from([1 / 90, 1 / 25, 2.0, None]))
    lengths = st.sampled_from([1e-9, 1e-3, 1 / 90, 1 / 25, 0.5, 10.0, 1000.0])
    durations = [draw(lengths) if steady is None else steady for _ in kinds]
    shape = draw(st.tuples(st.integers(8, 40), st.integers(8, 40)))
    return frames_of(kinds, durations, shape, draw(st.integers(0, 999)))


@st.composite
def displays(draw: st.DrawFn) -> Display:
    peak = 10 ** draw(st.floats(-1, 4))
    return Display(
        "any",
        peak_luminance=peak,
        black_level=peak * draw(st.sampled_from([0.0, 1e-6, 1e-3, 0.3])),
        gamma=draw(st.floats(1, 3)),
        pixels_per_degree=draw(st.floats(5, 120)),
        reflected_luminance=draw(st.sampled_from([0.0, 1e-3, 1.0, 1e3])),
    )


@st.composite
def limits(draw: st.DrawFn) -> RateLimit:
    coefficients = draw(
        st.one_of(
            st.sampled_from([(0.0,), (-49.0,), (20.0,), (1.0, 1.0)]),
            st.lists(st.floats(-3, 3), min_size=1, max_size=5).map(tuple),
        )
    )
    measured = draw(st.sampled_from([(1.0, 100.0), (1e-6, 1e6), (10.0, 10.01), (1e-3, 0.1)]))
    form = draw(st.sampled_from(RateLimitForm))
    if (
        form is RateLimitForm.RATE
    ):  # one that is below 0 everywhere is refused: the mean is the first coefficient
        coefficients = (abs(coefficients[0]), *coefficients[1:])
    return RateLimit("any", "any", "", form, coefficients, measured)


@st.composite
def cases(draw: st.DrawFn) -> Case:
    lcd = PowerModel("l", PanelKind.LCD, 0.3, power_per_luminance=0.002, peak_luminance=500.0)
    oled = PowerModel("o", PanelKind.OLED, 0.1, red_power=0.3, green_power=1.0, blue_power=0.4)
    panel = draw(st.sampled_from([lcd, oled]))
    units = [BudgetUnit.POWER, BudgetUnit.WATT] + [BudgetUnit.FACTOR] * (panel is lcd)
    ends = st.sampled_from([0.0, 1e-12, 1e-9, 1e-6, 1 - 1e-6, 1 - 1e-9, 1.0])
    return Case(
        draw(videos()),
        draw(displays()),
        draw(limits()),
        panel,
        draw(st.sampled_from(units)),
        draw(st.one_of(st.floats(0.05, 0.95), ends)),
        draw(st.sampled_from([0.001, 0.05, 0.2, 0.9])),
        draw(st.sampled_from(ModulatedLuminance)),
    )


def used(case: Case, curves: LossCurves, factor: float) -> float:
    """What constant dimming by a factor uses, in the unit of the budget."""
    if case.unit is BudgetUnit.FACTOR:
        return factor
    share = curves.durations / curves.durations.sum()
    watt, full = (
        float(share @ power(case.panel, np.full(curves.n_frames, b), curves.channel_means))
        for b in (factor, 1.0)
    )
    return watt if case.unit is BudgetUnit.WATT else watt / full


def analysed(case: Case) -> LossCurves:
    knots = brightness_factors(case.lowest_factor, knots=9)
    return analyze_frames(case.frames, "any", case.display, factors=knots)


def posed(case: Case, curves: LossCurves) -> tuple[Problem, Request]:
    low, high = used(case, curves, case.lowest_factor), used(case, curves, 1.0)
    budget = low + case.budget_place * (high - low)
    request = Request(budget, case.unit, case.panel, case.limit, LimitCurve.FITTED, case.modulated)
    return pose(curves, request), request


def lit(case: Case, curves: LossCurves) -> bool:
    """Whether there is any power to save: an OLED panel needs none for a black video."""
    return case.panel.kind is PanelKind.LCD or bool(curves.channel_means.any())


def header_of(request: Request) -> TrackHeader:
    return TrackHeader(
        "any", "any", "f", "p", "r", request.budget, request.budget_unit, "splitting", Provenance()
    )


@pytest.mark.slow
@settings(max_examples=30, derandomize=True)
@given(case=cases())
def test_every_result_is_one(case) -> None:
    curves = analysed(case)
    assert np.isfinite(curves.loss).all()
    assert ((curves.loss >= 0) & (curves.loss <= 1)).all()
    assert (curves.loss[:, -1] == 0).all()
    assume(lit(case, curves))
    problem, request = posed(case, curves)
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    assert is_feasible(problem, answer.factors)
    bound = lower_bound(problem, answer)
    assert bound <= problem.objective(answer.factors) + 1e-9
    factors = no_worse_than_constant(problem, answer.factors)
    track = track_of(problem, request, factors, header_of(request))
    summary = summarize(
        problem, request, SolverAnswer(bound, answer.iterations, "default"), track, RunRecord(0, 0, 0)
    )
    assert summary.lower_bound <= summary.objective
    assert summary.objective <= summary.objective_baseline + 1e-12
    assert summary.max_rate_ratio <= 1 + 1e-6
    assert abs(summary.achieved - request.budget) <= 1e-6 * (1 + request.budget)
    assert track.factors.min() >= case.lowest_factor - 1e-12
    assert track.factors.max() <= 1 + 1e-12


# Frames of a nanosecond, in which the step allowed is a few thousand roundings long: rounded to the nearest
# factor, it went beyond the limit by 1e-5 of it.
NANOSECONDS = Case(
    frames_of(["white", "black", "noise", "flat"] * 3, [1e-9, 1e-9, 1 / 25] * 4, (8, 8), 0),
    Display("any", 100.0, 0.0, 2.2, 60.0),
    RateLimit("any", "any", "", RateLimitForm.RATE, (0.05,), (1.0, 100.0)),
    PowerModel("l", PanelKind.LCD, 0.3, power_per_luminance=0.002, peak_luminance=500.0),
    BudgetUnit.FACTOR,
    0.5,
    0.2,
    ModulatedLuminance.FRAME_MEAN,
)


@pytest.mark.slow
@settings(max_examples=50, derandomize=True)
@example(case=NANOSECONDS, target=0.3, gains=(50.0, 5.0, 5.0))
@given(case=cases(), target=st.floats(0, 1), gains=st.sampled_from([(0.2, 0.01, 0.05), (50.0, 5.0, 5.0)]))
def test_the_controller_never_exceeds_the_limit(case, target, gains) -> None:
    curves = analysed(case)
    limit = scalar_rate_limit(case.limit, case.display.reflected_luminance)
    settings_of = ControllerSettings(target, *gains, lowest_factor=case.lowest_factor)
    track = control_curves(curves, Controller(settings_of, limit))
    assert ((track.factors >= case.lowest_factor) & (track.factors <= 1)).all()
    assert largest_rate_ratio(track.rate, track.rate_limit) <= 1 + 1e-6


@pytest.mark.slow
@settings(max_examples=30, derandomize=True)
@given(case=cases(), stretch=st.sampled_from([1e-3, 0.5, 2.0, 1e3]), seed=st.integers(0, 99))
def test_slower_video_under_a_slower_limit_is_the_same_problem(case, stretch, seed) -> None:
    curves = analysed(case)
    assume(lit(case, curves))
    if case.limit.form is RateLimitForm.RATE:
        scaled = tuple(c / stretch for c in case.limit.coefficients)
    else:  # ln(rate): its constant term
        scaled = (case.limit.coefficients[0] - np.log(stretch), *case.limit.coefficients[1:])
    assume(max(map(abs, scaled)) < 45)
    slow = replace(curves, times=curves.times * stretch, durations=curves.durations * stretch)
    first = posed(case, curves)[0]
    second = posed(replace(case, limit=replace(case.limit, coefficients=scaled)), slow)[0]
    factors = np.random.default_rng(seed).uniform(case.lowest_factor, 1, curves.n_frames)
    assert second.rate_ratio(factors) == pytest.approx(first.rate_ratio(factors), rel=1e-9)
    assert second.budget_error(factors) == pytest.approx(first.budget_error(factors), abs=1e-12)


@pytest.mark.slow
@settings(max_examples=12, derandomize=True)
@given(case=cases())
def test_a_video_backwards_has_the_same_tracks_backwards(case) -> None:
    # The limit of a step is over the time of its first frame, so only for frames of one length.
    frames = tuple(Frame(k / 25, 1 / 25, f.pixel_values) for k, f in enumerate(case.frames))
    case = replace(case, frames=frames)
    forwards = analysed(case)
    backwards = analysed(replace(case, frames=tuple(
        Frame(k / 25, 1 / 25, f.pixel_values) for k, f in enumerate(reversed(frames))
    )))  # fmt: skip
    np.testing.assert_array_equal(backwards.loss, forwards.loss[::-1])
    assume(lit(case, forwards))
    problem, reverse = posed(case, forwards)[0], posed(case, backwards)[0]
    answers = [
        optimize(p, make_solver(SolverName.SPLITTING, np.random.default_rng(0))) for p in (problem, reverse)
    ]
    assert is_feasible(problem, answers[1].factors[::-1])
    objectives = [p.objective(a.factors) for p, a in zip((problem, reverse), answers, strict=True)]
    # Each bound holds for both: they are one problem.
    for p, a in zip((problem, reverse), answers, strict=True):
        assert lower_bound(p, a) <= min(objectives) + 1e-9


@pytest.mark.slow
@settings(max_examples=25, derandomize=True)
@given(case=cases(), seed=st.integers(0, 99))
def test_the_order_of_identical_frames_and_their_number_do_not_matter(case, seed) -> None:
    rng = np.random.default_rng(seed)
    one = case.frames[0]
    frames = tuple(Frame(k * 0.04, 0.04, one.pixel_values) for k in range(5))
    curves = analysed(replace(case, frames=frames))
    assert np.ptp(curves.loss, axis=0).max() == 0
    np.testing.assert_array_equal(curves.loss[0], analysed(replace(case, frames=frames[:1])).loss[0])
    same = replace(case, frames=frames)
    assume(lit(same, curves))
    problem = posed(same, curves)[0]
    factors = rng.uniform(case.lowest_factor, 1, 5)
    order = rng.permutation(5)
    assert problem.objective(factors) == pytest.approx(problem.objective(factors[order]), abs=1e-15)
    answer = optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(0)))
    assert problem.objective(answer.factors) == pytest.approx(0, abs=1e-12)
    assert lower_bound(problem, answer) <= 1e-12
