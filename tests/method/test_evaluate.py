"""Of a summary: a bound that is none is refused; of an answer: what misses the budget is, too."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, TrackHeader
from evenlight.method.optimizer.evaluate import RunRecord, SolverAnswer, summarize, track_of
from evenlight.method.optimizer.lower_bound import lower_bound
from evenlight.method.optimizer.optimize import Problem, Solution, optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.preset_files import load_power_model, load_rate_limit


@pytest.fixture
def summary_with(make_curves):
    """A function that summarizes an answer with a lower bound that is given as a share of the objective."""
    curves = make_curves([0.2, 0.3, 0.5, 0.6], luminance=30.0, frames_per_second=5.0)
    limit = load_rate_limit("surace2025")
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), limit)
    problem = pose(curves, request)
    factors = problem.baseline()
    header = TrackHeader("v", "d", "f", "p", "r", 0.5, BudgetUnit.FACTOR, "splitting", Provenance())
    track = track_of(problem, request, factors, header)

    def summary(share):
        bound = problem.objective(factors) * share
        return summarize(problem, request, SolverAnswer(bound, 1, "default"), track, RunRecord(0, 0, 0))

    return summary


@pytest.mark.parametrize("share", [1.0001, 2.0, np.inf])
def test_a_bound_above_the_objective_of_an_answer_is_refused(summary_with, share) -> None:
    with pytest.raises(RuntimeError, match=r"lower bound .* is above .*, which an answer has"):
        summary_with(share)


def test_a_bound_above_the_objective_by_rounding_counts_as_the_objective(summary_with) -> None:
    summary = summary_with(1 + 1e-13)
    assert summary.lower_bound == summary.objective
    assert summary_with(0.5).lower_bound == pytest.approx(0.5 * summary.objective)


@dataclass(frozen=True)
class OffTheBudget:
    """A solver whose answer uses more, or less, than the budget."""

    by: float

    def solve(self, problem: Problem) -> Solution:
        answer = SplittingSolver().solve(problem)
        return replace(answer, factors=answer.factors + self.by)


@pytest.mark.slow
def test_an_answer_is_held_to_the_budget_that_the_bound_covers(make_curves, make_problem) -> None:
    problem = make_problem(make_curves(np.linspace(0.2, 0.3, 4), luminance=30.0), 0.5)
    for by in (1e-7, -1e-7):
        with pytest.raises(RuntimeError, match="broke: budget"):
            optimize(problem, OffTheBudget(by))
    answer = optimize(problem, OffTheBudget(5e-10))
    assert lower_bound(problem, answer) <= problem.objective(answer.factors)
