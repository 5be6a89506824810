"""Claims about versions compared pass by pass: what drifts is shared, what is equal must be shown."""

from __future__ import annotations

import numpy as np
import pytest

from evenlight.analysis.played_power.pass_power import PassComparison, PowerEstimate
from evenlight.analysis.played_power.power_report import _equal_power
from evenlight.data_schema.recordings.played_power import PassPower

T_975 = {1: 12.706, 2: 4.303, 5: 2.571}  # Student's t, of any table
T_95_1 = 6.314


def passes(*given: tuple[str, float], used: bool = True) -> list[PassPower]:
    """Passes of 10 s, one every 12 s."""
    return [
        PassPower(k, version, 12.0 * k, 10.0, power, 0.5, 600, 0, 0, 1.0, 0.0, used)
        for k, (version, power) in enumerate(given)
    ]


def test_a_drift_that_all_share_is_no_difference() -> None:
    """1 mW more with each pass, 300 mW/h: ours, played first, would seem to take 1 mW less."""
    played = [
        (version, 1.0 + 0.001 * (3 * k + j))
        for k in range(2)
        for j, version in enumerate(("ours", "baseline"))
    ]
    drifting = [(version, 1.0 + 0.001 * k) for k, (version, _) in enumerate(played)]
    comparison = PassComparison(passes(*drifting))
    found = comparison.difference("ours", "baseline")
    assert found is not None
    assert found.value == pytest.approx(0.0, abs=1e-12)
    assert comparison.drift == pytest.approx(0.001 / 12 * 3600)


def test_differences_by_hand() -> None:
    """Ours 1, 3 and baseline 4, 2 at ± times that balance: the drift is 0 by symmetry, the difference -1.

    Of four passes at times -18, -6, 6, 18 in the order ours, baseline, baseline, ours, time is orthogonal to
    the versions. Slope: (-18·1 - 6·4 + 6·2 + 18·3) / 720 = 1/30. Left over after means 2 and 3 and the slope:
    ours ∓(1 - 0.6), baseline ±(1 + 0.2): 0.16·2 + 1.44·2 = 3.2 with 4 - 3 = 1 degree of freedom. The variance
    of a difference of two means of two is 3.2 · (1/2 + 1/2).
    """
    found = PassComparison(passes(("ours", 1.0), ("baseline", 4.0), ("baseline", 2.0), ("ours", 3.0)))
    difference = found.difference("ours", "baseline")
    assert difference is not None
    assert difference.value == pytest.approx(-1.0)
    assert difference.degrees == 1
    assert difference.error == pytest.approx(3.2**0.5)
    assert difference.interval()[1] == pytest.approx(-1 + T_975[1] * 3.2**0.5, rel=1e-3)
    assert found.drift == pytest.approx(3600 / 30)


def test_savings_are_a_share_of_full_brightness() -> None:
    found = PassComparison(passes(("ours", 0.9), ("full", 1.8), ("ours", 0.9), ("full", 1.8))).saving("ours")
    assert found is not None
    assert found.value == pytest.approx(0.5)
    assert found.interval() == pytest.approx((0.5, 0.5))


def test_the_interval_of_the_saving_holds_the_truth_in_95_percent() -> None:
    """3 rounds, noise of 2 mW between passes, a drift of 1 W/h; 600 draws: 95 % ± 2.7 %."""
    rng = np.random.default_rng(8)
    truth = {"ours": 0.9, "baseline": 0.9, "full": 1.8}
    order = ["ours", "baseline", "full"] * 3
    hits = []
    for _ in range(600):
        noisy = [(v, truth[v] + 12 * k / 3600 + 0.002 * rng.normal()) for k, v in enumerate(order)]
        saving = PassComparison(passes(*noisy)).saving("ours")
        assert saving is not None
        assert saving.degrees == 5
        # At the middle of the measurement everything has drifted by 4 · 12 s · 1 W/h.
        drifted = 4 * 12 / 3600
        low, high = saving.interval()
        assert low is not None
        hits.append(low <= 1 - (0.9 + drifted) / (1.8 + drifted) <= high)
    assert np.mean(hits) == pytest.approx(0.95, abs=0.027)


def test_one_pass_of_each_has_differences_and_no_interval() -> None:
    comparison = PassComparison(passes(("ours", 0.9), ("baseline", 0.8), ("full", 1.8)))
    found = comparison.difference("ours", "baseline")
    assert found == PowerEstimate(pytest.approx(0.1), None, 0)
    assert found is not None
    assert found.interval() == (None, None)
    assert comparison.drift is None
    equal = _equal_power(comparison, 1.8)
    assert equal is not None
    assert (equal.p, equal.equal) == (None, None)


def test_a_version_that_was_not_measured_is_compared_with_nothing() -> None:
    comparison = PassComparison(passes(("ours", 0.9), ("ours", 0.9)))
    assert comparison.versions == ["ours"]
    assert comparison.difference("ours", "baseline") is None
    assert comparison.saving("ours") is None
    assert _equal_power(comparison, None) is None


def test_passes_that_do_not_count_are_left_out() -> None:
    counted = passes(("ours", 0.9), ("baseline", 0.9))
    others = passes(("ours", 5.0), ("full", 9.0), used=False)
    assert PassComparison(counted + others).versions == ["baseline", "ours"]


@pytest.mark.parametrize(
    ("difference", "error", "equal"),
    [
        (0.0, 0.0171 / T_95_1, True),  # the margin of 18 mW is just beyond t(0.95, 1) standard errors
        (0.0, 0.0190 / T_95_1, False),
        (0.02, 0.0001, False),  # surely different
        (0.017, 0.0001, True),  # surely different from 0, and surely less than the margin
        (-0.017, 0.0001, True),
    ],
)
def test_powers_are_equal_if_two_one_sided_tests_exclude_the_margin(
    difference: float, error: float, equal: bool
) -> None:
    p = PowerEstimate(difference, error, 1).probability_beyond(0.018)
    assert p is not None
    assert (p < 0.05) is equal


def test_no_noise_at_all_is_no_division_by_zero() -> None:
    assert PowerEstimate(0.01, 0.0, 2).probability_beyond(0.018) == 0
    assert PowerEstimate(0.02, 0.0, 2).probability_beyond(0.018) == 1
