"""What is asked of OpenXR's library and of the mirror's: what is missing or refused, controllers, keys."""

import ctypes
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from openxr_stand_in import SECOND, FakeRuntime, xr

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware import headset_facts
from evenlight.hardware.headset_facts import measure_headset
from evenlight.hardware.presentation import openxr_runtime
from evenlight.hardware.presentation.headset_views import SRGB8_ALPHA8
from evenlight.hardware.presentation.mirror_window import PLACES, MirrorWindow, glfw_library
from evenlight.hardware.presentation.openxr_actions import PROFILES, Controllers, Edges, direction
from evenlight.hardware.presentation.openxr_graphics import Swapchain
from evenlight.hardware.presentation.openxr_runtime import Library, OpenXRRuntime, openxr_library
from evenlight.hardware.protocols import InstrumentError, KeyPress
from evenlight.hardware.simulated.headset import SimulatedHeadset

CLOCK = "convert_timespec_time_to_time_khr"  # on Linux


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


@pytest.mark.parametrize(("formats", "width", "message"), [
    ([0x8058, 0x881A, 0x1234], 640, "SRGB8_ALPHA8: choose"),
    ([SRGB8_ALPHA8], 5000, "5000 x 240 pixels, and the runtime takes 4096 x 4096"),
])  # fmt: skip
def test_codes_that_would_be_encoded_twice_and_pictures_too_large_are_refused(
    formats: list[int], width: int, message: str
) -> None:
    runtime: Any = FakeRuntime(enumerate_swapchain_formats=lambda _: formats)
    with pytest.raises(InstrumentError, match=message):
        Swapchain(runtime, None, None, (width, 240))  # type: ignore[arg-type] # refused before it draws


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
