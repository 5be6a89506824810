"""Tests of real time are tried again where time may have been short, and nowhere else."""

from collections.abc import Callable

import pytest


@pytest.fixture
def is_worth_another_try(request: pytest.FixtureRequest) -> Callable[[pytest.TestReport], bool]:
    plugins = request.config.pluginmanager.get_plugins()
    return next(one.is_worth_another_try for one in plugins if hasattr(one, "is_worth_another_try"))


@pytest.mark.parametrize(
    ("when", "why", "again"),
    [
        ("call", "E  assert 0.31 < 0.25", True),
        ("setup", "E  assert -11 == 0", False),
        ("teardown", "E  a thread is left", False),
        ("call", "E  Failed: Timeout (>300.0s) from pytest-timeout.", False),
    ],
)
def test_what_could_not_be_set_up_or_hung_is_not_tried_again(
    is_worth_another_try: Callable[[pytest.TestReport], bool], when, why: str, again: bool
) -> None:
    report = pytest.TestReport("test", ("test.py", 1, "test"), {}, "failed", why, when)
    assert is_worth_another_try(report) is again
