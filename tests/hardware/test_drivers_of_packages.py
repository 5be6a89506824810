"""Drivers of a package that is installed: found when needed, guarded, told of when they are broken."""

import math
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evenlight import ClockPing, ContextDevice, Driver, Fault, InstrumentError, PowerSample, Reading
from evenlight.data_schema.errors import InputError
from evenlight.hardware.driver import NamedDriver
from evenlight.hardware.guarded_devices import GuardedBacklight, GuardedLuminanceMeter, GuardedPowerMeter
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver, known_drivers
from evenlight.hardware.rig import open_backlight, open_luminance_meter
from evenlight.hardware.rig_files import load_rig

METER = """
import evenlight
class Meter(evenlight.ContextDevice):
    def __init__(self, address, clock, timeout=None): self.address, self._clock = address, clock
    def read_luminance(self): return evenlight.Reading({value}, "cd/m^2", self._clock(), self._clock())
    def apparatus(self): return {{"model": "one", "address": self.address}}
METER = evenlight.Driver(Meter, "a meter", "{name}:PORT", "none")
"""


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., None]:
    """Install a package as pip leaves it: its entry points, and a module of its own name."""

    def make(package: str, entries: str, text: str | None) -> None:
        site = tmp_path / package
        info = site / f"{package}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(entries)
        if text is not None:
            (site / f"{package}.py").write_text(text)
        monkeypatch.syspath_prepend(site)

    return make


def entries(package: str, name: str, kind: str = "luminance_meters", thing: str = "METER") -> str:
    return f"[evenlight.{kind}]\n{name} = {package}:{thing}\n"


def test_a_packages_meter_is_opened_at_its_address_and_says_whose_driver_it_is(install: Any) -> None:
    install("lab_one", entries("lab_one", "lab-one"), METER.format(value=12.5, name="lab-one"))
    with open_luminance_meter("lab-one:/dev/ttyUSB0", time.monotonic) as meter:
        assert meter.read_luminance().value == 12.5
        said = meter.apparatus()
    assert said["address"] == "/dev/ttyUSB0"
    assert said["driver"] == "lab-one, driver of the package lab_one"
    with pytest.raises(InstrumentError, match="is closed"):
        meter.read_luminance()
    with pytest.raises(InputError, match="did you mean 'lab-one'"):
        find_driver("lab-on:/dev/ttyUSB0", InstrumentKind.LUMINANCE)


@pytest.mark.parametrize(
    ("entry", "text", "said"),
    [
        (entries("lab_b", "lab-b"), None, "No module named 'lab_b'"),
        (entries("lab_b", "lab-b"), "1 / 0", "ZeroDivisionError: division by zero"),
        (entries("lab_b", "lab-b"), "raise SystemExit(0)", "SystemExit: 0"),
        (entries("lab_b", "lab-b"), "raise ValueError('two\\nlines')", "ValueError: two lines"),
        (entries("lab_b", "lab-b"), "METER = 3", "is not an evenlight.Driver, but of the type int"),
        (entries("lab_b", "ls100"), METER.format(value=1, name="ls100"), "'ls100' is a driver of Evenlight"),
        (entries("lab_b", "Lab B"), METER.format(value=1, name="Lab B"), "a name is of small letters"),
        (entries("lab_b", "lab-b"), METER.format(value=1, name="other"), "an address of the form lab-b:"),
        (
            entries("lab_b", "lab-b"),
            "import evenlight\nMETER = evenlight.Driver('lab_b:Meter', 'one', 'lab-b:PORT')",
            "must be a class",
        ),
    ],
)
def test_a_package_that_is_broken_is_named_in_one_line_once_and_stops_nothing_else(
    install: Any, entry: str, text: str | None, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    sys.modules.pop("lab_b", None)
    install("lab_b", entry, text)
    assert set(known_drivers(InstrumentKind.LUMINANCE)) == set(InstrumentKind.LUMINANCE.ours)
    told = capsys.readouterr().err
    assert told.startswith("evenlight: note: the installed package lab_b: its luminance meter")
    assert said in told
    assert told.count("\n") == 1
    assert find_driver("ls100:COM3", InstrumentKind.LUMINANCE).driver.package == ""
    known_drivers(InstrumentKind.LUMINANCE)
    assert capsys.readouterr().err == ""


def test_of_two_packages_with_a_driver_of_one_name_the_second_is_left_out(
    install: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    for package in ("lab_two", "lab_three"):
        install(package, entries(package, "lab-two"), METER.format(value=1, name="lab-two"))
    kept = known_drivers(InstrumentKind.LUMINANCE)["lab-two"].package
    assert f"'lab-two' is a driver of the package {kept}" in capsys.readouterr().err


def test_packages_are_not_looked_at_where_no_instrument_of_theirs_is_named(install: Any) -> None:
    """A module is there that ends the process when it is imported; help and the name of ls100 live on."""
    install("lab_deadly", entries("lab_deadly", "deadly"), "import os; os._exit(7)")
    words = [
        "from evenlight.hardware.installed_drivers import *",
        "find_driver('ls100:COM3', InstrumentKind.LUMINANCE)",
        "from evenlight.command import main",
        "main(['measure', '--help'])",
    ]
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path!r}\n" + "\n".join(words)],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0


class Fake(ContextDevice):
    """A device of a package that returns, or raises, whatever it is told to."""

    def __init__(self, gives: Any) -> None:
        self._gives = gives

    def __getattr__(self, method: str) -> Any:
        def called(*_: Any) -> Any:
            if isinstance(self._gives, BaseException):
                raise self._gives
            return self._gives

        return called


NAMED = NamedDriver("fake", Driver(Fake, "a fake", "fake:PORT", package="lab-fakes"), "COM9", False)


def reading(value: Any = 1.0, **more: Any) -> Reading:
    """Return a reading whose values its record did not check, as a class of the package's own might not."""
    made = Reading(1.0, "cd/m^2", 1.0, 2.0)
    for name, given in {"value": value, **more}.items():
        object.__setattr__(made, name, given)
    return made


def sample(count: int, time_: float) -> PowerSample:
    return PowerSample(count, time_, 3.0, 1.0)


@pytest.mark.parametrize(
    ("guard", "method", "gives", "words"),
    [
        (GuardedLuminanceMeter, "read_luminance", reading(math.nan), "nan"),
        (GuardedLuminanceMeter, "read_luminance", reading(math.inf), "inf"),
        (GuardedLuminanceMeter, "read_luminance", reading(-3.0), "-3 cd/m"),
        (
            GuardedLuminanceMeter,
            "read_luminance",
            reading("12.5"),
            "a luminance must be a number, got '12.5'",
        ),
        (GuardedLuminanceMeter, "read_luminance", reading(True), "must be a number, got True"),
        (GuardedLuminanceMeter, "read_luminance", reading(unit="W"), "an evenlight.Reading in 'cd/m"),
        (GuardedLuminanceMeter, "read_luminance", reading(begun=3.0), "begun <= ended"),
        (GuardedLuminanceMeter, "read_luminance", reading(chromaticity=0.3), "x and y"),
        (GuardedLuminanceMeter, "read_luminance", 12.5, "an evenlight.Reading"),
        (GuardedLuminanceMeter, "read_luminance", None, "an evenlight.Reading"),
        (GuardedLuminanceMeter, "read_luminance", ValueError("could\nnot"), "ValueError: could not"),
        (GuardedLuminanceMeter, "apparatus", "a meter", "a dictionary of words"),
        (GuardedPowerMeter, "start", "fast", "the rate achieved must be a number"),
        (GuardedLuminanceMeter, "read_luminance", reading(10**400), "inf"),
        (GuardedLuminanceMeter, "read_luminance", reading(begun=-math.inf), "begun must be a finite number"),
        (GuardedLuminanceMeter, "read_luminance", SystemExit(0), "SystemExit: 0"),
        (GuardedLuminanceMeter, "zero", math.nan, "the zero must be a finite number"),
        (GuardedPowerMeter, "start", 0.0, "must be above 0 Hz"),
        (GuardedPowerMeter, "start", 1e300, "1e\\+06 Hz at most"),
        (GuardedPowerMeter, "samples", [sample(2, 1.0), sample(1, 2.0)], "sample 1 at 2 s after 2 at 1 s"),
        (GuardedPowerMeter, "samples", [sample(1, 2.0), sample(2, 1.0)], "its samples go back"),
        (GuardedPowerMeter, "samples", 3.0, "a sequence of evenlight.PowerSample"),
        (GuardedPowerMeter, "samples", [1.5], "an evenlight.PowerSample, got 1.5"),
        (GuardedPowerMeter, "samples", [PowerSample(0, 0.0, 0.0, 1e30)], r"1e\+30 W"),
        (GuardedPowerMeter, "samples", KeyError("power"), "KeyError: 'power'"),
        (GuardedPowerMeter, "ping", 7, "a comparison of clocks must be an evenlight.ClockPing or None"),
        (GuardedBacklight, "set_factor", 1.5, "the factor achieved must lie between 0 and 1, got 1.5"),
        (GuardedBacklight, "set_factor", 0.01, "was set to 0.5, and says 0.01"),
        (GuardedBacklight, "read_factor", math.nan, "between 0 and 1, got nan"),
        (GuardedBacklight, "step", None, "the step must be a number, got None"),
        (GuardedBacklight, "min_interval", -1.0, "must be 0 s or more"),
    ],
)
def test_whatever_a_driver_gives_is_a_value_that_can_be_or_one_line_that_names_driver_and_package(
    guard: Any, method: str, gives: Any, words: str
) -> None:
    arguments = {"start": (10.0,), "set_factor": (0.5,)}.get(method, ())
    device = guard(NAMED, lambda: Fake(gives))
    with pytest.raises(InstrumentError, match=words) as told:
        getattr(device, method)(*arguments)
    assert "fake:COM9 (driver of the package lab-fakes)" in str(told.value)
    assert "\n" not in str(told.value)


def test_samples_go_on_from_those_before_and_begin_anew_at_a_start() -> None:
    fake = Fake([sample(3, 1.0)])
    meter = GuardedPowerMeter(NAMED, lambda: fake)
    assert meter.samples() == meter.samples() == [sample(3, 1.0)]  # a repetition is a duplicated sample
    fake._gives = [sample(0, 0.0)]
    with pytest.raises(InstrumentError, match="go back") as told:
        meter.samples()
    assert told.value.fault is Fault.GARBLED
    fake._gives = 10.0
    meter.start(10.0)
    fake._gives = [sample(0, 0.0)]
    assert meter.samples() == [sample(0, 0.0)]


def test_what_can_be_comes_through_unchanged() -> None:
    ping, sample = ClockPing(1.0, 2.0, 3.0), PowerSample(4, 1.0, 1.1, 2.5)
    said = reading(3.5, status="ok", chromaticity=(0.31, 0.33))
    assert GuardedLuminanceMeter(NAMED, lambda: Fake(said)).read_luminance() == said
    assert GuardedPowerMeter(NAMED, lambda: Fake([sample])).stop() == [sample]
    assert GuardedPowerMeter(NAMED, lambda: Fake(ping)).ping() == ping
    assert GuardedBacklight(NAMED, lambda: Fake(0.498)).set_factor(0.5) == 0.498


def test_a_driver_that_cannot_be_opened_or_closed_is_told_of_and_its_own_error_is_kept() -> None:
    def opener() -> Any:
        raise OSError("no such bus")

    with pytest.raises(InstrumentError, match=r"driver of the package lab-fakes\): OSError: no such bus"):
        GuardedPowerMeter(NAMED, opener)
    own = InstrumentError("too dark", Fault.UNDER_RANGE)
    with pytest.raises(InstrumentError) as told:
        GuardedLuminanceMeter(NAMED, lambda: Fake(own)).read_luminance()
    assert told.value is own

    class Stuck(Fake):
        def close(self) -> None:
            raise RuntimeError("stuck")

    with pytest.raises(InstrumentError, match="RuntimeError: stuck"):
        GuardedBacklight(NAMED, lambda: Stuck(0.5)).close()
    with pytest.raises(KeyboardInterrupt) as interrupted, GuardedBacklight(NAMED, lambda: Stuck(0.5)):
        raise KeyboardInterrupt
    assert "stuck" in interrupted.value.__notes__[0]


def test_a_packages_backlight_is_a_rigs(install: Any) -> None:
    lamp = (
        "import evenlight\nclass Lamp(evenlight.ContextDevice):\n"
        "    def __init__(self, address, clock, timeout=None): self.address = address\n"
        "    def smallest_factor(self): return 0.25\n"
        "LAMP = evenlight.Driver(Lamp, 'a lamp', 'lab-lamp:PORT')\n"
    )
    install("lab_lamp", entries("lab_lamp", "lab-lamp", "backlights", "LAMP"), lamp)
    rig = replace(load_rig("simulated")[0], backlight="lab-lamp:COM4")
    backlight = open_backlight(rig, time.monotonic)
    assert backlight is not None
    assert backlight.smallest_factor() == 0.25
    backlight.close()
