"""Playing clips, on a window that draws nothing: which frame each refresh shows, drops, probes, refusals."""

import dataclasses
import threading
from collections.abc import Callable, Iterator
from time import perf_counter, sleep
from typing import Any

import numpy as np
import pytest

from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.frame import Frame
from data_schema.rig import Actuator, Rig
from experiments import clip_player, window_stage
from experiments.blind_stage import BlindStage
from experiments.stage import Clip, PausePressed, ShownClip
from experiments.window_stage import WindowStage
from hardware.backlights import SimulatedBacklight
from hardware.clocks import RefreshClock
from hardware.simulated_keyboard import SimulatedKeyboard
from method.luminance import emitted_luminance
from stimuli.dithering import thresholds_of
from stimuli.field_renderer import Field
from stimuli.image_codes import image_codes
from stimuli.image_renderer import Picture

LAB = Display("lab", 100.0, 0.0, 2.0, pixels_per_degree=60.0)
RIG = Rig("lab", "lab.display.toml", viewing_distance=0.6, refresh_rate=50.0)
SIZE = (64, 48)


class Video:
    """Noise on gray, brighter from frame to frame."""

    name = "walk"

    def __init__(self, times: np.ndarray, size: tuple[int, int] = SIZE, fails_at: int | None = None) -> None:
        self.times, self.size, self.fails_at = times, size, fails_at
        self.n_frames: int | None = len(times)

    def pixels(self, k: int) -> np.ndarray:
        rng = np.random.default_rng(k)
        return (rng.integers(0, 40, (self.size[1], self.size[0], 3)) + 100 + k).astype(np.uint8)

    def frames(self) -> Iterator[Frame]:
        for k, time in enumerate(self.times):
            if k == self.fails_at:
                raise InputError(f"walk.mkv is damaged at frame {k}")
            yield Frame(float(time), 0.04, self.pixels(k))

    def sha256(self) -> str:
        return ""


def clip_of(times: Any, video: Video | None = None, **changes: Any) -> Clip:
    """A clip of frames that get darker; the last one lasts 0.04 s."""
    times = np.asarray(times, dtype=float)
    plain = {
        "video": video or Video(times),
        "times": times,
        "duration": float(times[-1]) + 0.04,
        "factors": np.linspace(1.0, 0.5, len(times)),
        "noise_seed": 9,
    }
    return Clip(**(plain | changes))


STEADY = clip_of(np.arange(50) / 25)  # 2 s


class Renderer:
    """Notes pictures and fields instead of drawing them."""

    drawn: list[Any]

    def __init__(self, *_: object) -> None:
        type(self).drawn = []

    def upload(self, levels: np.ndarray, count: int) -> np.ndarray:
        assert count == 256
        return levels

    def draw(self, framebuffer: object, shown: Any, frame: int = 0, seed: int = 0) -> None:
        Renderer.drawn.append((shown, frame, seed))


class Window:
    """A window whose flips take as many refreshes as a list says, then one each."""

    def __init__(self, late: dict[int, int] | None = None, dims: bool = True) -> None:
        self.clock, self.flips, self.late, self.dims = RefreshClock(50.0), 0, late or {}, dims

    def size(self) -> tuple[int, int]:
        return 401, 300

    def bits(self) -> int:
        return 8

    def now(self) -> float:
        return self.clock.now()

    def context(self) -> None:
        return None

    def framebuffer(self) -> None:
        return None

    def flip(self) -> float:
        self.flips += 1
        return self.clock.advance(self.late.get(self.flips - 1, 1))

    def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
        """Return the codes of the image, which the part that is read back is as large as."""
        assert size == SIZE
        picture, frame, seed = Renderer.drawn[-1]
        factor = picture.factor if self.dims else 1.0
        thresholds = thresholds_of(RIG.dither, SIZE[::-1], frame, seed)
        return image_codes(picture.image, factor, thresholds, LAB, 8)

    def apparatus(self) -> dict[str, str]:
        return {"window": "none"}

    def close(self) -> None:
        pass


@pytest.fixture(autouse=True)
def no_graphics(monkeypatch) -> Iterator[None]:
    monkeypatch.setattr(window_stage, "FieldRenderer", Renderer)
    monkeypatch.setattr(clip_player, "ImageRenderer", Renderer)
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
        return self.times[-1]


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


def readers() -> int:
    return sum(thread.name == "frames of walk" for thread in threading.enumerate())


def until(happened: Callable[[], bool]) -> None:
    """Wait for something that takes a moment."""
    end = perf_counter() + 10
    while not happened() and perf_counter() < end:
        sleep(0.001)
    assert happened()


def staged(window: Window, rig: Rig = RIG, backlight: SimulatedBacklight | None = None):
    keyboard = SimulatedKeyboard(window.now)
    return WindowStage(window, keyboard, rig, LAB, 20.0, backlight), keyboard


def played(clip: Clip, window: Window | None = None) -> ShownClip:
    return staged(window or Window())[0].play(clip)


def test_a_frame_of_25_hz_is_shown_for_two_refreshes_of_50_hz() -> None:
    shown = played(STEADY)
    assert shown.video_frames == tuple(np.repeat(np.arange(50), 2))
    np.testing.assert_allclose(shown.flip_times, np.arange(100) / 50, atol=1e-9)
    np.testing.assert_allclose(shown.factors, np.repeat(np.linspace(1, 0.5, 50), 2))
    assert shown.frames_dropped == 0
    pictures = [(picture.factor, frame, seed) for picture, frame, seed in Renderer.drawn]
    assert pictures == [(factor, refresh, 9) for refresh, factor in enumerate(shown.factors)]
    video = Video(STEADY.times)
    assert all(
        (picture.image == video.pixels(k)).all()
        for (picture, _, _), k in zip(Renderer.drawn, shown.video_frames, strict=True)
    )


def test_after_dropped_refreshes_the_clip_is_where_its_time_is() -> None:
    """Flip 10 comes 4 refreshes after the one before: 3 dropped, and refresh 14 shows frame 7, not 5."""
    shown = played(STEADY, Window(late={10: 4}))
    assert shown.frames_dropped == 3
    assert shown.video_frames[9:13] == (4, 5, 7, 7)
    assert shown.video_frames[-1] == 49
    assert shown.flip_times[-1] == pytest.approx(99 / 50)
    assert len(shown.flip_times) == 97


def test_of_a_video_faster_than_the_display_frames_are_left_out_evenly() -> None:
    """125 Hz on 50 Hz: refresh k shows frame floor(2.5 k)."""
    times = np.arange(250) / 125
    shown = played(clip_of(times, duration=2.0))
    assert shown.video_frames == tuple(int(2.5 * k) for k in range(100))


def test_frames_of_uneven_length_are_shown_for_their_time() -> None:
    shown = played(clip_of([0.0, 0.1, 0.12, 0.3]))
    assert shown.video_frames == (0,) * 5 + (1,) + (2,) * 9 + (3,) * 2


def test_an_excerpt_ends_after_its_seconds_and_reads_no_further() -> None:
    times = np.arange(50) / 25
    shown = played(clip_of(times, Video(times, fails_at=10), seconds=0.4))
    assert shown.video_frames == tuple(np.repeat(np.arange(10), 2))


def test_the_number_of_the_interval_is_shown_before_on_the_field_that_was_there() -> None:
    stage, _ = staged(Window())
    stage.wait(0.1, 33.0)
    Renderer.drawn.clear()
    shown = stage.play(dataclasses.replace(STEADY, label="2"))
    kinds = [type(drawn) for drawn, _, _ in Renderer.drawn]
    assert kinds == [Field] * 40 + [Picture] * 100  # 0.8 s at 50 Hz
    assert {(field.luminance, field.coverage.max()) for field, _, _ in Renderer.drawn[:40]} == {(33.0, 255)}
    assert len(shown.flip_times) == 100
    assert shown.onset == pytest.approx(
        0.1 + 0.8 + 2 / 50, abs=0.011
    )  # the first flip of each comes one later


def test_what_is_read_back_is_what_was_to_be() -> None:
    """64 x 48 pixels of steps below 0.79 cd/m^2: noise leaves 0.79 / 2 / sqrt(3072) = 0.007."""
    shown = played(STEADY)
    assert len(shown.probe_refreshes) == 12
    assert (shown.probe_refreshes[0], shown.probe_refreshes[-1]) == (0, 99)
    np.testing.assert_allclose(shown.probe_luminance, shown.probe_intended, atol=0.03)
    video = Video(STEADY.times)
    for refresh, intended in zip(shown.probe_refreshes, shown.probe_intended, strict=True):
        frame = shown.video_frames[refresh]
        wanted = shown.factors[refresh] * emitted_luminance(video.pixels(frame), LAB).mean()
        assert intended == pytest.approx(wanted, abs=1e-6)


def test_a_window_that_does_not_dim_is_found_out_by_the_probes() -> None:
    shown = played(STEADY, Window(dims=False))
    errors = np.array(shown.probe_luminance) - shown.probe_intended
    assert errors[0] == pytest.approx(0.0, abs=0.03)
    assert errors[-1] > 0.4 * shown.probe_luminance[-1]


def test_the_backlight_dims_and_the_pixels_do_not() -> None:
    window = Window()
    backlight = SimulatedBacklight(window.now)
    rig = dataclasses.replace(RIG, actuator=Actuator.BACKLIGHT, backlight="simulated")
    stage, _ = staged(window, rig, backlight)
    shown = stage.play(STEADY)
    pictures = [drawn for drawn, _, _ in Renderer.drawn if isinstance(drawn, Picture)]
    assert {picture.factor for picture in pictures} == {1.0}
    assert len(shown.backlight_factors) == len(shown.factors) == 100
    # It follows within what it takes for one step of the track, and its own steps of 1 / 4095.
    np.testing.assert_allclose(shown.backlight_factors, shown.factors, atol=0.03)
    np.testing.assert_allclose(shown.probe_luminance, shown.probe_intended, rtol=0.03)


def test_a_backlight_that_takes_a_setting_only_now_and_then_has_the_first_factor_before_the_clip() -> None:
    """It was set at 0 s, and takes the next setting at 0.1 s; 0.04 s later e^-8 of the way is left.

    Its own step of 1 / 4095 may take one refresh more; what never reached it would be waited for 0.25 s.
    """
    window = Window()
    backlight = SimulatedBacklight(window.now, min_interval=0.1)
    rig = dataclasses.replace(RIG, actuator=Actuator.BACKLIGHT, backlight="simulated")
    stage, _ = staged(window, rig, backlight)
    shown = stage.play(dataclasses.replace(STEADY, factors=np.full(50, 0.5)))
    np.testing.assert_allclose(shown.backlight_factors, 0.5, atol=1e-3)
    assert 0.14 <= shown.onset < 0.2


def test_the_pause_key_stops_a_clip() -> None:
    window = Window()
    stage, keyboard = staged(window)
    keyboard.queue("escape", delay=0.5)
    with pytest.raises(PausePressed):
        stage.play(STEADY)
    assert window.now() == pytest.approx(0.5, abs=0.021)


TOO_LARGE = "the video has 500x48 pixels, and the window 401x300: render it at --size 401x300, or smaller"
TIMES = np.arange(50) / 25


@pytest.mark.parametrize(
    ("clip", "says"),
    [
        (clip_of(TIMES, Video(TIMES, size=(500, 48))), TOO_LARGE),
        (clip_of(TIMES, Video(TIMES[:40])), "'walk' has 40 frames, and its brightness track 50"),
        (
            clip_of(TIMES, Video(TIMES * 1.2)),
            r"frame 1 of the video 'walk' appears at 0.0480 s.* says 0.0400 s",
        ),
        (clip_of(TIMES, Video(TIMES, fails_at=0)), "walk.mkv is damaged at frame 0"),
        (clip_of(TIMES, Video(TIMES, fails_at=30)), "walk.mkv is damaged at frame 30"),
    ],
    ids=["too large", "too short", "other rate", "unreadable", "unreadable in the midst"],
)
def test_what_cannot_be_played_is_refused_in_one_line(clip: Clip, says: str) -> None:
    with pytest.raises(InputError, match=says) as refused:
        played(clip)
    assert "\n" not in str(refused.value)


def test_a_video_that_does_not_tell_its_length_and_ends_early_is_refused() -> None:
    video = Video(TIMES[:40])
    video.n_frames = None
    with pytest.raises(InputError, match="'walk' ends after 40 of the 50 frames"):
        played(clip_of(TIMES, video))


def test_without_a_window_the_same_frames_are_counted() -> None:
    shown = played(STEADY)
    clock = RefreshClock(50.0)
    stage = BlindStage(RIG, clock, SimulatedKeyboard(clock.now))
    blind = stage.play(dataclasses.replace(STEADY, video=None))
    assert dataclasses.replace(shown, probe_refreshes=(), probe_luminance=(), probe_intended=()) == blind
    keyboard = SimulatedKeyboard(clock.now)
    keyboard.queue("escape", delay=0.1)
    with pytest.raises(PausePressed):
        BlindStage(RIG, clock, keyboard).play(STEADY)


FEW = np.arange(10) / 25  # 0.4 s, all of which are decoded before the first is shown


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
    assert shown.onset - begun - shown.waited < 0.2
    assert len(fields) >= shown.waited * 50 / 2  # all of them, but for a machine that is busy
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
    window, video = WindowInTime(), SlowVideo(FEW, 0.1)
    stage, keyboard = staged(window)
    keyboard.queue("escape", delay=0.1)
    begun = window.now()
    with pytest.raises(PausePressed):
        stage.play(clip_of(FEW, video))
    assert window.now() - begun < 0.6  # of 1 s that it would take
    assert not [drawn for drawn, _, _ in Renderer.drawn if isinstance(drawn, Picture)]
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
