"""The conformance test finds what is wrong: the example's drivers, each with one promise broken."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from emulators.link import LinkFault
from emulators.ours import OURS, Emulated, LinkKind
from line_faults import FaultySubject, not_restored_is_told, nothing_is_made_up

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.hardware.conformance.conform import PROMISES, Promise, broken, conform, subject_named
from evenlight.hardware.conformance.subject import Subject
from evenlight.hardware.driver import NamedDriver
from evenlight.hardware.installed_drivers import InstrumentKind

EXAMPLE = Path(evenlight.__file__).parents[1] / "examples" / "evenlight-instruments"
DRIVERS = {InstrumentKind.LUMINANCE: "SPOT", InstrumentKind.POWER: "WATT", InstrumentKind.BACKLIGHT: "LAMP"}


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module of the example's drivers."""
    monkeypatch.syspath_prepend(EXAMPLE)
    from evenlight_instruments import drivers

    yield drivers
    while KEPT:
        KEPT.pop()._line.close()
    for name in [name for name in sys.modules if name.partition(".")[0] == "evenlight_instruments"]:
        del sys.modules[name]


def changed(example: Any, kind: InstrumentKind, **methods: Any) -> Subject:
    """A driver of the example, some of whose methods are others."""
    driver = getattr(example, DRIVERS[kind])
    cls = type(driver.place.__name__, (driver.place,), methods)
    driver = replace(driver, place=cls)
    return Subject(kind, NamedDriver(driver.address.partition(":")[0], driver, "", emulated=True))


def outcome(subject: Subject, words: str) -> str:
    """What is said of a promise; nothing if it is kept."""
    (promise,) = [one for one in PROMISES if words in one.words and subject.kind in one.kinds]
    return broken(promise, subject)


def reads(self: Any, value: float, unit: str = "cd/m^2") -> Any:
    return evenlight.Reading(value, unit, self._clock(), self._clock())


KEPT: list[Any] = []  # drivers that are not let go of


def keeps_open(self: Any) -> None:
    self._closed = True
    KEPT.append(self)


def forgets_the_number(self: Any) -> Any:
    """Read whatever line is there, as drivers do that ask and take the next line."""
    self._require_open()
    link = self._line._link
    link.write(b"#1 L?\n")
    line = link.read_line(self._line._timeout)
    return reads(self, float(line.split()[1]))


def twice_and_back(self: Any) -> Any:
    samples = [evenlight.PowerSample(k, 1.0 - k, 1.0, 0.6661) for k in range(2)]
    return [one for one in samples if self._period]


def floors(self: Any, factor: float) -> float:
    """The lamp has 200 steps: 0.7133 is 142.66 of them."""
    return self._set(int(factor * 200))


LUMINANCE, POWER, BACKLIGHT = InstrumentKind


@pytest.mark.parametrize(
    ("kind", "methods", "promise", "said"),
    [
        (LUMINANCE, {"apparatus": None}, "each method", "there is no method apparatus"),
        (LUMINANCE, {"read_luminance": lambda self, port: 1}, "each method", "takes ['self', 'port']"),
        (LUMINANCE, {"zero": lambda self: None}, "each method", "come together"),
        (LUMINANCE, {"read_luminance": lambda self: sys.exit(0)}, "reads luminances", "SystemExit: 0"),
        (LUMINANCE, {"close": lambda self: sys.exit(0)}, "says what it is", "SystemExit: 0"),
        (POWER, {"samples": twice_and_back}, "samples powers", "its samples go back"),
        (LUMINANCE, {"read_luminance": lambda self: reads(self, 100.0)}, "reads luminances", "gave 100 cd/m"),
        (
            LUMINANCE,
            {"read_luminance": lambda self: reads(self, 200.0, "nit")},
            "reads luminances",
            "in 'cd/m",
        ),
        (LUMINANCE, {"read_luminance": lambda self: 1 / 0}, "reads luminances", "ZeroDivisionError"),
        (LUMINANCE, {"apparatus": lambda self: {}}, "says what it is", "a dictionary of words"),
        (
            LUMINANCE,
            {"read_luminance": lambda self: reads(self, 1.0)},
            "then refuses",
            "in place of an error",
        ),
        (LUMINANCE, {"close": keeps_open}, "says what it is", "more files open than there were"),
        (POWER, {"samples": lambda self: []}, "samples powers", "no sample in"),
        (POWER, {"samples": lambda self: []}, "no samples before", "returned []"),
        (POWER, {"start": lambda self, rate: 10.0}, "refuses rates", "start(0): returned 10.0"),
        (BACKLIGHT, {"step": lambda self: 1e-4}, "nearest step", "set to 0.7133, and says 0.715"),
        (BACKLIGHT, {"set_factor": floors}, "nearest step", "set to 0.7133, it is 0.71, not the nearest"),
        (BACKLIGHT, {"set_factor": lambda self, factor: factor}, "nearest step", "it reports 1"),
        (BACKLIGHT, {"set_factor": lambda self, factor: self._set(200)}, "refuses factors", "in place of an"),
        (
            BACKLIGHT,
            {"close": lambda self: self._line.close()},
            "as it was found",
            "set to 1, it shines with",
        ),
    ],
)
def test_a_promise_that_is_broken_is_told_with_what_the_driver_did(
    example: Any, kind: InstrumentKind, methods: dict[str, Any], promise: str, said: str
) -> None:
    assert outcome(changed(example, kind), promise) == "", "the example itself keeps it"
    told = outcome(changed(example, kind, **methods), promise)
    assert said in told
    assert bool(told) == bool(said)
    assert "\n" not in told


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
    for changes in ({}, methods):
        named = changed(example, kind, **changes).named
        monkeypatch.setitem(kind.ours, "tried", named.driver)
        subject = FaultySubject(kind, replace(named, name="tried"))
        told = broken(Promise("", check), subject)
        assert (said if changes else "") in told
        assert bool(told) == bool(changes)


def test_libraries_that_are_imported_too_early_are_named(
    example: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    (tmp_path / "early_driver.py").write_text("import serial\nclass Early:\n    pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    from early_driver import Early

    driver = replace(example.SPOT, place=Early)
    subject = Subject(LUMINANCE, NamedDriver("example-spot", driver, "", emulated=True))
    assert "serial" in outcome(subject, "no device library")


def test_what_a_person_types_in_is_not_tried() -> None:
    lines: list[str] = []
    kept, wrong, untried = conform(subject_named("manual", "luminance"), lines.append)
    assert (kept, wrong, untried) == (2, 0, len(lines) - 2)
    assert sum(line.startswith("not tried") for line in lines) == untried > 2


def test_a_package_may_use_what_evenlight_itself_needs(
    example: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    (tmp_path / "array_driver.py").write_text("import numpy\nclass Arrays:\n    pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    from array_driver import Arrays

    driver = replace(example.SPOT, place=Arrays)
    subject = Subject(LUMINANCE, NamedDriver("example-spot", driver, "", emulated=True))
    assert outcome(subject, "no device library") == ""


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
        subject_named(name, kind)
