"""Logs and tables that grow: what was appended is on the disk, whole, whatever ends the program."""

import json
import os
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.data_schema.recordings.session import EventKind, SessionEvent
from evenlight.data_schema.storage.append_log import AppendedRows, AppendLog, mend_last_line, record_line
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


def event(number: int) -> SessionEvent:
    return SessionEvent(EventKind.PAGE_SHOWN, float(number), detail=f"page {number} – ΔL")


def filled(path: Path, count: int = 3) -> str:
    log = AppendLog(path)
    for number in range(count):
        log.append(event(number))
    log.close()
    return path.read_text()


@contextmanager
def disk_with_room_for(size: int) -> Iterator[None]:
    """The system itself refuses to let a file grow beyond a size, as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_a_log_opened_again_goes_on_at_its_end(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    first = filled(path, 2)
    assert filled(path, 1) == first + record_line(event(0))
    assert [json.loads(line)["time_s"] for line in path.read_text().splitlines()] == [0, 1, 0]


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.data())
def test_wherever_a_crash_tears_a_log_no_whole_line_is_lost(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("torn") / "events.jsonl"
    whole = filled(path).encode()
    cut = data.draw(st.integers(0, len(whole)))
    path.write_bytes(whole[:cut])
    torn = mend_last_line(path)
    mended = path.read_bytes()
    assert mended == b"" or mended.endswith(b"\n")
    # Lines whose last brace is there are kept, even if the line feed after it is not.
    kept = whole[: cut + 1].count(b"}\n")
    assert mended == b"".join(whole.splitlines(keepends=True)[:kept])
    assert (torn or "") == whole[len(mended) : cut].decode(errors="backslashreplace")


def test_a_full_disk_ends_in_one_line_and_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    before = filled(path, 2)
    log = AppendLog(path)
    with (
        disk_with_room_for(len(before.encode()) + 20),
        pytest.raises(InputError, match=r"events\.jsonl: File too large; what was recorded before is safe"),
    ):
        log.append(event(2))
    assert path.read_text() == before
    log.append(event(2))
    log.close()
    assert path.read_text() == before + record_line(event(2))


def test_a_log_that_cannot_be_opened_is_named(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").mkdir()
    with pytest.raises(InputError, match=r"cannot write .*events\.jsonl: Is a directory"):
        AppendLog(tmp_path / "events.jsonl")
