"""A film beside a runtime that does what runtimes may do, or should not: it is shown, or one line says why.

Functions of pyopenxr are changed between Evenlight and Monado.
"""

import ctypes
import math
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from types import FunctionType
from typing import Any

import numpy as np
import pytest
import xr
from played_in_headset import of_squares, watch

from evenlight.experiments.playback.player import Pass, Player, open_devices
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.eyes.surfaces import FlatScreen

RIG = replace(load_rig("headset")[0], full_screen=True)
SIXTY = math.radians(60)
Change = Callable[..., Any]


@pytest.fixture
def changes(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, Change], None]:
    """Change a function of pyopenxr: the change is given the plain one and its arguments."""

    def changing(name: str, change: Change) -> None:
        plain = getattr(xr, name)

        def called(*arguments: Any, **options: Any) -> Any:
            return change(plain, *arguments, **options)

        monkeypatch.setattr(xr, name, called)

    return changing


def played() -> Pass:
    """The film as it is shown, in the middle of the left eye's picture; its darkest square has code 54."""
    with (
        pytest.MonkeyPatch.context() as patched,
        open_devices(RIG, load_display("varjo-xr3"), simulated=True, any_rate=False, gaze=True) as devices,
    ):
        given = watch(patched)
        player = Player(devices, of_squares(FlatScreen(60.0), step=0.2), lambda _: None)
        assert player.play()
    (one,) = player.passes
    assert len(one.heads) == len(one.shown.flip_times) > 5
    height, width = given[0].codes.shape[0], given[0].codes.shape[1] // 2
    part = np.s_[height * 4 // 10 : height * 6 // 10 + 1, width * 4 // 10 : width * 6 // 10 + 1]
    assert min(refresh.codes[part].min() for refresh in given[-len(one.heads) :]) > 40
    return one


def test_no_graphics_context_is_current_after_any_call(changes: Callable[[str, Change], None]) -> None:
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetCurrentDisplay.restype = ctypes.c_void_p

    def taken(plain: Change, *arguments: Any, **options: Any) -> Any:
        try:
            return plain(*arguments, **options)
        finally:
            egl.eglMakeCurrent(ctypes.c_void_p(egl.eglGetCurrentDisplay()), None, None, None)

    for name in dir(xr):
        if isinstance(getattr(xr, name), FunctionType):
            changes(name, taken)
    played()


def test_the_axes_begin_elsewhere(changes: Callable[[str, Change], None]) -> None:
    def created(plain: Change, session: Any, info: Any) -> Any:
        if info.reference_space_type == xr.ReferenceSpaceType.LOCAL:
            turned = xr.Quaternionf(0.0, math.sin(SIXTY), 0.0, math.cos(SIXTY))
            info.pose_in_reference_space = xr.Posef(turned, xr.Vector3f(0.8, -0.45, 0.6))
        return plain(session, info)

    changes("create_reference_space", created)
    assert max(math.hypot(*head.head.position) for head in played().heads) < 0.3  # it sways


def test_the_axes_move_and_another_program_comes_in_front(changes: Callable[[str, Change], None]) -> None:
    kinds, states, polled = xr.ReferenceSpaceType, xr.SessionState, count()
    coming = [
        xr.EventDataSessionStateChanged(state=states.VISIBLE),
        xr.EventDataSessionStateChanged(state=states.FOCUSED),
        xr.EventDataReferenceSpaceChangePending(reference_space_type=kinds.LOCAL),
    ]

    def poll(plain: Change, *arguments: Any) -> Any:
        at = next(polled) - 25  # the first frames poll twice where there is an event
        if 0 <= at < 12 and at % 4 == 0:
            return coming[at // 4]
        return plain(*arguments)

    changes("poll_event", poll)
    heads = played().heads
    assert [head.focused for head in heads].count(False) >= 1
    assert heads[-1].focused
    assert [head.recentred for head in heads].count(True) == 1


def test_it_knows_where_the_eyes_look(changes: Callable[[str, Change], None]) -> None:
    """Monado offers the extension, but its headset has no eye tracker: here eyes look up by 30 degrees."""
    eyes: list[Any] = []

    def created(plain: Change, session: Any, info: Any) -> Any:
        eyes.append(plain(session, info))
        return eyes[-1]

    def located(plain: Change, space: Any, *rest: Any) -> Any:
        found = plain(space, *rest)
        if space in eyes:
            up = xr.Quaternionf(math.sin(math.radians(15)), 0.0, 0.0, math.cos(math.radians(15)))
            return xr.SpaceLocation(xr.SpaceLocationFlags(15), xr.Posef(up))
        return found

    assert {head.gaze for head in played().heads} == {None}
    changes("create_action_space", created)
    changes("locate_space", located)
    for head in played().heads:
        assert head.gaze[1] == pytest.approx(0.5, abs=1e-6)
        assert math.hypot(*head.gaze) == pytest.approx(1.0)


def test_it_runs_at_half_rate(changes: Callable[[str, Change], None]) -> None:
    """Every other frame is somebody else's."""

    def wait(plain: Change, session: Any) -> Any:
        state, mode = plain(session), xr.EnvironmentBlendMode.OPAQUE
        xr.begin_frame(session)
        xr.end_frame(session, xr.FrameEndInfo(state.predicted_display_time, mode, layers=[]))
        return plain(session)

    changes("wait_frame", wait)
    assert min(head.late for head in played().heads[1:]) >= 1


@pytest.mark.parametrize("size", [(321, 241), (1, 1)])
def test_it_recommends_odd_sizes(changes: Callable[[str, Change], None], size: tuple[int, int]) -> None:
    def views(plain: Change, *arguments: Any) -> Any:
        found = plain(*arguments)
        for view in found:
            view.recommended_image_rect_width, view.recommended_image_rect_height = size
        return found

    changes("enumerate_view_configuration_views", views)
    played()


@pytest.mark.parametrize("name", [
    "create_session", "create_swapchain", "enumerate_swapchain_images", "attach_session_action_sets",
    "begin_session", "poll_event", "wait_frame", "begin_frame", "sync_actions", "acquire_swapchain_image",
    "wait_swapchain_image", "release_swapchain_image", "end_frame",
])  # fmt: skip
def test_what_fails_once_is_told_in_one_line(changes: Callable[[str, Change], None], name: str) -> None:
    calls, at = count(1), 3 if name.endswith(("event", "frame", "actions", "_image")) else 1

    def failing(plain: Change, *arguments: Any, **options: Any) -> Any:
        if next(calls) == at:
            raise xr.exception.RuntimeFailureError
        return plain(*arguments, **options)

    changes(name, failing)
    with pytest.raises(InstrumentError, match="XR_ERROR_RUNTIME_FAILURE") as told:
        played()
    assert "\n" not in str(told.value)
