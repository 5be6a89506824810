"""Looking around: what mouse and keys do to the direction of view, and where it ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.stimuli.scenes.engine.camera import LookingAround, eased, steps_to


def test_a_turn_is_slow_at_both_ends_and_never_goes_back() -> None:
    """3 s^2 - 2 s^3 has no slope at 0 and 1: a hundredth of the time does 0.0003 of the turn."""
    shares = np.array([eased(t) for t in np.linspace(0, 1, 101)])
    assert (np.diff(shares) > 0).all()
    assert shares[1] == pytest.approx(0.000298)
    np.testing.assert_allclose(shares + shares[::-1], 1.0)


def test_presses_within_a_turn_add_up() -> None:
    """Two presses 0.1 s apart: 20 degrees in all; at 0.2 s, 0.896 and 0.352 of 10 degrees."""
    looking = LookingAround(0.0, 100.0, 20.0)
    looking.turn(1, 0, now=0.0)
    looking.turn(1, 0, now=0.1)
    assert looking.direction(0.2)[0] == pytest.approx(8.96 + 3.52)
    assert looking.direction(0.35)[0] == pytest.approx(20.0)


def test_a_press_back_is_answered_at_once_at_the_limit() -> None:
    """Presses beyond the limit are not saved up."""
    looking = LookingAround(0.0, 15.0, 20.0)
    for press in range(5):
        looking.turn(-1, 0, now=float(press))
    looking.turn(1, 0, now=10.0)
    assert looking.direction(11.0) == (-5.0, 0.0)


movements = st.lists(
    st.tuples(st.booleans(), st.integers(-1, 1), st.integers(-1, 1), st.floats(-900, 900), st.floats(0, 0.4)),
    max_size=30,
)


@given(movements, st.floats(-90, 90), st.floats(1, 180))
def test_the_view_never_leaves_its_limits(moves, altitude, widest) -> None:
    looking, now = LookingAround(altitude, widest, 20.0), 0.0
    for by_key, right, up, pixels, pause in moves:
        if by_key:
            looking.turn(right, up, now)
        else:
            looking.moved(pixels, -pixels)
        now += pause
        azimuth, height = looking.direction(now)
        assert abs(azimuth) <= widest
        assert min(-60, altitude) <= height <= max(60, altitude)


@given(st.floats(-80, 80), st.floats(-40, 40))
def test_as_many_steps_as_are_told_bring_the_view_within_half_a_step(azimuth, altitude) -> None:
    right, up = steps_to(azimuth, altitude)
    looking = LookingAround(0.0, 100.0, 20.0)
    for _ in range(abs(right)):
        looking.turn(int(np.sign(right)), 0, now=0.0)
    for _ in range(abs(up)):
        looking.turn(0, int(np.sign(up)), now=0.0)
    seen = looking.direction(1.0)
    assert abs(seen[0] - azimuth) <= 5.0 + 1e-9
    assert abs(seen[1] - altitude) <= 5.0 + 1e-9
