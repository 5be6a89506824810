"""Videos at places: local or at URLs, the same results, read in parts, refused in one line."""

from __future__ import annotations

import os
import pickle
import re
import sys
import tomllib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import fsspec
import numpy as np
import pytest
from av.video.frame import VideoFrame
from loopback_server import LoopbackServer, served
from optimized_videos import texture, video

import evenlight
from evenlight.analysis.catalogue.video_listing import file_state, videos_at
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.stimuli.sequences import open_video, open_videos
from evenlight.stimuli.video import video_locations
from evenlight.stimuli.video.film_bytes import FilmBytes
from evenlight.stimuli.video.video_file import open_video_file
from evenlight.stimuli.video.video_locations import shown_name

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


# --- videos at urls

OPTIONS = ("--budget", 0.5, "--display", "laptop-lcd", "--other-display-ok")

SECRET = "X-Amz-Signature=Hidden2"


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("served")
    return video(folder / "a clip.mkv", [texture(k % 5) * 0.2 * (k % 4 + 1) for k in range(10)])


@pytest.fixture
def film_server(clip: Path) -> Iterator[LoopbackServer]:
    with served(clip.parent) as film_server:
        yield film_server


@pytest.fixture
def film(film_server: LoopbackServer) -> str:
    """The clip at a URL with a password and a signature."""
    return f"{film_server.url.replace('//', '//me:Hidden1@')}/a%20clip.mkv?{SECRET}"


def at_urls(clip: Path, film: str) -> list[str]:
    fsspec.filesystem("memory").pipe(f"/{clip.name}", clip.read_bytes())
    return [clip.as_uri(), f"memory://{clip.name}", film]


def refusal(name: str) -> str:
    """The line that a video is refused with."""
    with pytest.raises(InputError) as refused:
        for _ in open_video(name).frames():
            pass
    line = str(refused.value)
    assert "\n" not in line
    assert "Hidden" not in line
    return line


def test_all_frames_names_times_and_hashes_are_those_of_the_file(clip: Path, film: str) -> None:
    local = open_video(str(clip))
    for name in at_urls(clip, film):
        there = open_video(name)
        assert (there.name, there.n_frames, there.sha256()) == ("a clip", 10, sha256_of_file(clip))
        for ours, theirs in zip(local.frames(), there.frames(), strict=True):
            assert (ours.time, ours.duration) == (theirs.time, theirs.duration)
            assert ours.pixel_values.tobytes() == theirs.pixel_values.tobytes()
        (third, last) = there.frames_at([3, 9])
        np.testing.assert_array_equal(third.pixel_values, list(local.frames())[3].pixel_values)
        assert last.time == pytest.approx(9 / 5)


@pytest.mark.slow
def test_results_are_byte_for_byte_those_of_the_file_without_a_secret(
    command, tmp_path, clip, film, blank_pictures
) -> None:
    written = []
    for number, name in enumerate([str(clip), *at_urls(clip, film)]):
        out = tmp_path / str(number)
        result = command("optimize", name, *OPTIONS, "--no-cache", "--out", out)
        assert result.code == 0, result.err
        assert "Hidden" not in result.out + result.err
        whole_url = "give the whole URL beside --request" in result.err
        assert whole_url is (name == film)
        inputs = tomllib.loads((out / "request.toml").read_text())["provenance"]["inputs"]
        assert list(inputs.values()) == [sha256_of_file(clip)]
        written.append({file.name: file.read_bytes() for file in out.iterdir()})
        took = rb'"(solve|curves|bound)_s": [0-9.e-]+'
        written[-1]["summary.json"] = re.sub(took, b"", written[-1]["summary.json"])
        sums = rb'"summary.json": "[0-9a-f]+"'  # of a file with times in it
        written[-1]["track.json"] = re.sub(sums, b"", written[-1]["track.json"])
        del written[-1]["SHA256SUMS"]
    assert {"track.csv", "loss_curves.npz", "player.html", "request.toml"} <= set(written[0])
    for other in written[1:]:  # the request says where the video was
        differing = {name for name, content in other.items() if content != written[0][name]}
        assert differing <= {"request.toml"}
        assert not any(b"Hidden" in content for content in other.values())


def test_the_interface_reads_them_too(clip: Path, film: str) -> None:
    here, there = evenlight.loss_curves(str(clip)), evenlight.loss_curves(film)
    assert here.loss.tobytes() == there.loss.tobytes()
    assert here.provenance == there.provenance


@pytest.mark.slow
def test_a_dimmed_file_is_the_same(command, tmp_path, clip, film, blank_pictures) -> None:
    options = (*OPTIONS, "--no-player", "--quiet", "--out", tmp_path / "track")
    assert command("optimize", clip, *options).code == 0
    for name, source in (("here", clip), ("there", film)):
        result = command("apply", source, tmp_path / "track", "--out", tmp_path / f"{name}.mkv", "--quiet")
        assert result.code == 0, result.err
    assert (tmp_path / "here.mkv").read_bytes() == (tmp_path / "there.mkv").read_bytes()


def test_what_plays_a_file_itself_says_to_download_it(command, tmp_path, clip, film) -> None:
    result = command("follow", film, tmp_path, "--dry-run")
    assert result.code == 2
    assert "download the video" in result.err
    assert "Hidden" not in result.err


def noise(path: Path, codec: str, n_frames: int) -> Path:
    """Write a film of noise."""
    planes = np.random.default_rng(1).integers(0, 256, (180, 160), np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        for k in range(n_frames):
            frame = VideoFrame.from_ndarray(np.roll(planes, k, axis=1), "yuv420p")
            frame.pts, frame.time_base = k, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.slow
def test_a_frame_far_into_a_film_takes_a_few_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_locations, "BLOCK", 1 << 16)
    path = noise(tmp_path / "long.mkv", "rawvideo", 200)
    with served(tmp_path) as film_server:
        film = open_video(f"{film_server.url}/long.mkv")
        size = path.stat().st_size
        assert film.sha256() == sha256_of_file(path)
        assert size <= film_server.sent < 1.1 * size  # once, for the times of the frames and the hash
        film_server.sent = 0
        wanted = [20, 100, 180]
        there = [frame.pixel_values.tobytes() for frame in film.frames_at(wanted)]
        assert film_server.sent < 3 * 6 * (1 << 16)
        assert there == [frame.pixel_values.tobytes() for frame in open_video(str(path)).frames_at(wanted)]


def test_they_travel_to_other_processes(clip: Path, film: str) -> None:
    there = open_video(film)
    copy = pickle.loads(pickle.dumps(there))
    assert copy.path == there.path
    assert hash(copy.path) == hash(there.path)
    assert len(list(copy.frames())) == 10
    assert "Hidden" not in repr(copy) + str(copy.path)


def test_only_those_without_a_frame_rate_take_one(clip: Path, film: str) -> None:
    with pytest.raises(InputError, match="has its own frame rate") as refused:
        open_video(film, 25.0)
    assert "Hidden" not in str(refused.value)
    assert [video.n_frames for video in open_videos([film, "checkerboard"], 10.0)] == [10, 200]


def test_what_is_not_there_or_not_ours_is_said(film_server: LoopbackServer, film: str) -> None:
    assert "no_film.mkv: the server says 404" in refusal(f"{film_server.url}/no_film.mkv?{SECRET}")
    film_server.forbidden = True
    assert "a%20clip.mkv: the server says 403" in refusal(film)
    assert "no such file" in refusal("memory://nowhere.mkv")


def test_a_server_that_sends_no_parts_is_refused(
    tmp_path: Path, film_server: LoopbackServer, film: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    film_server.parts = False
    monkeypatch.setattr(video_locations, "BLOCK", 1 << 12)
    assert "range requests" in refusal(film)


@pytest.mark.parametrize("begun", [False, True])
def test_a_server_that_goes_away_is_said(
    film_server: LoopbackServer, film: str, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    monkeypatch.setattr(video_locations, "BLOCK", 1 << 12)
    there = open_video(film) if begun else None
    film_server.most = film_server.sent + 3000
    if there is None:
        line = refusal(film)
    else:
        with pytest.raises(InputError) as refused:
            list(there.frames())
        line = str(refused.value)
    assert line.startswith("cannot read http://127.0.0.1")
    assert "Hidden" not in line


def test_files_that_shrink_while_they_are_read_are_noticed() -> None:
    files = fsspec.filesystem("memory")
    files.pipe("/shrinking.mkv", bytes(5000))
    with FilmBytes(video_locations.RemoteFile("memory://shrinking.mkv")) as stream:
        files.store["/shrinking.mkv"].truncate(2000)
        assert len(stream.read(3000)) == 2000
        with pytest.raises(InputError, match="it ends at byte 2000 of 5000"):
            stream.read(1000)


def test_what_holds_no_video_is_said(film_server: LoopbackServer, clip: Path) -> None:
    files = fsspec.filesystem("memory")
    for name, content in {"notes.mp4": b"nothing", "empty.mp4": b"", "folder/a.mkv": b"a"}.items():
        files.pipe(f"/none/{name}", content)
    assert "finds no video in memory://none/notes.mp4" in refusal("memory://none/notes.mp4")
    assert "is empty" in refusal("memory://none/empty.mp4")
    assert "is a folder" in refusal("memory://none/folder")
    (clip.parent / "empty.mp4").touch()
    assert "is empty" in refusal(f"{film_server.url}/empty.mp4")


def test_a_playlist_from_elsewhere_opens_no_file_here(tmp_path: Path) -> None:
    part = noise(tmp_path / "part.ts", "mpeg2video", 5)
    lines = ["#EXTM3U", "#EXT-X-TARGETDURATION:2", "#EXTINF:2,", str(part), "#EXT-X-ENDLIST"]
    fsspec.filesystem("memory").pipe("/list.m3u8", "\n".join(lines).encode())
    assert "finds no video in memory://list.m3u8" in refusal("memory://list.m3u8")


# --- film bytes

CONTENT = bytes(range(256)) * 400


def noise_film(path: Path, codec: str, seed: int = 1) -> Path:
    """Write a film of moving noise."""
    noise = np.random.default_rng(seed).integers(0, 256, (180, 160), np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        for k in range(60):
            picture = av.VideoFrame.from_ndarray(np.roll(noise, k, axis=1), "yuv420p")
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many bytes each call read."""
    counts: list[int] = []
    read = FilmBytes.read

    def counted(self: FilmBytes, size: int) -> bytes:
        content = read(self, size)
        counts.append(len(content))
        return content

    monkeypatch.setattr(FilmBytes, "read", counted)
    return counts


@pytest.fixture
def some(tmp_path: Path) -> Path:
    path = tmp_path / "some.bin"
    path.write_bytes(CONTENT)
    return path


@pytest.mark.parametrize(
    ("name", "codec"),
    [("index at the end.mp4", "libx264"), ("a.mov", "mpeg4"), ("a.mkv", "ffv1"), ("a.avi", "mpeg4")],
)
def test_packets_and_hash_take_one_reading(tmp_path: Path, read: list[int], name: str, codec: str) -> None:
    path = noise_film(tmp_path / name, codec)
    opened, size = open_video_file(path), path.stat().st_size
    assert opened.n_frames == 60
    assert opened.sha256() == sha256_of_file(path)
    assert size <= sum(read) < 1.1 * size + 2**16


def test_a_film_that_changes_after_it_was_opened_is_not_taken_for_that_of_its_hash(tmp_path: Path) -> None:
    opened = open_video_file(noise_film(tmp_path / "a.mkv", "ffv1"))
    assert len(list(opened.frames())) == 60
    noise_film(tmp_path / "a.mkv", "ffv1", seed=2)
    with pytest.raises(InputError, match=r"a\.mkv has changed since it was opened; run this again$"):
        list(opened.frames())


@pytest.mark.parametrize(
    "places", [(), (0, 100_000), (90_000, 0, 50_000), (50_000, 90_000), (10, 0, 10, 0, 102_000, 102_399)]
)
def test_the_hash_is_that_of_the_file_in_whatever_order_it_is_read(
    some: Path, read: list[int], places: tuple[int, ...]
) -> None:
    with FilmBytes(some) as stream:
        for place in places:
            assert stream.seek(place) == place
            assert stream.read(30_000) == CONTENT[place : place + 30_000]
        assert stream.sha256() == sha256_of_file(some)


def test_what_was_read_in_its_order_is_not_read_again_for_the_hash(some: Path, read: list[int]) -> None:
    with FilmBytes(some) as stream:
        while stream.read(1000):
            pass
        assert sum(read) == len(CONTENT)
        stream.sha256()
        assert sum(read) == len(CONTENT)


@pytest.mark.parametrize("name", ["film.m3u8", "film.mp4"])
def test_a_list_of_other_files_is_no_film_as_its_sha256_is_not_theirs(tmp_path: Path, name: str) -> None:
    noise_film(tmp_path / "part.ts", "mpeg2video")
    lines = ["#EXTM3U", "#EXT-X-TARGETDURATION:3", "#EXTINF:2.4,", "part.ts", "#EXT-X-ENDLIST"]
    if name == "film.mp4":
        lines = ["ffconcat version 1.0", "file part.ts"]
    (tmp_path / name).write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"FFmpeg finds no video in .* a list of others"):
        open_video_file(tmp_path / name)


def test_a_file_that_shrinks_is_said_to_end(some: Path) -> None:
    with FilmBytes(some) as stream:
        os.truncate(some, 1000)
        stream.seek(2000)
        with pytest.raises(
            InputError, match=rf"^cannot read .*: it ends at byte 2000 of {len(CONTENT)}; give"
        ):
            stream.read(10)
