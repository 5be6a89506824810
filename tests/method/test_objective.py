"""The pair sum as a sort, and its proximal step as an isotonic regression."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.method.optimizer.objective import pairwise_spread, proximal_spread

losses = arrays(np.float64, st.integers(2, 30), elements=st.floats(0, 1))


def spread_as_printed(loss: np.ndarray) -> float:
    """Eq. 6, transcribed: the double sum over i < j, over its number of pairs."""
    n = len(loss)
    return sum(abs(loss[i] - loss[j]) for i in range(n) for j in range(i + 1, n)) / (n * (n - 1) / 2)


@given(losses)
def test_matches_equation_as_printed(loss: np.ndarray) -> None:
    assert pairwise_spread(loss) == pytest.approx(spread_as_printed(loss), abs=1e-12)


@pytest.mark.slow
@given(losses, st.floats(-5, 5))
def test_a_common_level_of_loss_costs_nothing(loss: np.ndarray, level: float) -> None:
    assert pairwise_spread(loss + level) == pytest.approx(pairwise_spread(loss), abs=1e-12)


def test_equal_losses_have_no_spread_at_all() -> None:
    assert pairwise_spread(np.full(999, 0.1)) == 0.0


def test_a_single_frame_has_no_pairs() -> None:
    assert pairwise_spread([0.3]) == 0.0


@given(losses, st.floats(1e-3, 1.0), st.integers(0, 1000))
def test_no_nudge_improves_the_proximal_point(values: np.ndarray, strength: float, seed: int) -> None:
    def cost(v: np.ndarray) -> float:
        n = len(v)
        return strength * spread_as_printed(v) * n * (n - 1) / 2 + float(np.sum((v - values) ** 2)) / 2

    best = proximal_spread(values, strength)
    rng = np.random.default_rng(seed)
    for scale in (1e-3, 1e-1):
        assert cost(best) <= cost(best + scale * rng.standard_normal(len(values))) + 1e-9
