"""Luminance meters byte by byte: what each driver sends, and what it makes of each answer."""

import time
from collections.abc import Sequence

import pytest
from scripted_instrument import ScriptedInstrument

from evenlight.data_schema.recordings.instrument_logs import MeterReading
from evenlight.data_schema.recordings.sweep import LuminanceReading, PowerReading, ReadingStatus, SweepPhase
from evenlight.hardware.drivers.colorcal import ColorCal
from evenlight.hardware.drivers.konica_minolta import CHECK_CODES, Cs100a, Ls100
from evenlight.hardware.drivers.photo_research import ERROR_CODES, PR650_QUALITY, Pr650, Pr655, Pr670
from evenlight.hardware.emulators.link import EmulatedLink
from evenlight.hardware.protocols import Fault, InstrumentError, LuminanceMeter, Reading

TIMEOUT = 0.4  # [s]
Script = Sequence[tuple[bytes, bytes]]

MINOLTA_BEGIN = [(b"MDS,04\r\n", b"OK00\r\n")]
PR655_BEGIN = [
    (b"PHOTO", b" REMOTE MODE\r\n"),
    (b"D111\r", b"0000,PR-655\r\n"),
    (b"D110\r", b"0000,60102905\r\n"),
    (b"D114\r", b"0000,2.02\r\n"),
    (b"SU1\r", b"0000\r\n"),
]
PR650_BEGIN = [(b"b1\n", b"000\r\n"), (b"s01,,,,,,01,1\n", b"000\r\n")]
# The rows of a matrix that CRS's own example shows: 8053, 52040, 50642 are 0.8053, -0.2040 and -0.0642.
COLORCAL_BEGIN = [
    (b"IDR\n", b"\n\rOK00,1,8096,100.10,3100042,1.24\n\r>"),
    (b"r01\n", b"\n\rOK00, 8053,52040,50642\n\r>"),
    (b"r02\n", b"\n\rOK00,    0,10000,    0\n\r>"),
    (b"r03\n", b"\n\rOK00,    0,    0,20000\n\r>"),
]
BEGINNINGS: dict[type, tuple[Script, Script]] = {
    Ls100: (MINOLTA_BEGIN, []),
    Cs100a: (MINOLTA_BEGIN, []),
    Pr655: (PR655_BEGIN, [(b"Q", b"")]),
    Pr650: (PR650_BEGIN, []),
    ColorCal: (COLORCAL_BEGIN, []),
}


def played(driver: type, script: Script, readings: int = 1) -> list[Reading | InstrumentError]:
    """What a driver reads in a dialogue, errors included; its script is played to the end."""
    beginning, end = BEGINNINGS[driver]
    instrument = ScriptedInstrument([*beginning, *script, *end])
    found: list[Reading | InstrumentError] = []
    options = {"interval": 0.0} if driver is Pr655 else {}
    terminal = driver not in (Ls100, Cs100a)  # which need 7 data bits
    with EmulatedLink(instrument, pseudo_terminal=terminal) as link:
        meter: LuminanceMeter = driver(link.url, timeout=TIMEOUT, **options)
        with meter:
            for _ in range(readings):
                try:
                    found.append(meter.read_luminance())
                except InstrumentError as error:
                    found.append(error)
        _wait_for_end(instrument)
    instrument.finish()
    return found


def _wait_for_end(instrument: ScriptedInstrument) -> None:
    """Give the link's thread time to take what was sent last."""
    end = time.monotonic() + TIMEOUT
    while not instrument.is_over() and time.monotonic() < end:
        time.sleep(0.001)


def read(driver: type, script: Script) -> Reading:
    """The one reading of a dialogue."""
    (found,) = played(driver, script)
    if isinstance(found, InstrumentError):
        raise found
    return found


def test_an_ls100s_reply_is_read_whatever_its_length() -> None:
    luminances = {
        b"OK00,   48.1\r\n": 48.1,  # padded to a sign and six characters
        b"OK00, 48.1\r\n": 48.1,
        b"OK00,48.1\r\n": 48.1,
        b"OK00,   .123\r\n": 0.123,
        b"OK00,  12340\r\n": 12340.0,
        b"OK00,  1234.\r\n": 1234.0,
        b"OK00,+ 0.000\r\n": 0.0,
        b"\r\nOK00,   48.1\r\n": 48.1,  # an end of line that nobody asked for
    }
    readings = played(Ls100, [(b"MES\r\n", answer) for answer in luminances], len(luminances))
    for reading, luminance in zip(readings, luminances.values(), strict=True):
        assert isinstance(reading, Reading)
        assert (reading.value, reading.status, reading.chromaticity) == (luminance, "OK00", None)


def test_a_cs100as_reply_of_28_bytes_is_luminance_and_chromaticity() -> None:
    """The manual's layout: check code, sign and six characters, twice a sign and five."""
    answer = b"OK00,   48.1, .3120, .3290\r\n"
    assert len(answer) == 28
    reading = read(Cs100a, [(b"MES\r\n", answer)])
    assert (reading.value, reading.chromaticity) == (48.1, (0.312, 0.329))


def test_what_is_no_reply_of_an_ls100_is_garbled_and_not_guessed() -> None:
    """Each is followed by what finds one's place again."""
    answers = [
        b"OK00,   48.1, .3120\r\n",
        b"OK00,   4 8.1\r\n",
        b"OK00,\r\n",
        b"OK00,abc\r\n",
        b"OK00,nan\r\n",
        b"OK0\r\n",
        b"48.1\r\n",
    ]
    again = (b"MDS,04\r\n", b"OK00\r\n")
    script = [part for answer in answers for part in ((b"MES\r\n", answer), again)][:-1]
    for error in played(Ls100, script, len(answers)):
        assert isinstance(error, InstrumentError)
        assert error.fault is Fault.GARBLED


def test_every_check_code_becomes_an_error_in_words_and_none_a_value() -> None:
    """-999999 comes with a luminance beyond the display."""
    codes = [*CHECK_CODES, "ER99"]
    script = [(b"MES\r\n", f"{code}{',-999999' if code == 'OK12' else ''}\r\n".encode()) for code in codes]
    for code, error in zip(codes, played(Ls100, script, readings=len(codes)), strict=True):
        assert isinstance(error, InstrumentError)
        assert error.code == code
        words, fault = CHECK_CODES.get(code, ("its manual does not have", Fault.REFUSED))
        assert words in str(error)
        assert error.fault is fault


def test_a_difference_is_no_luminance() -> None:
    with pytest.raises(InstrumentError, match="Set it to ABS"):
        read(Ls100, [(b"MES\r\n", b"OK00,-   3.2\r\n")])


def test_an_ls100_that_refuses_absolute_luminances_is_not_opened() -> None:
    with (
        EmulatedLink(ScriptedInstrument([(b"MDS,04\r\n", b"ER01\r\n")])) as link,
        pytest.raises(InstrumentError, match=r"settings are wrong.*ER01"),
    ):
        Ls100(link.url, timeout=TIMEOUT)


def test_a_lost_reply_is_followed_by_the_mode_whose_answer_holds_no_data() -> None:
    """The lost reply arrives after all, before that to the mode; the reading is the one after it."""
    script = [
        (b"MES\r\n", b""),
        (b"MDS,04\r\n", b"OK00,   11.0\r\nOK00\r\n"),
        (b"MES\r\n", b"OK00,   22.0\r\n"),
    ]
    lost, reading = played(Ls100, script, readings=2)
    assert isinstance(lost, InstrumentError)
    assert lost.fault is Fault.NO_REPLY
    assert "with F held" in str(lost)
    assert isinstance(reading, Reading)
    assert reading.value == 22.0


def test_a_pr655_is_asked_for_luminance_and_chromaticity() -> None:
    reading = read(Pr655, [(b"M1\r", b"0000,111,4.810e+01,0.3120,0.3290\r\n")])
    assert (reading.value, reading.status, reading.chromaticity) == (48.1, "0000", (0.312, 0.329))


def test_a_pr655_that_measures_something_else_is_refused() -> None:
    with pytest.raises(InstrumentError, match="illuminance: take the accessory off"):
        read(Pr655, [(b"M1\r", b"0000,112,4.810e+01,0.3120,0.3290\r\n")])


def test_a_pr670_that_is_named_pr655_is_told_so() -> None:
    script = [PR655_BEGIN[0], (b"D111\r", b"0000,PR-670\r\n"), (b"Q", b"")]
    with (
        EmulatedLink(ScriptedInstrument(script[:2]), pseudo_terminal=True) as link,
        pytest.raises(InstrumentError, match="it is a PR-670; name it pr670"),
    ):
        Pr655(link.url, timeout=TIMEOUT, interval=0.0)
    assert issubclass(Pr670, Pr655)


def test_every_error_of_a_pr655_is_told_in_words() -> None:
    codes = [*ERROR_CODES, -77]
    script = [(b"M1\r", f"{code}\r\n".encode()) for code in codes]
    for code, error in zip(codes, played(Pr655, script, readings=len(codes)), strict=True):
        assert isinstance(error, InstrumentError)
        assert error.code == str(code)
        words, fault = ERROR_CODES.get(code, ("its manual does not have", Fault.REFUSED))
        assert words in str(error)
        assert error.fault is fault


@pytest.mark.parametrize(
    "answer", [b"0000,111\r\n", b"0000,111,abc,0.3,0.3\r\n", b"hello\r\n", b"0000,111,nan,0.3,0.3\r\n"]
)
def test_what_is_no_reply_of_a_pr655_is_garbled(answer: bytes) -> None:
    with pytest.raises(InstrumentError) as failed:
        read(Pr655, [(b"M1\r", answer)])
    assert failed.value.fault is Fault.GARBLED


def test_a_pr650_measures_and_then_gives_its_values() -> None:
    """x = X / (X + Y + Z): 30 / 100 and 48 / 100."""
    reading = read(Pr650, [(b"m0\n", b"000\r\n"), (b"d2\n", b"00,0,3.000e+01,4.800e+01,2.200e+01\r\n")])
    assert reading.value == 48.0
    assert reading.chromaticity == pytest.approx((0.3, 0.48))


def test_a_pr650_that_shows_footlamberts_is_refused() -> None:
    with pytest.raises(InstrumentError, match="units are not cd/m"):
        read(Pr650, [(b"m0\n", b"000\r\n"), (b"d2\n", b"00,1,3.000e+01,4.800e+01,2.200e+01\r\n")])


def test_every_quality_code_of_a_pr650_is_told_in_words() -> None:
    codes = [*PR650_QUALITY, 99]
    script = [(b"m0\n", f"{code:02d}\r\n".encode()) for code in codes]
    for code, error in zip(codes, played(Pr650, script, readings=len(codes)), strict=True):
        assert isinstance(error, InstrumentError)
        assert error.code == str(code)
        words, fault = PR650_QUALITY.get(code, ("its manual does not have", Fault.REFUSED))
        assert words in str(error)
        assert error.fault is fault


def test_a_colorcals_reading_is_corrected_with_its_matrix() -> None:
    """By hand: 0.8053 * 100 - 0.2040 * 50 - 0.0642 * 20 = 69.046; 50; 2 * 20 = 40; their sum is 159.046."""
    reading = read(ColorCal, [(b"MES\n", b"\n\rOK00,100.00, 50.00, 20.00\n\r>")])
    assert reading.value == pytest.approx(50.0)
    assert reading.chromaticity == pytest.approx((69.046 / 159.046, 50 / 159.046))


@pytest.mark.parametrize(
    ("driver", "script", "code"),
    [
        # By hand: Y of the matrix's second row is the measured Y, as it is.
        (ColorCal, [(b"MES\n", b"\n\rOK00,  0.02, -0.01,  0.00\n\r>")], "OK00"),
        (ColorCal, [(b"MES\n", b"\n\rOK00,  0.02,  0.00,  0.01\n\r>")], "OK00"),
        (ColorCal, [(b"MES\n", b"\n\rOK00,  0.00,  0.00,  0.00\n\r>")], "OK00"),
        (Pr655, [(b"M1\r", b"0000,111,-1.000e-02,0.3120,0.3290\r\n")], "0000"),
        (Pr655, [(b"M1\r", b"0000,111,0.000e+00,0.0000,0.0000\r\n")], "0000"),
        (Pr650, [(b"m0\n", b"000\r\n"), (b"d2\n", b"00,0,1.000e-02,-2.000e-02,2.000e-02\r\n")], "00"),
        (Pr650, [(b"m0\n", b"000\r\n"), (b"d2\n", b"00,0,0.000e+00,0.000e+00,0.000e+00\r\n")], "00"),
    ],
)
def test_what_is_not_above_the_zero_of_a_meter_that_takes_its_own_off_is_too_dark(
    driver: type, script: Script, code: str
) -> None:
    with pytest.raises(InstrumentError, match=r"too dark for it: it makes -?0") as failed:
        read(driver, script)
    assert (failed.value.fault, failed.value.code) == (Fault.UNDER_RANGE, code)


def test_no_record_of_a_reading_takes_a_luminance_below_zero() -> None:
    luminance = {"luminance": -0.004, "begun": 0.0, "ended": 1.0, "meter_status": "OK00"}
    level = {"index": 0, "phase": SweepPhase.SWEEP, "repeat": 1, "factor": 0.5, "achieved_factor": 0.5}
    power = {"power": 0.5, "power_sd": 0.0, "duration": 1.0, "n_samples": 2, "n_lost": 0, "n_duplicated": 0}
    for record in (
        lambda: MeterReading(index=1, utc="", meter="colorcal:COM3", **luminance),
        lambda: LuminanceReading(pixel_value=0.0, status=ReadingStatus.OK, **level, **luminance),
        lambda: PowerReading(luminance_status=ReadingStatus.OK, **level, **power, **luminance),
    ):
        with pytest.raises(ValueError, match=r"luminance.* 0 .*-0\.004"):
            record()


@pytest.mark.parametrize("answer", [b"\n\rOK00,1.0,2.0\n\r>", b"\n\rOK00,1.0,2.0,x\n\r>", b"\n\r1.0\n\r>"])
def test_what_is_no_reply_of_a_colorcal_is_garbled(answer: bytes) -> None:
    with pytest.raises(InstrumentError) as failed:
        read(ColorCal, [(b"MES\n", answer)])
    assert failed.value.fault is Fault.GARBLED


def test_a_script_refuses_what_is_not_in_it_and_what_was_not_used() -> None:
    instrument = ScriptedInstrument([(b"MES\r\n", b"OK00\r\n")])
    with pytest.raises(ValueError, match="not sent"):
        instrument.finish()
    with pytest.raises(ValueError, match="expected b'MES"):
        instrument.receive(b"MDS")
