"""An OpenXR runtime and a session that say what a test has them say, in place of a runtime."""

import ctypes
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from evenlight.hardware.presentation import openxr_headset, openxr_runtime
from evenlight.hardware.presentation.openxr_actions import HANDS
from evenlight.hardware.presentation.openxr_headset import OpenXRHeadset
from evenlight.hardware.presentation.openxr_runtime import OpenXRRuntime

xr: Any = pytest.importorskip("xr")
SECOND = 1_000_000_000  # [ns]
PERIOD = SECOND // 50
KIND = xr.ViewConfigurationType
FOCUS = (-0.25, 0.2, 0.22, -0.22)  # edges of the focus views [rad]


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
        info = {"GL_RENDERER": "none", "GL_VERSION": "none"}
        return SimpleNamespace(simple_framebuffer=lambda size, _: f"a picture of its own, {size}", info=info)

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

    def part(self, part: tuple[int, int, int, int]) -> Any:
        rectangle = xr.Rect2Di(xr.Offset2Di(*part[:2]), xr.Extent2Di(*part[2:]))
        return xr.SwapchainSubImage(image_rect=rectangle)


class FakeSession:
    """A headset whose session's events, frames and flags a test gives; open after its ten first frames."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, eye_size: tuple[int, int] | None = None, **runtime: Any
    ) -> None:
        self.calls: list[str] = []
        self.layers: list[int] = []
        self.kinds: list[int] = []  # of views that were asked for
        self.places: list[tuple[int, ...]] = []  # of the views in the picture of the frame before
        self.more_kinds = runtime.pop("more_kinds", ())
        self.slept: list[float] = []
        self.render, self.flags, self.waited = True, 15, 0
        self.turned, self.period, self.size = 1.0, runtime.pop("period", PERIOD), runtime.pop("size", 320)
        hidden_area = runtime.pop("hidden_area", xr.PFN_xrGetVisibilityMaskKHR(lambda *_: -8))
        self.edges = runtime.pop("edges", (-0.8, 0.7, 0.75, -0.75))
        noted = {name: self._noting(name) for name in ("begin_session", "end_session", "begin_frame")}
        self.runtime = FakeRuntime(
            get_opengl_graphics_requirements_khr=lambda *_: None,
            enumerate_view_configurations=lambda *_: [KIND.PRIMARY_STEREO.value, *self.more_kinds],
            enumerate_view_configuration_views=lambda *asked: [
                xr.ViewConfigurationView(*size) for size in self._sizes(asked[-1])
            ],
            create_session=lambda *_: xr.Session(),
            destroy_session=lambda _: None,
            create_reference_space=lambda *_: xr.Space(),
            get_display_refresh_rate_fb=lambda _: ctypes.c_float(50.0),
            enumerate_display_refresh_rates_fb=lambda _: [50.0, 75.0],
            poll_event=self._poll,
            wait_frame=self._wait,
            get_instance_proc_addr=lambda *_: hidden_area,
            end_frame=self._end,
            locate_views=lambda _, info: (
                xr.ViewState(xr.ViewStateFlags(self.flags)),
                [
                    xr.View(self._pose(x), xr.Fovf(*edges))
                    for edges in (self.edges, FOCUS)[: len(self._sizes(info.view_configuration_type)) // 2]
                    for x in (-0.03, 0.03)
                ],
            ),
            locate_space=lambda *_: xr.SpaceLocation(xr.SpaceLocationFlags(self.flags), self._pose(0.0)),
            **noted,
        )
        self.runtime.__dict__.update(runtime)
        self.controllers = controllers = SimpleNamespace(sync=lambda _: None, gaze=None, names=lambda: HANDS)
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
        self.headset = OpenXRHeadset(eye_size)
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

    def _end(self, _: Any, info: Any) -> None:
        self.layers.append(info.layer_count)
        self.places = []
        if info.layer_count:
            layer = ctypes.cast(info.layers[0], ctypes.POINTER(xr.CompositionLayerProjection)).contents
            for view in layer.views[: layer.view_count]:
                at = view.sub_image.image_rect
                self.places.append((at.offset.x, at.offset.y, at.extent.width, at.extent.height))

    def _sizes(self, kind: Any) -> list[tuple[int, int, int]]:
        """Recommended and largest width, and recommended height, of each view."""
        self.kinds.append(kind.value)
        wide = 2 * [(self.size, 0, 240)]
        return wide if kind == KIND.PRIMARY_STEREO else [*wide, (100, 0, 90), (104, 0, 88)]

    def _pose(self, x: float) -> Any:
        return xr.Posef(xr.Quaternionf(0.0, 0.0, 0.0, self.turned), xr.Vector3f(x, 0.0, 0.0))
