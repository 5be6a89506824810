"""Pixel formats of video against the formulas of ITU-T H.273, in float64, code by code."""

import av
import numpy as np
import pytest
from av.video.frame import VideoFrame

from evenlight.stimuli.video.frame_conversion import ColourConverter, UnsupportedColourError

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
