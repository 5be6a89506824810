"""Files, tables and folders of results are there completely, or as they were before."""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_writing import new_dataset
from evenlight.data_schema.storage import whole_files
from evenlight.data_schema.storage.append_log import AppendLog
from evenlight.data_schema.storage.result_folders import (
    SUMS,
    Asked,
    asked_of_command,
    files_in,
    growing_folder,
    result_folder,
)
from evenlight.data_schema.storage.whole_files import held_place, write_whole


def everything(folder: Path) -> dict[str, bytes | None]:
    """Names below a folder, hidden ones too, with the contents of files."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def test_a_file_is_written_with_the_folders_it_needs(tmp_path: Path) -> None:
    write_whole(tmp_path / "a" / "b.txt", "L_a [cd/m²]")
    assert everything(tmp_path) == {"a": None, "a/b.txt": "L_a [cd/m²]".encode()}


def test_a_file_may_come_in_parts_of_which_a_disk_takes_some(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "write", lambda handle, part, write=os.write: write(handle, part[:2]))
    write_whole(tmp_path / "f.txt", (part for part in (b"lumi", b"", b"nance")))
    assert (tmp_path / "f.txt").read_bytes() == b"luminance"


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


def put(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)


def texts(folder: Path) -> dict[str, str]:
    """What is in the files of a folder, but for that of the sums."""
    return {name: (folder / name).read_text() for name in files_in(folder) if name != SUMS}


def write(out: Path, text: str, command: str = "optimize", force: bool = False) -> None:
    with result_folder(out, command, force=force) as folder:
        put(folder, track=text)
        put(folder / "tables", t=text)


def test_results_appear_when_the_block_ends_and_take_the_place_of_earlier_ones(tmp_path: Path) -> None:
    write(tmp_path / "a" / "out", "1")
    with result_folder(tmp_path / "a" / "out", "optimize") as folder:
        put(folder, other="2")
        assert texts(tmp_path / "a" / "out") == {"track": "1", "tables/t": "1"}
    assert texts(tmp_path / "a" / "out") == {"other": "2"}
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["out"]


def fail_in(out: Path, failure: BaseException) -> None:
    with result_folder(out, "optimize") as folder:
        put(folder, half="half")
        raise failure


@pytest.mark.parametrize(
    "failure", [RuntimeError("no"), InputError("no"), KeyboardInterrupt(), SystemExit(1)]
)
def test_a_block_that_fails_leaves_all_as_it_was(failure: BaseException, tmp_path: Path) -> None:
    write(tmp_path / "out", "earlier")
    before = everything(tmp_path)
    for out in (tmp_path / "out", tmp_path / "new" / "folder"):
        with pytest.raises(type(failure)):
            fail_in(out, failure)
    assert everything(tmp_path) == before


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("step", [1, 2])
def test_an_interruption_at_either_rename_leaves_one_of_the_two(
    step: int, when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C comes when the earlier folder goes, or the new one comes."""
    write(tmp_path / "out", "1")
    usual, done = Path.replace, []

    def replace(path: Path, target: Path) -> Path:
        done.append(target) if path.is_dir() else None
        interrupted = path.is_dir() and len(done) == step
        if interrupted and when == "before":
            raise KeyboardInterrupt
        moved = usual(path, target)
        if interrupted:
            raise KeyboardInterrupt
        return moved

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "out", "2")
    text = "2" if (step, when) == (2, "after") else "1"
    assert texts(tmp_path / "out") == {"track": text, "tables/t": text}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_what_was_killed_between_the_two_renames_is_brought_back(tmp_path: Path) -> None:
    write(tmp_path / "out", "1")
    (tmp_path / "out").rename(tmp_path / ".earlier.out")
    put(tmp_path / ".partial.out", half="2")
    with pytest.raises(InputError, match="no"):
        fail_in(tmp_path / "out", InputError("no"))
    assert texts(tmp_path / "out") == {"track": "1", "tables/t": "1"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda out: put(out, notes="mine"), "notes"),
        (lambda out: put(out, track="edited"), "track"),
        (lambda out: put(out / "deep" / "down", notes="mine"), "deep/down/notes"),
        (lambda out: (out / "link").symlink_to(out / "track"), "link"),
        (lambda out: (out / SUMS).unlink(), "tables/t, track"),
    ],
)
def test_what_no_earlier_result_has_is_not_replaced_but_by_force(
    change: Callable[[Path], object], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "out", "1")
    change(tmp_path / "out")
    before = everything(tmp_path)
    with pytest.raises(InputError, match=f"other things than a result of `evenlight optimize`: {told}; "):
        write(tmp_path / "out", "2")
    assert everything(tmp_path) == before
    write(tmp_path / "out", "2", force=True)
    assert texts(tmp_path / "out") == {"track": "2", "tables/t": "2"}
    assert capsys.readouterr().err == f"evenlight: note: {tmp_path / 'out'}: removed {told}\n"


def test_a_named_file_does_not_take_the_place_of_a_new_one(tmp_path: Path) -> None:
    """Loss curves of an earlier version are taken from the folder, and written into it."""
    put(out := tmp_path / "out", track="old")
    with asked_of_command(Asked(out, (out / "track",), lambda folder: None)):
        with pytest.raises(InputError, match="track: a result has its name"):
            write(out, "2")
        write(out, "2", force=True)
    assert texts(out) == {"track": "2", "tables/t": "2"}


def test_a_result_of_another_command_is_not_replaced(tmp_path: Path) -> None:
    write(tmp_path / "out", "1")
    with pytest.raises(InputError, match="than a result of `evenlight control`: tables/t, track; "):
        write(tmp_path / "out", "2", command="control")


def test_what_comes_while_the_work_is_done_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "1")
    with result_folder(out, "optimize") as folder:
        put(folder, track="2")
        put(out, notes="mine")
    assert texts(out) == {"track": "2", "notes": "mine"}
    with pytest.raises(InputError, match="notes; "):
        write(out, "3")


def test_validate_tells_a_file_of_a_result_that_was_changed(tmp_path: Path) -> None:
    write(tmp_path / "out", "1")
    assert [one.problems for one in validate(tmp_path / "out") if one.path.name == SUMS] == [[]]
    put(tmp_path / "out" / "tables", t="2")
    [problem] = next(one.problems for one in validate(tmp_path / "out") if one.path.name == SUMS)
    assert problem == f"{tmp_path}/out/SHA256SUMS: tables/t: is not as it was when this result was written"


def test_files_that_desktops_leave_in_any_folder_count_as_nothing(tmp_path: Path) -> None:
    put(tmp_path / "out", **{".DS_Store": ""})
    write(tmp_path / "out", "1")
    put(tmp_path / "out", **{".DS_Store": ""})
    write(tmp_path / "out", "2")
    assert texts(tmp_path / "out") == {"track": "2", "tables/t": "2"}


@pytest.mark.parametrize("write_there", [write_whole, write])
def test_two_programs_do_not_write_one_place(
    write_there: Callable[[Path, str], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(whole_files, "LONGEST_WAIT", 0.0)
    told = "out: another program is writing it; wait until it ends"
    with held_place(tmp_path / "out", tmp_path / "out"), pytest.raises(InputError, match=told):
        write_there(tmp_path / "out", "2")
    assert everything(tmp_path) == {}
    write_there(tmp_path / "out", "2")


@pytest.mark.parametrize("out", [".", "..", str(Path.home()), "/"])
def test_a_folder_in_use_is_not_replaced(out: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for place in (lambda: result_folder(Path(out), "fit", force=True), lambda: new_dataset(Path(out))):
        with pytest.raises(InputError, match="is a folder in use; give the name of one to make"), place():
            pytest.fail("the work was begun")
    assert everything(tmp_path) == {"here": None}


def test_a_user_without_a_home_writes_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In containers the number of a user may have no name."""
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    write(tmp_path / "out", "1")
    assert texts(tmp_path / "out") == {"track": "1", "tables/t": "1"}


def test_an_earlier_result_stays_where_neither_it_nor_the_new_one_can_be_put_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "out", "1")
    usual, out = Path.replace, tmp_path / "out"

    def replace(path: Path, target: Path) -> Path:
        if path.is_dir() and path != out:
            raise OSError(5, "I/O error")
        return usual(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(InputError, match="out: I/O error"):
        write(out, "2")
    monkeypatch.undo()
    with pytest.raises(InputError, match="no"):
        fail_in(out, InputError("no"))
    assert texts(out) == {"track": "1", "tables/t": "1"}


def test_a_link_to_a_folder_stays_one(tmp_path: Path) -> None:
    put(tmp_path / "disk" / "results")
    (tmp_path / "out").symlink_to(tmp_path / "disk" / "results")
    write(tmp_path / "out", "1")
    assert (tmp_path / "out").is_symlink()
    assert texts(tmp_path / "disk" / "results") == {"track": "1", "tables/t": "1"}


@pytest.mark.parametrize(
    ("out", "reason"), [("file/out", "Not a directory"), ("a/" + "b" * 300, "File name too long")]
)
def test_a_place_that_cannot_be_written_is_refused_before_any_work(
    out: str, reason: str, tmp_path: Path
) -> None:
    """Permissions do not hold an administrator back, but nobody makes a folder inside a file."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=f"cannot write .*: {reason}"), result_folder(tmp_path / out, "fit"):
        pytest.fail("the work was begun")
    assert everything(tmp_path) == {"file": b""}


def test_a_file_is_no_folder_of_results(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InputError, match="out: is a file; give the name of a folder"):
        write(tmp_path / "out", "1", force=True)


def test_the_sums_are_those_of_sha256sum_whatever_a_file_is_called(tmp_path: Path) -> None:
    names = ["plain", "two words", "back\\slash", "new\nline", os.fsdecode(b"caf\xe9")]
    for _ in range(2):  # the second time they are known again
        with result_folder(tmp_path / "out", "fit") as folder:
            put(folder, **dict.fromkeys(names, "x"))
    checked = subprocess.run(
        ["sha256sum", "--strict", "-c", SUMS], cwd=tmp_path / "out", capture_output=True, check=False
    )
    assert (checked.returncode, checked.stdout.count(b": OK\n")) == (0, len(names))


def test_a_folder_that_grows_holds_results_and_files_about_them(tmp_path: Path) -> None:
    def grow(force: bool = False) -> None:
        with growing_folder(tmp_path / "out", "catalogue", ["report"], force=force):
            write(tmp_path / "out" / "film", "1", command="catalogue")
            put(tmp_path / "out", report="1")

    grow()
    put(tmp_path / "out" / "below" / ".partial.film", half="of a killed worker")
    grow()
    shutil.rmtree(tmp_path / "out" / "below")
    put(tmp_path / "out", notes="mine")
    put(tmp_path / "out" / "other", track="mine")
    with pytest.raises(InputError, match="than a result of `evenlight catalogue`: notes, other/track;"):
        grow()
    grow(force=True)
    assert texts(tmp_path / "out") == {
        "report": "1", f"film/{SUMS}": (tmp_path / "out" / "film" / SUMS).read_text(), "film/track": "1",
        "film/tables/t": "1",
    }  # fmt: skip


def test_data_are_never_replaced_and_only_their_owner_reads_them(tmp_path: Path) -> None:
    with new_dataset(tmp_path / "lab") as folder:
        put(folder, f="data")
    assert (tmp_path / "lab").stat().st_mode & 0o777 == 0o700
    with pytest.raises(InputError, match="is there already"), new_dataset(tmp_path / "lab"):
        pytest.fail("the work was begun")
    put(tmp_path / "shared")
    (tmp_path / "shared").chmod(0o750)
    with new_dataset(tmp_path / "shared") as folder:
        put(folder, f="data")
    assert (tmp_path / "shared").stat().st_mode & 0o777 == 0o750
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lab", "shared"]


def test_files_have_the_permissions_that_the_user_wants(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        write_whole(tmp_path / "a" / "f", "x")
        AppendLog(tmp_path / "log").close()
        write(tmp_path / "out", "1")
    finally:
        os.umask(before)
    modes = {path.name: path.stat().st_mode & 0o777 for path in tmp_path.rglob("*") if path.is_file()}
    assert set(modes.values()) == {0o600}, modes
