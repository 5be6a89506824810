"""The picture of a player page: every frame at its own time, near the video's colours, within its bounds."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from itertools import pairwise

import av
import numpy as np
import pytest
from av.video.reformatter import ColorRange
from numpy.typing import NDArray
from PIL import Image

from evenlight.analysis.player import proxy_video
from evenlight.analysis.player.proxy_video import (
    PictureFormat,
    Proxy,
    ProxyEncoder,
    StillsEncoder,
    in_background,
    picture_format,
)
from evenlight.data_schema.frame import Frame, Pixels
from evenlight.stimuli.video.colour_planes import PixelReader
from evenlight.stimuli.video.frame_conversion import BT601, BT709, EXACT

PATCHES = ((255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255), (0, 0, 0), (128, 128, 128), (200, 100, 50))
PATCH = 32  # [pixels]


def patches() -> NDArray[np.uint8]:
    """Squares of flat colour, side by side."""
    return np.repeat(np.repeat(np.array([PATCHES], np.uint8), PATCH, axis=0), PATCH, axis=1)


def planes(matrix: int, colour_range: ColorRange) -> Pixels:
    """The same as a decoder gives it."""
    picture = av.VideoFrame.from_ndarray(patches(), "rgb24").reformat(
        format="yuv420p", dst_colorspace=matrix, dst_color_range=colour_range, interpolation=EXACT
    )
    picture.colorspace, picture.color_range = matrix, colour_range
    return PixelReader().pixels(picture)


def encoded(form: PictureFormat, pictures: Sequence[Pixels], times: Sequence[float]) -> Proxy:
    steps = [later - time for time, later in pairwise(times)]
    encoder = ProxyEncoder(form, (len(times) - 1) / times[-1])
    for number, (time, duration, pixels) in enumerate(zip(times, [*steps, 0.5], pictures, strict=True)):
        encoder.add(number, Frame(time, duration, pixels))
    return encoder.finished()


def decoded(proxy: Proxy) -> list[av.VideoFrame]:
    with av.open(io.BytesIO(proxy.data)) as container:
        return list(container.decode(video=0))


def in_rgb(frame: av.VideoFrame) -> NDArray[np.uint8]:
    return frame.reformat(format="rgb24", dst_color_range=ColorRange.JPEG, interpolation=EXACT).to_ndarray()


# --- times


@pytest.mark.parametrize(
    "times",
    [
        [k / 25 for k in range(30)],
        [k * 1001 / 30000 for k in range(30)],
        [0.0, 0.0333, 0.04, 0.2, 0.2001, 1.5, 3.0, 3.0333],  # varies
        [0.0, 7.0, 7.000004, 14.0],  # two frames closer than the clock of the file tells
    ],
    ids=["25 Hz", "29.97 Hz", "varying", "as good as at once"],
)
def test_a_player_shows_each_frame_at_its_own_time(times: list[float]) -> None:
    form = PictureFormat(64, 32, 1e6)
    noise = np.random.default_rng(1).integers(0, 255, (len(times), 32, 64, 3), dtype=np.uint8)
    proxy = encoded(form, list(noise), times)
    with av.open(io.BytesIO(proxy.data)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.size]
        assert [packet.pts for packet in packets] == [packet.dts for packet in packets]  # none waits
        shown = [float(packet.pts * packet.time_base) for packet in packets]
        assert float(stream.duration * stream.time_base) == pytest.approx(times[-1] + 0.5, abs=2e-5)
    assert shown[0] == 0
    np.testing.assert_allclose(shown, times, atol=1.2e-5)  # a tick is 1/90000 s
    np.testing.assert_allclose(proxy.times, shown, rtol=1e-12)
    assert (np.diff(proxy.times) > 0).all()
    assert proxy.frames.tolist() == list(range(len(times)))


def test_a_seek_decodes_a_second_at_most() -> None:
    frame = patches()
    proxy = encoded(PictureFormat(224, 32, 1e6), [frame] * 60, [k / 20 for k in range(60)])
    keys = [float(time) for time, one in zip(proxy.times, decoded(proxy), strict=True) if one.key_frame]
    np.testing.assert_allclose(keys, [0.0, 1.0, 2.0], atol=0.06)


# --- colours


@pytest.mark.parametrize(
    "pixels_of",
    [
        patches,
        lambda: patches().astype(np.uint16) * 257,
        lambda: patches() / np.float32(255),
        lambda: planes(BT709, ColorRange.MPEG),
        lambda: planes(BT601, ColorRange.MPEG),
        lambda: planes(BT601, ColorRange.JPEG),
    ],
    ids=["8 bits", "16 bits", "floats", "BT.709", "BT.601", "full range"],
)
def test_colours_are_the_videos_to_3_of_255_and_tagged_so_that_a_browser_shows_them(
    pixels_of: Callable[[], Pixels],
) -> None:
    proxy = encoded(picture_format((7 * PATCH, PATCH), 3, 3.0), [pixels_of()] * 3, [0.0, 1.0, 2.0])
    for frame in decoded(proxy):
        assert frame.color_range == ColorRange.MPEG
        assert frame.colorspace in (BT601, BT709)
        rgb = frame.reformat(
            format="rgb24", dst_color_range=ColorRange.JPEG, interpolation=EXACT
        ).to_ndarray()
        middles = rgb[PATCH // 2, PATCH // 2 :: PATCH].astype(int)
        assert np.abs(middles - np.array(PATCHES)).max() <= 3


def test_the_picture_is_the_video_averaged_to_its_size() -> None:
    """Smooth content: 4 by 4 pixels become one, and coding adds 2 of 255 on average."""
    down, across = np.mgrid[0:384, 0:512]
    gray = 128 + 60 * np.sin(down / 60) + 50 * np.cos(across / 75)
    video = np.rint(np.stack([gray, 0.9 * gray, 0.8 * gray], axis=-1)).astype(np.uint8)
    proxy = encoded(PictureFormat(128, 96, 2e6), [video] * 3, [0.0, 1.0, 2.0])
    expected = video.reshape(96, 4, 128, 4, 3).mean(axis=(1, 3))
    error = in_rgb(decoded(proxy)[1]) - expected
    assert np.abs(error).mean() <= 2
    assert abs(error.mean()) <= 0.5


# --- sizes


def test_noise_stays_within_its_rate_and_the_same_frames_give_the_same_bytes() -> None:
    noise = np.random.default_rng(2).integers(0, 255, (50, 48, 64, 3), dtype=np.uint8)
    rate, seconds = 1e5, 10.0
    proxies = [encoded(PictureFormat(64, 48, rate), list(noise), [k / 5 for k in range(50)]) for _ in "12"]
    assert 8 * len(proxies[0].data) <= rate * (seconds + 2)  # and what 2 s of buffer hold
    assert proxies[0].data == proxies[1].data


@pytest.mark.parametrize("size", [(1920, 1080), (1080, 1920), (640, 360), (9, 13), (16, 16), (8000, 500)])
@pytest.mark.parametrize("seconds", [1.0, 150.0, 600.0, 1200.0, 7200.0])
def test_a_page_has_room_for_the_picture(size: tuple[int, int], seconds: float) -> None:
    n_frames = round(25 * seconds)
    form = picture_format(size, n_frames, seconds)
    assert form.width % 2 == form.height % 2 == 0
    assert form.width <= size[0]
    assert form.height <= min(size[1], 480)
    assert abs(form.width - size[0] * form.height / size[1]) <= 1.5 + size[0] / size[1]  # its shape
    if form.rate:
        # Base64 takes 4 bytes for 3, and a frame of the track 48.
        assert 4 / 3 * form.rate * (seconds + 2) / 8 + 48 * n_frames <= 25e6
        assert form.rate >= form.width * form.height
    else:
        assert -(-n_frames // form.stride) <= 240


def test_longer_videos_have_fewer_lines_and_very_long_ones_stills() -> None:
    forms = [picture_format((1920, 1080), round(25 * s), s) for s in (150.0, 400.0, 900.0, 7200.0)]
    assert [form.height for form in forms[:3]] == [480, 360, 240]
    assert [form.rate > 0 for form in forms] == [True, True, True, False]


def test_stills_lie_on_the_sheet_in_order() -> None:
    encoder = StillsEncoder(PictureFormat(16, 8, 0, 10))
    for k in range(14):
        encoder.add(10 * k, Frame(float(k), 1.0, np.full((32, 64, 3), 10 * k, np.uint8)))
    tiles = encoder.finished()
    with Image.open(io.BytesIO(tiles.data)) as sheet:
        assert sheet.size == (12 * 16, 2 * 8)
        found = [sheet.getpixel((16 * (k % 12) + 8, 8 * (k // 12) + 4)) for k in range(14)]
    assert np.abs(np.array(found) - 10 * np.arange(14)[:, None]).max() <= 2  # JPEG
    assert tiles.frames.tolist() == [10 * k for k in range(14)]
    assert (tiles.width, tiles.height, tiles.columns) == (16, 8, 12)


# --- the other thread


def test_what_goes_wrong_in_the_background_is_raised_where_frames_are_handed_over() -> None:
    def fails(number: int, _: Frame) -> None:
        raise ValueError(f"frame {number}")

    frame = Frame(0.0, 1.0, np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(ValueError, match="frame 0"), in_background(fails) as do:
        do(0, frame)


def test_frames_in_the_background_are_as_they_were_handed_over_and_in_order() -> None:
    seen, pixels = [], np.zeros((8, 8, 3), np.uint8)
    with in_background(lambda number, frame: seen.append((number, int(frame.pixel_values[0, 0, 0])))) as do:
        for k in range(40):
            pixels[:] = k  # a source may fill its array again
            do(k, Frame(float(k), 1.0, pixels))
    assert seen == [(k, k) for k in range(40)]


def test_large_frames_wait_one_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    monkeypatch.setattr(proxy_video, "AHEAD_BYTES", 8 * 8 * 3 * 2 - 1)  # of two frames, all but a byte
    with in_background(lambda number, _: seen.append(number)) as do:
        for k in range(10):
            do(k, Frame(float(k), 1.0, np.zeros((8, 8, 3), np.uint8)))
            assert len(seen) >= k  # those before it are done
