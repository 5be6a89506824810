"""Films of other people: cut, joined, damaged, mirrored, of several streams; what is in them is known."""

from fractions import Fraction
from pathlib import Path
from struct import pack

import av
import numpy as np
import pytest
from av.video.frame import VideoFrame
from optimized_videos import texture

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video

N, SIZE = 20, (48, 32)


def encoded(path: Path, codec: str, kind="yuv420p", size=SIZE, first=0, n=N, **options: str) -> Path:
    """A film of moving detail at 25 Hz, whose stamps begin at frame `first`."""
    detail = np.rint(255 * texture(1, 64, 96)).astype(np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = *size, kind
        for k in range(n):
            gray = np.roll(detail, 5 * (k + first), axis=1)[: size[1], : size[0]]
            frame = VideoFrame.from_ndarray(np.stack([gray, gray[::-1], 255 - gray], axis=-1), "rgb24")
            frame.pts, frame.time_base = k + first, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def pictures(path: Path, **how: object) -> np.ndarray:
    return np.stack([frame.pixel_values for frame in open_video(path, **how).frames()])


def times(path: Path, **how: object) -> list[float]:
    return [frame.time for frame in open_video(path, **how).frames()]


def copied(source: Path, path: Path, begin: int = 0, overlap: int = 0) -> int:
    """Copy a film from some key frame on, its later half too early; return which picture that frame is."""
    with av.open(str(source)) as there, av.open(str(path), "w") as here:
        stream = here.add_stream_from_template(there.streams.video[0])
        packets = [packet for packet in there.demux(video=0) if packet.size]
        first = [k for k, packet in enumerate(packets) if packet.is_keyframe][begin]
        shown = sum(packet.pts < packets[first].pts for packet in packets)
        for k, packet in enumerate(packets[first:]):
            packet.stream = stream
            if overlap:  # containers of one tick in a millisecond
                packet.pts, packet.dts = 40 * k - 40 * overlap * (k >= N / 2), k - N
            here.mux(packet)
    return shown


@pytest.mark.parametrize(("codec", "options"), [
    ("mpeg2video", {"g": "6", "bf": "2"}),
    ("libx265", {"x265-params": "open-gop=1:keyint=6:min-keyint=6:scenecut=0:bframes=2:log-level=none"}),
])  # fmt: skip
def test_a_film_cut_at_an_open_group_begins_with_its_first_whole_picture(tmp_path, codec, options):
    whole = encoded(tmp_path / "whole.mkv", codec, size=(96, 64), **options)
    first = copied(whole, tmp_path / "cut.mkv", 1)
    assert 0 < first < N
    np.testing.assert_array_equal(pictures(tmp_path / "cut.mkv"), pictures(whole)[first:])
    np.testing.assert_allclose(times(tmp_path / "cut.mkv"), np.arange(N - first) / 25, atol=1e-3)


def test_a_stamp_that_a_decoder_guesses_wrong_costs_no_picture(tmp_path):
    vob = encoded(tmp_path / "a.vob", "mpeg2video", bf="2")  # which stamps some of its packets only
    np.testing.assert_allclose(times(vob), np.arange(N) / 25, atol=1e-9)


def joined(folder: Path, overlap: int) -> tuple[Path, Path]:
    """A film, and the same with its later half so many pictures too early."""
    parts = encoded(folder / "parts.mkv", "ffv1", g="1"), folder / "joined.mkv"
    copied(*parts, overlap=overlap)
    return parts


def test_of_cuts_that_overlap_the_later_is_seen_and_it_is_said(tmp_path):
    parts, film = joined(tmp_path, 2)
    np.testing.assert_allclose(times(film), np.arange(N - 2) / 25, atol=1e-9)
    np.testing.assert_array_equal(pictures(film), np.delete(pictures(parts), (8, 9), axis=0))
    said = "0 frames held, 2 skipped: time stamps fall back by up to 0.040 s"
    assert open_video(film).notes == (said,)


def test_stamps_that_begin_anew_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"time stamps fall back by up to 0\.360 s, and 10 of 20 pictures"):
        open_video(joined(tmp_path, 10)[1])


def test_what_is_damaged_is_refused_held_or_skipped(tmp_path):
    whole = encoded(tmp_path / "whole.mkv", "ffv1", level="3", slicecrc="1", g="1")
    content = bytearray(whole.read_bytes())
    content[len(content) // 2] ^= 1
    (film := tmp_path / "film.mkv").write_bytes(content)
    with pytest.raises(InputError, match=r"frame \d+ \(0\.\d+ s\): its checksum .*`damaged` hold or skip"):
        open_video(film)
    before, held = pictures(whole), pictures(film, damaged="hold")
    (k,) = np.flatnonzero((before != held).any(axis=(1, 2, 3)))
    np.testing.assert_array_equal(held[k], before[k - 1])
    np.testing.assert_array_equal(pictures(film, damaged="skip"), np.delete(before, k, axis=0))
    np.testing.assert_allclose(times(film, damaged="skip"), np.delete(np.arange(N) / 25, k), atol=1e-3)
    counts = {how: open_video(film, damaged=how).reading for how in ("hold", "skip")}
    assert [counts["hold"].frames_held, counts["hold"].frames_skipped] == [1, 0]
    assert [counts["skip"].frames_held, counts["skip"].frames_skipped] == [0, 1]


def test_a_gif_that_ends_within_a_picture_is_refused(tmp_path):
    whole = encoded(tmp_path / "whole.gif", "gif", "rgb8")
    assert len(times(whole)) == N
    (tmp_path / "cut.gif").write_bytes(whole.read_bytes()[:-40])
    with pytest.raises(InputError, match="damaged at frame 19"):
        open_video(tmp_path / "cut.gif")


def test_a_still_is_no_film_where_something_moves(tmp_path):
    parts = [
        encoded(tmp_path / "still.mkv", "mjpeg", "yuvj420p", (96, 64), n=1),
        encoded(tmp_path / "f.mkv", "ffv1"),
    ]
    film = tmp_path / "film.mkv"
    with av.open(str(film), "w") as here, av.open(str(parts[0])) as still, av.open(str(parts[1])) as moving:
        sources = [
            (source, here.add_stream_from_template(source.streams.video[0])) for source in (still, moving)
        ]
        for source, stream in sources:
            for packet in source.demux(video=0):
                packet.stream = stream
                here.mux(packet)
    np.testing.assert_array_equal(pictures(film), pictures(parts[1]))
    assert open_video(film).notes == ("of its videos [0, 1], stream 1 is taken (`stream`)",)
    assert open_video(film, stream=1).reading.stream == open_video(film).reading.stream == 1
    with pytest.raises(InputError, match=r"`stream` 2: .* \[0, 1\]"):
        open_video(film, stream=2)


@pytest.mark.parametrize(("a", "b", "c", "d"), [
    (1, 0, 0, 1), (0, 1, -1, 0), (-1, 0, 0, -1), (0, -1, 1, 0),
    (-1, 0, 0, 1), (1, 0, 0, -1), (0, 1, 1, 0), (0, -1, -1, 0),
])  # fmt: skip
def test_pictures_are_turned_and_mirrored_as_the_file_says(tmp_path, a, b, c, d):
    """What lies at (x, y) is seen at (ax + cy, bx + dy) (ISO 14496-12, 6.2.2)."""
    film = encoded(tmp_path / "a.mp4", "libx264", n=2)
    stored, content = pictures(film), film.read_bytes()
    at = content.index(b"tkhd") + 44
    matrix = pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)
    film.write_bytes(content[:at] + matrix + content[at + len(matrix) :])
    y, x = np.mgrid[: stored.shape[1], : stored.shape[2]]
    columns, rows = a * x + c * y, b * x + d * y
    expected = np.zeros((2, np.ptp(rows) + 1, np.ptp(columns) + 1, 3), np.uint8)
    expected[:, rows - rows.min(), columns - columns.min()] = stored
    np.testing.assert_array_equal(pictures(film), expected)


@pytest.mark.parametrize("kind", ["yuv420p", "yuv422p10le"])
def test_a_picture_of_odd_size_is_the_even_one_without_its_last_row_and_column(tmp_path, kind):
    """A sample of chroma stands for two pixels, also where the second is not there."""
    even = np.full((20, 34), 100), np.arange(17) * 8 + 60
    shown = []
    for width, height in ((34, 20), (33, 19)):
        frame = VideoFrame(width, height, kind)
        deep = "10" in kind
        for plane, values in zip(frame.planes, (even[0][0, :width], even[1], even[1][::-1]), strict=True):
            rows = np.zeros((plane.height, plane.line_size // (1 + deep)), np.uint16 if deep else np.uint8)
            rows[:, : plane.width] = values * (4 if deep else 1)
            plane.update(rows.tobytes())
        with av.open(str(path := tmp_path / f"{width}.mkv"), "w") as container:
            stream = container.add_stream("ffv1", rate=25)
            stream.width, stream.height, stream.pix_fmt = width, height, kind
            container.mux([*stream.encode(frame), *stream.encode()])
        shown.append(pictures(path))
    np.testing.assert_array_equal(shown[1], shown[0][:, :19, :33])


def test_transparency_of_vp9_is_mixed_with_black(tmp_path):
    frame = VideoFrame(*SIZE, "yuva420p")
    for plane, value in zip(
        frame.planes, (235, 128, 128, 100), strict=True
    ):  # white, of which 100/255 is there
        plane.update(bytes([value]) * plane.buffer_size)
    with av.open(str(tmp_path / "a.webm"), "w") as container:
        stream = container.add_stream("libvpx-vp9", rate=25, options={"lossless": "1"})
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuva420p"
        container.mux([*stream.encode(frame), *stream.encode()])
    assert (pictures(tmp_path / "a.webm") == 100).all()


def test_any_frame_of_an_avi_is_found_though_its_stamps_are_those_of_decoding(tmp_path):
    film = encoded(tmp_path / "a.avi", "libx264", bf="2", g="10")
    for k in (3, 13):
        (frame,) = open_video(film).frames_at([k])
        np.testing.assert_array_equal(frame.pixel_values, pictures(film)[k])
