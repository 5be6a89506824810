"""How often the tests and intervals of the artifact comparison err: docs/decisions/comparison-inference.md.

Run with `python benchmarks/studies/comparison_levels.py [EXPERIMENTS]`; 10 000 take about two minutes without
the mixed model, of which a twentieth as many are fitted (about ten minutes more).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import special
from studies import Mapped, run_study

from evenlight.analysis.comparison.comparison_results import choice_model
from evenlight.analysis.comparison.comparison_shares import Choices, estimate_share
from evenlight.analysis.inference.binomial_tests import difference_power, equivalence_power, interval_coverage
from evenlight.analysis.plans.questions import ComparisonTruth
from evenlight.analysis.plans.viewing_plan import person_in_the_middle
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.viewing import ComparisonTrial

PEOPLE, SEQUENCES, MARGIN, SEED = 17, 4, 0.15, 7
SPREADS = (0.0, 0.5, 1.0)  # of the log-odds of choosing ours, between people
SHARES = (0.5, 0.65, 0.8)
EVERYWHERE, MIDDLE = np.linspace(0.001, 0.999, 999), np.linspace(0.2, 0.8, 601)


@dataclass(frozen=True, slots=True)
class Rates:
    """How often a true share is told as it should not be, and how often the interval holds it."""

    difference: float
    equivalence: float
    coverage: float
    unknown: float


def drawn_counts(truth: ComparisonTruth, share: float, runs: int, seed: int) -> NDArray[np.int64]:
    """Return how often each of 17 people chose ours, (runs, people), all sequences together."""
    rng = np.random.default_rng([seed, int(1000 * share), int(1000 * truth.spread), truth.repetitions])
    odds = person_in_the_middle(share, truth.spread) + truth.spread * rng.standard_normal((runs, PEOPLE))
    return rng.binomial(truth.sequences * truth.repetitions, special.expit(odds))


def pooled_rates(truth: ComparisonTruth, share: float, runs: int, seed: int) -> Rates:
    """Return the rates of what is told of all answers together, at a true share."""
    answers = np.full(PEOPLE, truth.sequences * truth.repetitions)
    people = tuple(f"{k:02d}" for k in range(PEOPLE))
    found = [
        estimate_share(Choices(people, chosen, answers), truth.margin)
        for chosen in drawn_counts(truth, share, runs, seed)
    ]
    intervals = [
        (one.difference.ci_low, one.difference.ci_high) for one in found if one.difference.ci_low is not None
    ]
    return Rates(
        difference=float(np.mean([one.difference.p_value <= 0.05 for one in found])),
        equivalence=float(np.mean([one.equivalent for one in found])),
        coverage=float(np.mean([low <= share <= high for low, high in intervals])),
        unknown=1 - len(intervals) / runs,
    )


def trials_of(chosen: NDArray[np.int64], answers: int) -> Iterator[ComparisonTrial]:
    """Yield trials in which each person chose ours so often, ours first in every other."""
    for person, count in enumerate(chosen.tolist()):
        for k in range(answers):
            first = (person + k) % 2 == 0
            yield ComparisonTrial(
                f"{person:02d}", "01", k, f"s{k % SEQUENCES}", 1 + k // SEQUENCES, 1 if first else 2, 0.5,
                0.5, Response.FIRST if (k < count) == first else Response.SECOND, None, True,
            )  # fmt: skip


def model_rates(truth: ComparisonTruth, share: float, runs: int, seed: int) -> tuple[float, float]:
    """Return how often the mixed model finds a difference, and how often its interval holds the truth."""
    middle = person_in_the_middle(share, truth.spread)
    answers = truth.sequences * truth.repetitions
    different, held = 0, 0
    for chosen in drawn_counts(truth, share, runs, seed):
        effect = choice_model(tuple(trials_of(chosen, answers))).intercept
        assert effect is not None
        different += effect.p_value is not None and effect.p_value <= 0.05
        low = -np.inf if effect.ci_low is None else effect.ci_low
        high = np.inf if effect.ci_high is None else effect.ci_high
        held += low <= middle <= high
    return different / runs, held / runs


def main(runs: int, mapped: Mapped = map) -> None:
    """Print the tables."""
    print("exact, by enumeration, one answer of each; coverage for shares of 0.2 to 0.8: least, mean, most\n")
    print("| answers | type I | at the margin | Clopper-Pearson | mid-p | mid-p, least of all shares |")
    print("|---|---|---|---|---|---|")
    for n in (17, 34, 68):
        cells = []
        for mid_p in (False, True):
            coverage = interval_coverage(n, MIDDLE, mid_p)
            cells.append(f"{coverage.min():.1%}, {coverage.mean():.1%}, {coverage.max():.1%}")
        least = interval_coverage(n, EVERYWHERE, True).min()
        errors = float(difference_power(n, 0.5)), float(equivalence_power(n, 0.5 + MARGIN, MARGIN))
        print(f"| {n} | {errors[0]:.1%} | {errors[1]:.1%} | {cells[0]} | {cells[1]} | {least:.1%} |")
    print(f"\n17 people, all sequences together, {runs} experiments\n")
    print("| repetitions | spread | share | differs | equivalent | coverage | no interval |\n|" + "---|" * 7)
    asked = [
        (ComparisonTruth(0.9, MARGIN, spread, repetitions, SEQUENCES), share)
        for repetitions, spread, share in product((1, 4), SPREADS, SHARES)
    ]
    rates = mapped(partial(pooled_rates, runs=runs, seed=SEED), *zip(*asked, strict=True))
    for (truth, share), r in zip(asked, rates, strict=True):
        print(f"| {truth.repetitions} | {truth.spread} | {share} | {r.difference:.1%} | "
              f"{r.equivalence:.1%} | {r.coverage:.1%} | {r.unknown:.1%} |", flush=True)  # fmt: skip
    fits = max(runs // 20, 1)
    print(f"\nmixed model, {fits} fits\n\n| spread | share | differs | coverage |\n|---|---|---|---|")
    asked = [(ComparisonTruth(0.9, MARGIN, spread), share) for spread, share in product(SPREADS, SHARES)]
    found = mapped(partial(model_rates, runs=fits, seed=SEED), *zip(*asked, strict=True))
    for (truth, share), (different, held) in zip(asked, found, strict=True):
        print(f"| {truth.spread} | {share} | {different:.1%} | {held:.1%} |", flush=True)


if __name__ == "__main__":
    run_study(__file__, runs=10_000)
