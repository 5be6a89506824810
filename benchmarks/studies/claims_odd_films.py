"""Films of other people: open groups, stills, mirrored pictures, odd sizes, transparency, wrong stamps."""

from struct import pack

import av
import numpy as np
import pytest
from av.video.frame import VideoFrame
from odd_films import SIZE, N, copied, encoded, pictures, times

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video


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
