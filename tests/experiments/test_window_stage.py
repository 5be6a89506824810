"""The stages, on a window that draws nothing: timing, keys, labels and the backlight."""

import dataclasses
import math
from collections.abc import Callable

import clip_windows
import numpy as np
import pytest
from clip_windows import LAB, RIG, Renderer, staged

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.sessions import window_stage
from evenlight.experiments.sessions.staging import BlindStage
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import PausePressed, RampInterval
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.hardware.simulated.panel import SimulatedBacklight

FALL = RampInterval(80.0, 70.0, 1.0, adaptation=1.0, duration=5.0, hold=1.0, noise_seed=9)


class Window(clip_windows.Window):
    """The same, for fields: larger, with something that may be done before each flip."""

    before_flip: Callable[[], None] = staticmethod(lambda: None)

    def size(self) -> tuple[int, int]:
        return 400, 300

    def flip(self) -> float:
        self.before_flip()
        return super().flip()

    def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
        """Return the ground, rounded to a code, in every pixel."""
        ground = Renderer.drawn[-1][0].luminance
        width, height = (min(a, b) for a, b in zip(size or self.size(), self.size(), strict=True))
        return np.full((height, width, 3), round(255 * math.sqrt(ground / 100)))


@pytest.fixture(autouse=True)
def no_graphics(monkeypatch) -> None:
    monkeypatch.setattr(window_stage, "field_renderer", Renderer)


def test_an_interval_is_7_s_of_frames_that_follow_the_ramp() -> None:
    stage, _ = staged(Window())
    shown = stage.show_ramp(FALL)
    times = np.arange(350) / 50
    np.testing.assert_allclose(shown.flip_times, times, atol=1e-9)
    np.testing.assert_allclose(shown.intended_luminance, np.interp(times, [1, 6], [80, 70]), atol=1e-6)
    drawn = [field.luminance for field, _, _ in Renderer.drawn]
    np.testing.assert_allclose(drawn, shown.intended_luminance, atol=1e-6)
    assert [frame for _, frame, _ in Renderer.drawn] == list(range(350))
    assert {seed for _, _, seed in Renderer.drawn} == {9}
    assert shown.frames_dropped == 0


def test_the_onset_is_the_first_flip() -> None:
    window = Window()
    window.clock.advance(100)
    stage, _ = staged(window)
    assert stage.show_ramp(FALL).onset == 101 / 50


def test_a_session_later_by_any_time_shows_the_same_to_the_last_digit() -> None:
    """A resumed session has other times since it began, and the same ramps."""
    late = Window()
    late.clock.advance(12347)
    first = staged(Window())[0].show_ramp(FALL)
    assert dataclasses.replace(staged(late)[0].show_ramp(FALL), onset=first.onset) == first


def test_after_a_dropped_frame_the_ramp_is_where_its_time_is() -> None:
    """Flip 100 comes 3 refreshes after the one before: 2 dropped, 2 frames fewer, same end."""
    stage, _ = staged(Window(late={100: 3, 200: 2}))
    shown = stage.show_ramp(FALL)
    assert shown.frames_dropped == 3
    assert len(shown.flip_times) == 350 - 3
    times = np.array(shown.flip_times)
    assert times[100] - times[99] == pytest.approx(3 / 50)
    # The two late frames were drawn for the refresh that they missed; all others for their own.
    on_time = np.ones(len(times), dtype=bool)
    on_time[[100, 200]] = False
    expected = np.interp(times, [1, 6], [80, 70])
    np.testing.assert_allclose(np.array(shown.intended_luminance)[on_time], expected[on_time], atol=1e-9)
    assert times[-1] == pytest.approx(349 / 50)


def test_frames_are_read_back_from_the_first_to_the_last() -> None:
    """The window rounds to codes; steps near 80 cd/m^2 are 0.70 wide."""
    stage, _ = staged(Window())
    shown = stage.show_ramp(FALL)
    assert len(shown.probe_frames) == 12
    assert (shown.probe_frames[0], shown.probe_frames[-1]) == (0, 349)
    intended = np.array(shown.intended_luminance)[list(shown.probe_frames)]
    assert 0 < np.abs(np.array(shown.probe_luminance) - intended).max() <= 0.36


def test_the_intervals_number_is_gone_before_the_ramp_begins() -> None:
    """1 s of adaptation at 50 Hz, without the last 0.3 s: 35 frames."""
    stage, _ = staged(Window())
    stage.show_ramp(dataclasses.replace(FALL, label="2"))
    labelled = [field.coverage is not None for field, _, _ in Renderer.drawn]
    assert labelled == [True] * 35 + [False] * 315
    coverage = Renderer.drawn[0][0].coverage
    assert coverage is not None
    rows, columns = np.nonzero(coverage)
    assert abs(rows.mean() - 150) < 10
    assert abs(columns.mean() - 200) < 10


def test_the_time_of_an_answer_counts_from_the_flip_that_showed_the_question() -> None:
    stage, keyboard = staged(Window())
    keyboard.queue("y", 0.73)  # the question appears with the next flip, 0.02 s from now
    press = stage.ask("Did it change?", ["y", "n"], 70.0)
    assert (press.name, press.time) == ("y", pytest.approx(0.71))
    assert Renderer.drawn[-1][0].luminance == 70.0


def test_keys_pressed_before_the_question_and_other_keys_are_no_answers() -> None:
    stage, keyboard = staged(Window())
    keyboard.queue("y", 3.0)
    stage.show_ramp(FALL)
    keyboard.queue("q", 0.2)
    keyboard.queue("n", 0.4)
    assert stage.ask("Did it change?", ["y", "n"], 70.0).name == "n"


@pytest.mark.parametrize("show", ["ramp", "ask", "wait"])
def test_the_pause_key_ends_what_is_shown_within_a_frame(show: str) -> None:
    window = Window()
    stage, keyboard = staged(window)
    keyboard.queue("escape", 0.5)
    shows = {
        "ramp": lambda: stage.show_ramp(FALL),
        "ask": lambda: stage.ask("Did it change?", ["y"], 70.0),
        "wait": lambda: stage.wait(2.0, 20.0),
    }
    with pytest.raises(PausePressed):
        shows[show]()
    assert 0.5 <= window.now() <= 0.52 + 1e-9


def test_a_pause_between_two_screens_is_not_lost() -> None:
    window = Window()
    stage, keyboard = staged(window)
    keyboard.queue("escape", 0.01)
    window.clock.advance()
    with pytest.raises(PausePressed):
        stage.ask("Did it change?", ["y"], 70.0)


def test_a_page_waits_for_its_keys_on_its_own_ground() -> None:
    stage, keyboard = staged(Window())
    for name, delay in (("x", 0.1), ("space", 0.3)):
        keyboard.queue(name, delay)
    assert stage.show_page("# Welcome", ["space"], "Space: go on").name == "space"
    assert {field.luminance for field, _, _ in Renderer.drawn} == {20.0}


def test_a_wait_is_as_long_as_it_says() -> None:
    window = Window()
    stage, _ = staged(window)
    stage.wait(0.5, 20.0)
    assert window.now() == pytest.approx(0.02 + 0.5)  # from the first flip that shows the field
    stage.wait(0.0, 20.0)
    assert window.now() == pytest.approx(0.02 + 0.5)


def test_pages_brighter_than_the_display_are_refused() -> None:
    window = Window()
    with pytest.raises(InputError, match="'lab'"):
        WindowStage(window, SimulatedKeyboard(window.now), RIG, LAB, 101.0)


BY_BACKLIGHT = dataclasses.replace(RIG, actuator=Actuator.BACKLIGHT, backlight="simulated")


class Lamp(SimulatedBacklight):
    """A simulated backlight that notes when it was set, and to what."""

    def __init__(self, clock: Callable[[], float], min_interval: float = 0.01) -> None:
        super().__init__(clock, steps=1000, time_constant=0.002, min_interval=min_interval)
        self.settings: list[tuple[float, float]] = []
        self.time = clock

    def set_factor(self, factor: float) -> float:
        self.settings.append((self.time(), factor))
        return super().set_factor(factor)


def test_with_the_backlight_pixels_stay_and_factors_follow_the_ramp() -> None:
    window = Window()
    lamp = Lamp(window.now)
    stage, _ = staged(window, BY_BACKLIGHT, lamp)
    half = dataclasses.replace(FALL, pixel_value=0.8, initial_luminance=40.0, final_luminance=32.0)
    shown = stage.show_ramp(half)
    drawn = [field.luminance for field, _, _ in Renderer.drawn]
    np.testing.assert_allclose(drawn, 64.0)  # 0.8^2 of 100
    factors = np.array(shown.backlight_factors)
    intended = np.array(shown.intended_luminance)
    # To half a step of 1/1000 of 64 cd/m^2, and what a lag of 2 ms leaves after 20 ms: nothing.
    assert np.abs(factors * 64.0 - intended).max() < 0.033
    assert np.abs(np.array(shown.probe_luminance) - intended[list(shown.probe_frames)]).max() < 0.25
    assert len(factors) == 350


def test_a_slow_backlight_is_set_no_more_often_than_it_takes() -> None:
    window = Window()
    lamp = Lamp(window.now, min_interval=0.05)
    stage, _ = staged(window, BY_BACKLIGHT, lamp)
    stage.show_ramp(FALL)
    times = np.array([time for time, _ in lamp.settings[1:]])
    assert len(times) > 80  # 5 s by 0.06 s, the next multiple of a refresh
    assert np.diff(times).min() >= 0.05 - 1e-9


def test_between_screens_the_backlight_never_meets_brighter_pixels() -> None:
    """From a field by pixels at full backlight to a white one at b = 0.2, and back: no flash above either."""
    window = Window()
    lamp = Lamp(window.now)
    stage, keyboard = staged(window, BY_BACKLIGHT, lamp)
    seen: list[float] = []
    on_screen = [20.0]

    def note() -> None:
        seen.append(on_screen[0] * lamp.read_factor())
        on_screen[0] = Renderer.drawn[-1][0].luminance
        seen.append(on_screen[0] * lamp.read_factor())  # at the flip, when the pixels change

    window.before_flip = note
    for _ in range(2):
        stage.wait(0.2, 20.0)
        stage.show_ramp(dataclasses.replace(FALL, initial_luminance=20.0, final_luminance=19.0))
        keyboard.queue("y", 0.3)
        stage.ask("Did it change?", ["y"], 19.0)
    assert max(seen) <= 20.0 + 0.1 + 1e-9  # a step, which counts as reached


def test_a_ramp_begins_when_the_backlight_has_its_first_luminance() -> None:
    window = Window()
    stage, _ = staged(window, BY_BACKLIGHT, Lamp(window.now))
    stage.wait(0.2, 20.0)
    shown = stage.show_ramp(dataclasses.replace(FALL, initial_luminance=30.0, final_luminance=29.0))
    assert shown.backlight_factors[0] == pytest.approx(0.3, abs=0.001)


def test_where_pixels_make_the_brightness_a_backlight_stays_full() -> None:
    window = Window()
    rig = dataclasses.replace(RIG, backlight="simulated")
    lamp = Lamp(window.now)
    lamp.set_factor(0.4)
    stage, _ = staged(window, rig, lamp)
    shown = stage.show_ramp(FALL)
    assert lamp.read_factor() == pytest.approx(1.0)
    assert shown.backlight_factors == ()


def test_without_a_window_the_same_frames_are_counted() -> None:
    clock = RefreshClock(50.0)
    keyboard = SimulatedKeyboard(clock.now)
    blind = BlindStage(RIG, clock, keyboard)
    window = Window()
    stage, seen_keyboard = staged(window)
    for keys in (keyboard, seen_keyboard):
        keys.queue("space", 0.25)
    assert blind.show_page("A page", ["space"]) == stage.show_page("A page", ["space"])
    blind.wait(0.5, 20.0)
    stage.wait(0.5, 20.0)
    assert blind.now() == pytest.approx(stage.now())
    shown, counted = stage.show_ramp(FALL), blind.show_ramp(FALL)
    assert counted == dataclasses.replace(shown, probe_frames=(), probe_luminance=())
    for keys in (keyboard, seen_keyboard):
        keys.queue("n", 0.9)
    assert blind.ask("Changed?", ["y", "n"], 70.0) == stage.ask("Changed?", ["y", "n"], 70.0)


def test_without_a_window_the_pause_key_works_and_silence_is_an_error() -> None:
    clock = RefreshClock(50.0)
    keyboard = SimulatedKeyboard(clock.now)
    blind = BlindStage(RIG, clock, keyboard)
    keyboard.queue("escape", 2.0)
    with pytest.raises(PausePressed):
        blind.show_ramp(FALL)
    assert clock.now() == pytest.approx(2.0)
    with pytest.raises(RuntimeError, match="no one answers 'Changed"):
        blind.ask("Changed?", ["y"], 70.0)


def test_pictures_are_taken_once_of_each_kind_of_screen_and_that_of_a_ramp_within_it(tmp_path) -> None:
    """The ramp begins after 1 s at 50 Hz: 50 frames after the first of its interval."""
    drawn: list[int] = []

    class Pictured(Window):
        def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
            drawn.extend([len(Renderer.drawn)] if size is None else [])
            return super().read_codes(size)

    window = Pictured()
    keyboard = SimulatedKeyboard(window.now)
    stage = WindowStage(window, keyboard, RIG, LAB, 20.0, screenshots=tmp_path / "shots")
    keyboard.queue("space", 0.3)
    stage.show_page("# Welcome to it\n\nText", ["space"])
    stage.show_ramp(FALL)
    keyboard.queue("y", 0.3)
    stage.ask("Did it change?", ["y"], 70.0)
    names = {path.name for path in (tmp_path / "shots").iterdir()}
    assert names == {"page-welcome-to-it.png", "field.png", "ramp.png", "question-did-it-change.png"}
    assert drawn[2] - drawn[1] == 50
