"""Tables that grow: what was appended is there whatever happens next, and what was there is not touched."""

import os
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.data_schema.storage.tables import read_rows

PINGS = [ClockPing(k + 0.1, k + 1 / 3, k + 0.5) for k in range(4)]


def test_what_was_appended_can_be_read_at_once_and_is_the_same_numbers(tmp_path: Path) -> None:
    path = tmp_path / "clock.csv"
    with AppendedRows(path, ClockPing) as rows:
        assert read_rows(ClockPing, path) == []
        rows.append(PINGS[:1])
        assert read_rows(ClockPing, path) == PINGS[:1]
        rows.append([])
        rows.append(PINGS[1:])
        assert read_rows(ClockPing, path) == PINGS
    rows.close()
    with pytest.raises(ValueError, match="is closed"):
        rows.append(PINGS)


def test_a_file_that_is_there_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "clock.csv"
    path.write_text("of yesterday")
    with pytest.raises(InputError, match="is there already, and measured data are never overwritten"):
        AppendedRows(path, ClockPing)
    assert path.read_text() == "of yesterday"


def test_a_place_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write"):
        AppendedRows(tmp_path / "nowhere" / "clock.csv", ClockPing)


def test_rows_that_do_not_fit_on_the_disk_leave_nothing_of_them(tmp_path: Path, monkeypatch) -> None:
    path, write, calls = tmp_path / "clock.csv", os.write, []

    def full(handle: int, data: bytes) -> int:
        calls.append(data)
        if len(calls) == 1:
            return write(handle, data[:7])  # a part, then there is no room
        raise OSError(28, "No space left on device")

    with AppendedRows(path, ClockPing) as rows:
        rows.append(PINGS[:2])
        monkeypatch.setattr(os, "write", full)
        with pytest.raises(InputError, match="No space left on device; what was read before is in it"):
            rows.append(PINGS[2:])
        monkeypatch.undo()
        assert read_rows(ClockPing, path) == PINGS[:2]
