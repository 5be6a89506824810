"""Video files and folders of images: times, sizes and colours as written; damage is refused."""

import shutil
import subprocess
import sys
import tracemalloc
from fractions import Fraction
from itertools import pairwise

import av
import numpy as np
import pytest
from av.video.frame import VideoFrame

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.image_folder import open_image_folder
from evenlight.stimuli.video.video_file import open_video_file
from evenlight.stimuli.video.video_locations import natural_order
from evenlight.stimuli.video_writer import write_video


def moving_picture(k, size=(96, 64)):
    """Return frame k of a picture with detail everywhere, so that damage to any byte is seen."""
    width, height = size
    texture = np.random.default_rng(7).integers(0, 256, (height, width, 3), dtype=np.uint8)
    return np.roll(texture, 3 * k, axis=1)


def encode(
    path, codec="mpeg4", pixel_format="yuv420p", stamps=range(40), tick=Fraction(1, 25), size=(96, 64)
):
    """Write a lossy video with presentation times of choice."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = *size, pixel_format
        stream.codec_context.time_base = tick
        for k, stamp in enumerate(stamps):
            frame = VideoFrame.from_ndarray(moving_picture(k, size), "rgb24").reformat(format=pixel_format)
            frame.pts, frame.time_base = stamp, tick
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "codec", "pixel_format"),
    [
        ("a.mp4", "mpeg4", "yuv420p"), ("a.mp4", "libx264", "yuv420p"), ("a.mkv", "libx264", "yuv420p"),
        ("a.avi", "mpeg4", "yuv420p"), ("a.avi", "mjpeg", "yuvj420p"), ("a.webm", "libvpx-vp9", "yuv420p"),
        ("a.ts", "libx264", "yuv420p"), ("a.mov", "prores_ks", "yuv422p10le"),
        ("a.h264", "libx264", "yuv420p"), ("a.mp4", "libx265", "yuv420p10le"),
    ],
)  # fmt: skip
def test_every_container_gives_all_frames_at_exact_times(tmp_path, name, codec, pixel_format, capfd):
    video = open_video(str(encode(tmp_path / name, codec, pixel_format)))
    frames = list(video.frames())
    assert video.n_frames == len(frames) == 40
    np.testing.assert_allclose([f.time for f in frames], np.arange(40) / 25, rtol=0, atol=1e-12)
    np.testing.assert_allclose([f.duration for f in frames], 0.04)
    assert {f.pixel_values.dtype for f in frames} == {
        np.dtype(np.uint16 if "10" in pixel_format else np.uint8)
    }
    # The right frame at the right time: the encoder is lossy, but the picture moves by 3 pixels a frame.
    errors = [np.abs(frames[20].pixel_values.mean(2) / np.iinfo(frames[20].pixel_values.dtype).max
                     - moving_picture(k).mean(2) / 255).mean() for k in range(40)]  # fmt: skip
    assert np.argmin(errors) == 20
    assert capfd.readouterr().err == "" or codec == "libx265"  # this encoder introduces itself


def test_varying_frame_rate_keeps_its_times(tmp_path):
    stamps = [0, 40, 60, 200, 210, 500]
    video = open_video_file(encode(tmp_path / "v.mkv", stamps=stamps, tick=Fraction(1, 1000)))
    frames = list(video.frames())
    np.testing.assert_allclose([f.time for f in frames], np.array(stamps) / 1000)
    np.testing.assert_allclose([f.duration for f in frames[:-1]], np.diff(stamps) / 1000)


def test_the_first_frame_is_at_zero_wherever_the_file_starts(tmp_path):
    video = open_video_file(encode(tmp_path / "v.mkv", stamps=range(100, 110)))
    assert next(video.frames()).time == 0


def test_frames_can_be_read_again_and_do_not_share_memory(tmp_path):
    video = open_video_file(encode(tmp_path / "v.mp4", stamps=range(5)))
    first = list(video.frames())
    again = list(video.frames())
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.pixel_values, b.pixel_values)
    assert not any(np.shares_memory(a.pixel_values, b.pixel_values) for a, b in pairwise(first))


def test_the_hash_is_that_of_the_file_and_the_name_its_stem(tmp_path):
    path = encode(tmp_path / "clip.mp4", stamps=range(3))
    same = tmp_path / "copy.mp4"
    same.write_bytes(path.read_bytes())
    assert open_video_file(path).sha256() == open_video_file(same).sha256()
    assert open_video_file(path).name == "clip"


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length(tmp_path):
    def peak(frames):
        path = encode(tmp_path / f"{frames}.mp4", stamps=range(frames), size=(320, 240))
        tracemalloc.start()
        for frame in open_video_file(path).frames():
            assert frame.pixel_values.size
        high = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return high

    short, long = peak(20), peak(200)
    # A frame takes 230 kB; 180 frames more may cost their time stamps, far less than one frame.
    assert long < short + 230_400 / 2


PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550000000a4944415478da63f80f00010101"
    "001bb6ee560000000049454e44ae426082"
)  # one gray pixel


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("text.mp4", b"once upon a time\n" * 200, "no video"),
        ("text.txt", b"once upon a time\n" * 200, "no video"),
        ("noise.mkv", np.random.default_rng(0).bytes(5000), "no video"),
        ("empty.mp4", b"", "is empty"),
        ("image.mp4", PNG, "one image, not a video"),
    ],
)
def test_what_is_no_video_is_refused(tmp_path, name, content, words, capfd):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        open_video(str(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_sound_alone_is_refused(tmp_path):
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        for _ in range(4):
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
            frame.sample_rate = 8000
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(InputError, match="holds no video"):
        open_video(str(path))


def test_a_name_that_is_nothing_lists_the_built_in_sequences():
    with pytest.raises(InputError, match=r"no video 'nothing'.*checkerboard, sunrise"):
        open_video("nothing")


def test_a_frame_rate_for_a_video_file_is_refused(tmp_path):
    path = encode(tmp_path / "v.mp4", stamps=range(3))
    with pytest.raises(InputError, match="its own frame rate"):
        open_video(str(path), fps=30)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
@pytest.mark.parametrize(
    ("name", "codec", "pixel_format"),
    [
        ("a.mp4", "libx264", "yuv420p"), ("a.mkv", "libx264", "yuv420p"), ("a.webm", "libvpx-vp9", "yuv420p"),
        ("a.avi", "mjpeg", "yuvj420p"), ("a.mkv", "ffv1", "bgr0"),
    ],
)  # fmt: skip
def test_a_video_that_is_cut_off_is_refused(tmp_path, name, codec, pixel_format, share, capfd):
    path = encode(tmp_path / name, codec, pixel_format)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"cut off|damaged") as caught:
        list(open_video(str(path)).frames())
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_an_mp4_whose_end_is_missing_says_how_much_is_there(tmp_path):
    path = tmp_path / "fast.mp4"
    with av.open(str(path), "w", container_options={"movflags": "faststart"}) as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height = 96, 64
        for k in range(30):
            container.mux(stream.encode(VideoFrame.from_ndarray(moving_picture(k), "rgb24")))
        container.mux(stream.encode())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.raises(InputError, match=r"cut off"):
        open_video(str(path))


@pytest.mark.parametrize("start", [0.35, 0.5, 0.65])
@pytest.mark.parametrize(
    ("name", "codec", "pixel_format"),
    [("a.mp4", "libx264", "yuv420p"), ("a.mp4", "mpeg4", "yuv420p"), ("a.mkv", "ffv1", "bgr0")],
)
def test_a_sector_lost_in_the_middle_is_noticed(tmp_path, name, codec, pixel_format, start, capfd):
    path = encode(tmp_path / name, codec, pixel_format)
    content = bytearray(path.read_bytes())
    at = int(start * len(content))
    content[at : at + 4096] = np.random.default_rng(3).bytes(4096)  # a sector of a disk
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match=r"damaged at frame [0-9]+"):
        list(open_video(str(path)).frames())
    assert capfd.readouterr().err == ""


def test_a_single_changed_bit_of_a_lossless_file_is_noticed(tmp_path):
    path = tmp_path / "lossless.mkv"
    write_video(path, [moving_picture(k) for k in range(8)], 25)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match=r"damaged at frame [345] \(0\.\d+ s\): its checksum is wrong"):
        open_video(str(path))


@pytest.mark.slow
def test_the_decoder_says_nothing_on_its_own(tmp_path):
    """FFmpeg's own complaints about a damaged file stay away from the terminal of a fresh program."""
    path = encode(tmp_path / "a.mp4", "mpeg4")
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 4096] = bytes(4096)
    path.write_bytes(bytes(content))
    program = (
        "import sys; from evenlight.data_schema.errors import InputError\n"
        "from evenlight.stimuli.sequences import open_video\n"
        "try: list(open_video(sys.argv[1]).frames())\n"
        "except InputError: print('refused')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)], capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("refused\n", "")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs the program ffmpeg")
def test_frames_that_an_edit_list_cuts_away_are_not_missed(tmp_path):
    whole = encode(tmp_path / "whole.mp4", "libx264", stamps=range(30))
    cut = tmp_path / "cut.mp4"  # from 0.4 s on: the frames before it are in the file, and not shown
    subprocess.run(["ffmpeg", "-v", "error", "-ss", "0.4", "-i", whole, "-c", "copy", cut], check=True)
    video = open_video_file(cut)
    assert video.n_frames == len(list(video.frames())) == 20


# --- video writer


def noise(kind, size=(33, 17), frames=4):
    """Return frames that use every bit of their type."""
    top = np.iinfo(kind).max
    rng = np.random.default_rng(5)
    return [rng.integers(0, top, (size[1], size[0], 3), endpoint=True).astype(kind) for _ in range(frames)]


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_frames_come_back_bit_by_bit(tmp_path, kind):
    written = noise(kind)
    assert write_video(tmp_path / "a.mkv", iter(written), 25) == 4
    for frame, pixels in zip(open_video(str(tmp_path / "a.mkv")).frames(), written, strict=True):
        assert frame.pixel_values.dtype == kind
        np.testing.assert_array_equal(frame.pixel_values, pixels)


@pytest.mark.parametrize("bits", [10, 12])
def test_values_on_the_grid_of_fewer_bits_come_back_bit_by_bit(tmp_path, bits):
    top = 2**bits - 1
    # A value on the grid is the 16-bit code next to k/top of the full range.
    codes = np.rint(np.arange(top + 1) * (65535 / top)).astype(np.uint16)
    picture = np.resize(codes, (64, 64, 3))
    write_video(tmp_path / "a.mkv", [picture], 25, bits=bits)
    (frame,) = open_video(str(tmp_path / "a.mkv")).frames()
    np.testing.assert_array_equal(frame.pixel_values, picture)


@pytest.mark.parametrize("rate", [25, 23.976, 29.97, 12.5, 60])
def test_the_times_come_back_exactly(tmp_path, rate):
    write_video(tmp_path / "a.mkv", noise(np.uint8, frames=30), rate)
    exact = {23.976: 24000 / 1001, 29.97: 30000 / 1001}.get(rate, rate)
    times = [frame.time for frame in open_video(str(tmp_path / "a.mkv")).frames()]
    np.testing.assert_allclose(times, np.arange(30) / exact, rtol=0, atol=1e-12)


def test_the_same_frames_make_the_same_file(tmp_path):
    for name in ("a.mkv", "b.mkv"):
        write_video(tmp_path / name, noise(np.uint16), 25)
    assert (tmp_path / "a.mkv").read_bytes() == (tmp_path / "b.mkv").read_bytes()


def test_a_failure_on_the_way_leaves_nothing_and_keeps_what_was_there(tmp_path):
    (tmp_path / "a.mkv").write_bytes(b"before")

    def breaking():
        yield from noise(np.uint8)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(tmp_path / "a.mkv", breaking(), 25)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mkv"]
    assert (tmp_path / "a.mkv").read_bytes() == b"before"


@pytest.mark.parametrize(
    ("name", "frames", "bits", "error", "words"),
    [
        ("a.mkv", [], None, InputError, "no frames"),
        (
            "a.mkv",
            [*noise(np.uint8), *noise(np.uint8, size=(8, 8))],
            None,
            ValueError,
            "need frames of shape",
        ),
        ("a.mkv", noise(np.uint16), 8, ValueError, "need uint8 for 8 bits"),
        ("a.mp4", noise(np.uint8), None, InputError, r"ends in \.mkv"),
    ],
)
def test_what_cannot_be_written_is_refused_and_leaves_nothing(tmp_path, name, frames, bits, error, words):
    with pytest.raises(error, match=words):
        write_video(tmp_path / name, frames, 25, bits=bits)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("size", [(8, 8), (9, 11), (17, 64), (161, 23)])
def test_odd_sizes_come_through_unchanged(tmp_path, size):
    path = tmp_path / "odd.mkv"
    write_video(path, [moving_picture(0, size)], 25)
    np.testing.assert_array_equal(next(open_video_file(path).frames()).pixel_values, moving_picture(0, size))


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        write_video(tmp_path / "file" / "a.mkv", noise(np.uint8), 25)


# --- image folder


def picture(seed=0, size=(24, 16), kind=np.uint8):
    """Return an image of random pixels."""
    top = np.iinfo(kind).max
    return np.random.default_rng(seed).integers(0, top, (size[1], size[0], 3), endpoint=True).astype(kind)


CODECS = {".png": "png", ".bmp": "bmp", ".tif": "tiff", ".jpg": "mjpeg", ".jpeg": "mjpeg", ".webp": "libwebp"}


def save(path, pixels, pixel_format=None):
    """Write an image with FFmpeg, in a pixel format of choice."""
    deep = pixels.dtype == np.uint16
    wanted = pixel_format or ("rgb48be" if deep else "bgr24" if path.suffix == ".bmp" else "rgb24")
    with av.open(str(path), "w", format="image2", options={"update": "1"}) as container:
        stream = container.add_stream(CODECS[path.suffix.lower()], rate=1)
        stream.height, stream.width = pixels.shape[:2]
        stream.pix_fmt = wanted
        frame = VideoFrame.from_ndarray(pixels, "rgb48le" if deep else "rgb24").reformat(format=wanted)
        container.mux(stream.encode(frame))
        container.mux(stream.encode())


def test_frames_come_in_the_natural_order_of_their_names(tmp_path):
    for number in (1, 2, 10, 11, 100):
        save(tmp_path / f"frame{number}.png", np.full((8, 8, 3), number, np.uint8))
    frames = list(open_video(str(tmp_path)).frames())
    assert [f.pixel_values[0, 0, 0] for f in frames] == [1, 2, 10, 11, 100]


def test_natural_order_counts_numbers_wherever_they_stand():
    names = ["b1", "a10b2", "a2b10", "a2b9", "A3", "a02"]
    assert sorted(names, key=natural_order) == ["a02", "a2b9", "a2b10", "A3", "a10b2", "b1"]


@pytest.mark.parametrize(
    ("suffix", "kind"), [("png", np.uint8), ("bmp", np.uint8), ("tif", np.uint8), ("png", np.uint16)]
)
def test_lossless_images_come_through_unchanged(tmp_path, suffix, kind):
    save(tmp_path / f"a.{suffix}", picture(kind=kind))
    (frame,) = open_video(str(tmp_path)).frames()
    assert frame.pixel_values.dtype == kind
    np.testing.assert_array_equal(frame.pixel_values, picture(kind=kind))


@pytest.mark.parametrize("suffix", ["jpg", "JPEG", "webp"])
def test_lossy_images_are_close_to_what_was_saved(tmp_path, suffix):
    gradient = np.broadcast_to(
        np.linspace(30, 220, 64, dtype=np.uint8)[:, np.newaxis, np.newaxis], (64, 64, 3)
    )
    path = tmp_path / f"a.{suffix}"
    save(path, np.ascontiguousarray(gradient), "yuv420p" if suffix == "webp" else "yuvj420p")
    (frame,) = open_video(str(tmp_path)).frames()
    assert np.abs(frame.pixel_values.astype(int) - gradient).max() <= 8


def test_gray_images_are_gray_in_all_channels(tmp_path):
    gray = picture()[..., 0]
    VideoFrame.from_ndarray(gray, "gray").save(tmp_path / "a.png")
    (frame,) = open_video(str(tmp_path)).frames()
    np.testing.assert_array_equal(frame.pixel_values, np.repeat(gray[..., np.newaxis], 3, axis=-1))


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.uint8, np.uint16, ">u2"])
def test_arrays_come_through_unchanged(tmp_path, kind):
    pixels = np.random.default_rng(1).random((9, 11, 3)) if "f" in np.dtype(kind).kind else picture()
    np.save(tmp_path / "a.npy", pixels.astype(kind))
    (frame,) = open_video(str(tmp_path)).frames()
    np.testing.assert_array_equal(frame.pixel_values, pixels.astype(kind))
    assert frame.pixel_values.dtype == np.dtype(kind).newbyteorder("=")


def test_other_files_are_passed_over_and_do_not_change_the_hash(tmp_path):
    save(tmp_path / "a.png", picture())
    before = open_image_folder(tmp_path).sha256()
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / ".hidden.png").write_bytes(b"")
    folder = open_image_folder(tmp_path)
    assert (folder.n_frames, folder.sha256()) == (1, before)
    save(tmp_path / "a.png", picture(seed=1))
    assert open_image_folder(tmp_path).sha256() != before


@pytest.mark.parametrize(("asked", "rate"), [(None, 25), (12.5, 12.5), (29.97, 30000 / 1001)])
def test_images_follow_at_the_rate_that_was_asked_for(tmp_path, asked, rate):
    for k in range(3):
        save(tmp_path / f"{k}.png", picture(k))
    frames = list(open_video(str(tmp_path), fps=asked).frames())
    np.testing.assert_allclose([f.time for f in frames], np.arange(3) / rate, rtol=1e-12)
    np.testing.assert_allclose([f.duration for f in frames], 1 / rate, rtol=1e-12)


@pytest.mark.parametrize(
    ("rate", "says"),
    [
        (0.0, "need a frame rate"),
        (-5.0, "need a frame rate"),
        (float("nan"), "fps must be a number, got nan"),
    ],
)
def test_an_impossible_frame_rate_is_refused(tmp_path, rate, says):
    save(tmp_path / "a.png", picture())
    with pytest.raises(InputError, match=says):
        open_video(str(tmp_path), fps=rate)


def test_images_of_different_sizes_are_refused(tmp_path):
    save(tmp_path / "1.png", picture())
    save(tmp_path / "2.png", picture(size=(16, 24)))
    with pytest.raises(InputError, match=r"2\.png is 16x24, the images before it are 24x16"):
        list(open_video(str(tmp_path)).frames())


@pytest.mark.parametrize("content", [b"", b"no image at all", None])
def test_an_unreadable_image_is_refused(tmp_path, content, capfd):
    save(tmp_path / "1.png", picture())
    whole = (tmp_path / "1.png").read_bytes()
    (tmp_path / "2.png").write_bytes(whole[: len(whole) // 2] if content is None else content)
    with pytest.raises(InputError, match=r"2\.png.*replace this image") as caught:
        list(open_video(str(tmp_path)).frames())
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (np.full((4, 4, 3), np.nan), "not finite"),
        (np.full((4, 4, 3), np.inf), "not finite"),
        (np.full((4, 4, 3), 1.5), "from 1.5 to 1.5"),
        (np.full((4, 4, 3), -0.25), "from -0.25 to -0.25"),
        (np.zeros((4, 4, 3), np.int64), "holds int64"),
        (np.zeros((4, 4, 4)), r"shape \(4, 4, 4\)"),
        (np.zeros((0, 4, 3)), r"shape \(0, 4, 3\)"),
    ],
)
def test_arrays_that_are_no_pixel_values_are_refused(tmp_path, pixels, message):
    np.save(tmp_path / "bad.npy", pixels)
    with pytest.raises(InputError, match=rf"bad\.npy.*{message}"):
        list(open_video(str(tmp_path)).frames())


def test_pickled_arrays_and_folders_without_images_are_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("notes")
    with pytest.raises(InputError, match=r"holds no images; give one with \.png"):
        open_video(str(tmp_path))
    np.save(tmp_path / "bad.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match=r"cannot read the array .*bad\.npy"):
        list(open_video(str(tmp_path)).frames())


def test_16_bit_images_come_through_unchanged(tmp_path):
    save(tmp_path / "a.png", picture(kind=np.uint16))
    (frame,) = open_video(str(tmp_path)).frames()
    assert frame.pixel_values.dtype == np.uint16
    np.testing.assert_array_equal(frame.pixel_values, picture(kind=np.uint16))
