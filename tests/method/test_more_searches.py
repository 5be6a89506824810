"""More searches above 600 frames: none leads to a worse answer, and where frames differ some to a better."""

import numpy as np
import pytest

from benchmarks.optimizer_problems import made_curves, mean_factor_problem
from evenlight.method.optimizer.optimize import is_feasible, optimize
from evenlight.method.optimizer.splitting import LONG, MEDIUM, SETTLED, SplittingSolver


@pytest.mark.slow
def test_more_searches_are_no_worse_and_the_default_takes_more_than_one() -> None:
    problem = mean_factor_problem(made_curves(LONG + 20, np.random.default_rng(3), 0.5), 0.5)
    answers = [optimize(problem, SplittingSolver(searches=k)).factors for k in (1, 2, 3)]
    objectives = [problem.objective(factors) for factors in answers]
    assert all(is_feasible(problem, factors) for factors in answers)
    assert objectives == sorted(objectives, reverse=True)
    assert LONG + 20 <= MEDIUM <= SETTLED
    best = problem.objective(optimize(problem, SplittingSolver()).factors)
    assert best == objectives[2] < objectives[0] * 0.999
