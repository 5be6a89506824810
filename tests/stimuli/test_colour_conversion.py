"""Pixel formats of video against the formulas of ITU-T H.273; pixels that are no squares."""

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
from evenlight.stimuli.video.frame_conversion import ColourConverter, UnsupportedColourError
from evenlight.stimuli.video.frames_in_memory import video_of
from evenlight.stimuli.video.square_pixels import pixel_aspect
from evenlight.stimuli.video.video_source import size_of
from evenlight.stimuli.video_writer import write_video

WEIGHTS = {1: (0.2126, 0.0722), 6: (0.299, 0.114), 9: (0.2627, 0.0593)}  # H.273, table 4: K_R, K_B

LIMITED, FULL = 1, 2


def flat_frame(pixel_format, codes, bits, size=(32, 16)):
    """Return a frame whose every plane holds one code."""
    frame = VideoFrame(*size, pixel_format)
    kind = np.dtype(np.uint8) if bits <= 8 else np.dtype("<u2")
    for plane, code in zip(frame.planes, codes, strict=True):
        plane.update(np.full(plane.buffer_size // kind.itemsize, code, kind).tobytes())
    return frame


def rgb_as_defined(codes, bits, matrix, colour_range):
    """H.273, section 8.3: from quantized Y, Cb, Cr to R, G, B in [0, 1], clipped."""
    luma, blue_difference, red_difference = (float(code) for code in codes)
    if colour_range == FULL:
        y = luma / (2**bits - 1)
        cb, cr = ((c - 2 ** (bits - 1)) / (2**bits - 1) for c in (blue_difference, red_difference))
    else:
        scale = 2 ** (bits - 8)
        y = (luma - 16 * scale) / (219 * scale)
        cb, cr = ((c - 128 * scale) / (224 * scale) for c in (blue_difference, red_difference))
    weight_red, weight_blue = WEIGHTS[matrix]
    red, blue = y + 2 * (1 - weight_red) * cr, y + 2 * (1 - weight_blue) * cb
    green = (y - weight_red * red - weight_blue * blue) / (1 - weight_red - weight_blue)
    return np.clip([red, green, blue], 0, 1)


@pytest.mark.parametrize("colour_range", [LIMITED, FULL])
@pytest.mark.parametrize("matrix", WEIGHTS)
@pytest.mark.parametrize(
    ("pixel_format", "bits"),
    [
        ("yuv420p", 8), ("yuv422p", 8), ("yuv444p", 8),
        ("yuv420p10le", 10), ("yuv422p10le", 10), ("yuv444p12le", 12), ("yuv420p16le", 16),
    ],
)  # fmt: skip
def test_luma_and_chroma_become_rgb_as_h273_defines(pixel_format, bits, matrix, colour_range):
    rng = np.random.default_rng(bits)
    top = 2**bits - 1
    quarter = 2 ** (bits - 2)
    # 8 bits: rounded by FFmpeg, with its coefficients' own rounding. 16 bits: within 1 code of 65535.
    tolerance = 0.55 / 255 if bits == 8 else 1.0 / 65535
    convert = ColourConverter()
    for _ in range(12):
        codes = rng.integers(0, top, endpoint=True), *rng.integers(quarter, 3 * quarter, 2)
        frame = flat_frame(pixel_format, codes, bits)
        frame.colorspace, frame.color_range = matrix, colour_range
        pixels = convert.rgb(frame)
        assert pixels.dtype == (np.uint8 if bits == 8 else np.uint16)
        found = pixels[8, 16] / np.iinfo(pixels.dtype).max
        np.testing.assert_allclose(
            found, rgb_as_defined(codes, bits, matrix, colour_range), rtol=0, atol=tolerance
        )


@pytest.mark.parametrize(
    ("pixel_format", "bits", "top"),
    [("yuv420p", 8, 255), ("yuv420p10le", 10, 65535), ("yuv444p12le", 12, 65535), ("yuv420p16le", 16, 65535)],
)
def test_black_and_white_of_limited_range_reach_the_ends(pixel_format, bits, top):
    scale = 2 ** (bits - 8)
    for luma, expected in ((16 * scale, 0), (235 * scale, top)):
        frame = flat_frame(pixel_format, (luma, 128 * scale, 128 * scale), bits)
        assert (ColourConverter().rgb(frame) == expected).all()


@pytest.mark.parametrize(
    ("size", "matrix"), [((640, 360), 6), ((720, 576), 6), ((1280, 544), 1), ((960, 720), 1)]
)
def test_untagged_video_is_bt601_below_high_definition_and_bt709_from_there(size, matrix):
    codes = (120, 90, 170)
    pixels = ColourConverter().rgb(flat_frame("yuv420p", codes, 8, size))
    expected = 255 * rgb_as_defined(codes, 8, matrix, LIMITED)
    np.testing.assert_allclose(pixels[100, 100], expected, atol=0.55)


def test_untagged_jpeg_pixels_are_of_full_range():
    pixels = ColourConverter().rgb(flat_frame("yuvj420p", (255, 128, 128), 8))
    assert (pixels == 255).all()
    assert (ColourConverter().rgb(flat_frame("yuvj420p", (16, 128, 128), 8)) == 16).all()


@pytest.mark.parametrize(("bits", "name"), [(10, "gbrp10le"), (12, "gbrp12le"), (16, "gbrp16le")])
def test_deep_rgb_is_scaled_to_16_bits_correctly_rounded(bits, name):
    top = 2**bits - 1
    codes = np.random.default_rng(1).integers(0, top, (9, 11, 3), endpoint=True).astype(np.uint16)
    codes[0, 0], codes[0, 1] = 0, top
    pixels = ColourConverter().rgb(VideoFrame.from_ndarray(codes, name))
    np.testing.assert_array_equal(pixels, np.rint(codes.astype(np.float64) * 65535 / top))


@pytest.mark.parametrize("name", ["rgb48le", "rgb48be"])
def test_16_bit_rgb_comes_through_unchanged(name):
    codes = np.random.default_rng(2).integers(0, 65536, (9, 11, 3)).astype(np.uint16)
    frame = VideoFrame.from_ndarray(codes, "rgb48le").reformat(format=name)
    np.testing.assert_array_equal(ColourConverter().rgb(frame), codes)


@pytest.mark.parametrize(("name", "kind"), [("gray", np.uint8), ("gray16le", np.uint16)])
def test_gray_is_full_range_and_equal_in_all_channels(name, kind):
    codes = np.random.default_rng(3).integers(0, np.iinfo(kind).max, (9, 11), endpoint=True).astype(kind)
    pixels = ColourConverter().rgb(VideoFrame.from_ndarray(codes, name))
    assert pixels.dtype == kind
    np.testing.assert_array_equal(pixels, np.repeat(codes[..., np.newaxis], 3, axis=-1))


def test_gray_that_says_it_is_limited_is_expanded():
    frame = flat_frame("gray", (235,), 8)
    frame.color_range = LIMITED
    assert (ColourConverter().rgb(frame) == 255).all()


def test_transparent_pixels_are_seen_before_black():
    pixels = np.zeros((8, 8, 4), dtype=np.uint8)
    pixels[..., :3] = (200, 100, 50)
    pixels[:, :4, 3] = 255
    pixels[:, 4:, 3] = 51  # a fifth of 255
    shown = ColourConverter().rgb(VideoFrame.from_ndarray(pixels, "rgba"))
    assert shown[0, 0].tolist() == [200, 100, 50]
    assert shown[0, 7].tolist() == [40, 20, 10]


def test_deep_transparent_pixels_are_seen_before_black():
    codes = np.full((8, 8, 4), 65535, dtype=np.uint16)
    codes[..., 3] = 13107  # a fifth
    shown = ColourConverter().rgb(VideoFrame.from_ndarray(codes, "rgba64le"))
    assert (shown == 13107).all()


@pytest.mark.parametrize(
    ("trc", "message"),
    [(av.video.reformatter.ColorTrc.SMPTE2084, "PQ"), (av.video.reformatter.ColorTrc.LINEAR, "linear light")],
)
def test_pixels_that_are_not_gamma_encoded_are_refused(trc, message):
    frame = VideoFrame(8, 8, "yuv420p10le")
    frame.color_trc = trc
    with pytest.raises(UnsupportedColourError, match=message):
        ColourConverter().rgb(frame)


@pytest.mark.parametrize("name", ["gbrpf32le", "grayf32le", "xyz12le", "rgbaf16le"])
def test_pixel_formats_without_integer_rgb_are_refused(name):
    with pytest.raises(UnsupportedColourError, match=name):
        ColourConverter().rgb(VideoFrame(8, 8, name))


def test_an_unknown_matrix_is_refused():
    frame = VideoFrame(8, 8, "yuv420p")
    frame.colorspace = 8  # YCgCo
    with pytest.raises(UnsupportedColourError, match="colour matrix 8"):
        ColourConverter().rgb(frame)


# --- square pixels

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
        assert (black.shape, white.shape) == ((48, 86, 3), (48, 86, 3))  # 64 times 4/3, even
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
