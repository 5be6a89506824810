"""The optimizer's benchmark times its peers as it says: in turn, several times, or once and says so."""

import re

import numpy as np

from benchmarks.measured import Approach, RunSettings, SubjectResults, point
from benchmarks.optimizer_lengths import (
    CERTIFIED,
    LENGTH_TASK,
    OPTIMIZED,
    RENDERED,
    TrackQuality,
    growth_claim,
    length_claims,
    target_points,
)
from benchmarks.optimizer_peers import Family, _family_claim, _timed, best_of
from benchmarks.optimizer_problems import keep_made, made_curves, odd_problems, solve_kept
from benchmarks.page import page
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import Times
from evenlight.method.optimizer.optimize import Problem, Solution, optimize
from evenlight.method.optimizer.splitting import SplittingSolver


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


def test_the_page_says_how_often_each_was_timed_and_gives_one_run_no_quartiles() -> None:
    about = Approach("a task", "ours", Role.DEFAULT, 10, "frames")
    often = point(about, Times(np.array([1.0, 2.0, 3.0]), np.ones(3), np.ones(3)))
    once = point(about, Times(np.array([5.0]), np.ones(1), np.ones(1)))
    text = page({}, [SubjectResults("optimizer", "Optimizer", "", (often, once), ())], False, "")
    rows = [[cell.strip() for cell in row.split("|")] for row in text.splitlines() if row.startswith("|")]
    runs, quartiles = rows[0].index("runs"), rows[0].index("quartiles")
    assert [row[runs] for row in rows[2:]] == ["3", "1"]
    assert re.search("to", rows[2][quartiles])
    assert rows[3][quartiles] == ""
    assert "its number of runs is 1" in text


def test_a_family_has_the_sizes_it_names_and_its_last_curves_rise() -> None:
    problems = odd_problems(np.random.default_rng(3), (61, 70), 4)
    assert all(61 <= problem.curves.n_frames <= 70 for problem in problems)
    assert (np.diff(problems[-1].curves.loss) > 0.1).any()
    assert not (np.diff(problems[-2].curves.loss) > 0).any()


def test_a_family_on_which_slsqp_finds_better_is_missed_and_says_by_how_much(monkeypatch) -> None:
    monkeypatch.setattr("benchmarks.optimizer_peers.best_of", lambda *_: 0.0)
    missed = _family_claim(RunSettings(quick=True), Family((2, 3), 2, 1))
    assert not missed.met
    assert missed.measured > 0.01
    assert "worse on" in missed.note


def test_of_four_problems_one_has_weights_one_allowances_one_an_oled_budget_and_the_last_nothing() -> None:
    weighted, allowed, oled, plain = _identifiable(odd_problems(np.random.default_rng(4), (12, 12), 4))
    assert set(np.round(weighted.importance / weighted.importance.max(), 9)) == {0.0, 0.2, 1.0}
    steps = np.unique(allowed.allowances / allowed.allowances[5])  # the middle third goes by the limit itself
    np.testing.assert_allclose(steps, [0.0, 1.0, 3.0])
    bright = oled.curves.channel_means @ [1.0, 0.6, 1.4]
    np.testing.assert_allclose(oled.budget_weights, bright / bright.sum())  # frames are equally long
    assert plain.importance is None


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


def test_a_family_with_fewer_starts_than_ten_says_so_and_all_say_their_sizes(monkeypatch) -> None:
    monkeypatch.setattr("benchmarks.optimizer_peers.best_of", lambda *_: 1.0)
    few = odd_problems(np.random.default_rng(1), (3, 3), 1)
    monkeypatch.setattr("benchmarks.optimizer_peers.odd_problems", lambda *_: few)
    note = _family_claim(RunSettings(quick=True), Family((2, 400), 1, 3)).note
    assert "3 starts, not 10, for want of time" in note
    assert "the splitting and the grid alone" in note
    assert "of 3 to 3 frames" in note
    assert "starts, not" not in _family_claim(RunSettings(quick=True), Family((2, 60), 1, 10)).note


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


def test_the_claim_on_growth_says_what_it_is_over_the_last_step_alone() -> None:
    lengths = [
        timed_point(name, n, fixed + n**1.0 * 1e-4, 1.0)
        for name, fixed in ((OPTIMIZED, 0.0), (CERTIFIED, 10.0))
        for n in (1000, 10_000, 100_000)
    ]
    grown, claimed = growth_claim(lengths)
    last = np.log10((10 + 10) / (10 + 1))
    np.testing.assert_allclose(grown[0].exponent, 1.0)
    np.testing.assert_allclose(claimed.measured, 1.0)
    assert f"from 10000 to 100000 frames alone it is 1 and {last:.3g}" in claimed.note


def test_curves_kept_for_another_process_are_those_that_were_made(tmp_path, monkeypatch) -> None:
    curves, seen = made_curves(20, np.random.default_rng(2)), []

    def look_at(problem: Problem, solver: SplittingSolver) -> Solution:
        seen.append(problem.curves)
        return Solution(problem.baseline(), 0)

    monkeypatch.setattr("benchmarks.optimizer_problems.optimize", look_at)
    keep_made(curves, tmp_path / "made.npz")
    solve_kept(str(tmp_path / "made.npz"))
    for name in ("loss", "factors", "times", "durations", "mean_luminance", "channel_means"):
        np.testing.assert_allclose(getattr(seen[0], name), getattr(curves, name), rtol=1e-15, atol=0)
