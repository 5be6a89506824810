"""Videos at URLs: the same results as of the local file, read in parts, refused in one line."""

import pickle
import re
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
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.stimuli.sequences import open_video, open_videos
from evenlight.stimuli.video import video_locations
from evenlight.stimuli.video.film_bytes import FilmBytes

OPTIONS = ("--budget", 0.5, "--display", "laptop-lcd", "--other-display-ok")
SECRET = "X-Amz-Signature=Hidden2"


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("served")
    return video(folder / "a clip.mkv", [texture(k % 5) * 0.2 * (k % 4 + 1) for k in range(10)])


@pytest.fixture
def server(clip: Path) -> Iterator[LoopbackServer]:
    with served(clip.parent) as server:
        yield server


@pytest.fixture
def film(server: LoopbackServer) -> str:
    """The clip at a URL with a password and a signature."""
    return f"{server.url.replace('//', '//me:Hidden1@')}/a%20clip.mkv?{SECRET}"


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


def test_results_are_byte_for_byte_those_of_the_file_without_a_secret(
    command, tmp_path, clip, film, blank_pictures
) -> None:
    written = []
    for number, name in enumerate([str(clip), *at_urls(clip, film)]):
        out = tmp_path / str(number)
        result = command("optimize", name, *OPTIONS, "--no-cache", "--out", out)
        assert result.code == 0, result.err
        assert "Hidden" not in result.out + result.err
        written.append({file.name: file.read_bytes() for file in out.iterdir()})
        took = rb'"(solve|curves|bound)_s": [0-9.e-]+'
        written[-1]["summary.json"] = re.sub(took, b"", written[-1]["summary.json"])
    assert {"track.csv", "loss_curves.npz", "player.html", "request.toml"} <= set(written[0])
    for other in written[1:]:  # the request says where the video was
        differing = {name for name, content in other.items() if content != written[0][name]}
        assert differing <= {"request.toml"}
        assert not any(b"Hidden" in content for content in other.values())


def test_the_interface_reads_them_too(clip: Path, film: str) -> None:
    here, there = evenlight.loss_curves(str(clip)), evenlight.loss_curves(film)
    assert here.loss.tobytes() == there.loss.tobytes()
    assert here.provenance == there.provenance


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


def test_a_frame_far_into_a_film_takes_a_few_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_locations, "BLOCK", 1 << 16)
    path = noise(tmp_path / "long.mkv", "rawvideo", 200)
    with served(tmp_path) as server:
        film = open_video(f"{server.url}/long.mkv")
        size = path.stat().st_size
        assert film.sha256() == sha256_of_file(path)
        assert size <= server.sent < 1.1 * size  # once, for the times of the frames and the hash
        server.sent = 0
        wanted = [20, 100, 180]
        there = [frame.pixel_values.tobytes() for frame in film.frames_at(wanted)]
        assert server.sent < 3 * 6 * (1 << 16)
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


def test_what_is_not_there_or_not_ours_is_said(server: LoopbackServer, film: str) -> None:
    assert "no_film.mkv: the server says 404" in refusal(f"{server.url}/no_film.mkv?{SECRET}")
    server.forbidden = True
    assert "a%20clip.mkv: the server says 403" in refusal(film)
    assert "no such file" in refusal("memory://nowhere.mkv")


def test_a_server_that_sends_no_parts_is_refused(
    tmp_path: Path, server: LoopbackServer, film: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.parts = False
    monkeypatch.setattr(video_locations, "BLOCK", 1 << 12)
    assert "range requests" in refusal(film)


@pytest.mark.parametrize("begun", [False, True])
def test_a_server_that_goes_away_is_said(
    server: LoopbackServer, film: str, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    monkeypatch.setattr(video_locations, "BLOCK", 1 << 12)
    there = open_video(film) if begun else None
    server.most = server.sent + 3000
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


def test_what_holds_no_video_is_said(server: LoopbackServer, clip: Path) -> None:
    files = fsspec.filesystem("memory")
    for name, content in {"notes.mp4": b"nothing", "empty.mp4": b"", "folder/a.mkv": b"a"}.items():
        files.pipe(f"/none/{name}", content)
    assert "finds no video in memory://none/notes.mp4" in refusal("memory://none/notes.mp4")
    assert "is empty" in refusal("memory://none/empty.mp4")
    assert "is a folder" in refusal("memory://none/folder")
    (clip.parent / "empty.mp4").touch()
    assert "is empty" in refusal(f"{server.url}/empty.mp4")


def test_a_playlist_from_elsewhere_opens_no_file_here(tmp_path: Path) -> None:
    part = noise(tmp_path / "part.ts", "mpeg2video", 5)
    lines = ["#EXTM3U", "#EXT-X-TARGETDURATION:2", "#EXTINF:2,", str(part), "#EXT-X-ENDLIST"]
    fsspec.filesystem("memory").pipe("/list.m3u8", "\n".join(lines).encode())
    assert "finds no video in memory://list.m3u8" in refusal("memory://list.m3u8")
