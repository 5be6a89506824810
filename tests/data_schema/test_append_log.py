"""Logs that only grow: what a crash or a full disk leaves of them."""

import json
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.session import EventKind, SessionEvent
from evenlight.data_schema.storage.append_log import AppendLog, mend_last_line, record_line


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
