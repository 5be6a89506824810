"""A file or a folder of results is there completely, or as it was before."""

import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_writing import new_dataset
from evenlight.data_schema.storage.whole_files import results_folder, write_whole


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


def test_a_folder_named_for_it_is_replaced_as_a_whole(tmp_path: Path) -> None:
    write_anew(earlier_results(tmp_path))
    assert everything(tmp_path) == {
        "dataset": None,
        "dataset/a.csv": b"later",
        "report.html": b"later",
        "mine.txt": b"mine",
    }


def test_a_folder_whose_replacement_fails_is_as_it_was(tmp_path: Path) -> None:
    """`report.html` comes last and is a folder in use, when the new data set is in place already."""
    (earlier_results(tmp_path) / "report.html" / "mine").mkdir(parents=True)
    before = everything(tmp_path)
    with pytest.raises(InputError, match="cannot write to the folder"):
        write_anew(tmp_path)
    assert everything(tmp_path) == before


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
