"""What a headset does as a runtime says, without a runtime: states, presses, refusals, keys of the mirror."""

import ctypes
import math
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware import headset_facts
from evenlight.hardware.headset_facts import measure_headset
from evenlight.hardware.presentation import openxr_headset, openxr_runtime
from evenlight.hardware.presentation.headset_views import SRGB8_ALPHA8, EyeFov, EyePose, Pose
from evenlight.hardware.presentation.mirror_window import PLACES, MirrorWindow, glfw_library
from evenlight.hardware.presentation.openxr_actions import PROFILES, Controllers, Edges, direction
from evenlight.hardware.presentation.openxr_graphics import Swapchain
from evenlight.hardware.presentation.openxr_headset import OpenXRHeadset
from evenlight.hardware.presentation.openxr_runtime import Library, OpenXRRuntime, openxr_library
from evenlight.hardware.protocols import InstrumentError, KeyPress
from evenlight.hardware.simulated.headset import SimulatedHeadset

xr: Any = pytest.importorskip("xr")
SECOND = 1_000_000_000  # [ns]
PERIOD = SECOND // 50
CLOCK = "convert_timespec_time_to_time_khr"  # on Linux


class FakeRuntime:
    """A runtime that says what a test has it say: pyopenxr's own records and errors, with other functions."""

    def __init__(self, **functions: Callable[..., Any]) -> None:
        self.xr = SimpleNamespace(**{name: getattr(xr, name) for name in xr.__all__ if hasattr(xr, name)})
        self.xr.exception = xr.exception
        for name, function in functions.items():
            setattr(self.xr, name, function)
        self.name, self.instance, self.system_id, self.time = "fake", None, 1, 0.0
        self.says_rates = True
        self.system = SimpleNamespace(
            graphics_properties=xr.SystemGraphicsProperties(4096, 4096, 16),
            tracking_properties=xr.SystemTrackingProperties(1, 1),
            system_name=b"a headset",
        )

    def offers(self, extension: str) -> bool:
        return self.says_rates or extension != openxr_runtime.REFRESH_RATES

    def now(self) -> float:
        self.time += 0.001
        return self.time

    talking = OpenXRRuntime.talking

    def close(self) -> None:
        pass


class FakeMirror:
    """A window and a context that draw nothing."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    def make_current(self) -> None:
        pass

    def context(self) -> Any:
        return SimpleNamespace(simple_framebuffer=lambda size, _: f"a picture of its own, {size}")

    def close(self) -> None:
        pass


class FakeSwapchain:
    """A swapchain whose picture is drawn as soon as it is asked for."""

    def __init__(self, _: Any, __: Any, ___: Any, size: tuple[int, int]) -> None:
        self.size, self._drawn = size, False

    def acquired(self) -> str:
        self._drawn = True
        return "the swapchain's"

    def release(self) -> bool:
        drawn, self._drawn = self._drawn, False
        return drawn

    def half(self, _: int) -> Any:
        return xr.SwapchainSubImage()


class FakeSession:
    """A headset whose session's events, frames and flags a test gives; open after its ten first frames."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **runtime: Any) -> None:
        self.calls: list[str] = []
        self.layers: list[int] = []
        self.slept: list[float] = []
        self.render, self.flags, self.waited = True, 15, 0
        self.turned, self.period, self.size = 1.0, runtime.pop("period", PERIOD), runtime.pop("size", 320)
        hidden_area = runtime.pop("hidden_area", xr.PFN_xrGetVisibilityMaskKHR(lambda *_: -8))
        self.edges = runtime.pop("edges", (-0.8, 0.7, 0.75, -0.75))
        noted = {name: self._noting(name) for name in ("begin_session", "end_session", "begin_frame")}
        self.runtime = FakeRuntime(
            get_opengl_graphics_requirements_khr=lambda *_: None,
            enumerate_view_configuration_views=lambda *_: 2 * [xr.ViewConfigurationView(self.size, 0, 240)],
            create_session=lambda *_: xr.Session(),
            destroy_session=lambda _: None,
            create_reference_space=lambda *_: xr.Space(),
            get_display_refresh_rate_fb=lambda _: ctypes.c_float(50.0),
            enumerate_display_refresh_rates_fb=lambda _: [50.0, 75.0],
            poll_event=self._poll,
            wait_frame=self._wait,
            get_instance_proc_addr=lambda *_: hidden_area,
            end_frame=lambda _, info: self.layers.append(info.layer_count),
            locate_views=lambda *_: (
                xr.ViewState(xr.ViewStateFlags(self.flags)),
                [xr.View(self._pose(x), xr.Fovf(*self.edges)) for x in (-0.03, 0.03)],
            ),
            locate_space=lambda *_: xr.SpaceLocation(xr.SpaceLocationFlags(self.flags), self._pose(0.0)),
            **noted,
        )
        self.runtime.__dict__.update(runtime)
        self.controllers = controllers = SimpleNamespace(sync=lambda _: None, gaze=None)
        for name, made in (
            ("openxr_library", lambda: None),
            ("OpenXRRuntime", lambda _, gaze: self.runtime),
            ("MirrorWindow", FakeMirror),
            ("Swapchain", FakeSwapchain),
            ("Controllers", lambda *_: controllers),
            ("graphics_binding", lambda _: xr.Posef()),
        ):
            monkeypatch.setattr(openxr_headset, name, made)
        monkeypatch.setattr(time, "sleep", self.slept.append)
        self.events: list[Any] = [None, None]  # of each frame, until there is none: idle for two
        self.says(xr.SessionState.READY)
        self.headset = OpenXRHeadset()
        self.calls.clear()
        self.layers.clear()

    def says(self, *states: Any) -> None:
        self.events += [xr.EventDataSessionStateChanged(state=state) for state in states]

    def _noting(self, name: str) -> Callable[..., None]:
        return lambda *_: self.calls.append(name)

    def _poll(self, _: Any) -> Any:
        if not self.events or (event := self.events.pop(0)) is None:
            raise xr.exception.EventUnavailable
        return event

    def _wait(self, _: Any) -> Any:
        self.waited += 1
        return xr.FrameState(self.waited * PERIOD, self.period, self.render)

    def _pose(self, x: float) -> Any:
        return xr.Posef(xr.Quaternionf(0.0, 0.0, 0.0, self.turned), xr.Vector3f(x, 0.0, 0.0))


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


def test_without_tracking_the_views_are_the_last_known_ones(fake: FakeSession) -> None:
    known = fake.headset.begin_frame()
    fake.flags, fake.turned = 0, 0.5
    lost = fake.headset.begin_frame()
    assert not lost.tracked
    assert (lost.eyes, lost.head) == (known.eyes, known.head)
    assert known.eyes[1] == EyePose(
        Pose((pytest.approx(0.03), 0.0, 0.0)), EyeFov(*map(pytest.approx, (-0.8, 0.7, 0.75, -0.75)))
    )


def test_it_says_what_the_runtime_says(fake: FakeSession) -> None:
    facts = fake.headset.facts()
    assert (facts.runtime, facts.system, facts.eye_size) == ("fake", "a headset", (320, 240))
    assert (facts.refresh_rate, facts.refresh_rates, facts.tracks_position) == (50.0, (50.0, 75.0), True)
    assert facts.eye_distance == pytest.approx(0.06)


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
    facts = FakeSession(monkeypatch, hidden_area=offered).headset.facts()
    assert np.array(facts.hidden) == pytest.approx(np.array(hidden))


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


def test_the_graphics_context_is_made_current_after_each_function_even_one_that_fails() -> None:
    def gone(*_: Any) -> None:
        raise xr.exception.InstanceLostError

    library, restored = Library(FakeRuntime(wait_frame=lambda _: "frame", end_frame=gone).xr), []
    assert library.wait_frame(None) == "frame"  # before there is a context
    library.afterwards = lambda: restored.append(1)
    assert library.wait_frame(None) == "frame"
    with pytest.raises(xr.exception.InstanceLostError):
        library.end_frame(None)
    assert library.Posef is xr.Posef  # records are pyopenxr's own
    assert len(restored) == 2


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


def test_codes_that_would_be_encoded_twice_are_refused() -> None:
    runtime: Any = FakeRuntime(enumerate_swapchain_formats=lambda _: [0x8058, 0x881A, 0x1234])
    with pytest.raises(InstrumentError, match="SRGB8_ALPHA8: choose"):
        Swapchain(runtime, None, None, (640, 240))  # type: ignore[arg-type] # refused before it draws


def test_pictures_larger_than_the_runtimes_are_refused() -> None:
    runtime: Any = FakeRuntime(enumerate_swapchain_formats=lambda _: [SRGB8_ALPHA8])
    with pytest.raises(InstrumentError, match="5000 x 240 pixels, and the runtime takes 4096 x 4096"):
        Swapchain(runtime, None, None, (5000, 240))  # type: ignore[arg-type] # refused before it draws


class FakeControllers:
    """Controllers whose parts a test pushes."""

    def __init__(self) -> None:
        self.pushed = {"trigger": 0.0, "menu": 0.0}
        self.stick, self.time, self.focus = (0.0, 0.0), 0, True
        self.suggested: dict[str, set[str]] = {}
        paths: list[str] = []
        names: list[str] = []

        def path(_: Any, text: str) -> int:
            paths.append(text)
            return len(paths) - 1

        def action(_: Any, info: Any) -> int:
            names.append(info.action_name.decode())
            return len(names) - 1

        def suggest(_: Any, one: Any) -> None:
            profile = paths[one.interaction_profile].removeprefix("/interaction_profiles/")
            self.suggested[profile] = {f"{names[b.action]}: {paths[b.binding]}" for b in one.bindings}
            if profile == "htc/vive_controller":  # one that this runtime does not know
                raise xr.exception.PathUnsupportedError

        def sync(*_: Any) -> None:
            if not self.focus:
                raise xr.exception.SessionNotFocused

        def given(**fields: Any) -> SimpleNamespace:
            return SimpleNamespace(is_active=True, last_change_time=self.time, **fields)

        record: Any = SimpleNamespace
        self.runtime: Any = FakeRuntime(
            create_action_set=lambda *_: None,
            create_action=action,
            create_action_space=lambda *_: None,
            ActionSpaceCreateInfo=lambda **_: None,
            string_to_path=path,
            suggest_interaction_profile_bindings=suggest,
            attach_session_action_sets=lambda *_: None,
            sync_actions=sync,
            ActionStateGetInfo=lambda number: names[number],
            ActiveActionSet=lambda *_: xr.ActiveActionSet(),
            ActionSuggestedBinding=lambda action, binding: record(action=action, binding=binding),
            InteractionProfileSuggestedBinding=lambda interaction_profile, suggested_bindings: record(
                interaction_profile=interaction_profile, bindings=suggested_bindings
            ),
            SessionActionSetsAttachInfo=lambda **_: None,
            get_action_state_float=lambda _, name: given(current_state=self.pushed[name]),
            get_action_state_vector2f=lambda *_: given(current_state=xr.Vector2f(*self.stick)),
        )
        self.controllers = Controllers(self.runtime, None)

    def after(self, seconds: float, stick: tuple[float, float] = (0.0, 0.0), **pushed: float) -> None:
        self.time, self.stick = round(seconds * SECOND), stick
        self.pushed |= pushed
        self.controllers.sync(seconds)


def test_presses_carry_their_names_and_the_runtimes_times() -> None:
    fake = FakeControllers()
    fake.after(1.0, trigger=0.3)
    fake.after(2.0, trigger=0.7, menu=1.0)
    fake.after(2.5, trigger=0.5, menu=0.0)
    fake.after(3.0, trigger=0.5, stick=(-0.9, 0.2))  # the trigger was not let go
    fake.after(4.0, trigger=0.9, stick=(-0.5, 0.5))  # the stick did not come back
    fake.after(5.0, trigger=0.0)
    fake.after(6.0, trigger=1.0, stick=(0.1, -0.8))
    assert fake.controllers.presses() == [
        KeyPress("trigger", 2.0), KeyPress("menu", 2.5), KeyPress("stick_left", 3.0),
        KeyPress("trigger", 6.0), KeyPress("stick_down", 6.0),
    ]  # fmt: skip
    assert fake.controllers.presses() == []
    assert fake.controllers.stick() == pytest.approx((0.1, -0.8))


def test_without_focus_nothing_is_pressed_and_the_stick_stands_in_the_middle() -> None:
    fake = FakeControllers()
    fake.after(1.0, stick=(1.0, 0.0))
    fake.focus = False
    fake.after(2.0, trigger=1.0, stick=(1.0, 0.0))
    assert fake.controllers.presses() == [KeyPress("stick_right", 1.0)]
    assert fake.controllers.stick() == (0.0, 0.0)


def test_a_menu_button_that_is_held_says_something_else_once() -> None:
    """A press is told as it ends; one that the system's menu took is none."""
    fake = FakeControllers()
    for seconds, far in ((1.0, 1.0), (1.9, 1.0), (2.0, 1.0), (3.5, 1.0), (4.0, 0.0), (5.0, 1.0)):
        fake.after(seconds, menu=far)
    assert fake.controllers.presses() == [KeyPress("menu_held", 2.0)]
    fake.focus = False
    fake.after(5.2)
    fake.focus = True
    fake.after(5.4, menu=0.0)
    assert fake.controllers.presses() == []


def test_every_known_controller_is_suggested_and_one_that_the_runtime_lacks_is_skipped() -> None:
    suggested = FakeControllers().suggested
    assert set(suggested) == {*PROFILES, "ext/eye_gaze_interaction"}
    assert suggested["ext/eye_gaze_interaction"] == {"gaze: /user/eyes_ext/input/gaze_ext/pose"}
    assert suggested["khr/simple_controller"] == {
        f"{action}: /user/hand/{hand}/input/{part}/click"
        for hand in ("left", "right")
        for action, part in (("trigger", "select"), ("menu", "menu"))
    }
    assert "stick: /user/hand/right/input/thumbstick" in suggested["oculus/touch_controller"]


def test_a_tremor_around_the_threshold_is_one_press() -> None:
    edges = Edges()
    assert [edges.pressed(far) for far in (0.59, 0.61, 0.59, 0.61, 0.41, 0.61, 0.39, 0.61)] == [
        False, True, False, False, False, False, False, True,
    ]  # fmt: skip
    assert direction((0.7, -0.7)) == "stick_right"  # a tie goes sideways


def test_without_pyopenxr_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xr", None)
    with pytest.raises(InputError, match=r'pip install "evenlight\[xr\]"'):
        openxr_library()


def test_without_glfw_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "glfw", None)
    with pytest.raises(
        InputError, match=r'mirror window needs the package glfw .*`pip install "evenlight\[xr\]"'
    ):
        glfw_library(egl=True)


def test_without_a_runtime_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XR_RUNTIME_JSON", "/nowhere/runtime.json")
    with pytest.raises(
        InputError, match=r"no OpenXR runtime answers.*monado-service.*simulated-headset needs none"
    ) as error:
        OpenXRRuntime(openxr_library())
    assert "\n" not in str(error.value)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
@pytest.mark.parametrize("egl", [True, False])
def test_without_a_display_one_line_says_so(monkeypatch: pytest.MonkeyPatch, egl: bool) -> None:
    pytest.importorskip("glfw")
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(InputError, match="no display for the operator's mirror window"):
        glfw_library(egl=egl)


@pytest.mark.parametrize(
    ("missing", "message"),
    [(openxr_runtime.OPENGL, "KHR_opengl_enable"), (openxr_runtime.TIMESPEC, "timespec")],
)
def test_a_runtime_without_what_is_needed_is_refused(missing: str, message: str) -> None:
    offered = {openxr_runtime.OPENGL, openxr_runtime.TIMESPEC, *openxr_runtime.CLOCKS.values()} - {missing}
    if sys.platform == "win32" and missing == openxr_runtime.TIMESPEC:
        offered -= set(openxr_runtime.CLOCKS.values())
    found = [xr.ExtensionProperties(name, 1) for name in offered]
    fake = FakeRuntime(enumerate_instance_extension_properties=lambda: found)
    with pytest.raises(InputError, match=message):
        OpenXRRuntime(fake.xr)


@pytest.mark.parametrize("gaze", [False, True])
def test_a_runtime_without_a_headset_is_told(gaze: bool) -> None:
    """Where the eyes look it is asked for a log only."""
    needed = [openxr_runtime.OPENGL, openxr_runtime.TIMESPEC, *openxr_runtime.CLOCKS.values()]
    offered, enabled = [*needed, openxr_runtime.GAZE], list[bytes]()

    def none_there(*_: Any) -> None:
        raise xr.exception.FormFactorUnavailableError

    closed: list[Any] = []
    fake = FakeRuntime(
        enumerate_instance_extension_properties=lambda: [xr.ExtensionProperties(name, 1) for name in offered],
        create_instance=lambda info: enabled.extend(info.enabled_extension_names) or "instance",
        get_instance_properties=lambda _: xr.InstanceProperties(xr.Version(1, 2, 3), "Fake"),
        get_system=none_there,
        destroy_instance=closed.append,
    )
    with pytest.raises(
        InstrumentError, match=r"Fake \(1.2.3\) has no headset \(XR_ERROR_FORM_FACTOR_UNAVAIL"
    ):
        OpenXRRuntime(fake.xr, gaze=gaze)
    assert closed == ["instance"]
    assert (openxr_runtime.GAZE.encode() in enabled) is gaze


@pytest.mark.parametrize(
    "function", ["get_instance_properties", "get_system", "get_system_properties", CLOCK]
)
def test_a_runtime_that_goes_away_while_it_is_asked_is_told_in_one_line(function: str) -> None:
    offered = [openxr_runtime.OPENGL, openxr_runtime.TIMESPEC, *openxr_runtime.CLOCKS.values()]

    def gone(*_: Any) -> None:
        raise xr.exception.InstanceLostError

    functions: dict[str, Callable[..., Any]] = {
        "get_instance_properties": lambda _: xr.InstanceProperties(xr.Version(1, 2, 3), "Fake"),
        "get_system": lambda *_: 1,
        "get_system_properties": lambda *_: None,
    }
    fake = FakeRuntime(
        enumerate_instance_extension_properties=lambda: [xr.ExtensionProperties(name, 1) for name in offered],
        create_instance=lambda _: ctypes.c_void_p(),
        destroy_instance=lambda _: None,
        **(functions | {function: gone}),
    )
    with pytest.raises(
        (InputError, InstrumentError), match=r"OpenXR runtime .*XR_ERROR_INSTANCE_LOST"
    ) as told:
        OpenXRRuntime(fake.xr).now()
    assert "\n" not in str(told.value)


def test_the_clock_is_the_systems_as_the_runtime_converts_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """1.5 s of the system's are 1.5e9 ns of the runtime's, and 7 s more."""

    def converted(_: Any, system: Any) -> ctypes.c_int64:
        return ctypes.c_int64((system.tv_sec + 7) * SECOND + system.tv_nsec)

    runtime = OpenXRRuntime.__new__(OpenXRRuntime)
    runtime.xr = FakeRuntime(**{CLOCK: converted}).xr
    runtime.instance = None
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(time, "clock_gettime_ns", lambda _: 3 * SECOND // 2)
    assert runtime.now() == pytest.approx(8.5)


def test_keys_are_named_by_what_is_printed_on_them() -> None:
    glfw = pytest.importorskip("glfw")
    printed = {10: "z", 11: "&", 12: ",", 13: "7", 14: None, 15: "ß"}  # as a layout has them, by codes
    window = MirrorWindow.__new__(MirrorWindow)
    window._glfw = SimpleNamespace(
        get_key_name=lambda _, code: printed.get(code),
        KEY_0=glfw.KEY_0, KEY_9=glfw.KEY_9, PRESS=glfw.PRESS, RELEASE=glfw.RELEASE,
        poll_events=lambda: None, set_window_should_close=lambda *_: None,
    )  # fmt: skip
    window._window, window._clock, window._pressed, window._held = None, lambda: 1.5, [], {}
    window._places = {getattr(glfw, f"KEY_{key}"): place for key, place in PLACES.items()}
    # A German keyboard's Z lies where an American one has Y; a French one prints & on the key of 1.
    keys = (glfw.KEY_Y, 10), (glfw.KEY_1, 11), (glfw.KEY_COMMA, 12), (glfw.KEY_KP_7, 13), (glfw.KEY_F3, 14)
    for key, code in (*keys, (glfw.KEY_MINUS, 15)):
        for action in (glfw.PRESS, glfw.REPEAT):
            window._take(None, key, code, action, 0)
    names = ["z", "1", "comma", "num_7", "f3", "ß"]
    assert window.pressed() == [KeyPress(name, 1.5) for name in names]
    assert window.held() == set(names)
    window._take(None, glfw.KEY_Y, 10, glfw.RELEASE, 0)
    assert window.held() == set(names[1:])


def test_a_rig_on_a_screen_has_no_headset_to_measure() -> None:
    rig = Rig(name="desk", display="laptop-lcd", viewing_distance=0.6, refresh_rate=60.0)
    with pytest.raises(InputError, match="shows on screen 0"):
        measure_headset(rig, 2)


def test_errors_of_the_graphics_library_are_told_in_one_line(
    command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A shader that does not compile: what a driver says of it has lines of its own."""

    def drawn(*_: object, **__: object) -> None:
        SimulatedHeadset((64, 64)).context().program(vertex_shader="#version 330\nvoid main() { x; }")

    monkeypatch.setattr(headset_facts, "open_headset", drawn)
    ended = command("measure", "headset", "--frames", 2, "--rig", "simulated-headset")
    assert ended.code == 1
    assert ended.err.startswith("evenlight: the graphics driver failed (")
    assert ended.err.count("\n") == 1
