"""The optimizer's benchmark times its peers as it says: in turn, several times, or once and says so."""

import numpy as np

from benchmarks.measured import Approach, RunSettings, SubjectResults, point
from benchmarks.optimizer_lengths import (
    CERTIFIED,
    LENGTH_TASK,
    RENDERED,
    TrackQuality,
    length_claims,
    target_points,
)
from benchmarks.optimizer_peers import Family, _family_claim, _timed, best_of
from benchmarks.optimizer_problems import odd_problems, some_frames
from benchmarks.page import page
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import Times
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.method.optimizer.optimize import Problem, optimize
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.preset_files import load_display


def test_peers_are_timed_in_turn_after_a_turn_that_does_not_count() -> None:
    order: list[str] = []

    def run(name: str) -> float:
        order.append(name)
        return len(order)

    runs = {name: (lambda name=name: run(name), Role.PEER) for name in ("ours", "peer")}
    times, found = _timed(runs, 2)
    assert order == ["ours", "peer"] * 3
    assert len(times["peer"].wall) == 2
    np.testing.assert_array_equal(times["peer"].ratio, times["peer"].wall / times["ours"].wall)
    assert set(found) == {"ours", "peer"}


def test_the_page_says_how_often_each_was_timed_and_which_is_the_default() -> None:
    about = Approach("a task", "ours", Role.DEFAULT, 10, "frames")
    often = point(about, Times(np.array([1.0, 2.0, 3.0]), np.ones(3), np.ones(3)))
    once = point(about, Times(np.array([5.0]), np.ones(1), np.ones(1)))
    text = page({}, [SubjectResults("optimizer", "Optimizer", "", (often, once), ())], False, "")
    rows = [[cell.strip() for cell in row.split("|")] for row in text.splitlines() if row.startswith("|")]
    runs = rows[0].index("runs")
    assert [row[runs] for row in rows[2:]] == ["3", "1"]
    assert rows[2][rows[0].index("approach")] == "**ours**"
    assert "its number of runs is 1" in text


def test_of_tasks_that_differ_in_the_size_of_the_frame_the_page_shows_the_largest() -> None:
    times = Times(np.array([1.0]), np.ones(1), np.ones(1))
    tasks = ("a frame of 640 x 360", "a frame of 1920 x 1080", "3000 frames", "100 frames")
    points = tuple(point(Approach(t, "a way", Role.PEER, 10, "pixels"), times) for t in tasks)
    text = page({}, [SubjectResults("curves", "Curves", "", points, ())], False, "")
    headings = [line for line in text.splitlines() if line.startswith("### ")]
    assert headings == ["### A frame of 1920 x 1080", "### 3000 frames", "### 100 frames"]
    assert "| a way (peer) |" in text


def test_a_family_on_which_slsqp_finds_better_is_missed_and_says_by_how_much(monkeypatch) -> None:
    monkeypatch.setattr("benchmarks.optimizer_peers.best_of", lambda *_: 0.0)
    missed = _family_claim(RunSettings(quick=True), Family((2, 3), 2, 1))
    assert not missed.met
    assert missed.measured > 0.01
    assert "worse on" in missed.note


def _identifiable(problems: list[Problem]) -> tuple[Problem, Problem, Problem, Problem]:
    """Return the problem with weights, with allowances, with an OLED budget, and the last one."""
    weighted = next(p for p in problems if p.importance is not None)
    allowed = next(p for p in problems if (p.allowances == 0).any())
    oled = next(p for p in problems if np.ptp(p.budget_weights) > 1e-9)
    return weighted, allowed, oled, problems[-1]


def test_ours_is_no_worse_than_slsqp_where_frames_have_weights_or_allowances_or_an_oled_budget() -> None:
    for problem in _identifiable(odd_problems(np.random.default_rng(9), (8, 12), 4))[:3]:
        base = problem.objective(problem.baseline())
        ours = optimize(problem, SplittingSolver()).factors
        assert problem.rate_ratio(ours) <= 1 + 1e-6
        assert problem.objective(ours) <= best_of(problem, 2, 1) + 1e-6 * base


def test_of_some_frames_each_is_shown_until_the_next() -> None:
    pixels = np.random.default_rng(2).integers(0, 256, (4, 16, 16, 3), np.uint8)
    frames = [Frame(0.2 * k, 0.2, each) for k, each in enumerate(pixels)]
    curves = analyze_frames(frames, "noise", load_display("varjo-xr3"))
    some = some_frames(curves, np.array([0, 2]))
    np.testing.assert_allclose(some.durations, 0.4)
    np.testing.assert_array_equal(some.loss, curves.loss[[0, 2]])


def timed_point(name: str, frames: int, seconds: float, processor: float) -> BenchmarkPoint:
    times = Times(np.array([seconds]), np.array([processor]), np.ones(1))
    return point(Approach(LENGTH_TASK, name, Role.DEFAULT, frames, "frames"), times)


def test_the_claims_on_3000_frames_and_on_limits_take_the_worse_of_made_and_rendered() -> None:
    made, rendered = timed_point(CERTIFIED, 3000, 0.4, 0.5), timed_point(RENDERED, 3000, 0.6, 1.2)
    targets = target_points([made], rendered)
    worse, better = TrackQuality(0.9, 1.2, 1e-3), TrackQuality(0.1, 1.0, 0.0)
    for first, other in ((worse, better), (better, worse)):
        time, rate, budget, bound = length_claims(targets, {3000: first}, other)
        assert (time.measured, time.met) == (1.2, False)
        assert "rendered sunrise" in time.note
        np.testing.assert_allclose((rate.measured, budget.measured), (0.2, 1e-3))
        assert bound.measured == first.gap
