"""A context with compute shaders for tests, or why they are skipped."""

import functools

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.method.gpu.context import OwnContext


@functools.cache
def own_context() -> OwnContext:
    """One context for all tests of a process; skips the test where there can be none.

    Then nothing of the shaders is tested: neither that their loss is that of the definition, nor that they
    are timed rightly. The reason that is told names the packages with which they can be tested anywhere. That
    Evenlight works without compute shaders is tested with or without them.
    """
    try:
        return OwnContext()
    except InputError as error:
        pytest.skip(f"what compute shaders compute is not tested: {error}")
