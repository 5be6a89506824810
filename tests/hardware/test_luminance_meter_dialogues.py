"""Luminance meters byte by byte: what each driver sends, and what it makes of each answer."""

import time
from collections.abc import Sequence

import pytest
from emulators.link import EmulatedLink
from scripted_instrument import ScriptedInstrument

from evenlight.data_schema.recordings.instrument_logs import MeterReading
from evenlight.data_schema.recordings.sweep import LuminanceReading, PowerReading, ReadingStatus, SweepPhase
from evenlight.hardware.drivers import serial_meter
from evenlight.hardware.drivers.colorcal import ColorCal
from evenlight.hardware.drivers.konica_minolta import CHECK_CODES, Cs100a, Ls100
from evenlight.hardware.drivers.photo_research import ERROR_CODES, PR650_QUALITY, Pr650, Pr655, Pr670
from evenlight.hardware.protocols import Fault, InstrumentError, LuminanceMeter, Reading

TIMEOUT = 4.0  # [s] one test waits so long; a busy machine answers within it
Script = Sequence[tuple[bytes, bytes]]

MINOLTA_BEGIN = [(b"MDS,04\r\n", b"OK00\r\n")]
PR655_BEGIN = [
    (b"PHOTO", b" REMOTE MODE\r\n"),
    (b"D111\r", b"0000,PR-655\r\n"),
    *[(b"D110\r", b"0000,60102905\r\n")] * 2,
    (b"D114\r", b"0000,2.02\r\n"),
    (b"SU1\r", b"0000\r\n"),
]
PR650_BEGIN = [(b"b1\n", b"000\r\n"), (b"s01,,,,,,01,1\n", b"000\r\n")]
# The rows of a matrix that CRS's own example shows: 8053, 52040, 50642 are 0.8053, -0.2040 and -0.0642.
COLORCAL_IDENTITY = (b"IDR\n", b"\n\rOK00,1,8096,100.10,3100042,1.24\n\r>")
COLORCAL_MATRIX = [
    (b"r01\n", b"\n\rOK00, 8053,52040,50642\n\r>"),
    (b"r02\n", b"\n\rOK00,    0,10000,    0\n\r>"),
    (b"r03\n", b"\n\rOK00,    0,    0,20000\n\r>"),
]
COLORCAL_BEGIN = [COLORCAL_IDENTITY, COLORCAL_IDENTITY, *COLORCAL_MATRIX, *COLORCAL_MATRIX]
# What follows a reading: nothing else has come when this is answered.
MINOLTA_MODE = (b"MDS,04\r\n", b"OK00\r\n")
BEGINNINGS: dict[type, tuple[Script, Script]] = {
    Ls100: (MINOLTA_BEGIN, []),
    Cs100a: (MINOLTA_BEGIN, []),
    Pr655: (PR655_BEGIN, [(b"Q", b"")]),
    Pr650: (PR650_BEGIN, []),
    ColorCal: (COLORCAL_BEGIN, []),
}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line counts as quiet sooner, and characters follow at once."""
    monkeypatch.setattr(serial_meter, "QUIET", 0.005)
    monkeypatch.setattr(Pr655, "interval", 0.0)


def played(driver: type, script: Script, readings: int = 1) -> list[Reading | InstrumentError]:
    """What a driver reads in a dialogue, errors included; its script is played to the end."""
    beginning, end = BEGINNINGS[driver]
    instrument = ScriptedInstrument([*beginning, *script, *end])
    found: list[Reading | InstrumentError] = []
    terminal = driver not in (Ls100, Cs100a)  # which need 7 data bits
    with EmulatedLink(instrument, pseudo_terminal=terminal) as link:
        meter: LuminanceMeter = driver(link.url, timeout=TIMEOUT)
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


def after_errors(exchanges: Script, landmark: tuple[bytes, bytes]) -> Script:
    """Exchanges that end in an error, but perhaps the last one; the next is preceded by two landmarks."""
    return [part for exchange in exchanges for part in (landmark, landmark, exchange)][2:]


def pr655_twice(answer: bytes) -> Script:
    """A PR-655's reading, and the same when it is asked for again."""
    return [(b"M1\r", answer), (b"D1\r", answer)]


def pr650_twice(answer: bytes) -> Script:
    """A PR-650's measurement, and its values twice."""
    return [(b"m0\n", b"000\r\n"), (b"d2\n", answer), (b"d2\n", answer)]


def read(driver: type, script: Script) -> Reading:
    """The one reading of a dialogue."""
    (found,) = played(driver, script)
    if isinstance(found, InstrumentError):
        raise found
    return found


def test_an_ls100s_reply_is_a_sign_and_six_characters() -> None:
    luminances = {
        b"OK00,   48.1\r\n": 48.1,
        b"OK00,   .123\r\n": 0.123,
        b"OK00,  12340\r\n": 12340.0,
        b"OK00, 299900\r\n": 299900.0,
        b"OK00,  1234.\r\n": 1234.0,
        b"OK00,+ 0.000\r\n": 0.0,
        b"\r\nOK00,   48.1\r\n": 48.1,  # an end of line that nobody asked for
    }
    script = [
        part
        for number, answer in enumerate(luminances)
        for part in ((b"MES\r\n", answer), *[MINOLTA_MODE] * (1 + number % 2))  # once and twice in turn
    ]
    readings = played(Ls100, script, len(luminances))
    for reading, luminance in zip(readings, luminances.values(), strict=True):
        assert isinstance(reading, Reading)
        assert (reading.value, reading.status, reading.chromaticity) == (luminance, "OK00", None)


def test_a_cs100as_reply_of_28_bytes_is_luminance_and_chromaticity() -> None:
    """The manual's layout: check code, sign and six characters, twice a sign and five."""
    answer = b"OK00,   48.1, .3120, .3290\r\n"
    assert len(answer) == 28
    reading = read(Cs100a, [(b"MES\r\n", answer), MINOLTA_MODE])
    assert (reading.value, reading.chromaticity) == (48.1, (0.312, 0.329))


def test_a_cs100as_reply_that_lost_characters_is_no_shorter_number() -> None:
    """12.3 for 12.34, and what else two lost bytes make of it."""
    cut = [
        b"OK00,  12.3, .312, .3290\r\n",
        b"OK00,  12., .3120, .3290\r\n",
        b"OK00,12.34, .3120, .3290\r\n",
        b"OK00,  12.34, .3120, .32\r\n",
        b"OK00,  12.34, .120, .290\r\n",
    ]
    script = after_errors([(b"MES\r\n", answer) for answer in cut], MINOLTA_MODE)
    for error in played(Cs100a, script, len(cut)):
        assert isinstance(error, InstrumentError)
        assert error.fault is Fault.GARBLED


def test_an_ls100_of_another_length_is_told_by_three_replies_and_held_to_it() -> None:
    """Its length is not confirmed. Here it is ten characters; then one gets lost."""
    measure = b"MES\r\n"
    script = [
        (measure, b"OK00, 48.1\r\n"),
        (measure, b"OK00, 48.2\r\n"),
        (measure, b"OK00, 48.3\r\n"),
        MINOLTA_MODE,
        (measure, b"OK00, 4.1\r\n"),
        MINOLTA_MODE,
        MINOLTA_MODE,
        (measure, b"OK00, 48.4\r\n"),
        MINOLTA_MODE,
        MINOLTA_MODE,
    ]
    first, lost, last = played(Ls100, script, 3)
    assert isinstance(first, Reading)
    assert first.value == 48.1
    assert isinstance(lost, InstrumentError)
    assert "9 characters instead of 10" in str(lost)
    assert isinstance(last, Reading)
    assert last.value == 48.4


def test_a_first_reply_of_another_length_that_does_not_come_again_is_garbled() -> None:
    script = [(b"MES\r\n", b"OK00,  48.1\r\n"), (b"MES\r\n", b"OK00,   48.1\r\n")]
    (error,) = played(Ls100, script)
    assert isinstance(error, InstrumentError)
    assert error.fault is Fault.GARBLED


def test_a_second_instrument_that_answers_is_noticed_and_not_read() -> None:
    """Each has two answers to one question: the first may be anyone's."""
    other = b"OK00,   77.7\r\n"
    script = [(b"MES\r\n", other + b"OK00,   48.1\r\n"), MINOLTA_MODE]
    (error,) = played(Ls100, script)
    assert isinstance(error, InstrumentError)
    assert "does a second instrument answer" in str(error)
    assert error.fault is Fault.GARBLED
    script = [(b"MES\r\n", b"OK00,   48.1\r\n"), (b"MDS,04\r\n", b"OK00\r\n" + other)]
    reading, unasked = played(Ls100, script, 2)
    assert isinstance(reading, Reading)
    assert reading.value == 48.1
    assert isinstance(unasked, InstrumentError)
    assert "which was not asked for" in str(unasked)
    script = [
        (b"MES\n", b"\n\rOK00,100.00, 50.00, 20.00\n\r>"),
        (b"IDR\n", b"\n\rOK00,1,8096,100.10,3100043,1.24\n\r>"),  # of another serial number
    ]
    (error,) = played(ColorCal, script)
    assert isinstance(error, InstrumentError)
    assert error.fault is Fault.GARBLED


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
    script = after_errors([(b"MES\r\n", answer) for answer in answers], MINOLTA_MODE)
    for error in played(Ls100, script, len(answers)):
        assert isinstance(error, InstrumentError)
        assert error.fault is Fault.GARBLED


def test_every_check_code_becomes_an_error_in_words_and_none_a_value() -> None:
    """-999999 comes with a luminance beyond the display."""
    codes = [*CHECK_CODES, "ER99"]
    answers = [f"{code}{',-999999' if code == 'OK12' else ''}\r\n".encode() for code in codes]
    script = after_errors([(b"MES\r\n", answer) for answer in answers], MINOLTA_MODE)
    for code, error in zip(codes, played(Ls100, script, readings=len(codes)), strict=True):
        assert isinstance(error, InstrumentError)
        assert error.code == code
        words, fault = CHECK_CODES.get(code, ("its manual does not have", Fault.REFUSED))
        assert words in str(error)
        assert error.fault is fault


def test_a_difference_is_no_luminance() -> None:
    with pytest.raises(InstrumentError, match="Set it to ABS"):
        read(Ls100, [(b"MES\r\n", b"OK00,-   3.2\r\n"), MINOLTA_MODE])
    with pytest.raises(InstrumentError, match="Set it to ABS"):
        read(Ls100, [(b"MES\r\n", b"OK00,-  0.00\r\n"), MINOLTA_MODE])


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
        MINOLTA_MODE,
        (b"MES\r\n", b"OK00,   22.0\r\n"),
        MINOLTA_MODE,
    ]
    lost, reading = played(Ls100, script, readings=2)
    assert isinstance(lost, InstrumentError)
    assert lost.fault is Fault.NO_REPLY
    assert "with F held" in str(lost)
    assert isinstance(reading, Reading)
    assert reading.value == 22.0


def test_a_pr655_is_asked_for_luminance_and_chromaticity() -> None:
    reading = read(Pr655, pr655_twice(b"0000,111,4.810e+01,0.3120,0.3290\r\n"))
    assert (reading.value, reading.status, reading.chromaticity) == (48.1, "0000", (0.312, 0.329))


def test_the_example_of_the_pr655s_manual_is_read() -> None:
    """Page 126 of the PR-655/670 manual, data code 1."""
    for exponent in (b"+01", b"+001"):  # as in code 1, and as in code 5
        reading = read(Pr655, pr655_twice(b"00000,0,1.865e" + exponent + b",0.4035,0.4202\r\n"))
        assert (reading.value, reading.chromaticity) == (18.65, (0.4035, 0.4202))


@pytest.mark.parametrize(
    ("first", "copy"),
    [
        (b"0000,111,4.810e+01,0.3120,0.3290\r\n", b"0000,111,4.910e+01,0.3120,0.3290\r\n"),
        (b"0000,112,4.810e+01,0.3120,0.3290\r\n", b"0000,111,4.810e+01,0.3120,0.3290\r\n"),
    ],
)
def test_a_reading_that_is_another_when_it_is_sent_again_is_garbled(first: bytes, copy: bytes) -> None:
    """The line has no parity: a flipped bit made a 9 of an 8, or other units."""
    (error,) = played(Pr655, [(b"M1\r", first), (b"D1\r", copy)])
    assert isinstance(error, InstrumentError)
    assert error.fault is Fault.GARBLED
    first, copy = (b"00,0,3.000e+01,4.800e+01,2.200e+01\r\n", b"00,0,3.000e+01,4.900e+01,2.200e+01\r\n")
    (error,) = played(Pr650, [(b"m0\n", b"000\r\n"), (b"d2\n", first), (b"d2\n", copy)])
    assert isinstance(error, InstrumentError)
    assert error.fault is Fault.GARBLED


def test_a_pr655_that_measures_something_else_is_refused() -> None:
    with pytest.raises(InstrumentError, match="illuminance: take the accessory off"):
        read(Pr655, pr655_twice(b"0000,112,4.810e+01,0.3120,0.3290\r\n"))
    with pytest.raises(InstrumentError, match="units that its manual does not have"):
        read(Pr655, pr655_twice(b"0000,7,4.810e+01,0.3120,0.3290\r\n"))


def test_a_pr670_that_is_named_pr655_is_told_so() -> None:
    script = [PR655_BEGIN[0], (b"D111\r", b"0000,PR-670\r\n"), (b"Q", b"")]
    with (
        EmulatedLink(ScriptedInstrument(script[:2]), pseudo_terminal=True) as link,
        pytest.raises(InstrumentError, match="it is a PR-670; name it pr670"),
    ):
        Pr655(link.url, timeout=TIMEOUT)
    assert issubclass(Pr670, Pr655)


def test_every_error_of_a_pr655_is_told_in_words() -> None:
    codes = [*ERROR_CODES, -77]
    script = after_errors(
        [(b"M1\r", f"{code}\r\n".encode()) for code in codes], (b"D110\r", b"0000,60102905\r\n")
    )
    for code, error in zip(codes, played(Pr655, script, readings=len(codes)), strict=True):
        assert isinstance(error, InstrumentError)
        assert error.code == str(code)
        words, fault = ERROR_CODES.get(code, ("see this error in its manual", Fault.REFUSED))
        assert words in str(error)
        assert error.fault is fault


@pytest.mark.parametrize(
    "answer",
    [
        b"0000,111\r\n",
        b"0000,111,abc,0.3,0.3\r\n",
        b"hello\r\n",
        b"0000,111,nan,0.3,0.3\r\n",
        b"0000,111,1.014e+02,nan,0.3290\r\n",
        b"0000,111,1.014,0.3120,0.3290\r\n",  # without its exponent
        b"0000,111,1.014e+0,0.3120,0.3290\r\n",
        b"0000,111,1.0140000,111,1.014e+02,0.3120,0.3290\r\n",  # two in one
        b"0000,111,1.014e+02,0.3120,0.3290,0.3290\r\n",
        b"0000,,1.014e+02,0.3120,0.3290\r\n",
    ],
)
def test_what_is_no_reply_of_a_pr655_is_garbled(answer: bytes) -> None:
    with pytest.raises(InstrumentError) as failed:
        read(Pr655, [(b"M1\r", answer)])
    assert failed.value.fault is Fault.GARBLED


def test_a_pr650_measures_and_then_gives_its_values() -> None:
    """x = X / (X + Y + Z): 30 / 100 and 48 / 100."""
    reading = read(Pr650, pr650_twice(b"00,0,3.000e+01,4.800e+01,2.200e+01\r\n"))
    assert reading.value == 48.0
    assert reading.chromaticity == pytest.approx((0.3, 0.48))


def test_a_pr650_whose_units_are_no_luminance_is_refused() -> None:
    with pytest.raises(InstrumentError, match="units are not cd/m"):
        read(Pr650, pr650_twice(b"00,1,3.000e+01,4.800e+01,2.200e+01\r\n"))


def test_every_quality_code_of_a_pr650_is_told_in_words() -> None:
    codes = [*PR650_QUALITY, 99]
    values = (b"d2\n", b"00,0,3.000e+01,4.800e+01,2.200e+01\r\n")
    script = after_errors([(b"m0\n", f"{code:02d}\r\n".encode()) for code in codes], values)
    for code, error in zip(codes, played(Pr650, script, readings=len(codes)), strict=True):
        assert isinstance(error, InstrumentError)
        assert error.code == str(code)
        words, fault = PR650_QUALITY.get(code, ("its manual does not have", Fault.REFUSED))
        assert words in str(error)
        assert error.fault is fault


def test_a_colorcals_reading_is_corrected_with_its_matrix() -> None:
    """By hand: 0.8053 * 100 - 0.2040 * 50 - 0.0642 * 20 = 69.046; 50; 2 * 20 = 40; their sum is 159.046."""
    reading = read(ColorCal, [(b"MES\n", b"\n\rOK00,100.00, 50.00, 20.00\n\r>"), COLORCAL_IDENTITY])
    assert reading.value == pytest.approx(50.0)
    assert reading.chromaticity == pytest.approx((69.046 / 159.046, 50 / 159.046))


@pytest.mark.parametrize(
    ("driver", "script", "code"),
    [
        # By hand: Y of the matrix's second row is the measured Y, as it is.
        (ColorCal, [(b"MES\n", b"\n\rOK00,  0.02, -0.01,  0.00\n\r>"), COLORCAL_IDENTITY], "OK00"),
        (ColorCal, [(b"MES\n", b"\n\rOK00,  0.02,  0.00,  0.01\n\r>"), COLORCAL_IDENTITY], "OK00"),
        (ColorCal, [(b"MES\n", b"\n\rOK00,  0.00,  0.00,  0.00\n\r>"), COLORCAL_IDENTITY], "OK00"),
        (Pr655, pr655_twice(b"0000,111,-1.000e-02,0.3120,0.3290\r\n"), "0000"),
        (Pr655, pr655_twice(b"0000,111,0.000e+00,0.0000,0.0000\r\n"), "0000"),
        (Pr655, pr655_twice(b"0000,111,-0.000e+00,0.0000,0.0000\r\n"), "0000"),
        (Pr650, pr650_twice(b"00,0,1.000e-02,-2.000e-02,2.000e-02\r\n"), "00"),
        (Pr650, pr650_twice(b"00,0,0.000e+00,0.000e+00,0.000e+00\r\n"), "00"),
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


@pytest.mark.parametrize(
    "answer",
    [
        b"\n\rOK00,1.0,2.0\n\r>",
        b"\n\rOK00,1.0,2.0,x\n\r>",
        b"\n\r1.0\n\r>",
        b"\n\rOK00,242.85,48.11, 89.05\n\r>",  # a digit lost
        b"\n\rOK00,242.85,2481.1, 89.05\n\r>",
    ],
)
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
