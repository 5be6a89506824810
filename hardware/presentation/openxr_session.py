"""A session at an OpenXR runtime: its states, and the frames that it asks for."""

from __future__ import annotations

import ctypes
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from evenlight.hardware.presentation.headset_link import EyeFov, EyePose, HeadsetFrame, Pose
from evenlight.hardware.presentation.openxr_graphics import graphics_binding
from evenlight.hardware.presentation.openxr_runtime import (
    EGL,
    NANOSECOND,
    PRESENCE,
    REFRESH_RATES,
    quiet_terminal,
)
from evenlight.hardware.protocols import Fault, InstrumentError

if TYPE_CHECKING:
    from evenlight.hardware.presentation.openxr_graphics import Swapchain
    from evenlight.hardware.presentation.openxr_runtime import OpenXRRuntime

IDLE_PERIOD = 1 / 60  # of frames that nobody sees, before the runtime says its own [s]
NOWHERE = EyePose(Pose(), EyeFov(0.0, 0.0, 0.0, 0.0))


class OpenXRSession:
    """A session, begun and ended as the runtime says.

    Parameters
    ----------
    runtime : OpenXRRuntime
        The runtime; an OpenGL context is current, and stays so.

    Raises
    ------
    InstrumentError
        If the runtime does not take the context.
    """

    def __init__(self, runtime: OpenXRRuntime) -> None:
        self._runtime, self._xr, xr = runtime, runtime.xr, runtime.xr
        xr.get_opengl_graphics_requirements_khr(
            runtime.instance, runtime.system_id
        )  # a runtime insists on it
        binding = graphics_binding(runtime.offers(EGL))
        self.handle = xr.create_session(
            runtime.instance,
            xr.SessionCreateInfo(
                system_id=runtime.system_id, next=ctypes.cast(ctypes.pointer(binding), ctypes.c_void_p)
            ),
        )
        self._space = self._reference_space(xr.ReferenceSpaceType.LOCAL)
        self._head_space = self._reference_space(xr.ReferenceSpaceType.VIEW)
        self.state = xr.SessionState.IDLE
        self.running = False
        self._worn, self._lost = True, ""
        self._period, self._last = IDLE_PERIOD, 0.0
        self._due = 0  # display time of the frame that is open; 0 for none [ns]
        self._eyes, self._head = (NOWHERE, NOWHERE), Pose()
        self._views: Any = ()
        self._tracked = False

    def begin_frame(self) -> HeadsetFrame:
        """Wait for the next frame, and return it; while the session is idle one that is not visible."""
        xr = self._xr
        self._take_events()
        if not self.running:
            return self._idle_frame()
        state = xr.wait_frame(self.handle)
        with suppress(xr.exception.FrameDiscarded):  # the one before was not ended, and is gone
            xr.begin_frame(self.handle)
        self._due, self._last = int(state.predicted_display_time), state.predicted_display_time * NANOSECOND
        if state.predicted_display_period > 0:
            self._period = state.predicted_display_period * NANOSECOND
        self._locate(self._due)
        return HeadsetFrame(
            self._last, self._period, self._eyes, self._head, bool(state.should_render), self._tracked
        )

    def end_frame(self, swapchain: Swapchain, drawn: bool) -> None:
        """Hand the frame over: with the swapchain's picture if one was drawn, else with nothing."""
        if not self._due:
            return
        xr = self._xr
        due, self._due = self._due, 0
        layers = []
        if drawn and len(self._views) == 2:
            views = [
                xr.CompositionLayerProjectionView(pose=view.pose, fov=view.fov, sub_image=swapchain.half(eye))
                for eye, view in enumerate(self._views)
            ]
            layers = [ctypes.pointer(xr.CompositionLayerProjection(space=self._space, views=views))]
        info = xr.FrameEndInfo(
            display_time=due, environment_blend_mode=xr.EnvironmentBlendMode.OPAQUE, layers=layers
        )
        xr.end_frame(self.handle, info)

    def focused(self) -> bool:
        """Return whether the session is in front, and somebody wears the headset as far as that is known."""
        return self._worn and self.state == self._xr.SessionState.FOCUSED

    def refresh_rate(self) -> tuple[float, tuple[float, ...]]:
        """Return the refresh rate and those that can be chosen; none if the runtime does not say [Hz]."""
        rate, rates = 0.0, tuple[float, ...]()
        if self._runtime.offers(REFRESH_RATES):
            rate = getattr(self._xr.get_display_refresh_rate_fb(self.handle), "value", 0.0)
            rates = tuple(float(one) for one in self._xr.enumerate_display_refresh_rates_fb(self.handle))
        return round(rate or 1 / self._period, 2), rates  # a resumed session finds the same

    def close(self) -> None:
        """End the session; a runtime that went away is not waited for."""
        handle, self.handle = self.handle, None
        if handle is not None:
            with quiet_terminal(), suppress(self._xr.exception.XrException):
                self._xr.destroy_session(handle)

    def _reference_space(self, kind: Any) -> Any:
        pose = self._xr.Posef()
        pose.orientation.w = 1.0
        info = self._xr.ReferenceSpaceCreateInfo(reference_space_type=kind, pose_in_reference_space=pose)
        return self._xr.create_reference_space(self.handle, info)

    def _idle_frame(self) -> HeadsetFrame:
        """Return a frame that nobody sees, a refresh after the last one."""
        time.sleep(max(self._last + self._period - self._runtime.now(), 0.0))
        self._last = self._runtime.now()
        return HeadsetFrame(self._last + self._period, self._period, self._eyes, self._head, False, False)

    def _take_events(self) -> None:
        """Follow what the runtime says until now.

        Raises
        ------
        InstrumentError
            If it ends the session.
        """
        xr, types = self._xr, self._xr.StructureType
        while True:
            try:
                event = xr.poll_event(self._runtime.instance)
            except xr.exception.EventUnavailable:
                break
            if event.type == types.EVENT_DATA_SESSION_STATE_CHANGED:
                self._follow(xr.SessionState(_as(event, xr.EventDataSessionStateChanged).state))
            elif event.type == types.EVENT_DATA_INSTANCE_LOSS_PENDING:
                self._lost = "the OpenXR runtime is about to stop"
            elif self._runtime.offers(PRESENCE) and event.type == types.EVENT_DATA_USER_PRESENCE_CHANGED_EXT:
                self._worn = bool(_as(event, xr.EventDataUserPresenceChangedEXT).is_user_present)
        if self._lost:
            raise InstrumentError(self._lost, Fault.DISCONNECTED)

    def _follow(self, state: Any) -> None:
        states = self._xr.SessionState
        self.state = state
        if state == states.READY:
            self._xr.begin_session(
                self.handle, self._xr.SessionBeginInfo(self._xr.ViewConfigurationType.PRIMARY_STEREO)
            )
            self.running = True
        elif state == states.STOPPING:
            self.running = False
            self._xr.end_session(self.handle)
        elif state == states.LOSS_PENDING:
            self._lost = "the OpenXR runtime lost the session, as when a headset is unplugged"
        elif state == states.EXITING:
            self._lost = "the session was ended in the headset, or by its runtime"

    def _locate(self, when: int) -> None:
        """Note where head and eyes will be at a time [ns]; what is not known stays as it was."""
        xr = self._xr
        info = xr.ViewLocateInfo(xr.ViewConfigurationType.PRIMARY_STEREO, when, self._space)
        state, views = xr.locate_views(self.handle, info)
        flags, bits = xr.ViewStateFlags(state.view_state_flags), xr.ViewStateFlags
        self._tracked = bits.ORIENTATION_TRACKED_BIT in flags and bits.POSITION_VALID_BIT in flags
        if bits.ORIENTATION_VALID_BIT | bits.POSITION_VALID_BIT not in flags:
            return
        self._views = views
        left, right = (EyePose(_pose(view.pose), _fov(view.fov)) for view in views)
        self._eyes = (left, right)
        self._head = _pose(xr.locate_space(self._head_space, self._space, when).pose)


def _as(event: Any, kind: Any) -> Any:
    return ctypes.cast(ctypes.byref(event), ctypes.POINTER(kind)).contents


def _pose(pose: Any) -> Pose:
    at, turned = pose.position, pose.orientation
    return Pose((at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w))


def _fov(fov: Any) -> EyeFov:
    return EyeFov(fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down)
