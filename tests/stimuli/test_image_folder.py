"""Folders of images: natural order, every format, and one line about the image that is wrong."""

import av
import numpy as np
import pytest
from av.video.frame import VideoFrame

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.image_folder import open_image_folder
from evenlight.stimuli.video.video_locations import natural_order


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


@pytest.mark.parametrize("suffix", ["png", "bmp", "tif"])
def test_lossless_images_come_through_unchanged(tmp_path, suffix):
    save(tmp_path / f"a.{suffix}", picture())
    (frame,) = open_video(str(tmp_path)).frames()
    np.testing.assert_array_equal(frame.pixel_values, picture())


def test_16_bit_images_come_through_unchanged(tmp_path):
    save(tmp_path / "a.png", picture(kind=np.uint16))
    (frame,) = open_video(str(tmp_path)).frames()
    assert frame.pixel_values.dtype == np.uint16
    np.testing.assert_array_equal(frame.pixel_values, picture(kind=np.uint16))


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


def test_a_folder_without_images_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("notes")
    with pytest.raises(InputError, match=r"holds no images; give one with \.png"):
        open_video(str(tmp_path))


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


def test_pickled_arrays_are_refused(tmp_path):
    np.save(tmp_path / "bad.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match=r"cannot read the array .*bad\.npy"):
        list(open_video(str(tmp_path)).frames())
