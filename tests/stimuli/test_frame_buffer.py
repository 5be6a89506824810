"""Frames decoded ahead: in order, within the memory, and with the reader's errors told where they matter."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.stimuli.video.frame_buffer import FrameBuffer

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
