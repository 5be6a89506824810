"""Claims about ends of profile intervals: what is not found is said, and is no number."""

import numpy as np
import pytest

from evenlight.analysis.inference.adaptive_quadrature import Likelihood
from evenlight.analysis.inference.fixed_effects import Maximum, Profile
from evenlight.data_schema.arrays import Array

CRITICAL = 4.0


def bell(parameters: Array) -> Likelihood:
    """A log-likelihood whose maximum is at 0, with curvature 1."""
    return Likelihood(-0.5 * float(parameters @ parameters), -parameters, -np.eye(2))


def profile(top: Array) -> Profile:
    return Profile(bell, Maximum(top, bell(top), True), 0)


def test_the_end_of_a_parabola_lies_where_it_must() -> None:
    end, _ = profile(np.zeros(2)).end(1, CRITICAL, 1.0, 10.0)
    assert end == pytest.approx(2.0, abs=1e-3)  # 2 · z² / 2 = 4
    assert profile(np.zeros(2)).end(1, CRITICAL, 1.0, 1.5) == (None, False)  # further than is tried


def test_a_maximum_that_is_none_gives_neither_statistic_nor_end() -> None:
    wrong = profile(np.array([0.0, 1.0]))  # the other parameter is not at its best
    assert wrong.at(0.0, wrong.top.parameters)[0] is None
    assert wrong.end(1, CRITICAL, 0.1, 10.0) == (None, True)


def test_an_end_that_is_never_reached_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    found = profile(np.zeros(2))
    jump = {False: 1.0, True: 9.0}  # a statistic that leaps over its critical value
    monkeypatch.setattr(Profile, "at", lambda _, value, near: (jump[value > 1.5], 0.0, near))
    assert found.end(1, CRITICAL, 1.0, 10.0) == (None, True)
