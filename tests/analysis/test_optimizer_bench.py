"""The optimizer's benchmark times its peers as it says: in turn, several times, or once and says so."""

import re

import numpy as np

from analysis.benchmarks.measured import Approach, Measured, Pains, point
from analysis.benchmarks.optimizer_peers import Family, _family_claim, _timed
from analysis.benchmarks.optimizer_problems import odd_problems
from analysis.benchmarks.page import page
from analysis.benchmarks.stopwatch import Times
from data_schema.benchmark import Role
from data_schema.errors import InputError


def test_peers_are_timed_in_turn_after_one_that_does_not_count_and_refusals_are_left_out() -> None:
    order: list[str] = []

    def missing() -> float:
        raise InputError("not installed")

    def run(name: str) -> float:
        order.append(name)
        return len(order)

    runs = {name: (lambda name=name: run(name), Role.PEER) for name in ("ours", "peer")}
    refused: dict[str, str] = {}
    times, found = _timed({**runs, "absent": (missing, Role.PEER)}, 2, refused)
    assert order == ["ours", "peer"] * 3
    assert len(times["peer"].wall) == 2
    np.testing.assert_array_equal(times["peer"].ratio, times["peer"].wall / times["ours"].wall)
    assert set(found) == {"ours", "peer"}
    assert refused == {"absent": "not installed"}


def test_the_page_says_how_often_each_was_timed_and_gives_one_run_no_quartiles() -> None:
    about = Approach("a task", "ours", Role.DEFAULT, 10, "frames")
    often = point(about, Times(np.array([1.0, 2.0, 3.0]), np.ones(3), np.ones(3)))
    once = point(about, Times(np.array([5.0]), np.ones(1), np.ones(1)))
    text = page({}, [Measured("optimizer", "Optimizer", "", (often, once), ())], False, "")
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
    monkeypatch.setattr("analysis.benchmarks.optimizer_peers.best_of", lambda *_: 0.0)
    missed = _family_claim(Pains(quick=True), Family((2, 3), 2, 1))
    assert not missed.met
    assert missed.measured > 0.01
    assert "worse on" in missed.note
