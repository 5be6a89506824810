"""Files, tables and folders of results are there completely, or as they were before."""

import json
import os
import resource
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_writing import new_dataset
from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.data_schema.recordings.session import EventKind, SessionEvent
from evenlight.data_schema.storage import whole_files
from evenlight.data_schema.storage.append_log import AppendedRows, AppendLog, mend_last_line, record_line
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.whole_files import results_folder, whole_folder, write_whole


def everything(folder: Path) -> dict[str, bytes | None]:
    """Names below a folder, hidden ones too, with the contents of files."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def test_a_file_is_written_with_the_folders_it_needs(tmp_path: Path) -> None:
    write_whole(tmp_path / "a" / "b.txt", "L_a [cd/m²]")
    assert everything(tmp_path) == {"a": None, "a/b.txt": "L_a [cd/m²]".encode()}


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_in_the_middle_leaves_nothing(
    failure: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The content is on its way when the disk is full, or the user interrupts."""

    def fail(handle: int) -> None:
        assert [p for p in tmp_path.rglob("*") if p.is_file() and p.stat().st_size >= 0]
        raise failure

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises((InputError, KeyboardInterrupt)) as caught:
        write_whole(tmp_path / "new" / "folder" / "f.txt", "half")
    assert everything(tmp_path) == {}
    if isinstance(failure, OSError):
        assert str(caught.value) == f"cannot write {tmp_path}/new/folder/f.txt: No space left on device"


def test_a_new_data_set_in_the_working_folder_where_python_names_temporary_folders_in_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `tempfile.mkdtemp` does since Python 3.12, also for a relative `dir`."""
    before = tempfile.mkdtemp
    monkeypatch.setattr(tempfile, "mkdtemp", lambda **where: str(Path(before(**where)).resolve()))
    monkeypatch.chdir(tmp_path)
    with new_dataset(Path("lab")) as staging:
        write_whole(staging / "f.txt", "first")
    assert everything(tmp_path) == {"lab": None, "lab/f.txt": b"first"}


def test_a_failure_leaves_the_earlier_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "f.txt").write_text("earlier")
    monkeypatch.setattr(Path, "replace", lambda self, target: (_ for _ in ()).throw(OSError(5, "I/O error")))
    with pytest.raises(InputError, match="I/O error"):
        write_whole(tmp_path / "f.txt", "later")
    assert everything(tmp_path) == {"f.txt": b"earlier"}


def test_a_name_in_another_encoding_is_written_as_an_escape(tmp_path: Path) -> None:
    """A byte that is no UTF-8 in a file name reaches Python as a lone surrogate, which has no encoding."""
    write_whole(tmp_path / "f.txt", os.fsdecode(b"caf\xe9"))
    assert (tmp_path / "f.txt").read_text() == r"caf\udce9"


def test_a_file_below_a_file_names_itself(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cannot write .*file/inner/f\.txt: Not a directory"):
        write_whole(tmp_path / "file" / "inner" / "f.txt", "x")


def test_a_folder_is_not_overwritten_by_a_file(tmp_path: Path) -> None:
    (tmp_path / "d").mkdir()
    with pytest.raises(InputError, match=r"cannot write .*/d: Is a directory"):
        write_whole(tmp_path / "d", "x")
    assert everything(tmp_path) == {"d": None}


def write_half(out: Path, name: str, failure: BaseException) -> None:
    """Write one of several results, and fail."""
    with results_folder(out) as folder:
        (folder / name).write_text("half")
        raise failure


def test_results_appear_when_the_block_ends_and_not_before(tmp_path: Path) -> None:
    out = tmp_path / "a" / "out"
    with results_folder(out) as folder:
        (folder / "tables").mkdir()
        (folder / "tables" / "t.csv").write_text("1")
        assert not (out / "tables").exists()
    assert everything(tmp_path) == {
        "a": None,
        "a/out": None,
        "a/out/tables": None,
        "a/out/tables/t.csv": b"1",
    }


@pytest.mark.parametrize(
    "failure", [RuntimeError("no"), InputError("no"), KeyboardInterrupt(), SystemExit(1)]
)
def test_a_block_that_fails_leaves_nothing_of_it(failure: BaseException, tmp_path: Path) -> None:
    with pytest.raises(type(failure)):
        write_half(tmp_path / "a" / "b" / "out", "half.csv", failure)
    assert everything(tmp_path) == {}


def test_a_block_that_fails_leaves_an_earlier_folder_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "track.csv").write_text("earlier")
    with pytest.raises(RuntimeError):
        write_half(tmp_path, "track.csv", RuntimeError())
    assert everything(tmp_path) == {"track.csv": b"earlier"}


def test_results_replace_those_of_the_same_name_only(tmp_path: Path) -> None:
    (tmp_path / "track.csv").write_text("earlier")
    (tmp_path / "mine.txt").write_text("mine")
    with results_folder(tmp_path) as folder:
        (folder / "track.csv").write_text("later")
    assert everything(tmp_path) == {"track.csv": b"later", "mine.txt": b"mine"}


@pytest.fixture
def blocked(tmp_path: Path) -> Iterator[Path]:
    """A folder in which `a.csv` can be replaced, `b/` made, and `c` not, because it is a folder in use."""
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "mine.txt").write_text("mine")
    (tmp_path / "a.csv").write_text("earlier")
    return tmp_path


def test_results_that_cannot_all_be_put_in_place_are_taken_back(blocked: Path) -> None:
    before = everything(blocked)
    with pytest.raises(InputError, match=r"cannot write to the folder .*: Is a directory"):
        write_three(blocked)
    assert everything(blocked) == before


def write_three(out: Path) -> None:
    with results_folder(out) as folder:
        (folder / "a.csv").write_text("later")
        (folder / "b").mkdir()
        (folder / "b" / "new.csv").write_text("new")
        (folder / "c").write_text("a file where a folder is")


def write_anew(out: Path) -> None:
    with results_folder(out, replacing=("dataset",)) as folder:
        (folder / "dataset").mkdir()
        (folder / "dataset" / "a.csv").write_text("later")
        (folder / "report.html").write_text("later")


def earlier_results(out: Path) -> Path:
    (out / "dataset" / "sub-02").mkdir(parents=True)
    (out / "dataset" / "a.csv").write_text("earlier")
    (out / "dataset" / "sub-02" / "b.csv").write_text("earlier")
    (out / "mine.txt").write_text("mine")
    return out


def test_a_folder_whose_replacement_fails_is_as_it_was(tmp_path: Path) -> None:
    """`report.html` comes last and is a folder in use, when the new data set is in place already."""
    (earlier_results(tmp_path) / "report.html" / "mine").mkdir(parents=True)
    before = everything(tmp_path)
    with pytest.raises(InputError, match="cannot write to the folder"):
        write_anew(tmp_path)
    assert everything(tmp_path) == before


def test_a_folder_named_for_it_is_replaced_as_a_whole(tmp_path: Path) -> None:
    write_anew(earlier_results(tmp_path))
    assert everything(tmp_path) == {
        "dataset": None,
        "dataset/a.csv": b"later",
        "report.html": b"later",
        "mine.txt": b"mine",
    }


@pytest.mark.parametrize("step", range(4))
@pytest.mark.parametrize("when", ["before", "after"])
def test_an_interruption_at_any_step_leaves_everything_as_it_was(
    step: int, when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The steps: the old data set goes, its folder is made, its file moves in, the report moves in."""
    before = everything(earlier_results(tmp_path))
    steps = {"replace": Path.replace, "mkdir": Path.mkdir}
    done: list[str] = []

    def interrupted(name: str) -> Callable[..., object]:
        def act(path: Path, *arguments: object, **options: object) -> object:
            done.append(name)
            at_the_step = len(done) == step + 3  # two folders are made while the results are written
            if at_the_step and when == "before":
                raise KeyboardInterrupt
            result = steps[name](path, *arguments, **options)
            if at_the_step:
                raise KeyboardInterrupt
            return result

        return act

    for name in steps:
        monkeypatch.setattr(Path, name, interrupted(name))
    with pytest.raises(KeyboardInterrupt):
        write_anew(tmp_path)
    assert everything(tmp_path) == before


def test_a_folder_below_a_file_is_refused_before_any_work(tmp_path: Path) -> None:
    """Permissions do not hold an administrator back, but nobody makes a folder inside a file."""
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(InputError, match=r"cannot write .*file/out: Not a directory; choose another folder"),
        results_folder(tmp_path / "file" / "out"),
    ):
        pytest.fail("the work was begun")
    assert everything(tmp_path) == {"file": b""}


def test_a_folder_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with (
        pytest.raises(InputError, match=r"cannot write to the folder .*out"),
        results_folder(tmp_path / "out"),
    ):
        pytest.fail("the work was begun")


def test_folders_made_on_the_way_to_one_that_cannot_be_made_are_removed(tmp_path: Path) -> None:
    """A name may have 255 bytes on the usual file systems."""
    with pytest.raises(InputError, match="name too long"), results_folder(tmp_path / "a" / ("b" * 300)):
        pytest.fail("the work was begun")
    assert everything(tmp_path) == {}


def test_a_relative_folder_stays_relative_where_python_names_temporary_ones_in_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Since Python 3.12 `mkdtemp` returns an absolute path: a new data set then took its own for another."""
    make = tempfile.mkdtemp
    monkeypatch.setattr(tempfile, "mkdtemp", lambda **options: str(Path(make(**options)).absolute()))
    monkeypatch.chdir(tmp_path)
    with new_dataset(Path("lab")) as folder:
        (folder / "README").write_text("data")
    assert everything(tmp_path) == {"lab": None, "lab/README": b"data"}


# --- whole folder


def put(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_it_takes_the_place_of_the_earlier_one_as_a_whole(tmp_path):
    put(tmp_path / "a", old="1", both="1")
    with whole_folder(tmp_path / "a") as fresh:
        put(fresh, both="2", new="2")
        assert contents(tmp_path / "a") == {"old": "1", "both": "1"}
    assert contents(tmp_path / "a") == {"both": "2", "new": "2"}
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_block_that_fails_leaves_all_as_it_was(tmp_path):
    put(tmp_path / "a", old="1")
    with pytest.raises(FileNotFoundError), whole_folder(tmp_path / "a") as fresh:
        put(fresh / "missing" / "folder", new=Path("nothing").read_text())
    assert contents(tmp_path / "a") == {"old": "1"}
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_place_that_cannot_be_taken_is_told(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("a file")
    monkeypatch.setattr(whole_files, "TRIES", 1)
    with pytest.raises(InputError, match="cannot write"), whole_folder(tmp_path / "a" / "b") as fresh:
        put(fresh, new="1")


def test_what_was_killed_between_the_two_renames_is_brought_back(tmp_path):
    put(tmp_path / ".partial-abcdefgh" / ".replaced-12345678" / "a", mine="1")
    seen = []
    with whole_folder(tmp_path / "a") as fresh:
        seen.append(contents(tmp_path / "a"))
        put(fresh, new="2")
    assert seen == [{"mine": "1"}]
    assert contents(tmp_path / "a") == {"new": "2"}


def test_another_that_comes_first_is_replaced(tmp_path, monkeypatch):
    """Between the two renames another process puts its own folder there."""
    put(tmp_path / "a", old="1")
    usual, count = Path.replace, 0

    def replace(path, target):
        nonlocal count
        count += 1
        moved = usual(path, target)
        if count == 1:
            put(tmp_path / "a", other="2")
        return moved

    monkeypatch.setattr(Path, "replace", replace)
    with whole_folder(tmp_path / "a") as fresh:
        put(fresh, new="3")
    assert contents(tmp_path / "a") == {"new": "3"}


# --- append rows

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


# --- append log


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
