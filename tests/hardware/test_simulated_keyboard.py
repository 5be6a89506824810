"""The simulated keyboard and the clock of a rehearsal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.protocols import KeyPress
from evenlight.hardware.simulated.clocks import RefreshClock


@given(st.floats(24, 240), st.integers(0, 10**6))
def test_the_clock_does_not_drift(refresh_rate: float, refreshes: int) -> None:
    clock = RefreshClock(refresh_rate)
    clock.advance(refreshes)
    assert clock.now() == refreshes / refresh_rate
    assert clock.advance() == (refreshes + 1) / refresh_rate


@given(st.lists(st.floats(0.001, 2), max_size=8))
def test_every_press_is_given_once_in_order_and_not_before_its_time(delays: list[float]) -> None:
    clock = RefreshClock(50.0)
    keyboard = SimulatedKeyboard(clock.now)
    for delay in delays:
        keyboard.queue("y", delay)
    given_out: list[KeyPress] = []
    for _ in range(101):
        presses = keyboard.pressed()
        assert all(clock.now() - 0.02 - 1e-9 <= press.time <= clock.now() for press in presses)
        given_out += presses
        clock.advance()
    assert [press.time for press in given_out] == sorted(delays)
    assert keyboard.waiting() == 0


def test_clearing_forgets_what_was_pressed_and_keeps_what_is_still_to_come() -> None:
    clock = RefreshClock(10.0)
    keyboard = SimulatedKeyboard(clock.now)
    keyboard.queue("early", 0.1)
    keyboard.queue("late", 0.3)
    clock.advance(2)
    keyboard.clear()
    clock.advance(2)
    assert [press.name for press in keyboard.pressed()] == ["late"]


def test_a_key_cannot_be_pressed_before_now() -> None:
    with pytest.raises(ValueError, match="delay must be above 0 s"):
        SimulatedKeyboard(lambda: 0.0).queue("y", 0.0)
