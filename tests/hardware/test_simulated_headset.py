"""The headset that is made up: its frames, its eyes, what its wearer does."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.hardware.presentation.headset_views import Pose, centre_pixels_per_degree
from evenlight.hardware.protocols import Fault, InstrumentError, KeyPress
from evenlight.hardware.simulated.headset import HeadsetScript, SimulatedHeadset

SIZE = (32, 24)
HALF = math.sqrt(0.5)


def headset(**changes) -> SimulatedHeadset:
    return SimulatedHeadset(SIZE, 50.0, HeadsetScript(**changes))


@pytest.fixture
def plain() -> Iterator[SimulatedHeadset]:
    with headset() as link:
        yield link


def frames(link: SimulatedHeadset, n: int) -> list:
    came = []
    for _ in range(n):
        came.append(link.begin_frame())
        link.end_frame()
    return came


def test_a_frame_appears_two_refreshes_after_it_began_and_the_clock_goes_with_the_frames(plain) -> None:
    times = []
    for frame in range(4):
        begun = plain.begin_frame()
        times.append((plain.now(), begun.display_time))
        assert begun.period == 0.02
        assert plain.now() == pytest.approx(frame / 50)
        plain.end_frame()
    np.testing.assert_allclose([shown - begun for begun, shown in times], 0.04)


def test_in_real_time_no_frame_begins_before_its_refresh() -> None:
    with SimulatedHeadset(SIZE, 50.0, real_time=True) as link:
        for _ in range(4):
            frame = link.begin_frame()
            assert 0.04 - 0.02 < frame.display_time - link.now() <= 0.04
            assert frame.display_time * 50 == pytest.approx(round(frame.display_time * 50))
            link.end_frame()
        assert link.now() >= 3 / 50


@pytest.mark.parametrize(
    ("orientation", "right"),
    [
        ((0.0, 0.0, 0.0, 1.0), (1, 0, 0)),
        ((0.0, HALF, 0.0, HALF), (0, 0, -1)),  # turned 90 degrees to the left: its right is straight ahead
        ((0.0, 0.0, HALF, HALF), (0, 1, 0)),  # leant 90 degrees to the left: its right is above
        ((HALF, 0.0, 0.0, HALF), (1, 0, 0)),  # looking up: its right stays where it is
    ],
)
def test_the_eyes_are_63_mm_apart_along_the_heads_right(orientation, right) -> None:
    with headset(head=lambda _: Pose((0.1, 0.2, 0.3), orientation)) as link:
        left_eye, right_eye = link.begin_frame().eyes
    middle, half = np.array([0.1, 0.2, 0.3]), 0.0315 * np.array(right)
    np.testing.assert_allclose(left_eye.pose.position, middle - half, atol=1e-12)
    np.testing.assert_allclose(right_eye.pose.position, middle + half, atol=1e-12)
    assert left_eye.pose.orientation == right_eye.pose.orientation == orientation


def test_the_eyes_pictures_are_each_others_mirror_image(plain) -> None:
    left, right = plain.facts().fovs
    assert (left.left, left.right) == (-right.right, -right.left)
    assert -left.left > left.right > 0  # outwards more than towards the nose
    # (tan 47 deg + tan 43 deg) of 32 pixels: 32 / 2.0049 pi / 180
    assert centre_pixels_per_degree(left, 32) == pytest.approx(0.27857, abs=1e-5)


def test_a_gentle_head_looks_straight_ahead_at_first_and_is_the_same_each_time() -> None:
    with headset() as one, headset() as other:
        assert [frame.head for frame in frames(one, 5)] == [frame.head for frame in frames(other, 5)]
        norms = [math.hypot(*frame.head.orientation) for frame in frames(one, 50)]
    np.testing.assert_allclose(norms, 1.0)


def test_presses_come_once_each_when_they_are_due_and_not_while_it_is_taken_off() -> None:
    presses = [KeyPress("trigger", 0.01), KeyPress("menu", 0.03), KeyPress("stick_left", 0.07)]
    with headset(presses=presses, unfocused=[(0.03, 0.05)], stick=lambda when: (when, 0.0)) as link:
        came = []
        for _ in range(6):  # at 0, 0.02 ... 0.1 s
            link.begin_frame()
            came.append((link.focused(), [press.name for press in link.presses()], link.stick()[0]))
            link.end_frame()
    assert [names for _, names, _ in came] == [[], ["trigger"], [], [], ["stick_left"], []]
    assert [focused for focused, _, _ in came] == [True, True, False, True, True, True]
    np.testing.assert_allclose([stick for _, _, stick in came], [0.0, 0.02, 0.0, 0.06, 0.08, 0.1])


def test_a_runtime_that_goes_away_is_one_line() -> None:
    with headset(lost_at=2) as link:
        frames(link, 2)
        with pytest.raises(InstrumentError, match="the runtime went away") as caught:
            link.begin_frame()
    assert caught.value.fault is Fault.DISCONNECTED


def test_frames_are_begun_and_ended_by_turns(plain) -> None:
    with pytest.raises(InstrumentError, match="no frame was begun"):
        plain.framebuffer()
    plain.begin_frame()
    with pytest.raises(InstrumentError, match="begun before the last one ended"):
        plain.begin_frame()
    plain.end_frame()
    plain.close()
    plain.close()
    with pytest.raises(InstrumentError, match="is closed"):
        plain.begin_frame()


def test_codes_arrive_as_they_are_in_an_srgb_image_as_of_a_swapchain(plain) -> None:
    plain.begin_frame()
    framebuffer = plain.framebuffer()
    for code in range(256):
        framebuffer.clear(code / 255, 0.0, 0.0, 1.0)
        assert framebuffer.read(components=1)[0] == code
    assert framebuffer.size == (2 * SIZE[0], SIZE[1])


def test_it_draws_on_after_another_context_was_made_and_left(plain) -> None:
    moderngl.create_context(standalone=True, require=330, backend="egl").release()
    plain.begin_frame()
    plain.framebuffer().clear(1.0, 1.0, 1.0, 1.0)
    assert set(plain.framebuffer().read()) == {255}


def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch) -> None:
    def fail(**_: object) -> None:
        raise Exception("cannot detect the display")

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(InputError, match=r"needs OpenGL 3\.3.*cannot detect the display.*libegl1"):
        headset()
