"""Videos of non-square pixels: read as squares, in the size that players show; odd shapes are refused."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from av.video.frame import VideoFrame

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.frames_in_memory import video_of
from evenlight.stimuli.video.square_pixels import pixel_aspect
from evenlight.stimuli.video.video_source import size_of
from evenlight.stimuli.video.video_writer import write_video

WIDE = Fraction(4, 3)
ROWS, COLUMNS, NARROW = 144, 256, 192  # 192 pixels of 4:3 are as wide as 256 squares
STRIPES = 24


def picture(columns: int, phase: float = 0.0) -> np.ndarray:
    """Faint upright stripes, stronger towards the bottom: each column is the mean over its own width."""
    x = (np.arange(columns * 12).reshape(columns, 12) + 0.5) / (columns * 12)
    strength = np.linspace(2.4, 12.0, ROWS)[:, None]
    gray = 127 + strength * np.sin(2 * np.pi * (STRIPES * x + phase)).mean(axis=1)
    return np.repeat(np.rint(gray).astype(np.uint8)[..., None], 3, axis=2)


def encode(path: Path, columns: int, aspect: Fraction | None, pixel_format: str = "yuv444p") -> Path:
    """Write three frames with next to no loss, and what the file says of its pixels."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"qp": "0"})
        stream.width, stream.height, stream.pix_fmt = columns, ROWS, pixel_format
        if aspect is not None:
            stream.codec_context.sample_aspect_ratio = aspect
        for k in range(3):
            frame = VideoFrame.from_ndarray(picture(columns, k / 8), "rgb24").reformat(format=pixel_format)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.fixture(scope="module")
def squeezed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return encode(tmp_path_factory.mktemp("squeezed") / "film.mp4", NARROW, WIDE)


def retagged(path: Path, width: int, height: int) -> Path:
    """The same file with another shape of its pixels, in the container's pixel aspect ratio box."""
    content = path.read_bytes()
    place = content.index(b"pasp") + 4
    other = path.with_name(f"{width}-{height}.mp4")
    other.write_bytes(content[:place] + struct.pack(">II", width, height) + content[place + 8 :])
    return other


def test_a_squeezed_film_has_the_pictures_of_the_square_one(squeezed: Path) -> None:
    """24 cycles over 192 columns are well below what cubics resolve: 1 of 255 codes is mostly rounding."""
    video = open_video(str(squeezed))
    assert (pixel_aspect(video), size_of(video)) == (WIDE, (COLUMNS, ROWS))
    for k, frame in enumerate(video.frames()):
        off = np.abs(frame.pixel_values.astype(float) - picture(COLUMNS, k / 8))
        assert off[:, 4:-4].mean() < 1.0
        assert frame.pixel_values.dtype == np.uint8


def test_pixels_that_are_higher_than_wide_make_the_picture_higher(squeezed: Path) -> None:
    """144 rows of pixels of 3:4 are 192 squares high; no column is lost."""
    assert size_of(open_video(str(retagged(squeezed, 3, 4)))) == (NARROW, 192)


def test_white_stays_white_and_black_black_at_8_and_10_bits(tmp_path: Path) -> None:
    for pixel_format, top in (("yuv420p", 255), ("yuv420p10le", 65535)):
        path = tmp_path / f"{pixel_format}.mp4"
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=25, options={"qp": "0"})
            stream.width, stream.height, stream.pix_fmt = 64, 48, pixel_format
            stream.codec_context.sample_aspect_ratio = WIDE
            for level in (0, 255):
                flat = np.full((48, 64, 3), level, np.uint8)
                container.mux(
                    stream.encode(VideoFrame.from_ndarray(flat, "rgb24").reformat(format=pixel_format))
                )
            container.mux(stream.encode())
        black, white = (frame.pixel_values.copy() for frame in open_video(str(path)).frames())
        assert (black.shape, white.shape) == ((48, 85, 3), (48, 85, 3))
        assert (black.max(), white.min()) == (0, top)


@pytest.mark.parametrize(("width", "height"), [(0, 1), (1, 1), (1216, 1215)])
def test_unknown_and_nearly_square_pixels_are_square(tmp_path: Path, width: int, height: int) -> None:
    """1216:1215 is what a scaled picture of whole pixels leaves; 0:1 stands for "not known"."""
    plain = encode(tmp_path / "plain.mp4", NARROW, Fraction(1))
    path = retagged(plain, width, height)
    assert size_of(open_video(str(path))) == (NARROW, ROWS)


@pytest.mark.parametrize(("width", "height"), [(1000, 1), (1, 1000), (9, 2)])
def test_pixels_of_no_format_are_refused_in_one_line(squeezed: Path, width: int, height: int) -> None:
    path = retagged(squeezed, width, height)
    with pytest.raises(InputError) as refused:
        open_video(str(path))
    told = str(refused.value)
    assert told.startswith(f"{path}: says that its pixels are {width}:{height}")
    assert "need 1:4 to 4:1" in told
    assert "\n" not in told


def test_a_turned_film_is_stretched_before_it_is_turned(tmp_path: Path) -> None:
    """The shape is that of the pixels in the file, whichever way up a phone was held."""
    with av.open(str(tmp_path / "phone.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"qp": "0"})
        stream.width, stream.height, stream.pix_fmt = NARROW, ROWS, "yuv420p"
        stream.codec_context.sample_aspect_ratio = WIDE
        stream.set_display_rotation(90)
        container.mux(stream.encode(VideoFrame.from_ndarray(picture(NARROW), "rgb24")))
        container.mux(stream.encode())
    assert size_of(open_video(str(tmp_path / "phone.mp4"))) == (ROWS, COLUMNS)


def test_loss_track_and_summary_of_a_squeezed_film(squeezed: Path) -> None:
    """The same film in square pixels loses the same share, to 0.06 of up to 0.4.

    Interpolation and wider columns take a little of the stripes' contrast. Taken for square, they are a third
    too fine for their display, and the loss is wrong by half of itself.
    """
    square = encode(squeezed.with_name("square.mp4"), COLUMNS, None)
    ours, wanted = (evenlight.loss_curves(path) for path in (squeezed, square))
    np.testing.assert_allclose(ours.loss, wanted.loss, atol=0.06)
    np.testing.assert_allclose(ours.mean_luminance, wanted.mean_luminance, rtol=0.01)
    unaware = evenlight.loss_curves([picture(NARROW, k / 8) for k in range(3)])
    assert np.abs(unaware.loss - wanted.loss).max() > 0.15
    assert evenlight.optimize(squeezed, 0.6).outcome.pixel_aspect == pytest.approx(4 / 3)
    assert evenlight.optimize(square, 0.6).outcome.pixel_aspect == 1.0


def test_what_is_written_again_has_square_pixels(squeezed: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "again.mkv", open_video(str(squeezed)).frames(), 25.0)
    again = open_video(str(tmp_path / "again.mkv"))
    assert (pixel_aspect(again), size_of(again)) == (1, (COLUMNS, ROWS))


def test_frames_in_memory_have_square_pixels() -> None:
    assert pixel_aspect(video_of([picture(NARROW)])) == 1
