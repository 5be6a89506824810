"""How often the interval of a share found holds the truth, if people differ.

Figures in docs/decisions/search-inference.md. Counts are beta-binomial, so that the intra-class correlation
is what it says. Run with `python benchmarks/studies/found_share_coverage.py [SETS]`; 2000 sets of each take
some minutes.
"""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
from studies import Mapped, run_study

from evenlight.analysis.search.search_pairs import clustered_share

PEOPLE = (2, 5, 10, 17)
CORRELATIONS = (0.0, 0.05, 0.3, 0.7, 0.97)
SHARES = (0.01, 0.05, 0.2, 0.5, 0.95, 0.99)
SEARCHES = 21
SEED = 5


def drawn_counts(
    people: int, correlation: float, share: float, sets: int, rng: np.random.Generator
) -> np.ndarray:
    """Return how many of 21 rings each person found, (sets, people)."""
    own = np.full((sets, people), share)
    if correlation:
        spread = (1 - correlation) / correlation
        own = rng.beta(spread * share, spread * (1 - share), (sets, people))
    return rng.binomial(SEARCHES, np.clip(own, 0.0, 1.0))


def coverage(people: int, correlation: float, share: float, sets: int) -> tuple[float, float]:
    """Return how often the interval holds the share, and its mean width."""
    rng = np.random.default_rng([SEED, people, round(100 * correlation), round(100 * share)])
    counts, place = np.unique(
        np.sort(drawn_counts(people, correlation, share, sets, rng), axis=1), axis=0, return_inverse=True
    )
    who = np.repeat(np.arange(people), SEARCHES)
    ends = []
    for row in counts:
        found = clustered_share((np.arange(SEARCHES) < row[:, None]).ravel(), who)
        ends.append((found.ci_low, found.ci_high))
    low, high = np.array(ends, dtype=np.float64)[place.reshape(-1)].T
    return float(np.mean((low <= share) & (share <= high))), float(np.mean(high - low))


def row_of(sets: int, people: int, share: float) -> tuple[int, float, list[tuple[float, float]]]:
    """Return so many people and a share, with coverage and width for each correlation."""
    return people, share, [coverage(people, correlation, share, sets) for correlation in CORRELATIONS]


def main(sets: int, mapped: Mapped = map) -> None:
    """Print the table: the least coverage over the correlations, and where."""
    print(f"{sets} sets of each\n| people | share | " + " | ".join(map(str, CORRELATIONS)) + " |")
    print("|" + "---|" * (2 + len(CORRELATIONS)))
    for people, share, found in mapped(partial(row_of, sets), *zip(*product(PEOPLE, SHARES), strict=True)):
        cells = " | ".join(f"{100 * held:.1f} % ({width:.2f})" for held, width in found)
        print(f"| {people} | {share} | {cells} |", flush=True)


if __name__ == "__main__":
    run_study(__file__, sets=2000)
