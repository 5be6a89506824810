"""A context with compute shaders for tests, or why they are skipped."""

import functools

import pytest

from data_schema.errors import InputError
from method.gpu_context import OwnContext


@functools.cache
def own_context() -> OwnContext:
    """One context for all tests of a process; skips the test where there can be none."""
    try:
        return OwnContext()
    except InputError as error:
        pytest.skip(f"no compute shaders here: {error}")
