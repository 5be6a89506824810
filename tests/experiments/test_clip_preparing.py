"""How a clip is read before it is shown: what is waited for, what is kept, and what is let go."""

import dataclasses
from collections.abc import Callable, Iterator
from time import perf_counter, sleep

import numpy as np
import pytest
from clip_windows import Renderer, Video, Window, clip_of, played, readers, staged

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.experiments.playback import clip_player
from evenlight.experiments.sessions import window_stage
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import PausePressed
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.image_renderer import DimmedImage

TIMES = np.arange(50) / 25
FEW = np.arange(10) / 25  # 0.4 s, all of which are decoded before the first is shown


@pytest.fixture(autouse=True)
def no_graphics(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(window_stage, "field_renderer", Renderer)
    monkeypatch.setattr(clip_player, "image_renderer", Renderer)
    yield
    assert readers() == 0


class WindowInTime(Window):
    """A window whose flips wait for the refreshes of a display of 50 Hz."""

    def __init__(self) -> None:
        super().__init__()
        self.times: list[float] = []

    def now(self) -> float:
        return perf_counter()

    def flip(self) -> float:
        sleep(0.02 - self.now() % 0.02)
        self.times.append(self.now())
        self.last = self.times[-1]
        return self.last


class SlowVideo(Video):
    """A video that takes its time to decode a frame [s]."""

    def __init__(self, times: np.ndarray, seconds: float) -> None:
        super().__init__(times)
        self.seconds, self.decoded = seconds, 0

    def frames(self) -> Iterator[Frame]:
        for frame in super().frames():
            sleep(self.seconds)
            self.decoded += 1
            yield frame


def until(happened: Callable[[], bool]) -> None:
    """Wait for something that takes a moment."""
    end = perf_counter() + 200
    while not happened() and perf_counter() < end:
        sleep(0.001)
    assert happened()


@pytest.mark.real_time
def test_until_a_clip_can_begin_the_field_goes_on_and_the_wait_is_in_the_record() -> None:
    """10 frames of 0.03 s each: 0.3 s, in which a display of 50 Hz has 15 refreshes."""
    window, video = WindowInTime(), SlowVideo(FEW, 0.03)
    stage, _ = staged(window)
    stage.wait(0.1, 33.0)
    Renderer.drawn.clear()
    begun = window.now()
    shown = stage.play(clip_of(FEW, video))
    fields = [field.luminance for field, _, _ in Renderer.drawn if isinstance(field, Field)]
    assert set(fields) == {33.0}
    assert [type(drawn) for drawn, _, _ in Renderer.drawn[: len(fields)]] == [Field] * len(fields)
    assert 0.3 <= shown.waited <= shown.onset - begun
    assert shown.onset - window.times[0] - shown.waited < max(0.2, np.diff(window.times).max())
    assert len(fields) >= 3  # of 15, on a machine that is busy
    assert len(window.times) >= len(fields) + len(shown.flip_times)


def test_a_long_clip_begins_when_two_seconds_of_it_are_there(monkeypatch) -> None:
    """2 s at 25 Hz are 51 frames, from the first to the last; all 500 would take 3 s."""
    times = np.arange(500) / 25
    video, window = SlowVideo(times, 0.006), WindowInTime()
    stage, keyboard = staged(window)
    decoded: list[int] = []

    def upload(_: Renderer, levels: np.ndarray, count: int) -> np.ndarray:
        decoded.append(video.decoded)
        keyboard.queue("escape", delay=0.001)
        return levels

    monkeypatch.setattr(Renderer, "upload", upload)
    with pytest.raises(PausePressed):
        stage.play(clip_of(times, video))
    assert 51 <= decoded[0] < 250


def test_the_pause_key_is_taken_while_a_clip_is_waited_for() -> None:
    window, video = WindowInTime(), SlowVideo(FEW, 0.4)
    stage, keyboard = staged(window)
    keyboard.queue("escape", delay=0.1)
    begun = window.now()
    with pytest.raises(PausePressed):
        stage.play(clip_of(FEW, video))
    assert window.now() - begun < 3.0  # of 4 s that it would take
    assert not [drawn for drawn, _, _ in Renderer.drawn if isinstance(drawn, DimmedImage)]
    assert readers() == 0


def test_a_clip_prepared_in_time_is_not_waited_for_and_read_once() -> None:
    window, video = WindowInTime(), SlowVideo(FEW, 0.01)
    stage, _ = staged(window)
    clip = clip_of(FEW, video)
    stage.prepare_clip(clip)
    stage.prepare_clip(clip)
    until(lambda: readers() == 0)  # all of it is there
    shown = stage.play(dataclasses.replace(clip, factors=np.full(10, 0.4), label=""))
    assert shown.waited < 0.05  # of 0.1 s that the reading took
    assert set(shown.factors) == {0.4}
    assert video.decoded == 10


def test_on_a_clock_that_counts_refreshes_nothing_is_waited_for() -> None:
    video = SlowVideo(FEW, 0.01)
    assert played(clip_of(FEW, video)) == played(clip_of(FEW))
    assert played(clip_of(FEW, video)).waited == 0.0


def close_the_stage(stage: WindowStage, _: SimulatedKeyboard) -> None:
    stage.close()


def prepare_another(stage: WindowStage, _: SimulatedKeyboard) -> None:
    stage.prepare_clip(clip_of(FEW, Video(FEW), seconds=0.04))
    until(lambda: readers() == 0)


def play_another(stage: WindowStage, _: SimulatedKeyboard) -> None:
    stage.play(clip_of(FEW))


def press_the_pause_key(stage: WindowStage, keyboard: SimulatedKeyboard) -> None:
    keyboard.queue("escape", delay=0.02)
    with pytest.raises(PausePressed):
        stage.wait(1.0, 20.0)


@pytest.mark.parametrize("end", [close_the_stage, prepare_another, play_another, press_the_pause_key])
def test_a_clip_that_is_prepared_and_not_played_is_let_go(end: Callable[..., None]) -> None:
    stage, keyboard = staged(Window())
    stage.prepare_clip(clip_of(np.arange(10**4) / 25, SlowVideo(np.arange(10**4) / 25, 0.01)))
    assert readers() == 1
    end(stage, keyboard)
    assert readers() == 0


def test_a_video_of_another_length_is_refused_when_it_is_prepared() -> None:
    with pytest.raises(InputError, match="'walk' has 40 frames, and its brightness track 50"):
        staged(Window())[0].prepare_clip(clip_of(TIMES, Video(TIMES[:40])))
