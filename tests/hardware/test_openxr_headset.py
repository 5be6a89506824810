"""What a headset does as a runtime says, without a runtime: states, frames, facts, what fails."""

import math
from typing import Any

import numpy as np
import pytest
from openxr_stand_in import FOCUS, PERIOD, FakeSession, xr

from evenlight.hardware.presentation import openxr_headset
from evenlight.hardware.presentation.headset_views import EyeFov, EyePose, Pose
from evenlight.hardware.protocols import InstrumentError


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeSession:
    return FakeSession(monkeypatch)


def test_frames_begin_when_the_runtime_is_ready_and_end_when_it_stops(fake: FakeSession) -> None:
    states = xr.SessionState
    assert fake.waited == 10  # tracked frames, of which the first one is that of READY
    fake.says(states.STOPPING, states.IDLE)
    assert not fake.headset.begin_frame().visible
    assert (fake.calls, fake.waited) == (["end_session"], 10)
    assert not fake.headset.focused()
    fake.says(states.READY, states.SYNCHRONIZED, states.VISIBLE)
    frame = fake.headset.begin_frame()
    assert (frame.display_time, frame.period) == pytest.approx((11 * 0.02, 0.02))
    assert (frame.visible, frame.tracked) == (True, True)
    assert not fake.headset.focused()
    fake.says(states.FOCUSED)
    fake.headset.begin_frame()
    assert fake.headset.focused()
    assert fake.calls == ["end_session", "begin_session", "begin_frame", "begin_frame"]


def test_idle_frames_come_at_the_period_and_have_nothing_to_end(fake: FakeSession) -> None:
    # the made-up clock goes on by 1 ms at each look; a frame is waited for from the one before
    assert fake.slept == [0.0, pytest.approx(openxr_headset.IDLE_PERIOD - 0.001, abs=1e-9)]
    fake.headset.end_frame()  # of the first ones, ended before
    fake.says(xr.SessionState.STOPPING)
    first, second = fake.headset.begin_frame(), fake.headset.begin_frame()
    fake.headset.end_frame()
    assert fake.layers == []
    assert second.display_time - first.display_time == pytest.approx(0.002)
    assert not second.tracked


def test_only_what_was_drawn_becomes_a_layer_and_what_nobody_sees_has_a_picture_of_its_own(
    fake: FakeSession,
) -> None:
    fake.headset.begin_frame()
    assert fake.headset.picture() == "the swapchain's"
    fake.headset.end_frame()
    fake.headset.begin_frame()
    fake.headset.end_frame()
    fake.render = False
    fake.headset.begin_frame()
    assert fake.headset.picture() == "a picture of its own, (640, 240)"
    fake.headset.end_frame()
    assert fake.layers == [1, 0, 0]


INSET = xr.ViewConfigurationType.PRIMARY_STEREO_WITH_FOVEATED_INSET.value
PARTS = (0, 0, 320, 240), (320, 0, 320, 240), (640, 0, 104, 90), (744, 0, 104, 90)  # the larger of a pair's


OWN = (0, 0, 200, 100), (200, 0, 200, 100)


@pytest.mark.parametrize(
    ("kinds", "eye_size", "parts"),
    [((INSET,), None, PARTS), ((), None, PARTS[:2]), ((INSET,), OWN[0][2:], OWN)],
)
def test_focus_views_are_drawn_where_the_runtime_has_them_and_the_rig_has_no_size_of_its_own(
    monkeypatch: pytest.MonkeyPatch, kinds: tuple[int, ...], eye_size: Any, parts: tuple[Any, ...]
) -> None:
    fake = FakeSession(monkeypatch, eye_size, more_kinds=kinds)
    frame, facts, focused = fake.headset.begin_frame(), fake.headset.facts(), len(parts) == 4
    assert tuple(eye.part for eye in frame.eyes) == parts
    edges = [(-0.8, 0.7, 0.75, -0.75)] * 2 + [FOCUS] * 2
    for eye, fov, wanted in zip(frame.eyes, facts.fovs, edges, strict=False):
        assert eye.fov == fov
        assert (fov.left, fov.right, fov.up, fov.down) == pytest.approx(wanted)
    assert (facts.runtime, facts.system, facts.eye_size) == ("fake", "a headset", (320, 240))
    assert (facts.refresh_rate, facts.refresh_rates, facts.tracks_position) == (50.0, (50.0, 75.0), True)
    assert (len(facts.fovs), facts.eye_distance) == (len(parts), pytest.approx(0.06))
    assert facts.focus_size == ((104, 90) if focused else None)
    assert set(fake.kinds) == {INSET if focused else xr.ViewConfigurationType.PRIMARY_STEREO.value}
    fake.headset.picture()
    fake.headset.end_frame()
    assert tuple(fake.places) == parts
    said = fake.headset.apparatus()
    assert said.get("focus_size") == ("104 x 90 pixels" if focused else None)
    # 104 / (tan 0.25 + tan 0.2) * pi / 180
    assert said.get("pixels_per_degree_focus_left") == ("3.963 at the centre" if focused else None)


def test_without_tracking_the_views_are_the_last_known_ones(fake: FakeSession) -> None:
    known = fake.headset.begin_frame()
    fake.flags, fake.turned = 0, 0.5
    lost = fake.headset.begin_frame()
    assert not lost.tracked
    assert (lost.eyes, lost.head) == (known.eyes, known.head)
    assert known.eyes[1] == EyePose(
        Pose((pytest.approx(0.03), 0.0, 0.0)),
        EyeFov(*map(pytest.approx, (-0.8, 0.7, 0.75, -0.75))),
        (320, 0, 320, 240),
    )


CORNER = ((-0.8, 0.7), (-0.2, 0.7), (-0.8, 0.1)), ((-0.2, 0.7), (-0.2, 0.1), (-0.8, 0.1))


@pytest.mark.parametrize(("indices", "hidden"), [
    ([0, 1, 2, 1, 3, 2], (CORNER, CORNER)), ([], ((), ())), ([0, 1, 4], ((), ())),
])  # fmt: skip
def test_what_lenses_hide_is_as_the_runtime_says_or_not_known(
    monkeypatch: pytest.MonkeyPatch, indices: list[int], hidden: tuple[Any, ...]
) -> None:
    """Asked for how much there is, then for what; an index beyond the points is no triangle."""
    points = [(-0.8, 0.7), (-0.2, 0.7), (-0.8, 0.1), (-0.2, 0.1)]

    def told(_: Any, __: Any, eye: int, kind: int, mask: Any) -> int:
        assert (eye in (0, 1), kind) == (True, 1)  # XR_VISIBILITY_MASK_TYPE_HIDDEN_TRIANGLE_MESH_KHR
        mask = mask.contents
        mask.vertex_count_output, mask.index_count_output = len(points), len(indices)
        for k, point in enumerate(points[: mask.vertex_capacity_input]):
            mask.vertices[k].x, mask.vertices[k].y = point
        for k, index in enumerate(indices[: mask.index_capacity_input]):
            mask.indices[k] = index
        return 0

    offered = xr.PFN_xrGetVisibilityMaskKHR(told)
    fake = FakeSession(monkeypatch, hidden_area=offered)
    assert np.array(fake.headset.facts().hidden) == pytest.approx(np.array(hidden))
    indices[:] = [2, 1, 3]
    assert np.array(fake.headset.facts().hidden) == pytest.approx(np.array(hidden))
    fake.events.append(xr.EventDataVisibilityMaskChangedKHR())
    fake.headset.begin_frame()
    assert np.array(fake.headset.facts().hidden) == pytest.approx(
        np.array(2 * [CORNER[1:]])[..., [2, 0, 1], :]
    )


@pytest.mark.parametrize("period", [11_111_110, 11_111_112])  # [ns]
def test_a_refresh_rate_by_the_period_is_the_same_at_each_start(
    monkeypatch: pytest.MonkeyPatch, period: int
) -> None:
    facts = FakeSession(monkeypatch, period=period, says_rates=False).headset.facts()
    assert (facts.refresh_rate, facts.refresh_rates) == (90.0, ())


def test_a_runtime_that_moves_its_origin_says_from_which_frame_on(fake: FakeSession) -> None:
    """The next frames appear at 11, 12 and 13 periods; the space of the floor is none that is used."""
    kinds = xr.ReferenceSpaceType
    fake.events += [
        xr.EventDataReferenceSpaceChangePending(reference_space_type=kind, change_time=time)
        for kind, time in ((kinds.LOCAL, 12 * PERIOD - 1), (kinds.STAGE, 0))
    ]
    assert [fake.headset.begin_frame().recentred for _ in range(3)] == [False, True, False]


def test_where_the_eyes_look_is_known_while_they_are_tracked(fake: FakeSession) -> None:
    """The eyes' space is located as the head's is; a failure of it leaves the head's alone."""
    assert fake.headset.begin_frame().gaze is None  # there is nothing to ask
    fake.controllers.gaze = "eyes"
    assert fake.headset.begin_frame().gaze == Pose()
    locate, answers = fake.runtime.xr.locate_space, iter([False, True])

    def located(space: Any, *rest: Any) -> Any:
        if space == "eyes" and next(answers):
            raise xr.exception.TimeInvalidError
        return (
            xr.SpaceLocation(xr.SpaceLocationFlags(3)) if space == "eyes" else locate(space, *rest)
        )  # closed

    fake.runtime.xr.locate_space = located
    frames = [fake.headset.begin_frame() for _ in range(2)]
    assert [(frame.gaze, frame.tracked) for frame in frames] == 2 * [(None, True)]


def fails_once(fake: FakeSession, function: str) -> None:
    plain = getattr(fake.runtime.xr, function)

    def failed(*_: Any) -> None:
        setattr(fake.runtime.xr, function, plain)
        raise xr.exception.RuntimeFailureError

    setattr(fake.runtime.xr, function, failed)


@pytest.mark.parametrize("function", ["poll_event", "wait_frame", "begin_frame", "end_frame", "end_session"])
def test_a_function_that_fails_once_is_told_in_one_line(fake: FakeSession, function: str) -> None:
    def frames() -> None:
        for states in ((), (xr.SessionState.STOPPING,)):
            fake.says(*states)
            fake.headset.begin_frame()
            fake.headset.end_frame()

    fails_once(fake, function)
    with pytest.raises(InstrumentError, match=r"fake went away or failed \(XR_ERROR_RUNTIME_FAILURE") as told:
        frames()
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("way", ["locate_views", "locate_space", "turned"])
def test_a_pose_that_fails_or_is_none_is_a_frame_whose_head_is_not_known(fake: FakeSession, way: str) -> None:
    known = fake.headset.begin_frame()
    if way == "turned":
        fake.turned = math.nan
    else:
        fails_once(fake, way)
    lost = fake.headset.begin_frame()
    assert (lost.tracked, lost.eyes, lost.head) == (False, known.eyes, known.head)
    fake.turned = 1.0
    assert fake.headset.begin_frame().tracked


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        ({"size": 0}, "recommends pictures of 0 x 240 pixels"),
        ({"edges": (0.7, 0.7, 0.75, -0.75)}, "an eye sees 0 by 85.94 degrees"),
        ({"edges": (-1.6, 1.6, 0.75, -0.75)}, "an eye sees 183.3 by 85.94 degrees"),
    ],
)
def test_what_no_headset_has_is_told_in_one_line(
    monkeypatch: pytest.MonkeyPatch, odd: dict[str, Any], message: str
) -> None:
    with pytest.raises(InstrumentError, match=message) as told:
        FakeSession(monkeypatch, **odd)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("state", ["EXITING", "LOSS_PENDING"])
def test_a_session_that_the_runtime_ends_is_told_in_one_line(fake: FakeSession, state: str) -> None:
    fake.says(getattr(xr.SessionState, state))
    for _ in range(2):  # and stays ended
        with pytest.raises(InstrumentError, match="session") as error:
            fake.headset.begin_frame()
        assert "\n" not in str(error.value)


def test_a_headset_that_is_taken_off_is_not_focused(fake: FakeSession) -> None:
    fake.says(xr.SessionState.FOCUSED)
    fake.events.append(xr.EventDataUserPresenceChangedEXT(is_user_present=0))
    fake.headset.begin_frame()
    assert not fake.headset.focused()
    fake.events.append(xr.EventDataUserPresenceChangedEXT(is_user_present=1))
    fake.headset.begin_frame()
    assert fake.headset.focused()
