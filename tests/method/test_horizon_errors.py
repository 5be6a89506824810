"""How far the mean over a horizon is from a budget: of any horizon, wherever it begins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.method.online.governor import horizon_errors

LEVELS = st.sampled_from([0.0, 0.2, 0.5, 1.0])


def test_a_horizon_that_ends_with_a_frame_counts() -> None:
    """From 6 to 11 s: 4 s of 0.5 and 1 s of 1 are 0.6 on average. None that begins with a frame is."""
    factors, seconds = np.array([0.5, 1.0, 0.0]), np.array([10.0, 1.0, 10.0])
    errors = horizon_errors(factors, np.ones(3), seconds, (0.5, 5.0))
    assert errors == pytest.approx((0.5, 0.1))


def mean_over(values: np.ndarray, seconds: np.ndarray, begin: float, horizon: float) -> float:
    """Integral over a window, frame by frame."""
    ends = np.cumsum(seconds)
    inside = np.minimum(ends, begin + horizon) - np.maximum(ends - seconds, begin)
    return float(np.clip(inside, 0, None) @ values)


@settings(max_examples=40)
@given(
    st.lists(st.tuples(LEVELS, LEVELS, st.sampled_from([0.3, 1.0, 2.5])), min_size=2, max_size=7),
    st.sampled_from([0.7, 1.5, 3.0]),
)
def test_no_window_of_a_dense_scan_is_further_off(
    frames: list[tuple[float, float, float]], horizon: float
) -> None:
    """Shares of full power, of content that is partly black, on a panel that takes nothing for black."""
    factors, content, seconds = (np.array(column) for column in zip(*frames, strict=True))
    used, total = factors * content, float(seconds.sum())
    found = horizon_errors(used, content, seconds, (0.5, horizon))
    if total < horizon - 1e-6:
        assert found is None
        return
    begins = np.linspace(0, max(total - horizon, 0.0), 301)
    whole = [mean_over(content, seconds, begin, horizon) for begin in begins]
    away = np.array(
        [
            mean_over(used, seconds, t, horizon) / of - 0.5
            for t, of in zip(begins, whole, strict=True)
            if of > 1e-6
        ]
    )
    if not len(away):
        assert found is None
        return
    assert found is not None
    assert np.abs(away).max() <= found.either_way + 1e-9
    assert away.max() <= found.above + 1e-9
    # And one comes near it: the ratio of two sums that change by 1 per second changes by 2 / whole at most.
    nearest = 1e-9 + begins[1] * 2 / min(of for of in whole if of > 1e-6)
    assert found.either_way <= np.abs(away).max() + nearest
    assert found.above <= max(away.max(), 0.0) + nearest


@pytest.mark.parametrize("horizon", [2.0, 4.0])
def test_what_takes_no_power_has_no_share(horizon: float) -> None:
    """A night of 5 s, then 5 s at 0.7: the windows of night alone say nothing."""
    used, of, seconds = np.repeat([0.0, 0.7], 50), np.repeat([0.0, 1.0], 50), np.full(100, 0.1)
    assert horizon_errors(used, of, seconds, (0.5, horizon)) == pytest.approx((0.2, 0.2))
    assert horizon_errors(used[:50], of[:50], seconds[:50], (0.5, horizon)) is None


def test_a_video_of_one_horizon_is_one_window() -> None:
    used, seconds = np.array([0.25, 0.75]), np.array([1.0, 1.0])
    assert horizon_errors(used, np.ones(2), seconds, (0.25, 2.0)) == pytest.approx((0.25, 0.25))
    assert horizon_errors(used, np.ones(2), seconds, (0.25, 2.1)) is None
