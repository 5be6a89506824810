"""How often the tests and intervals of the cumulative-link mixed model err, for 17 participants.

    python benchmarks/studies/ordinal_levels.py [runs]

prints the table of docs/decisions/cumulative-link-model.md: a row for each truth, with the error of the first
kind of the test (no effect) and the coverage of the interval (an effect).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from studies import Mapped, run_study

from evenlight.analysis.inference.cumulative_link import OrdinalData, fit_ordinal
from evenlight.analysis.inference.fixed_effects import FixedEffect

CUT_POINTS = (-3.0, -1.2, 0.4, 2.4)  # of ratings 1 to 5: 8, 20, 30, 29 and 14 % with participants of SD 1
SEQUENCES = (0.0, 0.8, -0.5, 0.3)  # log-odds
PARTICIPANTS = 17


@dataclass(frozen=True, slots=True)
class OrdinalTruth:
    """What is true of simulated answers: 17 participants, 4 sequences, 2 versions unless said otherwise.

    Attributes
    ----------
    effect : float
        Of the version, the group, or the intercept [log-odds].
    tested : str
        Which of them: "version", "group" (half of the people), "sequence" (the second), or "intercept" (of
        two categories).
    group_sd, slope_sd : float
        Between participants, of intercept and version [log-odds].
    random_slope : bool
        Whether the model fitted has the slope.
    """

    effect: float
    tested: str = "version"
    group_sd: float = 1.0
    slope_sd: float = 0.0
    random_slope: bool = False


TRUTHS = {
    "version, everybody alike": OrdinalTruth(0.0),
    "version, slopes differ (SD 0.8), ignored": OrdinalTruth(0.0, slope_sd=0.8),
    "version, slopes differ (SD 1.5), ignored": OrdinalTruth(0.0, slope_sd=1.5),
    "version with random slope, everybody alike": OrdinalTruth(0.0, random_slope=True),
    "version with random slope, SD 0.8": OrdinalTruth(0.0, slope_sd=0.8, random_slope=True),
    "version with random slope, SD 1.5": OrdinalTruth(0.0, slope_sd=1.5, random_slope=True),
    "the same, effect 1": OrdinalTruth(1.0, slope_sd=0.8, random_slope=True),
    "the same, effect 2, SD 0": OrdinalTruth(2.0, random_slope=True),
    "sequence (effect 0.8)": OrdinalTruth(0.8, tested="sequence"),
    "half of the people": OrdinalTruth(0.0, tested="group"),
    "intercept of 4 choices each, SD 0": OrdinalTruth(0.0, tested="intercept", group_sd=0.0),
    "intercept, SD 0.5": OrdinalTruth(0.0, tested="intercept", group_sd=0.5),
    "intercept, SD 1.5": OrdinalTruth(0.0, tested="intercept", group_sd=1.5),
    "intercept 0.85 (70 %), SD 0.5": OrdinalTruth(0.85, tested="intercept", group_sd=0.5),
}


def simulated_answers(truth: OrdinalTruth, rng: np.random.Generator) -> OrdinalData:
    """Return the answers of 17 simulated participants."""
    if truth.tested == "intercept":
        groups = np.repeat(np.arange(PARTICIPANTS), len(SEQUENCES))
        eta = truth.effect + truth.group_sd * rng.standard_normal(PARTICIPANTS)[groups]
        chosen = eta + rng.logistic(size=groups.size) > 0
        return OrdinalData(chosen.astype(np.int64), 2, np.zeros((groups.size, 0)), (), groups)
    groups, sequence, version = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(PARTICIPANTS), np.arange(4), [-0.5, 0.5], indexing="ij")
    )
    half = (groups % 2 - 0.5).astype(np.float64)
    effects = {"version": truth.effect * version, "group": truth.effect * half, "sequence": 0.0 * half}
    own = truth.slope_sd * rng.standard_normal(PARTICIPANTS)[groups] * version
    person = truth.group_sd * rng.standard_normal(PARTICIPANTS)[groups]
    eta = effects[truth.tested] + own + person + np.array(SEQUENCES)[sequence]
    latent = eta + rng.logistic(size=groups.size)
    dummies = [(sequence == k).astype(np.float64) for k in range(1, 4)]
    columns = {"version": version, "sequence": dummies[0], "third": dummies[1], "fourth": dummies[2]}
    if truth.tested == "group":
        columns["group"] = half
    return OrdinalData(
        responses=(latent[:, None] > np.array(CUT_POINTS)).sum(axis=1).astype(np.int64),
        n_categories=5,
        design=np.column_stack(list(columns.values())),
        names=tuple(columns),
        groups=groups,
        slope_column=0 if truth.random_slope else None,
    )


def fitted_effect(truth: OrdinalTruth, data: OrdinalData) -> FixedEffect:
    """Return the effect in question as it was fitted."""
    fit = fit_ordinal(data, profiled=(truth.tested,))
    if truth.tested == "intercept":
        assert fit.intercept is not None
        return fit.intercept
    return next(effect for effect in fit.effects if effect.name == truth.tested)


def covers(effect: FixedEffect, truth: float) -> bool:
    """Return whether an interval holds the truth; an end that is missing has no bound."""
    low = -np.inf if effect.ci_low is None else effect.ci_low
    high = np.inf if effect.ci_high is None else effect.ci_high
    return bool(low <= truth <= high)


def covered(truth: OrdinalTruth, runs: int, seed: int) -> tuple[int, list[float]]:
    """Return how many of so many intervals hold the truth, and the estimates there are."""
    rng = np.random.default_rng(seed)
    effects = [fitted_effect(truth, simulated_answers(truth, rng)) for _ in range(runs)]
    estimates = [effect.estimate for effect in effects if effect.estimate is not None]
    return sum(covers(effect, truth.effect) for effect in effects), estimates


def main(runs: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print(f"| truth | misses of {runs} | ± | median estimate |\n|---|---|---|---|")
    cases = mapped(partial(covered, runs=runs, seed=17), TRUTHS.values())
    for name, (held, estimates) in zip(TRUTHS, cases, strict=True):
        share = 1 - held / runs
        error = np.sqrt(share * (1 - share) / runs)
        print(f"| {name} | {share:.1%} | {error:.1%} | {np.median(estimates):.2f} |", flush=True)


if __name__ == "__main__":
    run_study(__file__, runs=2000)
