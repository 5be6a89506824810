"""Factors do not depend on how many threads linear algebra may have."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import evenlight
from evenlight.analysis.tracks import optimization
from evenlight.method.one_blas_thread import one_blas_thread


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_long_sum_is_the_same_bit_for_bit_and_the_threads_are_given_back() -> None:
    """Threads are used from 10 000 terms on, and each adds up its own share of them."""
    values = np.random.default_rng(1).normal(size=200_000)
    found = []
    for count in (1, 2, 3):
        with threadpool_limits(limits=count, user_api="blas"):
            found.append(one_blas_thread(np.dot)(values, values[::-1].copy()))
            assert threads() == {count}
    assert len(set(found)) == 1


def test_a_track_is_optimized_and_certified_in_one_thread(
    make_curves: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    for name in ("optimize_problem", "lower_bound"):
        work = getattr(optimization, name)
        monkeypatch.setattr(
            optimization, name, lambda *given, work=work: (seen.append(threads()), work(*given))[1]
        )
    with threadpool_limits(limits=2, user_api="blas"):
        evenlight.optimize(make_curves(np.linspace(0.1, 0.2, 5)), 0.5)
    assert seen == [{1}, {1}]
