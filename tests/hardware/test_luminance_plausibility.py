"""Luminances and chromaticities that cannot be are refused; those of real lights are not."""

import math
from pathlib import Path

import numpy as np
import pytest
from emulators.link import EmulatedLink
from scripted_instrument import ScriptedInstrument

from evenlight.hardware.driver_table import LUMINANCE_METERS
from evenlight.hardware.drivers.konica_minolta import Cs100a
from evenlight.hardware.drivers.manual_meter import ManualMeter
from evenlight.hardware.drivers.photo_research import Pr655
from evenlight.hardware.drivers.serial_meter import SerialMeter
from evenlight.hardware.drivers.spotread import Spotread
from evenlight.hardware.plausibility import LUMINANCES, distance_from_lights, require_luminance
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError


@pytest.mark.parametrize("luminance", [math.nan, math.inf, -math.inf, -0.01, 999_999_999_999.0, 1.6e9])
def test_a_luminance_that_cannot_be_is_refused_with_what_can(luminance: float) -> None:
    with pytest.raises(InstrumentError, match=r"is 0 to 1e\+06 cd") as refused:
        require_luminance("pr655", "meter at COM3", luminance)
    assert f"meter at COM3: sent {luminance:g} cd/m^2" in str(refused.value)
    assert refused.value.fault is Fault.IMPLAUSIBLE
    assert refused.value.fault in TRANSIENT


def test_a_luminance_beyond_the_instruments_range_is_refused() -> None:
    require_luminance("ls100", "meter", 299_900.0)
    with pytest.raises(InstrumentError, match="0 to 299900"):
        require_luminance("ls100", "meter", 299_901.0)


@pytest.mark.parametrize(
    ("x", "y"), [(-0.9, 0.329), (0.3127, 0.95), (0.7, 0.7), (math.nan, 0.3), (0.3, math.inf), (0.0, 0.0)]
)
def test_a_chromaticity_of_no_light_is_refused(x: float, y: float) -> None:
    """Nothing is outside the spectral locus; (0, 0) is 0.17 to the left of its violet end."""
    with pytest.raises(InstrumentError, match="which is that of no light") as refused:
        require_luminance("cs100a", "meter", 100.0, (x, y))
    assert refused.value.fault is Fault.IMPLAUSIBLE


@pytest.mark.parametrize(
    "chromaticity",
    [
        (0.3127, 0.3290),  # D65
        (0.708, 0.292),  # the primaries of Rec. 2020, which are single wavelengths
        (0.170, 0.797),
        (0.131, 0.046),
        (0.735, 0.275),  # 700 nm, with 0.01 of error
        (0.1738, 0.0049),  # 380 nm
    ],
)
def test_real_lights_pass(chromaticity: tuple[float, float]) -> None:
    require_luminance("cs100a", "meter", 100.0, chromaticity)


def test_in_the_dark_noise_may_leave_the_lights() -> None:
    """0.02 cd/m^2 of noise, at 0.05 cd/m^2, make an error of 0.4; at 5 cd/m^2 of 0.004."""
    odd = (0.10, -0.25)  # 0.3 below the line of purples
    require_luminance("colorcal", "meter", 0.05, odd)
    require_luminance("cs100a", "meter", 0.0, odd)
    with pytest.raises(InstrumentError, match="no light"):
        require_luminance("colorcal", "meter", 5.0, odd)


@pytest.mark.slow
def test_the_table_of_the_spectral_locus_is_the_cies() -> None:
    """Against the CIE 1931 functions of the library colour, each nm from 380 to 700, to within 0.005."""
    colour = pytest.importorskip("colour")
    functions = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    wavelengths = np.arange(380, 701)
    XYZ = functions[wavelengths]
    for x, y in (XYZ[:, :2] / XYZ.sum(axis=1, keepdims=True)).tolist():
        assert abs(distance_from_lights(x, y)) < 0.005


def test_a_reading_that_cannot_be_is_an_error_and_the_line_is_found_again() -> None:
    """After it, the place on the line is found by two answers of the mode."""
    mode = (b"MDS,04\r\n", b"OK00\r\n")
    measure = b"MES\r\n"
    script = [
        mode,
        (measure, b"OK00,   48.1,-.9000, .3290\r\n"),
        *[mode] * 3,
        (measure, b"OK00, 999999, .3120, .3290\r\n"),
        *[mode] * 4,  # of which the first two belong to the reading, as every second time
        (measure, b"OK00,   48.1, .3120, .3290\r\n"),
        mode,
    ]
    with EmulatedLink(ScriptedInstrument(script)) as link, Cs100a(link.url, timeout=30.0) as meter:
        for words in ("no light", "sent 999999 cd"):
            with pytest.raises(InstrumentError, match=words) as refused:
                meter.read_luminance()
            assert refused.value.fault is Fault.IMPLAUSIBLE
        assert meter.read_luminance().value == 48.1


def test_a_spectroradiometers_impossible_number_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Pr655, "interval", 0.0)
    """Of the right form, and sent twice: 9.999e+11 cd/m^2."""
    answer = b"00000,0,9.999e+11,0.3120,0.3290\r\n"
    script = [
        (b"PHOTO", b" REMOTE MODE\r\n"),
        (b"D111\r", b"00000,PR-655\r\n"),
        *[(b"D110\r", b"00000,60102905\r\n")] * 2,
        (b"D114\r", b"00000,2.02\r\n"),
        (b"SU1\r", b"0000\r\n"),
        (b"M1\r", answer),
        (b"D1\r", answer),
        (b"Q", b""),
    ]
    with (
        EmulatedLink(ScriptedInstrument(script), pseudo_terminal=True) as link,
        Pr655(link.url, timeout=30.0) as meter,
        pytest.raises(InstrumentError, match=r"9\.999e\+11") as refused,
    ):
        meter.read_luminance()
    assert refused.value.fault is Fault.IMPLAUSIBLE


@pytest.mark.parametrize(
    ("result", "fault"),
    [
        (
            "XYZ: 1.0 2000000.000000 1.0, Yxy: 2000000.000000 0.312700 0.329000",
            Fault.GARBLED,
        ),  # not printf's %f
        ("XYZ: 47.5 50.0 54.4, Yxy: 50.0 0.31 0.33", Fault.GARBLED),
        ("XYZ: 475258.358663 500000.000000 544528.875380, Yxy: 5.000000 0.312700 0.329000", Fault.GARBLED),
        ("XYZ: 0.000000 2000000.000000 0.000000, Yxy: 2000000.000000 0.000000 1.000000", Fault.IMPLAUSIBLE),
        ("XYZ: -40.000000 50.000000 54.450000, Yxy: 50.000000 -0.620636 0.775795", Fault.IMPLAUSIBLE),
    ],
)
def test_a_result_of_spotread_that_cannot_be_is_refused(result: str, fault: Fault, tmp_path: Path) -> None:
    program = tmp_path / "spotread"
    listing = "case \"$1\" in -*\\?) echo 'Version 2.3.1'; echo \"    1 = 'x'\" ;;"
    program.write_text(f"#!/bin/sh\n{listing} *) echo 'Result is {result}' ;; esac\n")
    program.chmod(0o700)
    with Spotread(f"1@{program}") as meter, pytest.raises(InstrumentError) as refused:
        meter.read_luminance()
    assert refused.value.fault is fault


def test_a_typed_number_that_cannot_be_is_asked_for_again_and_minus_zero_is_zero() -> None:
    lines, questions = iter(["1e12", "inf", "-0"]), []

    def ask(question: str) -> str:
        questions.append(question)
        return next(lines)

    reading = ManualMeter(ask).read_luminance()
    assert math.copysign(1.0, reading.value) == 1.0
    assert reading.value == 0.0
    assert "from 0 to 1e+06" in questions[1]
    assert "type a number" in questions[2]


def test_each_driver_of_a_line_names_itself_as_the_table_does() -> None:
    """By which its range is found."""
    for name, driver in LUMINANCE_METERS.items():
        if driver.place and issubclass(driver.load(), SerialMeter):
            assert driver.load().driver == name
    assert set(LUMINANCES) <= set(LUMINANCE_METERS)
