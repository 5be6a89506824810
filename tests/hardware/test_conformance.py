"""The conformance test finds what is wrong, also in time: simulated instruments, each with one fault.

They are on a clock that goes only where something waits, so nothing depends on how busy the computer is.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulators.link import LinkFault
from emulators.ours import OURS, Emulated, LinkKind
from line_faults import FaultySubject, not_restored_is_told, nothing_is_made_up

import evenlight
from evenlight import PowerSample, Reading
from evenlight.data_schema.errors import InputError
from evenlight.hardware.conformance.conform import PROMISES, broken, conform
from evenlight.hardware.conformance.subject import BrokenPromiseError, Screen, Subject
from evenlight.hardware.driver import Driver, NamedDriver
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver_of
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.luminance_meter import MeterPhysics, SimulatedLuminanceMeter
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedBacklight, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics, SimulatedPowerMeter

EXAMPLE = Path(evenlight.__file__).parents[1] / "examples" / "evenlight-instruments"
LUMINANCE, POWER, BACKLIGHT = InstrumentKind
RIGHT = {LUMINANCE: SimulatedLuminanceMeter, POWER: SimulatedPowerMeter, BACKLIGHT: SimulatedBacklight}


def subject_of(kind: InstrumentKind, cls: type[Any]) -> Subject:
    """A simulated device of a class."""
    return Subject(kind, NamedDriver("simulated", Driver(cls, "tried", "simulated"), "", emulated=False))


def faults_found(subject: Subject) -> str:
    """All that is said of the promises of a driver that are broken."""
    lines: list[str] = []
    _, n_broken, _ = conform(subject, lines.append)
    said = [line for line in lines if line.startswith("BROKEN")]
    assert len(said) == n_broken
    assert all("\n" not in line for line in said)
    return "; ".join(said)


@pytest.mark.parametrize("kind", RIGHT, ids=lambda kind: kind.name)
def test_a_right_one_breaks_no_promise(kind: InstrumentKind) -> None:
    assert faults_found(subject_of(kind, RIGHT[kind])) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    "physics",
    [
        PowerMeterPhysics(lost_share=0.1, duplicated_share=0.05),  # told by the count
        PowerMeterPhysics(clock_start=-7e4, clock_drift=2e-3),  # told by pings
        PowerMeterPhysics(receive_jitter=0.01, noise=0.005),
        PowerMeterPhysics(gain_error=0.01),
    ],
    ids=["lossy", "another clock", "late and noisy", "1 % high"],
)
def test_a_power_meter_that_tells_its_shortcomings_breaks_none(physics: PowerMeterPhysics) -> None:
    class Meter(SimulatedPowerMeter):
        def __init__(self, simulation: Simulation) -> None:
            super().__init__(simulation, physics)

    assert faults_found(subject_of(POWER, Meter)) == ""


@pytest.mark.parametrize(
    "physics",
    [
        MeterPhysics(lowest=0.3, highest=20_000.0, resolution=0.0, dark_reading_time=20.0),
        MeterPhysics(proportional_noise=0.004, calibration_error=0.005),
    ],
    ids=["none in the dark", "noisy"],
)
def test_a_luminance_meter_that_tells_its_range_breaks_none(physics: MeterPhysics) -> None:
    class Meter(SimulatedLuminanceMeter):
        def __init__(self, simulation: Simulation) -> None:
            super().__init__(simulation, physics)

    assert faults_found(subject_of(LUMINANCE, Meter)) == ""


class Polled(SimulatedPowerMeter):
    """A power meter whose samples another class changes."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation, PowerMeterPhysics(noise=0.0, receive_jitter=1e-4))
        self.came: list[float] = []

    def start(self, rate: float) -> float:
        self.came, self.asked = [], rate
        return super().start(rate)

    def samples(self) -> list[PowerSample]:
        return [changed for one in super().samples() for changed in self.changed(one)]

    def stop(self) -> list[PowerSample]:
        return [changed for one in super().stop() for changed in self.changed(one)]

    def changed(self, sample: PowerSample) -> list[PowerSample]:
        self.came.append(sample.power)
        return [replace(sample, power=self.power())]

    def power(self) -> float:
        return self.came[-1]


def made(base: type[Any], name: str, **methods: Any) -> type[Any]:
    """Return a device that does something else."""
    return type(name, (base,), methods)


Milliwatts = made(Polled, "Milliwatts", power=lambda self: self.came[-1] * 1000)
SixPercentHigh = made(Polled, "SixPercentHigh", power=lambda self: self.came[-1] * 1.02 + 0.03)
EverySecondStale = made(
    Polled, "EverySecondStale", power=lambda self: self.came[-1 - (len(self.came) % 2 == 0)]
)
MeanOfASecond = made(
    Polled, "MeanOfASecond", power=lambda self: float(np.mean(self.came[-round(self.asked) :]))
)
Late = made(  # by 0.4 s
    Polled, "Late", power=lambda self: self.came[max(len(self.came) - 1 - round(0.4 * self.asked), 0)]
)
AnHourOff = made(
    Polled, "AnHourOff", changed=lambda _, one: [replace(one, device_time=one.device_time + 3600)]
)
Never = made(Polled, "Never", changed=lambda *_: [])
GoesBack = made(
    Polled, "GoesBack", changed=lambda _, one: [one, replace(one, sequence=max(one.sequence - 1, 0))]
)
LosesEveryTenth = made(  # and counts on without a gap
    Polled,
    "LosesEveryTenth",
    changed=lambda _, one: [replace(one, sequence=k - k // 10)] if (k := one.sequence) % 10 < 9 else [],
)


class HalfTheRate(Polled):
    def start(self, rate: float) -> float:
        super().start(rate / 2)
        return rate


class WaitsForASample(Polled):
    def samples(self) -> list[PowerSample]:
        self._simulation.wait(0.6)
        return super().samples()


class AnyRate(Polled):
    def start(self, rate: float) -> float:
        super().start(20.0)
        return 20.0


class Unstarted(Polled):
    def samples(self) -> list[PowerSample]:
        return super().samples() if self._sampling else []


class Seen(SimulatedLuminanceMeter):
    """A luminance meter whose readings another class changes."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation, MeterPhysics(proportional_noise=0.0, floor_noise=0.0))
        self.came: list[float] = []

    def read_luminance(self) -> Reading:
        reading = super().read_luminance()
        self.came.append(reading.value)
        return self.changed(reading)

    def changed(self, reading: Reading) -> Reading:
        return replace(reading, value=self.value())

    def value(self) -> float:
        return self.came[-1]


FootLamberts = made(Seen, "FootLamberts", value=lambda self: self.came[-1] / 3.426)
FourPercentLow = made(Seen, "FourPercentLow", value=lambda self: self.came[-1] * 0.96)
OneBehind = made(Seen, "OneBehind", value=lambda self: self.came[-2:][0])
EveryThirdStale = made(
    Seen, "EveryThirdStale", value=lambda self: self.came[-2 if len(self.came) % 3 == 0 else -1]
)
# 2 cd/m^2, and its range is not told
ClippedBelow = made(Seen, "ClippedBelow", value=lambda self: max(self.came[-1], 2.0))
ClippedAbove = made(Seen, "ClippedAbove", value=lambda self: min(self.came[-1], 99.99))
AnHourAgo = made(
    Seen, "AnHourAgo", changed=lambda _, one: replace(one, begun=one.begun - 3600, ended=one.ended - 3600)
)
Nits = made(Seen, "Nits", changed=lambda _, one: replace(one, unit="nit"))
Divides = made(Seen, "Divides", value=lambda _: 1 / 0)
Exits = made(Seen, "Exits", value=lambda _: sys.exit(0))
SaysNothing = made(Seen, "SaysNothing", apparatus=lambda _: {})
ZeroesUnasked = made(Seen, "ZeroesUnasked", zero=lambda _: None)
WorksClosed = made(Seen, "WorksClosed", _require_open=lambda _: None)


class Averaging(Seen):
    """Each weighs half of the one after."""

    mean: float | None = None

    def value(self) -> float:
        self.mean = self.came[-1] if self.mean is None else 0.5 * self.mean + 0.5 * self.came[-1]
        return self.mean


class Lamp(SimulatedBacklight):
    pass


class Square(Lamp):
    def _set(self, step: int) -> None:
        super()._set(max(1, round(step * step / self._steps)))


class OneSettingBehind(Lamp):
    before = 4095

    def _set(self, step: int) -> None:
        super()._set(self.before)
        self.before = step

    def read_factor(self) -> float:
        return self.before / self._steps


class Floors(Lamp):
    def set_factor(self, factor: float) -> float:
        super().set_factor(factor)
        self._set(int(factor * self._steps))
        return int(factor * self._steps) / self._steps


class TakesAny(Lamp):
    def set_factor(self, factor: float) -> float:
        try:
            return super().set_factor(factor)
        except InstrumentError:
            return factor


class LeftDim(Lamp):
    def close(self) -> None:
        self._closed = True


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mutant", "said"),
    [
        (Milliwatts, "W where the panel has 0."),
        (SixPercentHigh, "W where the panel has 0."),
        (EverySecondStale, "% of its samples repeat the one before, of another power"),
        (MeanOfASecond, "does not follow the power"),
        (Late, "its samples are of the power 0.40 s before the time that they say"),
        (HalfTheRate, "states 20 samples a second, and has 10"),
        (LosesEveryTenth, "10% of its samples come after a gap that their count does not have"),
        (AnHourOff, "after the start that it is of 36"),
        (WaitsForASample, "samples() waits"),
        (Never, "0 samples in 8 s"),
        (GoesBack, "its samples go back"),
        (AnyRate, "start(0): returned 20.0 in place of an error"),
        (Unstarted, "samples() before start(): returned []"),
        (FootLamberts, "gave 58.377 cd/m^2 where the panel has 200"),
        (FourPercentLow, "gave 192 cd/m^2 where the panel has 200"),
        (OneBehind, "gave 200 cd/m^2 where the panel has 60"),
        (EveryThirdStale, "gave 60.14 cd/m^2 where the panel has 120"),
        (Averaging, "cd/m^2 where the panel has 60"),
        (ClippedBelow, "gave 2 cd/m^2 where the panel has 0.3998"),
        (ClippedAbove, "gave 99.99 cd/m^2 where the panel has 200"),
        (AnHourAgo, "says that it read from -3600 to -3600 s after it was asked"),
        (Nits, "in 'cd/m^2', got Reading"),
        (Divides, "ZeroDivisionError"),
        (Exits, "SystemExit: 0"),
        (SaysNothing, "a dictionary of words, got none"),
        (ZeroesUnasked, "zero and before_zero come together"),
        (WorksClosed, "asked when closed: returned"),
        (Square, "it reports"),
        (OneSettingBehind, "it shines with"),
        (Floors, "not the nearest step"),
        (TakesAny, "in place of an error"),
        (LeftDim, "Leave the backlight as it was found: set to 1, it shines with 0.5"),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_a_subtly_wrong_one_is_told_by_what_it_did(mutant: type[Any], said: str) -> None:
    kind = next(kind for kind, right in RIGHT.items() if issubclass(mutant, right))
    assert said in faults_found(subject_of(kind, mutant))


class Desk:
    """A window and a backlight on a panel that is no model: 350 cd/m^2 at most, 1.1 W, gamma 2.1."""

    def __init__(self) -> None:
        self.clock = WaitingClock()
        physics = PanelPhysics(350.0, 0.3, 2.1, warm_up_share=0.0, base_power=0.4, power_per_luminance=0.002)
        self.panel = SimulatedPanel(physics, self.clock.now)
        self.simulation = Simulation(self.panel, np.random.default_rng(2), self.clock.now, self.clock.wait)
        self.now, self._grey = self.clock.now, 0.0

    def framebuffer(self) -> "Desk":
        return self

    def clear(self, red: float, green: float, blue: float, alpha: float) -> None:
        assert red == green == blue
        self._grey = red

    def flip(self) -> float:
        self.clock.wait(1 / 60)
        self.panel.show(self._grey)
        return self.clock.now()


def on_a_desk(kind: InstrumentKind, cls: type[Any], monkeypatch: pytest.MonkeyPatch) -> Subject:
    """A device at an address, which looks at the screen of a rig, or feeds it."""
    desk = Desk()
    lamp = SimulatedBacklight(desk.now, follow=desk.panel.set_backlight) if kind is POWER else None
    monkeypatch.setattr("evenlight.hardware.measuring.time.sleep", desk.clock.wait)

    class AtAnAddress(cls):  # type: ignore[misc] # whichever is tried
        def __init__(self, address: str, clock: Any, timeout: float | None = None) -> None:
            super().__init__(desk.simulation)

    named = NamedDriver("lab", Driver(AtAnAddress, "tried", "lab:PORT"), "PORT", emulated=False)
    return Subject(kind, named, Screen(desk, lamp))  # type: ignore[arg-type] # as much of a window as is used


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mutant", "said"),
    [
        (SimulatedLuminanceMeter, ""),
        (SimulatedPowerMeter, ""),
        (EverySecondStale, "repeat the one before"),
        (MeanOfASecond, "does not follow"),
        (Late, "0.40 s before"),
        (OneBehind, "for the same grey"),
        (EveryThirdStale, "for the same grey"),
        (Averaging, "for the same grey"),
        (ClippedBelow, "gave 2 and 2 cd/m^2 for 0 and 0.001 of the light"),
        (ClippedAbove, "gave 99.99 and 99.99 cd/m^2 for 0.3 and 0.6 of the light"),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_a_rigs_own_screen_tells_a_wrong_one_from_a_right_one(
    mutant: type[Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = next(kind for kind, right in RIGHT.items() if issubclass(mutant, right))
    found = faults_found(on_a_desk(kind, mutant, monkeypatch))
    assert said in found
    assert bool(found) == bool(said)


def test_without_a_rig_what_follows_is_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    subject = replace(on_a_desk(LUMINANCE, OneBehind, monkeypatch), screen=None)
    assert conform(subject, lines.append)[2] == 1
    assert [line for line in lines if "give --rig, whose screen the instrument looks at" in line]


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module of the example's drivers."""
    monkeypatch.syspath_prepend(EXAMPLE)
    from evenlight_instruments import drivers

    yield drivers
    for name in [name for name in sys.modules if name.partition(".")[0] == "evenlight_instruments"]:
        del sys.modules[name]


def changed(driver: Driver, **methods: Any) -> NamedDriver:
    """A driver of the example, some of whose methods are others."""
    assert isinstance(driver.place, type)
    cls = type(driver.place.__name__, (driver.place,), methods)
    return NamedDriver(driver.address.partition(":")[0], replace(driver, place=cls), "", emulated=True)


def forgets_the_number(self: Any) -> Any:
    """Read whatever line is there, as drivers do that ask and take the next line."""
    self._require_open()
    link = self._line._link
    link.write(b"#1 L?\n")
    line = link.read_line(self._line._timeout)
    return Reading(float(line.split()[1]), "cd/m^2", self._clock(), self._clock())


def test_what_is_left_open_is_counted(example: Any) -> None:
    kept: list[Any] = []

    def keeps_open(self: Any) -> None:
        self._closed = True
        kept.append(self)

    says_what_it_is = PROMISES[LUMINANCE][2]
    assert broken(says_what_it_is, Subject(LUMINANCE, changed(example.SPOT))) == ""
    told = broken(says_what_it_is, Subject(LUMINANCE, changed(example.SPOT, close=keeps_open)))
    assert "more files open than there were" in told
    kept.pop()._line.close()


@pytest.mark.parametrize(
    ("kind", "methods", "check", "said"),
    [
        (LUMINANCE, {"read_luminance": forgets_the_number}, nothing_is_made_up(LinkFault.LATE_REPLY), "gave"),
        (BACKLIGHT, {"close": lambda self: self._line.close()}, not_restored_is_told, "in place of an error"),
    ],
)
def test_a_driver_that_a_failing_line_deceives_is_found_by_the_tests_of_ours(
    example: Any, kind: InstrumentKind, methods: dict[str, Any], check: Any, said: str, monkeypatch: Any
) -> None:
    """As tests/conventions/test_drivers.py tries every driver of ours on a line that fails."""
    from evenlight_instruments.emulated import EmulatedInstrument

    class Quiet(EmulatedInstrument):
        def stream(self) -> bytes:
            return b""

    monkeypatch.setitem(OURS, (kind, "tried"), Emulated(Quiet, LinkKind.TERMINAL))
    right = {LUMINANCE: example.SPOT, BACKLIGHT: example.LAMP}[kind]
    for changes in ({}, methods):
        named = changed(right, **changes)
        monkeypatch.setitem(kind.ours, "tried", named.driver)
        subject = FaultySubject(kind, replace(named, name="tried"))
        if changes:
            with pytest.raises(BrokenPromiseError, match=said):
                check(subject)
        else:
            check(subject)


@pytest.mark.parametrize(
    ("name", "kind", "said"),
    [
        ("exec:true", None, "give --kind luminance or --kind power or --kind backlight"),
        ("nothing:COM3", None, "there is no driver 'nothing'"),
        ("ls100:COM3", "power", "there is no power meter 'ls100'"),
        ("ls100:COM3", "light", "--kind must be luminance, power, backlight, got 'light'"),
        ("ls100", None, "where is it"),
    ],
)
def test_a_name_that_says_no_driver_is_refused(name: str, kind: str | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        find_driver_of(name, kind)
