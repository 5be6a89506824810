"""Playing clips, on a window that draws nothing: which frame each refresh shows, drops, probes, refusals."""

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest
from clip_windows import LAB, RIG, STEADY, Renderer, Video, Window, clip_of, played, readers, staged

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.playback import clip_player
from evenlight.experiments.sessions import window_stage
from evenlight.experiments.sessions.staging import BlindStage
from evenlight.experiments.stage import Clip, PausePressed
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.hardware.simulated.panel import SimulatedBacklight
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.image_renderer import DimmedImage


@pytest.fixture(autouse=True)
def no_graphics(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(window_stage, "field_renderer", Renderer)
    monkeypatch.setattr(clip_player, "image_renderer", Renderer)
    yield
    assert readers() == 0


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
    assert kinds == [Field] * 40 + [DimmedImage] * 100  # 0.8 s at 50 Hz
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
    pictures = [drawn for drawn, _, _ in Renderer.drawn if isinstance(drawn, DimmedImage)]
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
