"""When frames appear, which are sought, decoded ahead, and averaged to fewer pixels."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.experiments.playback.frame_buffer import FrameBuffer
from evenlight.stimuli.sequences import built_in_sequence, open_video, open_videos
from evenlight.stimuli.video.film_reader import FilmReader
from evenlight.stimuli.video.frame_conversion import area_weights, coarser
from evenlight.stimuli.video.image_folder import open_image_folder
from evenlight.stimuli.video.video_file import VideoFile, open_video_file
from evenlight.stimuli.video.video_source import (
    VideoSource,
    frame_times,
    frames_at,
    frames_from,
    rate_from_number,
    uniform_times,
)

MILLISECOND = Fraction(1, 1000)

rates = st.sampled_from(
    [Fraction(24000, 1001), Fraction(25), Fraction(30000, 1001), Fraction(60), Fraction(25, 2)]
)


@given(rate=rates, frames=st.integers(2, 400), offset=st.integers(-5000, 5000))
def test_time_stamps_in_milliseconds_become_the_exact_grid(rate, frames, offset):
    stamps = [offset + round(k * 1000 / rate) for k in range(frames)]
    found = frame_times(stamps, MILLISECOND, rates=[rate])
    np.testing.assert_allclose(found.times, [float(k / rate) for k in range(frames)], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.durations, float(1 / rate), rtol=1e-12)


@pytest.mark.slow
@given(rate=rates, frames=st.integers(1200, 3000))
def test_a_long_grid_is_recovered_without_a_claimed_rate(rate, frames):
    # After 1200 frames, 24 and 24000/1001 Hz are 50 ms apart: only one of them explains the stamps.
    found = frame_times([round(k * 1000 / rate) for k in range(frames)], MILLISECOND)
    assert found.times[-1] == pytest.approx(float((frames - 1) / rate), abs=1e-12)


def test_truncated_time_stamps_count_as_rounded_ones():
    stamps = [int(k * 1000 * 1001 / 30000) for k in range(100)]
    found = frame_times(stamps, MILLISECOND, rates=[Fraction(30000, 1001)])
    assert found.times[99] == pytest.approx(99 * 1001 / 30000, abs=1e-12)


def test_a_wrong_claim_is_not_believed():
    found = frame_times(range(0, 4000, 40), MILLISECOND, rates=[Fraction(30)])
    assert found.times[99] == pytest.approx(3.96, abs=1e-12)


def test_varying_steps_are_kept_and_the_last_frame_lasts_as_its_packet_says():
    found = frame_times([100, 140, 240, 260], MILLISECOND, last=70, rates=[Fraction(25)])
    np.testing.assert_allclose(found.times, [0, 0.04, 0.14, 0.16])
    np.testing.assert_allclose(found.durations, [0.04, 0.1, 0.02, 0.07])


def test_a_last_frame_of_unknown_duration_lasts_as_long_as_the_median():
    found = frame_times([0, 10, 110, 140], MILLISECOND)
    assert found.durations[-1] == pytest.approx(0.03)  # the median of 10, 100 and 30 ms


def test_a_coarse_tick_does_not_turn_varying_steps_into_a_grid():
    # 0, 1, 3 ticks lie within half a tick of the grid 0, 1.5, 3, but they are two different steps.
    found = frame_times([0, 1, 3], Fraction(1, 25))
    np.testing.assert_allclose(found.times, [0, 0.04, 0.12])


def test_frames_at_the_same_time_are_marked_as_unseen_but_the_last_of_them():
    found = frame_times([0, 40, 40, 120], MILLISECOND, last=40)
    np.testing.assert_allclose(found.durations, [0.04, 0, 0.08, 0.04])
    assert found.shown == 3


@given(
    steps=st.lists(st.integers(0, 500), min_size=1, max_size=50).filter(any),
    shuffle=st.randoms(use_true_random=False),
)
def test_times_start_at_zero_never_fall_and_durations_fill_them(steps, shuffle):
    stamps = np.concatenate([[7], 7 + np.cumsum(steps)]).tolist()
    shuffle.shuffle(stamps)
    found = frame_times(stamps, MILLISECOND)
    assert found.times[0] == 0
    assert (np.diff(found.times) >= 0).all()
    np.testing.assert_allclose(found.times[:-1] + found.durations[:-1], found.times[1:], atol=1e-12)
    assert found.durations[-1] > 0


@pytest.mark.parametrize(
    ("last", "claimed", "expected"), [(200, [Fraction(10)], 0.2), (0, [Fraction(10)], 0.1), (0, [], 0.04)]
)
def test_a_single_frame_lasts_as_its_packet_or_the_rate_says(last, claimed, expected):
    assert frame_times([5], MILLISECOND, last, claimed).durations.tolist() == [pytest.approx(expected)]


def test_uniform_times_do_not_drift():
    times = uniform_times(10**6, Fraction(30000, 1001)).times
    assert times[999_999] == 999_999 * 1001 / 30000


def test_times_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        uniform_times(3, Fraction(25)).times[0] = 1


@pytest.mark.parametrize(
    ("number", "ratio"),
    [(29.97, (30000, 1001)), (23.976, (24000, 1001)), (59.94, (60000, 1001)), (12.5, (25, 2)), (24, (24, 1))],
)
def test_broadcast_rates_are_meant_as_ratios_over_1001(number, ratio):
    assert rate_from_number(number) == Fraction(*ratio)


@pytest.mark.parametrize("number", [0, -1, float("nan"), float("inf"), 1e-9, 1e9])
def test_impossible_rates_are_refused(number):
    with pytest.raises(ValueError, match="need a frame rate from"):
        rate_from_number(number)


# --- frames from

N = 40

NUMBERS = (0, 1, 9, 11, 12, 13, 23, 25, 39)  # about the key frames, every twelfth

ENCODERS = {
    "closed": ("a.mp4", "libx264", {"x264-params": "keyint=12:min-keyint=12:scenecut=0:bframes=3"}),
    "open": ("b.mkv", "libx264", {"x264-params": "keyint=12:min-keyint=12:scenecut=0:bframes=3:open-gop=1"}),
    "without key frames": ("c.mp4", "libx264", {"x264-params": "keyint=12:intra-refresh=1:bframes=0"}),
    "mpeg2": ("d.mkv", "mpeg2video", {"g": "12", "bf": "2"}),
    "avi": ("e.avi", "mpeg4", {"g": "12", "bf": "2"}),
    "lossless": ("f.mkv", "ffv1", {"g": "12"}),
}


def written(path: Path, codec: str, options: dict[str, str]) -> VideoFile:
    noise = np.random.default_rng(1).integers(0, 255, (64, 96, 3), dtype=np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(25), options=options)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for k in range(N):
            picture = av.VideoFrame.from_ndarray(np.roll(noise, 3 * k, axis=1), "rgb24")
            container.mux(stream.encode(picture.reformat(format="yuv420p")))
        container.mux(stream.encode())
    return open_video_file(path)


def require_the_same(video: VideoSource, numbers: tuple[int, ...]) -> None:
    every = [(frame.time, frame.pixel_values.tobytes()) for frame in video.frames()]
    for number in numbers:
        rest = [(frame.time, frame.pixel_values.tobytes()) for frame in frames_from(video, number)]
        assert rest == every[number:]
    found = [(frame.time, frame.pixel_values.tobytes()) for frame in frames_at(video, numbers)]
    assert found == [every[number] for number in numbers]
    assert not list(frames_at(video, ()))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ENCODERS)
def test_frames_of_a_file(kind: str, tmp_path: Path) -> None:
    name, codec, options = ENCODERS[kind]
    require_the_same(written(tmp_path / name, codec, options), NUMBERS)


def test_what_lies_before_the_last_key_frame_is_not_decoded_and_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, codec, options = ENCODERS["closed"]
    video, decoded = written(tmp_path / name, codec, options), []
    pictures = FilmReader.pictures

    def counted(reader: FilmReader):
        for picture in pictures(reader):
            decoded.append(picture.pts)
            yield picture

    monkeypatch.setattr(FilmReader, "pictures", counted)
    next(video.frames_at([30]))
    assert len(decoded) == 30 - 24 + 1
    decoded.clear()
    assert len(list(video.frames_at([26, 30, 34]))) == 3
    assert len(decoded) == 34 - 24 + 1  # of one group, all in one go


def test_frames_of_a_folder_and_of_a_sequence(tmp_path: Path) -> None:
    for k in range(4):
        np.save(tmp_path / f"{k}.npy", np.full((8, 8, 3), k, np.uint8))
    require_the_same(open_image_folder(tmp_path), (0, 2, 3))
    require_the_same(built_in_sequence("checkerboard", (16, 16), 0.4), (0, 3, 9))  # it cannot be sought


# --- frame buffer

BYTES = 6 * 8 * 3  # of a frame

ALL = float("inf")  # seconds of video: as many as fit, or as are needed


class Video:
    """A video that fills the same array again for each frame, and counts those it was asked for."""

    name = "walk"

    def __init__(self, n_frames: int, fails_at: int | None = None) -> None:
        self.n_frames, self.fails_at = n_frames, fails_at
        self.decoded, self.closed = 0, False
        self.held_at, self.go_on = n_frames, threading.Event()  # a frame that is waited for

    def frames(self) -> Iterator[Frame]:
        pixels = np.empty((6, 8, 3), np.uint8)
        try:
            for k in range(self.n_frames):
                if k == self.fails_at:
                    raise InputError(f"walk.mkv is damaged at frame {k}")
                if k == self.held_at:
                    self.go_on.wait()
                pixels[:] = k
                self.decoded += 1
                yield Frame(k / 25, 1 / 25, pixels)
        finally:
            self.closed = True

    def sha256(self) -> str:
        return ""


def threads() -> int:
    return sum(thread.name == "frames of walk" for thread in threading.enumerate())


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    yield
    assert threads() == 0


def test_every_frame_comes_with_its_own_pixels_and_time() -> None:
    with FrameBuffer(Video(40), 40, capacity=5 * BYTES) as buffer:
        for k in range(40):
            frame = buffer.frame(k)
            assert (frame.index, frame.time, frame.count) == (k, k / 25, 256)
            assert (frame.levels == k).all()
            assert buffer.frame(k) is frame  # a frame may be shown for several refreshes


def test_frames_may_be_left_out_but_not_asked_for_again() -> None:
    with FrameBuffer(Video(40), 40, capacity=5 * BYTES) as buffer:
        assert (buffer.frame(17).levels == 17).all()
        assert (buffer.frame(39).levels == 39).all()
        with pytest.raises(ValueError, match="frame 12 was let go"):
            buffer.frame(12)


def test_the_buffer_is_full_before_and_holds_no_more_than_fits() -> None:
    """5 frames fit; one more is decoded and waits for room."""
    video = Video(1000)
    with FrameBuffer(video, 1000, capacity=5 * BYTES) as buffer:
        assert buffer.ready(ALL)
        time.sleep(0.05)
        assert 5 <= video.decoded <= 6
        buffer.frame(3)
        assert buffer.ready(ALL)
        assert 8 <= video.decoded <= 9
    assert video.closed


def test_a_short_clip_is_held_wholly_and_no_frame_beyond_it_is_decoded() -> None:
    video = Video(1000)
    with FrameBuffer(video, 20) as buffer:
        assert buffer.ready(ALL)
        assert video.decoded == 20
        with pytest.raises(ValueError, match="frame 20 is not among the 20"):
            buffer.frame(20)


def test_a_frame_larger_than_the_memory_can_be_shown_all_the_same() -> None:
    with FrameBuffer(Video(5), 5, capacity=1) as buffer:
        assert buffer.ready(ALL)
        assert [buffer.frame(k).levels[0, 0, 0] for k in range(5)] == list(range(5))


def test_what_can_be_read_is_shown_before_the_error_is_told() -> None:
    with FrameBuffer(Video(40, fails_at=3), 40) as buffer:
        assert buffer.ready(ALL)
        assert buffer.frame(2).index == 2
        with pytest.raises(InputError, match=r"walk\.mkv is damaged at frame 3"):
            buffer.frame(3)
        with pytest.raises(InputError, match=r"walk\.mkv is damaged at frame 3"):
            buffer.frame(3)


def test_a_video_shorter_than_its_track_is_told_with_both_numbers() -> None:
    with FrameBuffer(Video(7), 9) as buffer:
        assert buffer.frame(6).index == 6
        with pytest.raises(
            InputError, match="'walk' ends after 7 of the 9 frames that its brightness track has"
        ):
            buffer.frame(8)


def test_it_is_ready_with_the_seconds_asked_for_and_not_before() -> None:
    """At 25 Hz the first 11 frames, and not the first 10, reach over 0.4 s."""
    video = Video(1000)
    video.held_at = 10
    with FrameBuffer(video, 1000) as buffer:
        assert not buffer.ready(0.4, patience=0.05)
        assert video.decoded == 10
        video.go_on.set()
        assert buffer.ready(0.4)
        assert video.decoded >= 11


def test_the_thread_ends_in_the_midst_of_a_long_video() -> None:
    video = Video(10**9)
    buffer = FrameBuffer(video, 10**9, capacity=5 * BYTES)
    buffer.frame(2)
    assert threads() == 1
    buffer.close()
    assert video.closed


def test_what_is_closed_lets_go_of_its_frames() -> None:
    buffer = FrameBuffer(Video(20), 20)
    levels = weakref.ref(buffer.frame(0).levels)
    assert levels() is not None
    buffer.close()
    assert levels() is None


# --- coarser frames

GAMMA = 2.2


def one(pixels: np.ndarray, shape: tuple[int, int], gamma: float = GAMMA) -> np.ndarray:
    (small,) = coarser([Frame(0.0, 0.04, pixels)], shape, gamma)
    assert small.pixel_values.shape == (*shape, 3)
    return small.pixel_values


def test_a_fine_checkerboard_gives_half_the_light_and_not_half_the_pixel_value() -> None:
    board = (np.indices((8, 12)).sum(axis=0) % 2 * 255).astype(np.uint8)
    np.testing.assert_allclose(one(np.dstack([board] * 3), (4, 6)), 0.5 ** (1 / GAMMA), rtol=1e-6)


def test_whole_factors_are_means_of_blocks() -> None:
    pixels = np.random.default_rng(1).random((6, 8, 3))
    blocks = pixels.reshape(3, 2, 2, 4, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(one(pixels, (3, 2), gamma=1.0), blocks, atol=1e-6)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_integers_are_shares_of_their_range(kind: type) -> None:
    full = np.full((4, 4, 3), np.iinfo(kind).max, kind)
    np.testing.assert_array_equal(one(full, (3, 2)), 1.0)


@given(many=st.integers(1, 60), data=st.data())
def test_every_pixel_counts_alike_and_every_cell_is_a_mean(many: int, data: st.DataObject) -> None:
    few = data.draw(st.integers(1, many))
    weights = area_weights(many, few).toarray()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-5)
    np.testing.assert_allclose(weights.sum(axis=0), few / many, atol=1e-5)
    assert (weights >= 0).all()


@given(shape=st.tuples(st.integers(1, 9), st.integers(1, 11)), seed=st.integers(0, 99))
def test_the_mean_light_of_a_frame_stays(shape: tuple[int, int], seed: int) -> None:
    pixels = np.random.default_rng(seed).random((9, 11, 3)).astype(np.float32)
    light = (one(pixels, shape).astype(np.float64) ** GAMMA).mean()
    assert light == pytest.approx((pixels.astype(np.float64) ** GAMMA).mean(), rel=1e-4)


def test_more_pixels_than_there_are_is_refused() -> None:
    with pytest.raises(ValueError, match="need 1 to 4 pixels in place of 4, got 5"):
        area_weights(4, 5)


# --- video source


@pytest.fixture
def film(tmp_path: Path, make_video: Callable[..., Any]) -> str:
    path = tmp_path / "a.mkv"
    make_video(path, np.linspace(0.2, 0.8, 4), (32, 24), 2.0)
    return str(path)


def test_a_frame_rate_goes_to_the_clips_that_tell_none(film: str) -> None:
    first, second = open_videos([film, "sunrise"], 0.1)
    assert first.sha256() == open_video(film).sha256()
    assert second.n_frames == open_video("sunrise", 0.1).n_frames
    assert second.n_frames != open_video("sunrise").n_frames


def test_a_frame_rate_that_no_clip_takes_is_refused(film: str) -> None:
    with pytest.raises(InputError, match="has its own frame rate"):
        open_videos([film, film], 0.1)
