"""P values of several tests, adjusted for their number."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p values adjusted for their number (Holm 1979).

    The k-th smallest of m is multiplied by m - k + 1, and is never below the one before. Rejecting where the
    adjusted p is at most 5 % keeps the chance of any false rejection at 5 %, however the tests depend on each
    other. Written out, as `statsmodels` collects garbage for 50 ms at each such call.

    Parameters
    ----------
    p_values : sequence of float or None
        None for a test that could not be made: it stays None, and is not counted.

    >>> holm([0.01, None, 0.04, 0.03])
    [0.03, None, 0.06, 0.06]
    """
    given = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    raised = accumulate((min(p * (len(given) - k), 1.0) for k, (p, _) in enumerate(given)), max)
    adjusted = dict(zip((place for _, place in given), raised, strict=True))
    return [adjusted.get(place) for place in range(len(p_values))]
