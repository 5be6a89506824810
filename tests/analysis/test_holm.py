"""Adjustment for the number of tests, by hand and against statsmodels."""

import numpy as np
import pytest
from statsmodels.stats.multitest import multipletests

from evenlight.analysis.inference.exact_tests import holm


def test_the_smallest_p_is_multiplied_by_the_number_of_tests_that_could_be_made() -> None:
    assert holm([0.02, 0.5, None, 0.01]) == pytest.approx([0.04, 0.5, None, 0.03])
    assert holm([None]) == [None]
    assert holm([]) == []


@pytest.mark.slow
def test_random_p_values_are_adjusted_as_by_statsmodels() -> None:
    for p in np.random.default_rng(1).random((4, 6)) ** 3:
        assert holm(p.tolist()) == pytest.approx(multipletests(p, method="holm")[1])
