"""`minimize_chain` finds the minimum of a quadratic on a chain, exactly."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, minimize

from evenlight.data_schema.arrays import Array
from evenlight.method.optimizer.chain import ChainLimits, minimize_chain


def random_chain(seed: int, n: int) -> tuple[Array, Array, ChainLimits]:
    """A chain on which every constant is feasible: slopes about 1, offsets outwards, a common box."""
    rng = np.random.default_rng(seed)
    curvature = rng.uniform(0.1, 3, n)
    gradient = -curvature * rng.uniform(-0.3, 1.3, n)
    limits = ChainLimits(
        down_slope=1 / (1 + rng.uniform(0, 0.1, n - 1)),
        down_offset=-rng.uniform(0, 0.05, n - 1),
        up_slope=1 + rng.uniform(0, 0.1, n - 1),
        up_offset=rng.uniform(0, 0.05, n - 1),
        low=rng.uniform(0.1, 0.3, n),
        high=rng.uniform(0.5, 1.0, n),
    )
    return curvature, gradient, limits


def as_constraints(limits: ChainLimits, n: int) -> list[LinearConstraint]:
    """The limits on steps as A x <= c, row by row."""
    rows, bounds = [], []
    for i in range(n - 1):
        up = np.zeros(n)
        up[i], up[i + 1] = -limits.up_slope[i], 1
        down = np.zeros(n)
        down[i], down[i + 1] = limits.down_slope[i], -1
        rows += [up, down]
        bounds += [limits.up_offset[i], -limits.down_offset[i]]
    return [LinearConstraint(np.array(rows), -np.inf, np.array(bounds))] if rows else []


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 10))
def test_no_worse_than_a_general_solver_and_within_the_limits(seed: int, n: int) -> None:
    curvature, gradient, limits = random_chain(seed, n)

    def cost(x: Array) -> float:
        return float(np.sum(curvature / 2 * x**2 + gradient * x))

    x = minimize_chain(curvature, gradient, limits)
    assert (x >= limits.low - 1e-12).all()
    assert (x <= limits.high + 1e-12).all()
    assert (x[1:] <= limits.up_slope * x[:-1] + limits.up_offset + 1e-12).all()
    assert (x[1:] >= limits.down_slope * x[:-1] + limits.down_offset - 1e-12).all()
    reference = minimize(
        cost,
        np.clip(np.full(n, 0.4), limits.low, limits.high),
        jac=lambda x: curvature * x + gradient,
        method="SLSQP",
        bounds=list(zip(limits.low, limits.high, strict=True)),
        constraints=as_constraints(limits, n),
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert cost(x) <= reference.fun + 1e-9


def test_two_values_pulled_apart_share_the_gap_by_hand() -> None:
    # (x - 0)² + (y - 1)² with |y - x| <= 0.2: by symmetry about 1/2, x = 0.4 and y = 0.6.
    limits = ChainLimits(np.ones(1), np.array([-0.2]), np.ones(1), np.array([0.2]), np.zeros(2), np.ones(2))
    x = minimize_chain(np.full(2, 2.0), np.array([0.0, -2.0]), limits)
    np.testing.assert_allclose(x, [0.4, 0.6], atol=1e-12)


def test_optimality_over_a_hundred_thousand_values() -> None:
    n = 100_000
    target = 0.5 + 0.3 * np.sin(np.arange(n) / 800)
    relative = 0.0005
    limits = ChainLimits(
        np.full(n - 1, 1 / (1 + relative)),
        np.zeros(n - 1),
        np.full(n - 1, 1 + relative),
        np.zeros(n - 1),
        np.full(n, 0.2),
        np.ones(n),
    )
    x = minimize_chain(np.ones(n), -target, limits)
    ratio = np.abs(np.diff(np.log(x))) / np.log1p(relative)
    assert ratio.max() <= 1 + 1e-9
    # Scaling a stretch as a whole, x -> (1 + e) x, keeps every ratio limit, so its
    # derivative Σ (x - t) x is 0.
    # Stretches end where a step is within its limit.
    ends = np.flatnonzero(ratio < 1 - 1e-6)
    stretch = np.add.reduceat((x - target) * x, np.concatenate([[0], ends + 1]))
    np.testing.assert_allclose(stretch, 0, atol=1e-9)
