"""A folder that is replaced as a whole is there in full, or as it was, whatever happens on the way."""

from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage import whole_files
from evenlight.data_schema.storage.whole_files import whole_folder


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


def test_a_place_that_cannot_be_taken_is_told(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("a file")
    monkeypatch.setattr(whole_files, "TRIES", 1)
    with pytest.raises(InputError, match="cannot write"), whole_folder(tmp_path / "a" / "b") as fresh:
        put(fresh, new="1")
