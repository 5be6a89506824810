"""Level of the exact tests and coverage of the intervals for 17 pairs, by enumeration.

Tables of docs/decisions/rating-inference.md.
Run with `python benchmarks/studies/rating_coverage.py`; a minute on one core. Nothing is random.
"""

from __future__ import annotations

import numpy as np
from paired_truths import PAIRS, TRUTHS, coverage, histograms, intervals, listed, probabilities, true_effects
from scipy import stats

from evenlight.analysis.inference.exact_tests import (
    ZeroHandling,
    sign_flip_p_values,
    sign_test,
    signed_rank_test,
)
from evenlight.analysis.inference.paired_effects import (
    exact_mean_difference,
    rank_biserial,
    standardized_difference,
    superiority,
)

EFFECTS = {
    "mean": lambda differences: exact_mean_difference(differences, 1.0),
    "d_z": standardized_difference,
    "superiority": superiority,
    "rank-biserial": rank_biserial,
}


def main() -> None:
    """Print both tables."""
    counts = histograms()
    sets = listed(counts)
    p_values = {
        "sign flip": sign_flip_p_values(sets),
        "mid-p": sign_flip_p_values(sets, mid_p=True),
        "ranks, Pratt": np.array([signed_rank_test(d).p_value for d in sets]),
        "ranks, dropped": np.array([signed_rank_test(d, ZeroHandling.DROPPED).p_value for d in sets]),
        "signs": np.array([sign_test(d).p_value for d in sets]),
    }
    deviations = sets.std(axis=1, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.abs(sets.mean(axis=1)) / deviations * np.sqrt(PAIRS)
    p_values["Student's t"] = np.nan_to_num(2 * stats.t.sf(t, PAIRS - 1), nan=1.0)
    print("| P(p <= 5 %) | " + " | ".join(p_values) + " |\n|---|" + "---|" * len(p_values))
    for name, truth in TRUTHS.items():
        chances = probabilities(counts, truth)
        shares = (chances[p <= 0.05 + 1e-12].sum() for p in p_values.values())
        print(f"| {name} | " + " | ".join(f"{100 * share:.1f}" for share in shares) + " |", flush=True)
    ends = {name: intervals(sets, effect) for name, effect in EFFECTS.items()}
    half = stats.t.ppf(0.975, PAIRS - 1) * deviations / np.sqrt(PAIRS)
    means = sets.mean(axis=1)
    print("\n| coverage | " + " | ".join(ends) + " | mean, plain t |\n|---|" + "---|" * (len(ends) + 1))
    for name, truth in TRUTHS.items():
        chances, true = probabilities(counts, truth), true_effects(truth)
        shares = [coverage(ends[key], chances, true[key]) for key in ends]
        shares.append(coverage(np.column_stack([means - half, means + half]), chances, true["mean"]))
        print(f"| {name} | " + " | ".join(f"{100 * share:.1f}" for share in shares) + " |", flush=True)


if __name__ == "__main__":
    main()
