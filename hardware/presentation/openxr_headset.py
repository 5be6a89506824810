"""A headset at this computer's OpenXR runtime: its session's states, and the frames that it asks for."""

from __future__ import annotations

import ctypes
import math
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from importlib import metadata
from typing import TYPE_CHECKING, Any

from evenlight.hardware.presentation.headset_views import (
    EyeFov,
    EyePose,
    HeadsetFacts,
    HeadsetFrame,
    Pose,
    Size,
    Triangle,
    side_by_side,
)
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.hardware.presentation.mirror_window import MirrorWindow
from evenlight.hardware.presentation.openxr_actions import HANDS, Controllers
from evenlight.hardware.presentation.openxr_graphics import Swapchain, graphics_binding, hidden_area
from evenlight.hardware.presentation.openxr_runtime import (
    EGL,
    NANOSECOND,
    PRESENCE,
    REFRESH_RATES,
    OpenXRRuntime,
    openxr_library,
    quiet_terminal,
)
from evenlight.hardware.protocols import Fault, InstrumentError, KeyPress

if TYPE_CHECKING:
    import moderngl

FIRST_FRAMES = 10  # until a runtime has its pace
LONGEST_START = 30.0  # until the headset shows and tracks: it may have to be put on first [s]
IDLE_PERIOD = 1 / 60  # of frames that nobody sees, before the runtime says its own [s]
NOTHING = EyeFov(0.0, 0.0, 0.0, 0.0)  # is seen, as far as is known


class OpenXRHeadset(HeadsetWindow):
    """A headset, open: somebody may wear it now.

    Parameters
    ----------
    eye_size : (int, int), optional
        Width and height of each eye's picture, in place of what the runtime recommends [pixels]; then there
        are no focus views.
    gaze : bool, optional
        Whether it is asked where the eyes look, if the runtime offers that.

    Raises
    ------
    InputError
        If pyopenxr, a runtime, glfw, a display or OpenGL are missing.
    InstrumentError
        If there is no headset, it does not track the head, or the runtime fails or goes away: here, and in
        all that is asked of it.
    """

    mirror: MirrorWindow

    def __init__(self, eye_size: tuple[int, int] | None = None, *, gaze: bool = False) -> None:
        super().__init__()
        self._name = "headset"
        self._running = False  # between the runtime's READY and STOPPING
        self._worn, self._lost = True, ""
        self._period, self._latest = IDLE_PERIOD, 0.0  # and when the latest frame appears [s]
        self._due = 0  # display time of the frame that is open; 0 for none [ns]
        self._recentred_at: int | None = None  # when the runtime moves its origin [ns]
        self._head, self._views = Pose(), list[Any]()
        self._unseen: moderngl.Framebuffer | None = None
        self._facts: HeadsetFacts | None = None
        with ExitStack() as opened:
            self._runtime = opened.enter_context(closing(OpenXRRuntime(openxr_library(), gaze=gaze)))
            self._xr = self._runtime.xr
            self._state = self._xr.SessionState.IDLE
            with self._runtime.talking():
                self._kind = self._view_configuration(quad=eye_size is None)
                self._recommended = self._recommended_sizes()
                self._sizes = self._recommended if eye_size is None else (eye_size, eye_size)
                parts = side_by_side(self._sizes)
                self._eyes = tuple(EyePose(Pose(), NOTHING, part) for part in parts)
                self._require_tracking(self._runtime.system.tracking_properties.orientation_tracking)
                self.mirror = MirrorWindow(self._sizes[0], self.now, egl=self._runtime.offers(EGL))
                opened.callback(self.mirror.close)
                self._xr.afterwards = self.mirror.make_current
                self._session = self._new_session()
                opened.callback(self._end_session)
                self._space, self._head_space = (
                    self._xr.create_reference_space(self._session, self._xr.ReferenceSpaceCreateInfo(kind))
                    for kind in (self._xr.ReferenceSpaceType.LOCAL, self._xr.ReferenceSpaceType.VIEW)
                )
                whole = sum(width for width, _ in self._sizes), max(height for _, height in self._sizes)
                self._swapchain = Swapchain(self._runtime, self._session, self.context(), whole)
                self._controllers = Controllers(self._runtime, self._session)
            self._facts = self._first_frames()
            self._opened = opened.pop_all()

    def facts(self) -> HeadsetFacts:
        """Return what the runtime says of the headset."""
        assert self._facts is not None
        return self._facts

    def versions(self) -> dict[str, str]:
        """Return versions, graphics and controllers."""
        info = self.context().info
        with self._runtime.talking():
            names = self._controllers.names()
        return {
            **{name: metadata.version(name) for name in ("pyopenxr", "glfw", "moderngl")},
            "renderer": info["GL_RENDERER"],
            "opengl": info["GL_VERSION"],
            "eye_gaze": "asked for" if self._controllers.gaze else "not asked for, or not offered",
            "graphics_binding": "EGL" if self._runtime.offers(EGL) else "the system's OpenGL",
            **{f"controller_{hand}": name for hand, name in zip(HANDS, names, strict=True)},
        }

    def view_sizes(self) -> tuple[Size, ...]:
        """Return width and height of each view, as it is drawn [pixels]."""
        return self._sizes

    def context(self) -> moderngl.Context:
        """Return the graphics context, which is the mirror window's."""
        return self.mirror.context()

    def runtime_time(self) -> float:
        """Return the time on the runtime's clock [s]."""
        return self._runtime.now()

    def begin_frame(self) -> HeadsetFrame:
        """Wait for the next frame, and return it; while the session is idle one that is not visible."""
        self._require_open()
        with self._runtime.talking():
            self._take_events()
            if not self._running:
                return self._idle_frame()
            state = self._xr.wait_frame(self._session)
            with suppress(self._xr.exception.FrameDiscarded):  # the one before was not ended, and is gone
                self._xr.begin_frame(self._session)
            self._due = int(state.predicted_display_time)
            self._latest = self._due * NANOSECOND
            if state.predicted_display_period > 0:
                self._period = state.predicted_display_period * NANOSECOND
            tracked = self._locate()
            self._controllers.sync(self._latest)
            frame = self._framed(visible=bool(state.should_render), tracked=tracked)
            recentred = self._recentred_at is not None and self._due >= self._recentred_at
            self._recentred_at = None if recentred else self._recentred_at
            return replace(frame, recentred=recentred, gaze=self._gaze())

    def picture(self) -> moderngl.Framebuffer:
        """Return the picture of the frame; one that is not visible goes to a picture of its own."""
        self._require_open()
        if self._visible:
            with self._runtime.talking():
                return self._swapchain.acquired()
        if self._unseen is None:
            self._unseen = self.context().simple_framebuffer(self._swapchain.size, 4)
        return self._unseen

    def end_frame(self) -> None:
        """Hand the frame over: with the swapchain's picture if one was drawn, else with nothing."""
        self._require_open()
        with self._runtime.talking():
            drawn = self._swapchain.release()
            if not self._due:
                return
            xr, due, self._due = self._xr, self._due, 0
            layers = []
            if drawn and self._views:
                views = [
                    xr.CompositionLayerProjectionView(
                        pose=view.pose, fov=view.fov, sub_image=self._swapchain.part(eye.part)
                    )
                    for eye, view in zip(self._eyes, self._views, strict=True)
                ]
                layers = [ctypes.pointer(xr.CompositionLayerProjection(space=self._space, views=views))]
            info = xr.FrameEndInfo(
                display_time=due, environment_blend_mode=xr.EnvironmentBlendMode.OPAQUE, layers=layers
            )
            xr.end_frame(self._session, info)

    def focused(self) -> bool:
        """Return whether the session is in front, and somebody wears the headset as far as that is known."""
        return self._worn and self._state == self._xr.SessionState.FOCUSED

    def controller_presses(self) -> list[KeyPress]:
        """Return what was pressed on controllers since the last call, in order."""
        return self._controllers.presses()

    def stick(self) -> tuple[float, float]:
        """Return how far a stick is pushed now."""
        return self._controllers.stick()

    def close(self) -> None:
        """Let go of session, window and runtime; more than once does nothing."""
        if not self._closed:
            super().close()
            self._opened.close()

    def _view_configuration(self, quad: bool) -> Any:
        """Return which views are drawn: with those of the focus, if the runtime has them and they may be."""
        xr, runtime = self._xr, self._runtime
        kinds = xr.ViewConfigurationType
        offered = map(int, xr.enumerate_view_configurations(runtime.instance, runtime.system_id))
        focused = kinds.PRIMARY_STEREO_WITH_FOVEATED_INSET
        return focused if quad and focused.value in offered else kinds.PRIMARY_STEREO

    def _recommended_sizes(self) -> tuple[Size, ...]:
        """Return the sizes that the runtime recommends for the views; left and right have the larger one."""
        xr, runtime = self._xr, self._runtime
        said = xr.enumerate_view_configuration_views(runtime.instance, runtime.system_id, self._kind)
        sizes: list[Size] = []
        for pair in zip(said[::2], said[1::2], strict=True):
            width = max(int(view.recommended_image_rect_width) for view in pair)
            height = max(int(view.recommended_image_rect_height) for view in pair)
            if min(width, height) < 1:
                raise self._implausible(f"recommends pictures of {width} x {height} pixels")
            sizes += [(width, height)] * 2
        return tuple(sizes)

    def _implausible(self, words: str) -> InstrumentError:
        return InstrumentError(
            f"the OpenXR runtime {self._runtime.name} {words}: start it again", Fault.IMPLAUSIBLE
        )

    def _require_tracking(self, known: object) -> None:
        if not known:
            raise InstrumentError(
                f"the headset of the OpenXR runtime {self._runtime.name} does not track the head: put it "
                "on, and check its cameras, base stations and the runtime's own set-up",
                Fault.NO_REPLY,
            )

    def _new_session(self) -> Any:
        """Return a session of the OpenGL context that is current."""
        xr, runtime = self._xr, self._runtime
        # a runtime insists on being asked
        xr.get_opengl_graphics_requirements_khr(runtime.instance, runtime.system_id)
        binding = graphics_binding(runtime.offers(EGL))
        info = xr.SessionCreateInfo(
            system_id=runtime.system_id, next=ctypes.cast(ctypes.pointer(binding), ctypes.c_void_p)
        )
        return xr.create_session(runtime.instance, info)

    def _end_session(self) -> None:
        """End the session; a runtime that went away is not waited for."""
        with quiet_terminal(), suppress(self._xr.exception.XrException):
            self._xr.destroy_session(self._session)

    def _first_frames(self) -> HeadsetFacts:
        """Show empty frames until the headset is on and tracks, and return what the runtime says."""
        deadline, tracked = time.monotonic() + LONGEST_START, 0
        while True:
            frame = self.begin_frame()
            self.end_frame()
            tracked += frame.tracked
            if tracked == FIRST_FRAMES:
                return self._stated(frame)
            if time.monotonic() > deadline:
                self._require_tracking(not self._running)
                raise InstrumentError(
                    f"the headset did not start within {LONGEST_START:.0f} s (its session is "
                    f"{self._state.name.lower()}): put it on, and close what else uses it",
                    Fault.NO_REPLY,
                )

    def _stated(self, frame: HeadsetFrame) -> HeadsetFacts:
        """Return what the runtime says; a resumed session finds the same refresh rate."""
        xr, system, (left, right, *_) = self._xr, self._runtime.system, frame.eyes
        rate, rates = 0.0, tuple[float, ...]()
        fovs = tuple(eye.fov for eye in frame.eyes)
        for fov in fovs:
            wide, high = math.degrees(fov.right - fov.left), math.degrees(fov.up - fov.down)
            if not (0 < wide < 180 and 0 < high < 180):
                raise self._implausible(f"says that an eye sees {wide:.4g} by {high:.4g} degrees")
        with self._runtime.talking():
            hidden = self._hidden()
            if self._runtime.offers(REFRESH_RATES):
                rate = getattr(xr.get_display_refresh_rate_fb(self._session), "value", 0.0)
                rates = tuple(float(one) for one in xr.enumerate_display_refresh_rates_fb(self._session))
        return HeadsetFacts(
            runtime=self._runtime.name,
            system=system.system_name.decode(errors="replace"),
            eye_size=self._recommended[0],
            fovs=fovs,
            refresh_rate=round(rate or 1 / self._period, 2),
            refresh_rates=rates,
            tracks_position=bool(system.tracking_properties.position_tracking),
            eye_distance=math.dist(left.pose.position, right.pose.position),
            hidden=hidden,
            focus_size=self._recommended[2] if len(fovs) > 2 else None,
        )

    def _hidden(self) -> tuple[tuple[Triangle, ...], ...]:
        """Return what the lenses never show of the wide views."""
        return tuple(hidden_area(self._runtime, self._session, self._kind, eye) for eye in (0, 1))

    def _idle_frame(self) -> HeadsetFrame:
        """Return a frame that nobody sees, a refresh after the latest one."""
        time.sleep(max(self._latest - self._runtime.now(), 0.0))
        self._latest = self._runtime.now() + self._period
        return self._framed(visible=False, tracked=False)

    def _framed(self, *, visible: bool, tracked: bool) -> HeadsetFrame:
        self._visible = visible
        return HeadsetFrame(self._latest, self._period, self._eyes, self._head, visible, tracked)

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
            elif event.type == types.EVENT_DATA_REFERENCE_SPACE_CHANGE_PENDING:
                change = _as(event, xr.EventDataReferenceSpaceChangePending)
                if change.reference_space_type == xr.ReferenceSpaceType.LOCAL:
                    self._recentred_at = int(change.change_time)
            elif event.type == types.EVENT_DATA_VISIBILITY_MASK_CHANGED_KHR and self._facts is not None:
                fovs = tuple(eye.fov for eye in self._eyes)
                self._facts = replace(self._facts, fovs=fovs, hidden=self._hidden())
            elif event.type == types.EVENT_DATA_INSTANCE_LOSS_PENDING:
                self._lost = "the OpenXR runtime is about to stop"
            elif self._runtime.offers(PRESENCE) and event.type == types.EVENT_DATA_USER_PRESENCE_CHANGED_EXT:
                self._worn = bool(_as(event, xr.EventDataUserPresenceChangedEXT).is_user_present)
        if self._lost:
            raise InstrumentError(self._lost, Fault.DISCONNECTED)

    def _follow(self, state: Any) -> None:
        states = self._xr.SessionState
        self._state = state
        if state == states.READY:
            self._xr.begin_session(self._session, self._xr.SessionBeginInfo(self._kind))
            self._running = True
        elif state == states.STOPPING:
            self._running = False
            self._xr.end_session(self._session)
        elif state == states.LOSS_PENDING:
            self._lost = "the OpenXR runtime lost the session, as when a headset is unplugged"
        elif state == states.EXITING:
            self._lost = "the session was ended in the headset, or by its runtime"

    def _locate(self) -> bool:
        """Note where head and eyes will be when the frame appears, and return whether the head is tracked.

        What is not known, or what the runtime fails to say, stays as it was.
        """
        xr = self._xr
        info = xr.ViewLocateInfo(self._kind, self._due, self._space)
        try:
            state, views = xr.locate_views(self._session, info)
            head = _pose(xr.locate_space(self._head_space, self._space, self._due).pose)
        except xr.exception.XrException:  # that it went away, the next frame says
            return False
        flags, bits = xr.ViewStateFlags(state.view_state_flags), xr.ViewStateFlags
        known = bits.ORIENTATION_VALID_BIT | bits.POSITION_VALID_BIT in flags
        if not known or not _is_pose(head):
            return False
        self._views, self._head = views, head
        self._eyes = tuple(
            EyePose(_pose(view.pose), _fov(view.fov), eye.part)
            for eye, view in zip(self._eyes, views, strict=True)
        )
        return bits.ORIENTATION_TRACKED_BIT in flags

    def _gaze(self) -> Pose | None:
        """Return where the eyes look, as the runtime knows it for the frame; None while it does not."""
        xr, flags = self._xr, self._xr.SpaceLocationFlags
        if self._controllers.gaze is None:
            return None
        with suppress(xr.exception.XrException):
            found = xr.locate_space(self._controllers.gaze, self._space, self._due)
            tracked = flags.ORIENTATION_TRACKED_BIT in flags(found.location_flags)
            return _pose(found.pose) if tracked and _is_pose(_pose(found.pose)) else None
        return None


def _as(event: Any, kind: Any) -> Any:
    return ctypes.cast(ctypes.byref(event), ctypes.POINTER(kind)).contents


def _is_pose(pose: Pose) -> bool:
    """Return whether the numbers that a runtime says are a place and a rotation."""
    return math.isfinite(math.hypot(*pose.position)) and 0.5 < math.hypot(*pose.orientation) < 2.0


def _pose(pose: Any) -> Pose:
    at, turned = pose.position, pose.orientation
    return Pose((at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w))


def _fov(fov: Any) -> EyeFov:
    return EyeFov(fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down)
