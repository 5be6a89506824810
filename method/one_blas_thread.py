"""Linear algebra in one thread: sums in several depend on how many there are, and small ones only wait.

How many there are is a setting of the whole process: where its own threads do this at the same time, only the
first to ask is sure of it. What must be the same bit for bit is computed in one of them, or in processes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Given = ParamSpec("Given")
Returned = TypeVar("Returned")


def one_blas_thread(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """Return a function in which NumPy's linear algebra has one thread, whatever the environment says.

    >>> one_blas_thread(len)("abc")
    3
    """
    limited: Callable[Given, Returned] = threadpool_limits.wrap(limits=1, user_api="blas")(function)
    return limited
