"""The search's tests keep their level, and its intervals hold the truth, if people differ: a short study.

Bounds are those that a level of 5 %, or a coverage of 95 %, passes in all but one of a thousand studies.
People differ by so much that analyses which take their searches as independent fail them. The long study,
with tables, is search_level.py.
"""

import numpy as np
from made_searches import SearchTruth, made_table
from scipy import stats
from search_level import OVERALL, PAIRS, study

from evenlight.analysis.search.search_pairs import detection_change, matched_pairs

DIFFERENT = SearchTruth(version_sd=1.2, locations=4, middle=6.0)
PAIRED = SearchTruth(version_sd=0.8, locations=12, middle=8.0)
FEW, MANY = 24, 80


def most(runs: int) -> float:
    """Largest share of errors that a true one of 5 % gives."""
    return float(stats.binom.ppf(0.999, runs, 0.05)) / runs


def test_the_model_of_times_keeps_its_level_if_people_differ() -> None:
    rejected, held = study(DIFFERENT, OVERALL, FEW)[OVERALL[0]]
    assert rejected <= most(FEW)
    assert held >= 1 - most(FEW)


def test_the_hazard_ratio_keeps_its_level_if_people_differ() -> None:
    rejected, held = study(PAIRED, PAIRS[:1], MANY)[PAIRS[0]]
    assert rejected <= most(MANY)
    assert held >= 1 - most(MANY)


def test_the_share_found_keeps_its_level_if_some_people_find_less() -> None:
    truth = SearchTruth(people_sd=0.8, locations=12, middle=20.0)  # a third is not found
    tables = (made_table(truth, np.random.default_rng((2, number))) for number in range(MANY))
    changes = [detection_change(matched_pairs(table)) for table in tables]
    assert np.mean([change.p_value <= 0.05 for change in changes]) <= most(MANY)
    low, high = (np.array([getattr(c, end) for c in changes], dtype=float) for end in ("ci_low", "ci_high"))
    assert np.mean((low <= 0) & (high >= 0)) >= 1 - most(MANY)


def test_a_binomial_test_of_all_pairs_would_not() -> None:
    tables = [made_table(PAIRED, np.random.default_rng((1, number))) for number in range(60)]
    pairs = [matched_pairs(table) for table in tables]
    counts = [(int((p.first > 0).sum()), int((p.first != 0).sum())) for p in pairs]
    rejected = [stats.binomtest(ours, known, 0.5).pvalue <= 0.05 for ours, known in counts]
    assert np.mean(rejected) > most(60)
