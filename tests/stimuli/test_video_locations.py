"""Which videos are at a place, local or at a URL, and what tells that one has changed."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest
from loopback_server import LoopbackServer, served

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.video.video_locations import file_state, shown_name, videos_at

FILES = ("b10.mkv", "b2.MKV", "notes.txt", ".hidden.mkv", "more/a film.mp4", "more/c.odd", ".kept/d.mp4")
FILMS = ["b2.MKV", "b10.mkv", "more/a film.mp4"]


@pytest.fixture
def films(tmp_path: Path) -> Path:
    """A folder with three films and what is none."""
    for name in FILES:
        (tmp_path / "films" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "films" / name).write_bytes(b"content of " + name.encode())
    return tmp_path / "films"


@pytest.fixture
def server(films: Path) -> Iterator[LoopbackServer]:
    with served(films.parent) as server:
        yield server


@pytest.fixture
def memory() -> Iterator[str]:
    """The same folder in fsspec's memory."""
    files = fsspec.filesystem("memory")
    for name in FILES:
        files.pipe(f"/films/{name}", b"content of " + name.encode())
    yield "memory://films"
    files.rm("/films", recursive=True)


@pytest.fixture(params=["path", "file", "memory", "http"])
def place(request: pytest.FixtureRequest, films: Path) -> str:
    """The folder, by each kind of name."""
    if request.param == "path":
        return str(films)
    if request.param == "file":
        return films.as_uri()
    if request.param == "memory":
        return str(request.getfixturevalue("memory"))
    return str(request.getfixturevalue("server").url) + "/films"


def ends(names: list[str]) -> list[str]:
    """Return what is below the folder, as people read it."""
    return [name.rpartition("films/")[2].replace("%20", " ") for name in names]


@pytest.mark.parametrize(
    ("below", "found"),
    [
        ("", FILMS),
        ("/", FILMS),
        ("/*", FILMS[:2]),
        ("/**/*", FILMS),
        ("/*.mkv", ["b10.mkv"]),
        ("/**/*.odd", ["more/c.odd"]),
        ("/b[0-9]*", FILMS[:2]),
        ("/notes.txt", ["notes.txt"]),
    ],
)
def test_folders_globs_and_files_are_alike_everywhere(place: str, below: str, found: list[str]) -> None:
    assert sorted(ends(videos_at(place + below))) == sorted(found)


def test_what_is_found_has_its_natural_order_and_names_the_place_as_it_was_named(place: str) -> None:
    names = videos_at(place)
    assert [name for name in ends(names) if name in FILMS[:2]] == FILMS[:2]
    assert all(name.startswith(place.removeprefix("file://")) for name in names)


@pytest.mark.parametrize("below", ["/none", "/none/", "/*.ogv", "/notes/*", "/.kept/none.mp4"])
def test_where_there_is_none_it_is_said_in_a_line(place: str, below: str) -> None:
    with pytest.raises(InputError, match=r"no such file|no videos|404") as refused:
        videos_at(place + below)
    assert "\n" not in str(refused.value)


def test_a_folder_without_videos_says_what_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there are no videos; looked for files that end in \.mp4 \.mkv"):
        videos_at(str(tmp_path))


def test_a_file_whose_name_looks_like_a_glob_is_that_file(tmp_path: Path) -> None:
    (tmp_path / "film[1].mkv").touch()
    assert videos_at(str(tmp_path / "film[1].mkv")) == [str(tmp_path / "film[1].mkv")]


def test_the_state_of_a_file_changes_with_its_content(place: str, films: Path) -> None:
    name = place + "/b10.mkv"
    before = file_state(name)
    assert before is not None
    assert file_state(name) == before
    (films / "b10.mkv").write_bytes(b"other")
    os.utime(films / "b10.mkv", (1e9, 1e9))
    fsspec.filesystem("memory").pipe("/films/b10.mkv", b"other")
    assert file_state(name) not in (None, before)


def test_where_nothing_tells_there_is_no_state(place: str) -> None:
    assert file_state(place + "/none.mkv") is None
    assert file_state("sunrise") is None


def test_a_server_that_is_not_there_is_named(server: LoopbackServer) -> None:
    server.server_close()
    with pytest.raises(InputError, match=r"cannot read http://127\.0\.0\.1:\d+/films/: nobody answers"):
        videos_at(f"{server.url}/films/")


def test_a_protocol_that_is_unknown_or_needs_a_package_is_named() -> None:
    with pytest.raises(InputError, match="cannot read odd://films: Protocol not known: odd"):
        videos_at("odd://films")
    with pytest.raises(InputError, match=r"^cannot read s3://bucket/films: Install s3fs to access S3$"):
        videos_at("s3://bucket/films")


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(InputError, match=r"need an extra: pip install 'evenlight\[cluster\]'"):
        videos_at("https://host/films")


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("https://me:pa@ss@host/a@b.mp4?X-Amz-Signature=1&b=2#c", "https://host/a@b.mp4"),
        ("simplecache::https://me:word@host/film.mp4?sig=1", "simplecache::https://host/film.mp4"),
        ("s3://bucket/film.mp4", "s3://bucket/film.mp4"),
        ("https://host/film.mp4?sig=a::b:c", "https://host/film.mp4"),
        ("what? #1.mp4", "what? #1.mp4"),
    ],
)
def test_names_are_shown_without_secrets(name: str, shown: str) -> None:
    assert shown_name(name) == shown
