"""Searches on a window and without one: time, keys, looking around, and what is drawn.

The window is a framebuffer whose flips go with a clock; the scene is a pattern in the real one's stead.
"""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drawn_codes import image_codes

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator, Dither, Rig
from evenlight.experiments.sessions import search_stage
from evenlight.experiments.sessions.staging import BlindStage
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import PausePressed, SearchResult, SearchView
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock, refresh_after
from evenlight.hardware.simulated.panel import SimulatedBacklight
from evenlight.stimuli.dithering import thresholds_of
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.ring_scene import RingScene
from evenlight.stimuli.scenes.engine.camera import Camera, focal_length_of
from evenlight.stimuli.scenes.engine.graphics import offscreen_context

SIZE = (96, 72)
LAB = Display("lab", 100.0, 0.1, 2.0, pixels_per_degree=12.0)
RIG = Rig("lab", "lab.display.toml", viewing_distance=0.6, refresh_rate=50.0)
VIEW = SearchView(
    scene="pattern",
    camera=Camera((1.0, 2.0, 1.65), azimuth=355.0, altitude=-5.0),
    ring=Ring(azimuth=357.0, altitude=-4.0, gap=15.0, contrast=-0.4, orientation=90),
    factor=0.5,
    time_limit=3.0,
    field_of_view=15.0,
    noise_seed=77,
)


class Pattern:
    """A scene whose brightness goes with the direction of view; notes the cameras it was drawn for."""

    made = 0
    cameras: list[Camera]

    def __init__(self, context, scene: object, size: tuple[int, int], **_: object) -> None:
        type(self).made += 1
        self.size, type(self).cameras = size, []
        self.codes = context.texture(size, 4, dtype="u2")

    def render(self, camera: Camera) -> None:
        self.cameras.append(camera)

    def encode(self) -> None:
        codes = np.zeros((self.size[1], self.size[0], 4), np.uint16)
        codes[..., :3] = 600 + int(self.cameras[-1].altitude)
        self.codes.write(codes.tobytes())


class Window:
    """A framebuffer; its flips take as many refreshes as a list says, then one each."""

    def __init__(self, context: Any, late: dict[int, int] | None = None) -> None:
        self.clock, self.late, self.flips = RefreshClock(RIG.refresh_rate), late or {}, 0
        self.last: float | None = None
        self._context = context
        self._target = context.framebuffer(context.texture(SIZE, 4))
        self.before_flip: Callable[[], None] = lambda: None

    def size(self) -> tuple[int, int]:
        return SIZE

    def bits(self) -> int:
        return 8

    def now(self) -> float:
        return self.clock.now()

    def context(self) -> Any:
        return self._context

    def framebuffer(self) -> Any:
        return self._target

    def flip(self) -> float:
        self.before_flip()
        self.flips += 1
        self.last = self.clock.advance(self.late.get(self.flips - 1, 1))
        return self.last

    def due(self, period: float) -> float:
        return refresh_after(self.last, self.now(), period)

    def eyes(self) -> None:
        return None

    def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
        data = np.frombuffer(self._target.read(components=3), np.uint8)
        return data.reshape(SIZE[1], SIZE[0], 3)[::-1].astype(np.int64)

    def apparatus(self) -> dict[str, str]:
        return {}

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def context() -> Iterator[Any]:
    context = offscreen_context()
    yield context
    context.release()


@pytest.fixture(autouse=True)
def pattern(monkeypatch) -> None:
    monkeypatch.setattr(search_stage, "SceneRenderer", Pattern)
    monkeypatch.setattr(search_stage, "scene_searched", lambda name: name)
    Pattern.made = 0


def staged(window: Window, rig: Rig = RIG, **more: Any) -> tuple[WindowStage, SimulatedKeyboard]:
    keyboard = SimulatedKeyboard(window.now)
    return WindowStage(window, keyboard, rig, LAB, 20.0, **more), keyboard


def test_the_time_counts_from_the_first_flip_and_a_press_has_its_own(context) -> None:
    """The clock is at 1 s; the first flip comes 0.02 s later; pressed at 1.5137 s, between two flips."""
    window = Window(context)
    window.clock.advance(50)
    stage, keyboard = staged(window)
    keyboard.queue("space", 0.5137)
    searched = stage.search(VIEW)
    assert searched.onset == 1.02
    assert searched.found_after == pytest.approx(0.4937, abs=1e-9)
    # Found with the flip at 1.52 s, the 26th; nothing is shown after it.
    np.testing.assert_allclose(searched.flip_times, np.arange(26) / 50)
    assert searched.frames_dropped == 0


def test_what_is_not_found_ends_with_the_time_limit(context) -> None:
    """3 s at 50 Hz: the first flip, and 150 after it."""
    window = Window(context)
    searched = staged(window)[0].search(VIEW)
    assert searched.found_after is None
    assert len(searched.flip_times) == 151


@pytest.mark.parametrize(("delay", "found_after"), [(3.019, 2.999), (3.02, 3.0), (3.021, None)])
def test_a_press_counts_up_to_the_time_limit(context, delay, found_after) -> None:
    """The first flip comes 0.02 s after the keys are set."""
    stage, keyboard = staged(Window(context))
    keyboard.queue("space", delay)
    assert stage.search(VIEW).found_after == found_after


def test_a_press_before_the_scene_is_there_finds_nothing(context) -> None:
    window = Window(context)
    stage, keyboard = staged(window)
    keyboard.queue("space", 0.01)
    assert stage.search(dataclasses.replace(VIEW, time_limit=0.2)).found_after is None


def test_the_pause_key_stops_it_and_the_mouse_is_let_go(context) -> None:
    window = Window(context)
    closed = []
    pointer = SimpleNamespace(moved=lambda: (0.0, 0.0), close=lambda: closed.append(True))
    stage, keyboard = staged(window, open_pointer=lambda: pointer)
    keyboard.queue("escape", 0.3)
    with pytest.raises(PausePressed):
        stage.search(VIEW)
    assert window.now() == pytest.approx(0.3)
    assert closed == [True]


def test_refreshes_without_a_new_frame_are_counted_and_the_search_is_no_longer(context) -> None:
    """Flip 10 comes 4 refreshes after the one before, flip 40 comes 3: 3 + 2 dropped."""
    window = Window(context, late={10: 4, 40: 3})
    searched = staged(window)[0].search(VIEW)
    assert searched.frames_dropped == 5
    assert searched.flip_times[-1] == pytest.approx(3.0)


def test_keys_turn_by_ten_degrees_in_a_quarter_of_a_second_each_within_the_field_of_view(context) -> None:
    window = Window(context)
    stage, keyboard = staged(window)
    keyboard.queue("left", 0.1)
    keyboard.queue("up", 1.0)
    for delay in (2.0, 2.1):
        keyboard.queue("left", delay)
    searched = stage.search(VIEW)
    times = np.array(searched.flip_times) + searched.onset
    azimuths, altitudes = np.array(searched.azimuths), np.array(searched.altitudes)
    np.testing.assert_allclose(azimuths[times < 0.1], 0.0)
    # Half of the turn is done after half of its time, 0.225 s; both flips beside it are 0.005 and 0.015 off.
    beside = np.interp(0.225, times, azimuths)
    assert beside == pytest.approx(-5.0, abs=0.05)
    np.testing.assert_allclose(azimuths[(times > 0.35) & (times < 2.0)], -10.0)
    np.testing.assert_allclose(azimuths[times > 2.35], -15.0)
    np.testing.assert_allclose(altitudes[times < 1.0], -5.0)
    np.testing.assert_allclose(altitudes[times > 1.25], 5.0)
    # The cameras that drew it looked there; the first picture is for the luminance around the ring.
    drawn = [camera.azimuth - 355.0 for camera in Pattern.cameras[1:]]
    np.testing.assert_allclose(sorted(set(drawn)), np.unique(azimuths))
    assert {camera.focal_length for camera in Pattern.cameras[1:]} == {focal_length_of(LAB)}


def test_the_mouse_turns_by_a_pixels_angle_for_each_pixel(context) -> None:
    window = Window(context)
    moves = [(window.now() + 0.5, (24.0, -36.0)), (window.now() + 1.0, (600.0, 0.0)), (np.inf, (0.0, 0.0))]
    pointer = SimpleNamespace(
        moved=lambda: moves.pop(0)[1] if moves[0][0] <= window.now() else (0.0, 0.0), close=bool
    )
    searched = staged(window, open_pointer=lambda: pointer)[0].search(VIEW)
    times = np.array(searched.flip_times) + searched.onset
    between = (times > 0.53) & (times < 0.99)
    assert set(np.array(searched.azimuths)[between]) == {2.0}
    assert set(np.array(searched.altitudes)[between]) == {-8.0}
    assert searched.azimuths[-1] == 15.0


def test_a_scene_is_drawn_anew_only_where_the_view_has_turned(context) -> None:
    window = Window(context)
    stage, _ = staged(window)
    stage.prepare_scene("pattern")
    stage.search(VIEW)
    assert len(Pattern.cameras) == 2  # around the ring, and the view that stays
    stage.search(VIEW)
    assert Pattern.made == 1


def test_the_window_shows_the_dimmed_scene_with_the_ring_to_the_code(context) -> None:
    """Every pixel of the 4th refresh: numpy's codes for the scene's pixel values, b = 0.5, seed 77."""
    window = Window(context)
    seen: list[np.ndarray] = []
    window.before_flip = lambda: seen.append(window.read_codes())
    staged(window)[0].search(dataclasses.replace(VIEW, time_limit=0.1))
    scene = RingScene(context, Pattern(context, "pattern", SIZE), LAB)
    painted = scene.paint(VIEW.ring, VIEW.camera.position)
    scene.draw(dataclasses.replace(VIEW.camera, focal_length=focal_length_of(LAB)), painted)
    thresholds = thresholds_of(Dither.NOISY_BIT, SIZE[::-1], 3, 77)
    expected = image_codes(scene.pixel_values(), 0.5, thresholds, LAB, 8)
    assert len(np.unique(scene.pixel_values())) > 2  # the ring is in it
    np.testing.assert_array_equal(seen[3], expected)


def test_where_the_backlight_makes_the_brightness_it_has_the_factor_before_the_scene_appears(context) -> None:
    window = Window(context)
    backlight = SimulatedBacklight(window.now, time_constant=0.03)  # 0.15 s until it is as near as 0.01
    rig = dataclasses.replace(RIG, actuator=Actuator.BACKLIGHT, backlight="simulated")
    searched = staged(window, rig, backlight=backlight)[0].search(dataclasses.replace(VIEW, time_limit=0.2))
    assert len(searched.backlight_factors) == len(searched.flip_times)
    np.testing.assert_allclose(searched.backlight_factors, 0.5, atol=0.01)


def test_the_background_is_what_the_display_emits_around_the_ring(context) -> None:
    """Codes of 596 of 1023 around a ring at an altitude of -4 degrees, gamma 2."""
    searched = staged(Window(context))[0].search(dataclasses.replace(VIEW, time_limit=0.1))
    wanted = (596 / 1023) ** 2 * (100.0 - 0.1) + 0.1
    assert searched.background_luminance == pytest.approx(wanted, rel=1e-4)


def test_a_ring_too_fine_for_the_display_and_an_unknown_scene_are_refused(context, monkeypatch) -> None:
    stage, _ = staged(Window(context))
    fine = dataclasses.replace(VIEW, ring=dataclasses.replace(VIEW.ring, gap=9.0))
    with pytest.raises(InputError, match=r"1\.80 pixels on the display 'lab'.*give 10 arcmin or more"):
        stage.search(fine)
    monkeypatch.undo()
    with pytest.raises(InputError, match="no scene 'attic'"):
        stage.prepare_scene("attic")


class Painter:
    """Says what is around a ring without drawing it."""

    def picture(self, scene: str, position: object, ring: Ring) -> object:
        return SimpleNamespace(background_luminance=12.5)


def blindly(press: tuple[str, float] | None) -> SearchResult:
    clock = RefreshClock(RIG.refresh_rate)
    keyboard = SimulatedKeyboard(clock.now)
    if press:
        keyboard.queue(*press)
    with BlindStage(RIG, clock, keyboard, lambda: nullcontext(Painter())) as stage:
        stage.prepare_scene("pattern")
        return stage.search(VIEW)


@pytest.mark.parametrize("press", [("space", 0.5137), ("left", 0.2), None])
def test_without_a_window_a_search_is_the_same_but_for_the_picture(context, press) -> None:
    window = Window(context)
    stage, keyboard = staged(window)
    if press:
        keyboard.queue(*press)
    seen = stage.search(VIEW)
    blind = blindly(press)
    assert dataclasses.replace(blind, background_luminance=seen.background_luminance) == seen
    assert blind.background_luminance == 12.5


def test_without_a_window_the_pause_key_stops_it_too() -> None:
    with pytest.raises(PausePressed):
        blindly(("escape", 0.5))
