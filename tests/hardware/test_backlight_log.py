"""Commanded against achieved: what is kept of each setting of a backlight."""

import pytest

from evenlight.data_schema.recordings.instrument_logs import BacklightSetting
from evenlight.hardware.backlights import LoggedBacklight
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.simulated.panel import SimulatedBacklight


class Slow(SimulatedBacklight):
    """A backlight that takes 20 ms to take a setting."""

    def __init__(self, time: list[float]) -> None:
        super().__init__(lambda: time[0], steps=10)
        self._time = time

    def set_factor(self, factor: float) -> float:
        self._time[0] += 0.02
        return super().set_factor(factor)


def test_each_setting_is_kept_with_what_was_asked_what_was_achieved_and_when() -> None:
    time = [5.0]
    backlight = LoggedBacklight(Slow(time), lambda: time[0])
    assert backlight.set_factor(0.52) == 0.5
    time[0] = 6.0
    backlight.set_factor(0.97)
    assert backlight.settings() == [
        BacklightSetting(5.0, 5.02, 0.52, 0.5),
        BacklightSetting(6.0, 6.02, 0.97, 1.0),
    ]


def test_a_refused_setting_is_kept_as_one_that_achieved_nothing_and_still_fails() -> None:
    backlight = LoggedBacklight(SimulatedBacklight(lambda: 1.0), lambda: 1.0)
    with pytest.raises(InstrumentError):
        backlight.set_factor(1.5)
    assert backlight.settings() == [BacklightSetting(1.0, 1.0, 1.5, None)]


def test_memory_is_bounded_and_a_sink_is_told_all() -> None:
    told: list[BacklightSetting] = []
    backlight = LoggedBacklight(SimulatedBacklight(lambda: 0.0, steps=100), lambda: 0.0, told.append, kept=3)
    for k in range(1, 11):
        backlight.set_factor(k / 10)
    assert [one.commanded for one in backlight.settings()] == [0.8, 0.9, 1.0]
    assert [one.commanded for one in told] == [k / 10 for k in range(1, 11)]


def test_the_device_is_closed_with_its_log_once() -> None:
    class Counting(SimulatedBacklight):
        closed = 0

        def close(self) -> None:
            self.closed += 1
            super().close()

    device = Counting(lambda: 0.0, steps=100)
    with LoggedBacklight(device, lambda: 0.0) as backlight:
        backlight.set_factor(0.5)
        assert (backlight.smallest_factor(), backlight.step(), backlight.min_interval()) == (0.01, 0.01, 0.01)
    assert device.closed == 1
    with pytest.raises(InstrumentError, match="is closed"):
        backlight.set_factor(0.5)
