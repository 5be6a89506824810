"""Seeds of random numbers, as commands take them."""

from __future__ import annotations

from evenlight.data_schema.errors import InputError


def require_seed(seed: int) -> None:
    """Raise `InputError` for a number that is no seed: NumPy's generators take none below 0.

    >>> require_seed(0)
    """
    if seed < 0:
        raise InputError(f"--seed must be 0 or more, got {seed}")
