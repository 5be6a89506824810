"""Readings that are typed in, and readings of a table that was made elsewhere."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.sweep import ReadingStatus
from evenlight.hardware.drivers.manual_meter import ManualMeter
from evenlight.hardware.luminance_table import luminance_readings_from_csv
from evenlight.hardware.protocols import Fault, InstrumentError

TABLE = """pixel_value,luminance_cd_m2,factor
0,u,
1,100.5,
0.5,22.1,
1,100.7,
1,50.2,0.5
"""


def typing(*lines: str) -> tuple[Callable[[str], str], list[str]]:
    """Somebody who types these lines, and the questions that they were asked."""
    left, questions = list(lines), []

    def ask(question: str) -> str:
        questions.append(question)
        if not left:
            raise EOFError
        return left.pop(0)

    return ask, questions


@pytest.mark.parametrize(
    ("typed", "luminance"),
    [
        ("12.5", 12.5),
        (" 12.5 cd/m2 ", 12.5),
        ("100 nits", 100.0),
        ("0.02cd/m^2", 0.02),
        ("1.2e2", 120.0),
        ("0", 0.0),
    ],
)
def test_a_number_is_a_luminance_with_its_unit_or_without(typed: str, luminance: float) -> None:
    times = iter([3.0, 8.0])
    reading = ManualMeter(typing(typed)[0], lambda: next(times)).read_luminance()
    assert (reading.value, reading.begun, reading.ended) == (luminance, 3.0, 8.0)


@pytest.mark.parametrize(
    ("typed", "problem"),
    [
        ("12,5", "Write a decimal point, not a comma"),
        ("1,234.5", "Write a decimal point"),
        ("bright", "type a number"),
        ("-3", "from 0 to 1e+06"),
        ("1e9", "from 0 to 1e+06"),
        ("29.2 fL", "29.2 fL are 100.039 cd/m^2"),  # 1 fL is 3.426 cd/m^2
        ("300 lux", "'lux' is not cd/m^2"),
        ("nan", "type a number"),
        ("12 13", "'13' is not cd/m^2"),
    ],
)
def test_what_is_no_luminance_is_asked_for_again_with_the_reason(typed: str, problem: str) -> None:
    ask, questions = typing(typed, "42")
    assert ManualMeter(ask).read_luminance().value == 42.0
    assert problem in questions[1]


def test_an_empty_line_repeats_the_question() -> None:
    ask, questions = typing("", "  ", "7")
    assert ManualMeter(ask).read_luminance().value == 7.0
    assert questions == [questions[0]] * 3


@pytest.mark.parametrize(
    ("typed", "fault", "code"),
    [
        ("u", Fault.UNDER_RANGE, "u"),
        ("O", Fault.OVER_RANGE, "o"),
        ("stop", Fault.REFUSED, "stop"),
    ],
)
def test_a_letter_says_that_there_is_no_reading(typed: str, fault: Fault, code: str) -> None:
    with pytest.raises(InstrumentError) as failed:
        ManualMeter(typing(typed)[0]).read_luminance()
    assert (failed.value.fault, failed.value.code) == (fault, code)


def test_an_input_that_has_ended_ends_the_readings() -> None:
    with pytest.raises(InstrumentError, match="no one types") as failed:
        ManualMeter(typing()[0]).read_luminance()
    assert failed.value.fault is Fault.DISCONNECTED


def test_a_closed_meter_asks_nothing() -> None:
    ask, questions = typing("1")
    with ManualMeter(ask) as meter:
        pass
    meter.close()
    with pytest.raises(InstrumentError, match="closed"):
        meter.read_luminance()
    assert not questions


@given(st.floats(0.0, 1e6))
def test_whatever_number_is_typed_is_the_one_that_is_read(luminance: float) -> None:
    assert ManualMeter(typing(repr(luminance))[0]).read_luminance().value == luminance


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(TABLE)
    return path


def test_a_table_becomes_readings_of_a_sweep(table: Path) -> None:
    readings = luminance_readings_from_csv(table)
    found = [(r.pixel_value, r.factor, r.luminance, r.repeat, r.status) for r in readings]
    assert found == [
        (0.0, None, None, 1, ReadingStatus.UNDER_RANGE),
        (1.0, None, 100.5, 1, ReadingStatus.OK),
        (0.5, None, 22.1, 1, ReadingStatus.OK),
        (1.0, None, 100.7, 2, ReadingStatus.OK),
        (1.0, 0.5, 50.2, 1, ReadingStatus.OK),
    ]
    assert [r.index for r in readings] == [0, 1, 2, 3, 4]


def test_a_spreadsheet_with_decimal_commas_reads_the_same(table: Path) -> None:
    readings = luminance_readings_from_csv(table)
    table.write_text(TABLE.replace(",", ";").replace(".", ","))
    assert luminance_readings_from_csv(table) == readings


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("pixel_value,luminance\n1,2\n", r"luminance"),
        ("pixel_value\n1\n", "'luminance_cd_m2' of a table of luminance readings is missing"),
        (
            "pixel_value,luminance_cd_m2\n255,2\n",
            r"line 2: pixel_value must be a number from 0 to 1, got '255'",
        ),
        ("pixel_value,luminance_cd_m2\n1,-999999\n", r"line 2: luminance_cd_m2 must be .*got '-999999'"),
        ("pixel_value,luminance_cd_m2\n1,nan\n", r"got 'nan'"),
        ("pixel_value,luminance_cd_m2,factor\n1,2,0\n", "factor must be above 0"),
        ("pixel_value,luminance_cd_m2\n1,2,3\n", "expected 2 cells, got 3"),
        ("pixel_value;luminance_cd_m2\n1;2,5;3\n", "expected 2 cells, got 3"),
        ("pixel_value,luminance_cd_m2\n", "has no readings"),
        ("", "is empty"),
    ],
)
def test_a_table_that_is_none_is_bad_input_in_one_line(text: str, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=problem) as refused:
        luminance_readings_from_csv(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)
