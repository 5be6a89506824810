"""A film is read once for its packets and its SHA-256, and what is known of its pictures is known once."""

import os
from pathlib import Path

import av
import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.stimuli.video.colour_planes import PixelReader
from evenlight.stimuli.video.film_bytes import FilmBytes
from evenlight.stimuli.video.video_file import open_video_file

CONTENT = bytes(range(256)) * 400


def film(path: Path, codec: str) -> Path:
    """Write a film of moving noise."""
    noise = np.random.default_rng(1).integers(0, 256, (180, 160), np.uint8)
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
    path = film(tmp_path / name, codec)
    opened, size = open_video_file(path), path.stat().st_size
    assert opened.n_frames == 60
    assert opened.sha256() == sha256_of_file(path)
    assert size <= sum(read) < 1.1 * size + 2**16


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


def test_a_playlist_here_opens_what_it_names_beside_it(tmp_path: Path) -> None:
    film(tmp_path / "part.ts", "mpeg2video")
    lines = ["#EXTM3U", "#EXT-X-TARGETDURATION:3", "#EXTINF:2.4,", "part.ts", "#EXT-X-ENDLIST"]
    (tmp_path / "list.m3u8").write_text("\n".join(lines))
    assert open_video_file(tmp_path / "list.m3u8").n_frames == 60


def test_a_file_that_shrinks_is_said_to_end(some: Path) -> None:
    with FilmBytes(some) as stream:
        os.truncate(some, 1000)
        stream.seek(2000)
        with pytest.raises(
            InputError, match=rf"^cannot read .*: it ends at byte 2000 of {len(CONTENT)}; give"
        ):
            stream.read(10)


def test_what_is_known_of_a_films_pictures_is_sought_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sought = []
    amid_for = PixelReader._amid_for
    monkeypatch.setattr(
        PixelReader, "_amid_for", lambda self, frame: (sought.append(1), amid_for(self, frame))[1]
    )
    opened = open_video_file(film(tmp_path / "a.mp4", "mpeg4"))
    first, again = ([frame.pixel_values.tobytes() for frame in opened.frames()] for _ in range(2))
    assert first == again
    assert sought == [1]
