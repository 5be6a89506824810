"""Y, Cb, Cr without R, G, B: the same light to the last bit, or R, G, B as before."""

from dataclasses import replace
from fractions import Fraction

import av
import numpy as np
import pytest
from av.error import FFmpegError
from av.video.frame import VideoFrame

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame, LumaChroma, same_pixels
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.stimuli.image_renderer import ImageUploads
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.video.colour_planes import PixelReader
from evenlight.stimuli.video.film_reader import STRICT
from evenlight.stimuli.video.frame_conversion import ColourConverter, planes_of
from evenlight.stimuli.video.video_file import open_video_file

LAB = Display("lab", 250.0, 0.1, 2.2, 40.0)
LIMITED, FULL = 1, 2
WEIGHTS = {1: (0.2126, 0.0722), 6: (0.299, 0.114)}  # H.273, table 4: K_R, K_B


def textured(pixel_format="yuv420p", size=(32, 24), seed=1):
    """Return a frame of noise, within the codes that encoders make; darker rows reach black and beyond."""
    rng = np.random.default_rng(seed)
    frame = VideoFrame(*size, pixel_format)
    for plane, (low, high) in zip(planes_of(frame), ((0, 256), (40, 216), (40, 216)), strict=True):
        plane[:] = rng.integers(low, high, plane.shape, dtype=np.uint8)
    return frame


def light(gamma=2.2, order=PixelToLuminance.LINEAR_FIRST):
    return FrameLight(Display("lab", 250.0, 0.1, gamma, 40.0), order)


def no_rgb():
    raise AssertionError("R, G, B were made")


def moving_video(path, codec="libx264", pixel_format="yuv420p", n=20, size=(96, 64), **options):
    """Write a video whose every second frame is that before it."""
    texture = np.random.default_rng(7).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = *size, pixel_format
        stream.thread_type = "FRAME"  # else the encoder cuts pictures into slices
        for k in range(n):
            picture = VideoFrame.from_ndarray(np.roll(texture, 3 * (k // 2), axis=1), "rgb24")
            picture.pts, picture.time_base = k, Fraction(1, 25)
            container.mux(stream.encode(picture.reformat(format=pixel_format)))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("matrix", [1, 5, 6])
@pytest.mark.parametrize(("pixel_format", "colour_range"), [
    ("yuv420p", LIMITED), ("yuv420p", FULL), ("yuv422p", LIMITED), ("yuv422p", FULL),
    ("yuv444p", LIMITED), ("yuv444p", FULL), ("yuvj420p", FULL),
])  # fmt: skip
def test_planes_give_the_light_of_rgb_to_the_last_bit(pixel_format, matrix, colour_range):
    frame = textured(pixel_format)
    frame.colorspace, frame.color_range = matrix, colour_range
    pixels = PixelReader().pixels(frame)
    assert isinstance(pixels, LumaChroma)
    rgb = ColourConverter().rgb(frame)
    np.testing.assert_array_equal(pixels.rgb, rgb)
    of_planes, of_rgb = light().luminance_and_means(pixels), light().luminance_and_means(rgb)
    np.testing.assert_array_equal(of_planes[0], of_rgb[0])
    np.testing.assert_array_equal(of_planes[1], of_rgb[1])


@pytest.fixture(scope="module")
def uploads():
    with offscreen_context() as context:
        context.simple_framebuffer((4, 4)).use()
        yield ImageUploads(context)


@pytest.mark.parametrize("amid", [(False, False), (False, True), (True, False), (True, True)])
@pytest.mark.parametrize("size", [(32, 24), (33, 25), (2, 2)])
@pytest.mark.parametrize(("pixel_format", "colour_range"), [
    ("yuv420p", LIMITED), ("yuv420p", FULL), ("yuv422p", LIMITED), ("yuv444p", FULL),
])  # fmt: skip
def test_the_graphics_card_makes_the_same_codes_of_planes(uploads, pixel_format, colour_range, size, amid):
    """Their light is that of the processor's loop; where chroma lies as FFmpeg takes it, they are its own."""
    frame = textured(pixel_format, size)
    frame.colorspace, frame.color_range = 1, colour_range
    pixels = PixelReader().pixels(frame)
    found_out = pixels.amid == amid
    pixels = replace(pixels, amid=amid)
    texture = uploads.upload(pixels, 256).texture
    made = np.frombuffer(texture.read(alignment=1), np.uint8).reshape(*size[::-1], 4)[..., :3]
    np.testing.assert_array_equal(light().luminance(made), light().luminance(pixels))
    if found_out:
        np.testing.assert_array_equal(made, pixels.rgb)


def test_pictures_that_follow_each_other_are_each_their_own(uploads):
    """Two buffers take turns: the third picture goes where the first was."""
    first = PixelReader().pixels(textured("yuv444p"))
    for shade in (0, 40, 80, 0):
        picture = replace(first, planes=tuple(plane // 2 + shade for plane in first.planes))
        texture = uploads.upload(picture, 256).texture
        made = np.frombuffer(texture.read(alignment=1), np.uint8).reshape(*picture.planes[0].shape, 4)
        np.testing.assert_array_equal(light().luminance(made[..., :3]), light().luminance(picture))


@pytest.mark.parametrize(("colour_range", "matrix"), [(LIMITED, 1), (FULL, 6)])
def test_light_of_planes_is_that_of_h273_within_the_rounding_to_codes(colour_range, matrix):
    """Section 8.3 in float64, with chroma amid the pixels and linear in between, on a linear display."""
    frame = textured()
    frame.colorspace, frame.color_range = matrix, colour_range
    luma, blue, red = (plane.astype(np.float64) for plane in planes_of(frame))
    black, luma_span, chroma_span = (0, 255, 255) if colour_range == FULL else (16, 219, 224)
    # A sample of chroma lies half a pixel after the first of the two pixels that it stands for.
    at = [np.clip((np.arange(n) - 0.5) / 2, 0, n // 2 - 1) for n in luma.shape]

    def at_pixels(plane):
        down = np.array([np.interp(at[0], np.arange(len(column)), column) for column in plane.T]).T
        return np.array([np.interp(at[1], np.arange(len(row)), row) for row in down])

    weight_red, weight_blue = WEIGHTS[matrix]
    y = (luma - black) / luma_span
    r = y + 2 * (1 - weight_red) * (at_pixels(red) - 128) / chroma_span
    b = y + 2 * (1 - weight_blue) * (at_pixels(blue) - 128) / chroma_span
    g = (y - weight_red * r - weight_blue * b) / (1 - weight_red - weight_blue)
    expected = 0.1 + 249.9 * np.clip(np.stack([r, g, b], -1), 0, 1) @ [0.2126, 0.7152, 0.0722]
    found = light(gamma=1.0).luminance(PixelReader().pixels(frame))
    # Half a code of rounding, and 0.06 for the whole numbers of the matrix.
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.56 / 255 * 249.9)


def test_blue_brighter_than_white_stays_blue():
    """By hand, BT.709: Y = 239/219, R = Y, B > 1 and G = Y - 0.0722 * 1.8556 / 0.7152 * 122/224 = 0.9893."""
    frame = textured()
    for plane, code in zip(planes_of(frame), (255, 250, 128), strict=True):
        plane[:] = code  # FFmpeg's sum overflows, and makes yellow of it
    frame.colorspace, frame.color_range = 1, LIMITED
    found = light(gamma=1.0).luminance(PixelReader().pixels(frame))
    expected = 0.1 + 249.9 * (0.2126 + 0.7152 * 0.9893 + 0.0722)
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.7152 * 0.56 / 255 * 249.9)


@pytest.mark.parametrize(("place", "amid"), [
    (0, (True, False)),  # beside the left of two pixels: what H.264 means if a file does not say
    (1, (True, True)),  # amid four pixels
    (2, (False, False)),  # on the upper left one
])  # fmt: skip
def test_where_chroma_lies_is_found_out(tmp_path, place, amid):
    path = moving_video(tmp_path / "a.mp4", n=2, **{"x264-params": f"chromaloc={place}"})
    frame = next(open_video_file(path).frames())
    assert frame.pixels.amid == amid
    np.testing.assert_array_equal(light().luminance(frame.pixels), light().luminance(frame.pixel_values))


@pytest.mark.parametrize("options", ["interlaced=1", "chromaloc=4"])  # 4: on the lower left pixel
def test_files_whose_chroma_is_interpolated_otherwise_come_as_rgb(tmp_path, options):
    path = moving_video(tmp_path / "a.mp4", n=2, **{"x264-params": options})
    assert isinstance(next(open_video_file(path).frames()).pixels, np.ndarray)


def test_luminance_of_planes_makes_no_rgb_where_channels_are_linearized_first():
    gray = np.full((4, 4), 235, np.uint8), np.full((2, 2), 128, np.uint8), np.full((2, 2), 128, np.uint8)
    white = LumaChroma(gray, WEIGHTS[1], False, (True, True), no_rgb)
    np.testing.assert_allclose(light().luminance(white), 250.0, rtol=1e-6)  # 235 is white
    np.testing.assert_allclose(light().drawn(white, 0.5), 125.0, rtol=1e-6)
    with pytest.raises(AssertionError, match="were made"):
        light(order=PixelToLuminance.LUMA_FIRST).luminance(white)


def test_finding_out_leaves_the_picture_as_it_was():
    frame = textured()
    before = [plane.copy() for plane in planes_of(frame)]
    pixels = PixelReader().pixels(frame)
    for plane, kept, shown in zip(planes_of(frame), before, pixels.planes, strict=True):
        np.testing.assert_array_equal(plane, kept)
        np.testing.assert_array_equal(shown, kept)


@pytest.mark.parametrize("aspect", [Fraction(64, 45), Fraction(8, 9), Fraction(32, 27)])
@pytest.mark.parametrize("size", [(36, 24), (31, 23)])
@pytest.mark.parametrize("pixel_format", ["yuv420p", "yuv422p", "yuv444p"])
def test_pixels_that_are_no_squares_come_as_planes_too_with_the_light_of_rgb(pixel_format, size, aspect):
    frame = textured(pixel_format, size)
    pixels, rgb = PixelReader(aspect).pixels(frame), ColourConverter(aspect).rgb(frame)
    assert isinstance(pixels, LumaChroma)
    assert pixels.shape == rgb.shape
    np.testing.assert_array_equal(light().luminance(pixels), light().luminance(rgb))
    for plane, whole in zip(pixels.planes, VideoFrame(*rgb.shape[1::-1], pixel_format).planes, strict=True):
        assert plane.shape == (whole.height, whole.width)


@pytest.mark.parametrize("pixel_format", ["yuv420p10le", "yuva420p", "gbrp", "gray", "yuv411p"])
def test_all_else_comes_as_rgb(pixel_format):
    frame = VideoFrame(32, 24, pixel_format)
    for plane in frame.planes:
        plane.update(np.random.default_rng(3).integers(0, 200, plane.buffer_size, dtype=np.uint8).tobytes())
    pixels = PixelReader().pixels(frame)
    np.testing.assert_array_equal(pixels, ColourConverter().rgb(frame))


def test_curves_of_planes_are_those_of_rgb_byte_for_byte_with_any_number_of_jobs(tmp_path):
    video = open_video_file(moving_video(tmp_path / "v.mp4"))
    frames = list(video.frames())
    assert all(isinstance(frame.pixels, LumaChroma) for frame in frames)
    as_rgb = [Frame(frame.time, frame.duration, frame.pixel_values) for frame in frames]
    expected = analyze_frames(as_rgb, "v", LAB)
    assert (np.diff(expected.loss, axis=0) == 0).all(axis=1).any()  # frames that equal the one before
    for jobs in (1, 2):
        found = analyze_frames(video.frames(), "v", LAB, effort=AnalysisEffort(jobs=jobs))
        for name in ("loss", "visible_contrast", "mean_luminance", "channel_means", "times"):
            assert getattr(found, name).tobytes() == getattr(expected, name).tobytes(), name


def test_pictures_are_equal_if_they_hold_the_same_and_mean_the_same():
    frame, other = textured(seed=1), textured(seed=2)
    one, again, different = (PixelReader().pixels(f) for f in (frame, textured(seed=1), other))
    assert same_pixels(one, again)
    assert not same_pixels(one, different)
    frame.color_range = FULL
    assert not same_pixels(one, PixelReader().pixels(frame))
    assert not same_pixels(one, one.rgb)


def test_threads_of_the_decoder_report_damage_at_the_frame_where_one_thread_does(tmp_path):
    path = moving_video(tmp_path / "v.mp4", n=30, qp="0")
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 512] = np.random.default_rng(3).bytes(512)
    path.write_bytes(bytes(content))
    one_thread, several = [], []

    def decode_in_one_thread():
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            stream.codec_context.thread_count, stream.codec_context.options = 1, STRICT
            one_thread.extend(frame.pts for frame in container.decode(stream))

    with pytest.raises(FFmpegError):
        decode_in_one_thread()
    with pytest.raises(InputError, match=r"damaged at frame \d+") as caught:
        several.extend(frame.time for frame in open_video_file(path).frames())
    assert 0 < len(several) == len(one_thread)
    assert f"damaged at frame {len(several)} (" in str(caught.value)


def test_frames_that_all_have_one_time_are_refused(tmp_path):
    path = tmp_path / "v.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = 32, 24, "yuvj420p"
        packets = [p for _ in range(3) for p in stream.encode(textured("yuvj420p"))]
        for packet in packets:
            packet.pts = packet.dts = 0
            container.mux(packet)
    with pytest.raises(InputError, match="all its 3 frames have the same time"):
        open_video_file(path)
