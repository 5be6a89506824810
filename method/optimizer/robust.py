"""A track that is good by several measures of loss: the worst of them is as small as can be found.

Each measure's objective counts as a share of its own at constant dimming. The worst share is the largest
blend of the shares; for given weights it is minimized by the splitting of `optimizer.splitting_search`,
with targets and dual variables for each measure and one chain for all. The weights move towards the measures
that are worst off meanwhile (multiplicative weights; Freund & Schapire 1999, Games Econ. Behav. 29:79).
Whatever the weights, what no track can go below by their blend, the worst cannot either: that is the
certificate, from the duals of all measures as in `optimizer.lower_bound`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.optimization_summary import MinimizedOutcome
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.optimizer.lower_bound import (
    ROUNDING_OF_LOSS,
    bound_of_costs,
    checked_bound,
    dual_weights,
    lower_bound,
)
from evenlight.method.optimizer.optimize import (
    Problem,
    Solution,
    Solver,
    feasible_blend,
    is_feasible,
    optimize,
)
from evenlight.method.optimizer.splitting_search import (
    SearchStage,
    chained,
    moved,
    pull,
    rebalanced,
    state_at,
)

# Stages, with how many iterations each takes; in the last one the weights stay, so that the duals settle.
LEARNING = (SearchStage(1.0, 40, 0.1), SearchStage(0.125, 40, 0.1), SearchStage(0.0, 60, 0.1))
SETTLING = SearchStage(0.0, 30, 0.03)
EAGERNESS = 2.0  # of the first steps of the weights
SLOWING = 20  # iterations after which their steps are half as large
LEAST_WEIGHT = 1e-4  # of a measure
LEAST_BASELINE = 1e-6  # of loss: what differs by less at constant dimming, differs by rounding


@dataclass(frozen=True, slots=True)
class Measures:
    """The same problem by several measures of loss.

    Attributes
    ----------
    problems : tuple of Problem
        Alike but for the losses.
    """

    problems: tuple[Problem, ...]

    def __post_init__(self) -> None:
        if len(self.problems) < 2:
            raise InputError(f"a robust track needs two measures or more, got {len(self.problems)}")

    def baselines(self) -> Array:
        """Return the objective of constant dimming by each measure, (M,)."""
        found = [problem.objective(problem.baseline()) for problem in self.problems]
        return np.maximum(found, LEAST_BASELINE)

    def shares(self, factors: Array) -> Array:
        """Return the objective by each measure as a share of that of constant dimming, (M,)."""
        return np.array([problem.objective(factors) for problem in self.problems]) / self.baselines()

    def worst(self, factors: Array) -> float:
        """Return the largest of these shares."""
        return float(self.shares(factors).max())

    def outcome(
        self, names: Sequence[str], factors: Array, bound: float, bounds: Sequence[float]
    ) -> tuple[MinimizedOutcome, tuple[MinimizedOutcome, ...]]:
        """Return what factors achieve, (N,), by the worst measure and by each; bounds are checked to be some.

        The bounds are those of `optimize_robustly`, the factors its own or calmer ones.
        """
        baseline, found = self.problems[0].baseline(), []
        for name, problem, own in zip(names, self.problems, bounds, strict=True):
            ours, constant = (problem.value(loss_at(problem.curves, b)) for b in (factors, baseline))
            checked = checked_bound(own, problem.objective(factors))
            found.append(MinimizedOutcome(name, ours, constant, min(checked, ours)))
        bound = checked_bound(bound, self.worst(factors), ROUNDING_OF_LOSS / float(self.baselines().min()))
        worst = max(one.value / max(one.baseline, LEAST_BASELINE) for one in found)
        name = f"worst of {', '.join(names)}"
        return MinimizedOutcome(name, worst, self.worst(baseline), min(bound, worst)), tuple(found)


def optimize_robustly(measures: Measures, solver: Solver) -> tuple[Solution, float, tuple[float, ...]]:
    """Return the track found whose worst measure is best, and bounds on what any could reach.

    Parameters
    ----------
    measures : Measures
        The problem by each measure.
    solver : Solver
        For each measure alone: where the search begins.

    Returns
    -------
    solution : Solution
        Its iterations are of all searches.
    bound : float
        What no track's worst share can be below; above the share of this one by rounding at most.
    bounds : tuple of float
        What no track's objective can be below, by each measure.
    """
    problems = measures.problems
    alone = [optimize(problem, solver) for problem in problems]
    bounds = tuple(lower_bound(p, answer) for p, answer in zip(problems, alone, strict=True))
    middle = feasible_blend(problems[0], np.mean([answer.factors for answer in alone], axis=0))
    tried = [problems[0].baseline(), middle, *(answer.factors for answer in alone)]
    bound = float((np.array(bounds) / measures.baselines()).max())
    iterations = sum(answer.iterations for answer in alone)
    if problems[0].leaves_a_choice:
        search = _JointSearch(measures, middle)
        tried.append(search.best)
        bound, iterations = max(bound, search.bound()), iterations + search.iterations
    best = min((b for b in tried if is_feasible(problems[0], b)), key=measures.worst)
    return Solution(best, iterations), bound, bounds


class _JointSearch:
    """The splitting for a blend of measures whose weights follow the worst."""

    def __init__(self, measures: Measures, start: Array) -> None:
        self._measures, self._baselines = measures, measures.baselines()
        self._states = [state_at(problem, start) for problem in measures.problems]
        self._weights = np.full(len(self._states), 1 / len(self._states))
        self.best, self._worst = start, measures.worst(start)
        self.iterations = 0
        recent = np.zeros_like(self._weights)
        for stage in LEARNING:
            for _ in range(stage.patience):
                self._advance(stage)
                self._learn()
                recent += self._weights if stage.reach == 0 else 0.0
        self._weights = recent / recent.sum()
        for _ in range(SETTLING.patience):
            self._advance(SETTLING)

    def bound(self) -> float:
        """Return what no track's worst share can be below, by the dual variables of all measures."""
        counts, scale = self._counts()
        first, costs = self._measures.problems[0], np.zeros_like(self._measures.problems[0].curves.loss)
        for problem, state, counted in zip(self._measures.problems, self._states, counts, strict=True):
            density = state.stiffness * problem.frame_importance() * state.dual / counted
            weights = dual_weights(problem, Solution(state.factors, 0, density))
            costs += counted * weights[:, None] * problem.curves.loss
        n = first.curves.n_frames
        known = float(self._weights @ self._measures.shares(self.best)) / scale * first.size() / n
        least = bound_of_costs(first, costs, self._states[0].price * n, known)
        return max(scale * n / first.size() * least, 0.0)

    def _counts(self) -> tuple[Array, float]:
        """Return how much each measure's objective counts, 1 on average, and what was divided out."""
        parts = self._weights / self._baselines
        return parts / parts.mean(), float(parts.mean())

    def _learn(self) -> None:
        shares = self._measures.shares(self._states[0].factors)
        eagerness = EAGERNESS / (1 + self.iterations / SLOWING)
        weights = self._weights * np.exp(eagerness * (shares - shares.max()) / max(shares.mean(), 1e-9))
        weights = np.maximum(weights / weights.sum(), LEAST_WEIGHT)
        self._weights = weights / weights.sum()

    def _advance(self, stage: SearchStage) -> None:
        problems, first = self._measures.problems, self._measures.problems[0]
        pulls = [pull(problem, state, stage) for problem, state in zip(problems, self._states, strict=True)]
        drawn = np.sum([p[0] for p in pulls], axis=0), np.sum([p[1] for p in pulls], axis=0)
        factors, price = chained(first, self._states[0], drawn, stage)
        counts, _ = self._counts()
        self._states = [
            moved(problem, state, factors, price, counted)
            for problem, state, counted in zip(problems, self._states, counts, strict=True)
        ]
        self.iterations += 1
        if self.iterations % 10 == 0:
            self._states = [rebalanced(state) for state in self._states]
        worst = self._measures.worst(factors)
        if worst < self._worst and is_feasible(first, factors):
            self.best, self._worst = factors, worst
