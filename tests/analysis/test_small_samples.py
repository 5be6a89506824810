"""Likelihood ratios of few participants: in a normal model they are Student's t, exactly."""

import numpy as np
import pytest
from scipy import stats

from evenlight.analysis.inference.mixed_designs import (
    NullDistribution,
    between_directions,
    reference_of,
    weight_of_people,
)


def test_the_likelihood_ratio_of_a_normal_mean_has_the_p_value_of_the_t_test() -> None:
    # ML: 2 ln L = -n ln(mean square) + constant, about 0 under the hypothesis and about the mean without it.
    x = np.array([0.3, -0.1, 0.8, 0.5, 1.2, -0.4, 0.9])
    ratio = x.size * np.log(np.mean(x**2) / np.var(x))
    reference = NullDistribution(df=x.size - 1, units=x.size)
    assert reference.p_value(ratio) == pytest.approx(stats.ttest_1samp(x, 0.0).pvalue, rel=1e-12)


def test_with_many_participants_it_becomes_the_chi_square() -> None:
    assert NullDistribution(df=10_000, units=10_001).critical == pytest.approx(
        stats.chi2.ppf(0.95, 1), rel=1e-3
    )
    assert NullDistribution(df=1e7).critical == pytest.approx(stats.chi2.ppf(0.95, 1), rel=1e-6)


def test_a_huge_ratio_has_a_tiny_p_value_and_no_warning() -> None:
    assert 0 <= NullDistribution(df=16, units=17).p_value(1e5) < 1e-100


def paper() -> tuple[np.ndarray, np.ndarray]:
    """The ones, version, dummies of the sequences, half of the people: 17 x 4 x 2 answers."""
    groups, sequence, version = (
        grid.ravel() for grid in np.meshgrid(np.arange(17), np.arange(4), [-0.5, 0.5], indexing="ij")
    )
    dummies = [(sequence == k).astype(float) for k in (1, 2, 3)]
    return np.column_stack([np.ones(136), version, *dummies, groups % 2 - 0.5]), groups


def test_the_papers_design_compares_people_in_two_directions_only() -> None:
    design, groups = paper()
    assert between_directions(design, groups) == 2  # the mean over people, and one half against the other
    weights = [weight_of_people(design, j, groups) for j in range(6)]
    # What the other columns leave of the version, or of a dummy, adds up to 0 for everybody. The ones, beside
    # the dummies, are the first sequence: 2 of everybody's answers, so that Σ (Σ x̃)² / Σ x̃² is 2
    # (and a little more, as 17 has no half).
    np.testing.assert_allclose(weights, [2, 0, 0, 0, 0, 8], atol=0.01)


def test_each_effect_of_the_papers_design_has_its_degrees_of_freedom() -> None:
    design, groups = paper()
    assert reference_of(design, 1, groups) == NullDistribution(136 - 17 - 4)
    assert reference_of(design, 1, groups, timed=100) == NullDistribution(100 - 17 - 4, 100 - 17)
    assert reference_of(design, 1, groups, varies=True) == NullDistribution(16, 17)
    assert reference_of(design, 0, groups) == reference_of(design, 5, groups) == NullDistribution(15, 17)


def test_one_missing_answer_does_not_make_an_effect_a_comparison_of_people() -> None:
    design, groups = paper()
    assert weight_of_people(design[1:], 1, groups[1:]) < 0.05
    assert reference_of(design[1:], 1, groups[1:]) == NullDistribution(135 - 17 - 4)


def test_one_participant_is_described_by_the_observations_alone() -> None:
    design, groups = paper()
    assert reference_of(design[:8, :5], 1, groups[:8]) == NullDistribution(3)
