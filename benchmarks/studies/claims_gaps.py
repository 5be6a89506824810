"""What is shown between two intervals: what it tells the observer of `interval_gaps`, and costs."""

from functools import cache

import numpy as np
import pytest
from interval_gaps import GAPS, THRESHOLD_D, sensitivities
from scipy import stats

from evenlight.data_schema.recordings.ramp import IntervalGap

TRIALS = 3000
# Of d' = sqrt(2) z(p) at p = 0.75 and at 0.5: sqrt(2 p (1 - p) / n) / φ(z)
ERROR = float(np.sqrt(2 * 0.75 * 0.25 / TRIALS) / stats.norm.pdf(stats.norm.ppf(0.75)))
ERROR_AT_CHANCE = float(np.sqrt(2 * 0.25 / TRIALS) / stats.norm.pdf(0.0))


@cache
def found(kind: IntervalGap | None) -> tuple[float, float]:
    (gap,) = (gap for gap in GAPS if gap.kind is kind)
    return sensitivities(gap, TRIALS)


@pytest.mark.parametrize("kind", list(IntervalGap))
def test_the_steps_of_a_session_tell_nothing(kind: IntervalGap) -> None:
    assert found(kind)[1] < 3 * ERROR_AT_CHANCE


def test_a_steady_gap_leaves_a_change_at_threshold_at_threshold_and_random_steps_do_not() -> None:
    assert found(IntervalGap.STEADY)[0] == pytest.approx(THRESHOLD_D, abs=3 * ERROR)
    assert found(IntervalGap.RANDOM_STEPS)[0] < found(IntervalGap.STEADY)[0]


def test_a_common_luminance_tells_which_interval_changed() -> None:
    """Its steps alone are worth more than the change that is to be measured."""
    assert found(None)[1] > THRESHOLD_D
