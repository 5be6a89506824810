"""A headset at this computer's OpenXR runtime."""

from __future__ import annotations

import math
import time
from contextlib import ExitStack, closing
from importlib import metadata
from typing import TYPE_CHECKING

from evenlight.hardware.presentation.headset_link import HeadsetFacts, HeadsetFrame
from evenlight.hardware.presentation.mirror_window import MirrorWindow
from evenlight.hardware.presentation.openxr_actions import HANDS, Controllers
from evenlight.hardware.presentation.openxr_graphics import Swapchain
from evenlight.hardware.presentation.openxr_runtime import EGL, OpenXRRuntime, openxr_library
from evenlight.hardware.presentation.openxr_session import OpenXRSession
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError, KeyPress

if TYPE_CHECKING:
    import moderngl

FIRST_FRAMES = 10  # until a runtime has its pace
LONGEST_START = 30.0  # until the headset shows and tracks: it may have to be put on first [s]


class OpenXRLink(ContextDevice):
    """A headset, open: somebody may wear it now.

    Parameters
    ----------
    eye_size : (int, int), optional
        Width and height of each eye's picture, in place of what the runtime recommends [pixels].

    Raises
    ------
    InputError
        If pyopenxr, a runtime, glfw, a display or OpenGL are missing.
    InstrumentError
        If there is no headset, it does not track the head, or the runtime fails or goes away: here, and in
        all that is asked of it.
    """

    def __init__(self, eye_size: tuple[int, int] | None = None) -> None:
        self._name = "headset"
        with ExitStack() as opened:
            self._runtime = opened.enter_context(closing(OpenXRRuntime(openxr_library())))
            with self._runtime.talking():
                self._recommended = self._views()
                self._eye_size = eye_size or self._recommended
                self._require_tracking(self._runtime.system.tracking_properties.orientation_tracking)
                self.mirror = MirrorWindow(self._eye_size, self.now, egl=self._runtime.offers(EGL))
                opened.callback(self.mirror.close)
                self._session = opened.enter_context(closing(OpenXRSession(self._runtime)))
                width, height = self._eye_size
                self._size = (2 * width, height)
                self._swapchain = Swapchain(self._runtime, self._session.handle, self.context(), self._size)
                self._controllers = Controllers(self._runtime, self._session.handle)
            self._unseen: moderngl.Framebuffer | None = None
            self._facts = self._first_frames()
            self._opened = opened.pop_all()

    def facts(self) -> HeadsetFacts:
        """Return what the runtime says."""
        return self._facts

    def eye_size(self) -> tuple[int, int]:
        """Return width and height of the picture of one eye [pixels]."""
        return self._eye_size

    def context(self) -> moderngl.Context:
        """Return the graphics context, which is the mirror window's."""
        return self.mirror.context()

    def now(self) -> float:
        """Return the time on the runtime's clock [s]."""
        return self._runtime.now()

    def begin_frame(self) -> HeadsetFrame:
        """Wait until the next frame may be drawn, and return it."""
        self._require_open()
        with self._runtime.talking():
            self._frame = self._session.begin_frame()
            if self._session.running:
                self._controllers.sync()
        return self._frame

    def framebuffer(self) -> moderngl.Framebuffer:
        """Return what the frame is drawn to; a frame that is not visible goes to a picture of its own."""
        self._require_open()
        if self._frame.visible:
            with self._runtime.talking():
                return self._swapchain.acquired()
        if self._unseen is None:
            self._unseen = self.context().simple_framebuffer(self._size, 4)
        return self._unseen

    def end_frame(self) -> None:
        """Hand the frame to the runtime."""
        self._require_open()
        with self._runtime.talking():
            self._session.end_frame(self._swapchain, self._swapchain.release())

    def focused(self) -> bool:
        """Return whether the wearer sees this session and its controllers act on it."""
        return self._session.focused()

    def presses(self) -> list[KeyPress]:
        """Return what was pressed on controllers since the last call, in order."""
        return self._controllers.presses()

    def stick(self) -> tuple[float, float]:
        """Return how far a stick is pushed now."""
        return self._controllers.stick()

    def controllers(self) -> tuple[str, ...]:
        """Return what the runtime calls the controllers of the left and the right hand."""
        with self._runtime.talking():
            return tuple(self._controllers.names())

    def apparatus(self) -> dict[str, str]:
        """Return versions, graphics and controllers."""
        info = self.context().info
        names = zip(HANDS, self.controllers(), strict=True)
        return {
            **{name: metadata.version(name) for name in ("pyopenxr", "glfw", "moderngl")},
            "renderer": info["GL_RENDERER"],
            "opengl": info["GL_VERSION"],
            "graphics_binding": "EGL" if self._runtime.offers(EGL) else "the system's OpenGL",
            **{f"controller_{hand}": name for hand, name in names},
        }

    def close(self) -> None:
        """Let go of session, window and runtime; more than once does nothing."""
        if not self._closed:
            super().close()
            self._opened.close()

    def _views(self) -> tuple[int, int]:
        """Return the size that the runtime recommends for an eye's picture: the larger, if they differ."""
        xr = self._runtime.xr
        views = xr.enumerate_view_configuration_views(
            self._runtime.instance, self._runtime.system_id, xr.ViewConfigurationType.PRIMARY_STEREO
        )
        return (
            max(int(view.recommended_image_rect_width) for view in views),
            max(int(view.recommended_image_rect_height) for view in views),
        )

    def _require_tracking(self, known: object) -> None:
        if not known:
            raise InstrumentError(
                f"the headset of the OpenXR runtime {self._runtime.name} does not track the head: put it "
                "on, and check its cameras, base stations and the runtime's own set-up",
                Fault.NO_REPLY,
            )

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
                self._require_tracking(not self._session.running)
                raise InstrumentError(
                    f"the headset did not start within {LONGEST_START:.0f} s (its session is "
                    f"{self._session.state.name.lower()}): put it on, and close what else uses it",
                    Fault.NO_REPLY,
                )

    def _stated(self, frame: HeadsetFrame) -> HeadsetFacts:
        system = self._runtime.system
        with self._runtime.talking():
            rate, rates = self._session.refresh_rate()
        left, right = frame.eyes
        return HeadsetFacts(
            runtime=self._runtime.name,
            system=system.system_name.decode(),
            eye_size=self._recommended,
            fovs=(left.fov, right.fov),
            refresh_rate=rate,
            refresh_rates=rates,
            tracks_position=bool(system.tracking_properties.position_tracking),
            eye_distance=math.dist(left.pose.position, right.pose.position),
        )
