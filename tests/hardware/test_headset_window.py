"""A window in a headset: when its frames appear, what it notes of them, and the rigs that open one."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from headset_frames import since
from scipy.spatial.transform import Rotation

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Eye, Rig
from evenlight.experiments.recordings import Refreshes
from evenlight.hardware import headset_facts
from evenlight.hardware import rig_windows as rigs
from evenlight.hardware.presentation import headset_window
from evenlight.hardware.presentation.headset_views import (
    EyeFov,
    EyePose,
    HeadsetFacts,
    HeadsetFrame,
    Pose,
)
from evenlight.hardware.presentation.headset_window import PANEL_SIZE, HeadsetWindow
from evenlight.hardware.protocols import InstrumentError, KeyPress
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.hardware.simulated.headset import HeadsetScript, SimulatedHeadset

RIG = Rig("lab", "lab", 1.0, 50.0, screen="simulated:openxr", full_screen=False, window_size=(64, 64))
QUARTER = math.pi / 4
FOV = EyeFov(-QUARTER, QUARTER, QUARTER, -QUARTER)
WIDE = EyeFov(-QUARTER, math.atan(2.0), QUARTER, -QUARTER)
EYE = EyePose(Pose(), FOV)
FACTS = HeadsetFacts("monado", "a headset", (900, 800), (FOV, WIDE), 50.0, (), True, 0.064)


class Framebuffer:
    viewport: Any = None
    size = (1800, 800)

    def use(self) -> None:
        pass

    def clear(self, *_: float) -> None:
        pass


class Headset(HeadsetWindow):
    """A headset whose clock and predictions are those of lists."""

    def __init__(self, predictions: list[float], period: float = 0.02) -> None:
        super().__init__()
        self._predictions, self._period = predictions, period
        self.time, self.done, self.closed = 0.0, [], False

    def facts(self) -> HeadsetFacts:
        return FACTS

    def versions(self) -> dict[str, str]:
        return {"api": "1.1"}

    def view_sizes(self) -> tuple[tuple[int, int], ...]:
        return (900, 800), (900, 800)

    def context(self) -> Any:
        raise AssertionError("nothing is drawn")

    def runtime_time(self) -> float:
        return self.time

    def begin_frame(self) -> HeadsetFrame:
        self.done.append("begin")
        if not self._predictions:
            raise InstrumentError("headset: the runtime went away")
        return HeadsetFrame(self._predictions.pop(0), self._period, (EYE, EYE), Pose(), True, True)

    def picture(self) -> Any:
        return Framebuffer()

    def end_frame(self) -> None:
        self.done.append("end")

    def focused(self) -> bool:
        return True

    def controller_presses(self) -> list[KeyPress]:
        return [KeyPress("trigger", 7.5)]

    def stick(self) -> tuple[float, float]:
        return 0.0, 0.0

    def close(self) -> None:
        self.closed = True


def opened(predictions: list[float], **begun: Any) -> Headset:
    headset = Headset(predictions)
    headset.begin(**{"eye": RIG.eye} | begun)
    return headset


class Mirror:
    def __init__(self, done: list[str], *keys: str) -> None:
        self._done, self._keys = done, keys or ("f1",)

    def take(self, framebuffer: Framebuffer, part: tuple[int, int, int, int]) -> None:
        self._done.append(f"take {part}")

    def show(self) -> None:
        self._done.append("show")

    def pressed(self) -> list[KeyPress]:
        return [KeyPress(key, 1.0) for key in self._keys]

    def held(self) -> frozenset[str]:
        return frozenset({"w"})


def test_what_is_drawn_appears_when_the_runtime_predicts_it_and_the_flip_says_so() -> None:
    window = opened([0.04, 0.06, 0.12, 0.14])
    due = []
    for _ in range(3):
        due.append(window.due(1 / 50))
        assert window.flip() == due[-1]
    assert due == [0.04, 0.06, 0.12]
    assert window.eyes().display_time == 0.14
    shown = window.shown_frames()
    assert [(frame.display_time, frame.late) for frame in shown] == [(0.04, 0), (0.06, 0), (0.12, 2)]
    assert window.shown_frames() == []


def test_a_frame_that_was_drawn_for_too_long_appears_whole_periods_after_its_prediction() -> None:
    """Predicted for 0.04 s and handed over at 0.1 s: at the refresh of 0.1 s; the next one follows it."""
    window = opened([0.04, 0.12, 0.14])
    window.time = 0.09
    assert window.due(0.02) == pytest.approx(0.10)
    assert window.flip() == pytest.approx(0.10)
    window.flip()
    assert [frame.late for frame in window.shown_frames()] == [0, 0]


def test_times_of_refreshes_are_those_of_the_predictions() -> None:
    window = opened([5.04, 5.06, 5.12, 5.14])
    refreshes, due = Refreshes(50.0), []
    for time in refreshes.due(window):
        due.append(time)
        if len(due) == 4:
            break
        refreshes.note(window.flip())
    assert due == [0.0, 0.02, 0.08, 0.1]
    assert refreshes.times() == (0.0, 0.02, 0.08)
    assert refreshes.dropped() == 2


TURNED = Rotation.from_euler("YXZ", [120, 20, -10], degrees=True)  # to the left, up, to the right shoulder
HERE = Pose((0.8, -0.45, 0.6), tuple(TURNED.as_quat().tolist()))


def facing_back(when: float) -> Pose:
    """A head 1.1 m off the runtime's origin, turned away; after 0.1 s it moves on by 0.3 m and 15 degrees."""
    if when < 0.1:
        return HERE
    further = Rotation.from_euler("y", 15, degrees=True) * TURNED
    return Pose((0.8, -0.45, 0.9), tuple(further.as_quat().tolist()))


@pytest.mark.parametrize("script", [{}, {"untracked": [(0.0, 0.07)]}, {"unfocused": [(0.0, 0.03)]}])
def test_the_heads_place_and_heading_are_the_origin_and_nod_and_tilt_stay(script: dict[str, Any]) -> None:
    headset = SimulatedHeadset((64, 64), 50.0, HeadsetScript(head=facing_back, **script))
    with rigs.open_window(RIG, headset=headset) as window:
        for _ in range(2):  # the frame of 0.08 s is tracked and worn
            window.flip()
        frame = window.eyes()
        level_head = Rotation.from_euler("XZ", [20, -10], degrees=True)
        assert frame.head.position == pytest.approx((0, 0, 0))
        assert frame.head.orientation == pytest.approx(level_head.as_quat())
        for side, eye in zip((-1, 1), frame.eyes, strict=True):
            assert eye.pose.position == pytest.approx(level_head.apply([side * 0.0315, 0, 0]))
            assert eye.pose.orientation == frame.head.orientation
        window.flip()
        window.flip()
        moved = window.eyes().head  # in the axes of before: 15 degrees further to the left
        place, turned = since(facing_back(1.0), HERE)
        assert moved.position == pytest.approx(place)
        assert moved.orientation == pytest.approx(turned.as_quat())
        window.recentre()
        assert window.eyes().head.position == pytest.approx((0, 0, 0))
        assert window.eyes().head.orientation == pytest.approx(level_head.as_quat())
        assert not window.eyes().recentred


def test_a_runtime_that_moves_its_origin_is_noted_and_followed() -> None:
    """It takes the head of 0.1 s as its origin; the frame that appears then is the first in the new axes."""
    script = HeadsetScript(head=lambda when: HERE if when < 0.1 else Pose(), recentred=[0.095])
    with rigs.open_window(RIG, headset=SimulatedHeadset((64, 64), 50.0, script)) as window:
        for _ in range(5):
            assert window.eyes().head.position == pytest.approx((0, 0, 0))
            window.flip()
        assert [frame.recentred for frame in window.shown_frames()] == [False, False, False, True, False]


@pytest.mark.parametrize("by", ["key", "button"])
def test_the_operator_and_the_wearer_set_straight_ahead_anew(by: str) -> None:
    held = [KeyPress("menu_held", 0.1)] if by == "button" else []
    script = HeadsetScript(head=lambda when: Pose((when, 0.0, 0.0)), presses=[*held, KeyPress("menu", 0.1)])
    with rigs.open_window(RIG, headset=SimulatedHeadset((64, 64), 50.0, script)) as window:
        for _ in range(5):
            window.flip()
        assert window.eyes().head.position[0] == pytest.approx(0.1)
        if by == "key":
            window.mirror = Mirror([], "f4", "f1")
            assert rigs.open_keyboard(window).pressed() == [KeyPress("f1", 1.0)]
            window.mirror = None
        else:
            assert window.presses() == [KeyPress("menu", 0.1)]
        assert (window.eyes().head.position[0], window.eyes().recentred) == (0.0, True)
        window.flip()
        assert window.shown_frames()[-1].recentred
        assert not window.eyes().recentred


def test_in_a_rehearsal_time_is_counted_and_the_frames_keep_the_runtimes_times() -> None:
    window = opened([3.04, 3.10, 3.12], refresh_clock=RefreshClock(50.0))
    assert (window.now(), window.due(0.02)) == (0.0, 0.02)
    assert (window.flip(), window.flip()) == (0.02, 0.04)
    assert [(frame.display_time, frame.late) for frame in window.shown_frames()] == [(3.04, 0), (3.10, 2)]
    assert window.presses() == [KeyPress("trigger", 0.04)]  # on the window's clock


def test_the_mirror_shows_the_eye_that_counts_after_the_frame_is_handed_over() -> None:
    window = opened([0.04, 0.06, 0.08], eye=Eye.RIGHT)
    window.mirror = Mirror(window.done)
    window.framebuffer()
    window.flip()
    window.flip()  # of which nothing was drawn
    taken = f"take {(900, 0, 900, 800)}"
    assert window.done == ["begin", taken, "end", "show", "begin", "end", "show", "begin"]
    keyboard, held = rigs.open_keyboard(window), rigs.open_held_keys(window)
    assert keyboard.pressed() == [KeyPress("f1", 1.0)]
    assert held.held() == {"w"}
    assert rigs.open_pointer(window) is None


def test_without_a_mirror_no_keys_are_pressed() -> None:
    window = opened([0.04])
    keyboard = rigs.open_keyboard(window)
    assert (keyboard.pressed(), keyboard.held()) == ([], frozenset())
    assert keyboard.apparatus() == {"keyboard": "none"}


def test_both_eyes_are_drawn_side_by_side_and_read_back_with_the_upper_row_first() -> None:
    with rigs.open_window(RIG, RefreshClock(50.0)) as window:
        framebuffer = window.framebuffer()
        assert framebuffer.viewport == (0, 0, 128, 64)
        framebuffer.clear(viewport=(0, 0, 128, 64))
        framebuffer.clear(10 / 255, 20 / 255, 30 / 255, 1.0, viewport=(0, 60, 64, 4))  # left eye, upper edge
        framebuffer.clear(40 / 255, 0.0, 0.0, 1.0, viewport=(64, 0, 64, 64))  # right eye
        codes = window.read_codes()
        assert codes.shape == (64, 128, 3)
        assert (codes[:4, :64] == (10, 20, 30)).all()
        assert (codes[4:, :64] == 0).all()
        assert (codes[:, 64:] == (40, 0, 0)).all()
        assert (window.read_codes((16, 20)) == 0).all()
        assert window.read_codes((16, 20)).shape == (20, 16, 3)
        top, middle = window.codes_later((16, 20), top=True), window.codes_later((16, 20))
        window.flip()
        window.framebuffer().clear(1.0, 1.0, 1.0, 1.0)
        first = top()  # of the frame before
        assert first.shape == (8, 16, 3)
        assert (first[:4] == (10, 20, 30)).all()
        assert (first[4:] == 0).all()
        assert (middle() == 0).all()
        window.framebuffer().clear(50 / 255, 0.0, 0.0, 1.0, viewport=(24, 22, 16, 10))  # the lower half of it
        assert window.read_codes((16, 20))[:, 0, 0].tolist() == 10 * [255] + 10 * [50]
    with rigs.open_window(dataclasses.replace(RIG, eye=Eye.RIGHT), RefreshClock(50.0)) as window:
        window.framebuffer().clear(40 / 255, 0.0, 0.0, 1.0, viewport=(64, 0, 64, 64))
        assert (window.read_codes((16, 20)) == (40, 0, 0)).all()


def test_pages_have_a_size_of_their_own_and_the_apparatus_tells_that_of_the_eyes() -> None:
    window = opened([0.04])
    assert (window.size(), window.bits()) == (PANEL_SIZE, 8)
    said = window.apparatus()
    assert said["system"] == "a headset"
    assert said["eye_size"] == "900 x 800 pixels"
    assert said["eye_that_counts"] == "left"
    assert said["pixels_per_degree_left"] == "7.854 at the centre"  # 900 / 2 pi / 180
    assert said["pixels_per_degree_right"] == "5.236 at the centre"  # 900 / 3 pi / 180
    assert said["field_of_view_left_deg"] == "-45.00 to 45.00, -45.00 to 45.00 upwards"
    assert said["api"] == "1.1"


def test_rig_and_display_take_what_the_headset_has() -> None:
    display = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=40.0)
    full = dataclasses.replace(RIG, full_screen=True, refresh_rate=60.0)
    rig, shown = rigs.with_headset(full, display, FACTS)
    assert (rig.refresh_rate, rig.screen) == (50.0, "simulated:openxr")
    assert shown.pixels_per_degree == pytest.approx(900 / 2 * math.pi / 180)
    assert dataclasses.replace(shown, pixels_per_degree=40.0) == display
    right = rigs.with_headset(dataclasses.replace(full, eye=Eye.RIGHT), display, FACTS)[1]
    assert right.pixels_per_degree == pytest.approx(900 / 3 * math.pi / 180)
    # The focus views are 300 pixels across; straight ahead lies in their middle, and aside of it.
    focus = (EyeFov(-math.atan(0.25), math.atan(0.25), 0.2, -0.2), EyeFov(-0.1, math.atan(0.5), 0.2, -0.2))
    four = dataclasses.replace(FACTS, fovs=(*FACTS.fovs, *focus), focus_size=(300, 280))
    for eye, tangents in ((Eye.LEFT, 0.5), (Eye.RIGHT, 0.5 + math.tan(0.1))):
        display = rigs.with_headset(dataclasses.replace(full, eye=eye), display, four)[1]
        assert display.pixels_per_degree == pytest.approx(300 / tangents * math.pi / 180)
    small = rigs.with_headset(RIG, display, FACTS)[1]  # 64 pixels wide, as the rig says
    assert small.pixels_per_degree == pytest.approx(64 / 2 * math.pi / 180)


@pytest.mark.parametrize("rate", [16.7, 1500.0])
def test_a_refresh_rate_that_no_display_has_is_told_in_one_line(rate: float) -> None:
    display = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=40.0)
    with pytest.raises(InputError, match=rf"monado says that its headset shows {rate:g} Hz") as told:
        rigs.with_headset(RIG, display, dataclasses.replace(FACTS, refresh_rate=rate))
    assert "\n" not in str(told.value)


def test_frames_that_nobody_asks_for_are_not_kept_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headset_window, "KEPT", 3)
    window = opened([0.04, 0.06, 0.08, 0.10, 0.12, 0.14])
    for _ in range(5):
        window.flip()
    assert [frame.display_time for frame in window.shown_frames()] == [0.08, 0.10, 0.12]


def test_refreshes_without_a_frame_are_counted_by_the_displays_rate_not_by_a_slow_runtimes_period(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At 50 Hz, 40 ms from one to the next: each frame but the first one is a refresh late."""
    headset = Headset([1.0, 1.04, 1.08, 1.12], period=0.04)
    monkeypatch.setattr(headset_facts, "open_headset", lambda _: headset)
    *said, timed = headset_facts.measure_headset(RIG, 3)
    assert timed == (
        "3 frames, 3 of them shown: 40.00 ms from one to the next (25.00 Hz), 2 refreshes without a new one"
    )
    assert "system                    a headset" in said
    assert "tracks                    orientation and position; known in 3 of 3 frames" in said
    assert "refresh_rate_hz = 50.00  # can be chosen: unknown" in said
    assert headset.closed


def test_a_headset_that_fails_at_once_is_closed() -> None:
    headset = Headset([])
    with pytest.raises(InstrumentError, match="went away"):
        rigs.open_window(RIG, RefreshClock(50.0), headset=headset)
    assert headset.closed


def test_a_window_in_a_made_up_headset_runs_in_time_or_at_once() -> None:
    with rigs.open_window(RIG) as window:  # 3 refreshes of 20 ms, from before the window opened
        for _ in range(3):
            window.flip()
        assert window.now() >= 0.06
    counted = rigs.open_headset(RIG, waits=False)
    assert counted.now() == 0.0
    counted.close()


def test_what_happens_to_the_headset_is_noted_with_its_frames() -> None:
    script = HeadsetScript(
        head=lambda when: Pose((when, 0.0, 0.0)),
        dropped={3: 1},
        invisible=[(0.055, 0.065)],
        unfocused=[(0.035, 0.045)],
        untracked=[(0.075, 0.085)],
    )
    with rigs.open_window(RIG, headset=SimulatedHeadset((64, 64), 50.0, script)) as window:
        for _ in range(4):
            window.flip()
        shown = window.shown_frames()  # begun at 0, 0.02, 0.04 and 0.08 s, and shown 0.04 s later
    np.testing.assert_allclose([frame.display_time for frame in shown], [0.04, 0.06, 0.08, 0.12])
    assert [frame.late for frame in shown] == [0, 0, 0, 1]
    assert [frame.visible for frame in shown] == [True, False, True, True]
    assert [frame.focused for frame in shown] == [True, True, False, True]
    assert [frame.tracked for frame in shown] == [True, True, False, True]
    # from where the head was when the first one appeared
    np.testing.assert_allclose([frame.head.position[0] for frame in shown], [0, 0.02, 0.035, 0.08], atol=1e-9)


def test_the_presets_are_in_headsets_and_the_made_up_one_opens() -> None:
    rig = load_rig("simulated-headset")[0]
    assert rig.in_headset
    assert load_rig("headset")[0].screen == "openxr"
    assert not load_rig("simulated")[0].in_headset
    rigs.require_display(rig)
    with rigs.open_window(rig, RefreshClock(rig.refresh_rate)) as window:
        window.flip()
