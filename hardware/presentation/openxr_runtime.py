"""The OpenXR runtime of this computer and its headset: found, or one line that says what is missing.

Everything of pyopenxr is imported here, where a headset is asked for.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FunctionType
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.hardware.protocols import Fault, InstrumentError

INSTALL = 'install it with `pip install "evenlight[xr]"`, in a checkout with `pip install ".[xr]"`'
NANOSECOND = 1e-9  # OpenXR's times are whole nanoseconds [s]
CLOCKS = {"win32": "XR_KHR_win32_convert_performance_counter_time"}
TIMESPEC = "XR_KHR_convert_timespec_time"  # the clock of other systems
REFRESH_RATES = "XR_FB_display_refresh_rate"
PRESENCE = "XR_EXT_user_presence"
OPENGL, EGL = "XR_KHR_opengl_enable", "XR_MNDX_egl_enable"
HIDDEN_AREA = "XR_KHR_visibility_mask"
GAZE = "XR_EXT_eye_gaze_interaction"
VARJO_CONTROLLER = "XR_VARJO_xr4_controller_interaction"
QUAD_VIEWS = "XR_VARJO_quad_views"  # of OpenXR 1.0; in 1.1 it is part of the specification
OPTIONAL = (REFRESH_RATES, PRESENCE, EGL, VARJO_CONTROLLER, HIDDEN_AREA, GAZE, QUAD_VIEWS)


def openxr_library() -> Any:
    """Return pyopenxr.

    Raises
    ------
    InputError
        If it is not installed, or cannot be loaded.
    """
    os.environ.setdefault("XR_LOADER_DEBUG", "none")  # else its loader writes to the terminal besides
    try:
        import xr
    except ModuleNotFoundError as error:
        raise InputError(f"a headset needs the package pyopenxr (no {error.name}): {INSTALL}") from None
    except (ImportError, OSError, AttributeError) as error:
        raise InputError(f"pyopenxr cannot be loaded on this computer: {error}") from None
    return xr


def one_line(error: Any) -> str:
    """Return what an error says, as the end of a sentence; of OpenXR its name in the specification.

    >>> one_line(ValueError("No such runtime.  Sorry."))
    'No such runtime. Sorry'
    """
    result = error.get_result_enum() if hasattr(error, "get_result_enum") else None
    said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return said if result is None else f"XR_{result.name}"


@contextmanager
def quiet_terminal() -> Iterator[None]:
    """Keep what a runtime writes to the terminal from it, unless XR_LOADER_DEBUG asks for more."""
    if os.environ.get("XR_LOADER_DEBUG", "none") != "none":
        yield
        return
    sys.stderr.flush()
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


class Library:
    """pyopenxr, after whose functions the graphics context is current again, which a runtime may take away.

    Parameters
    ----------
    xr : module
        pyopenxr, of `openxr_library`.
    """

    def __init__(self, xr: Any) -> None:
        self._xr = xr
        self.afterwards: Callable[[], object] = bool  # does nothing, until there is a context

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._xr, name)
        if not isinstance(found, FunctionType):
            return found

        def called(*arguments: Any, **options: Any) -> Any:
            try:
                return found(*arguments, **options)
            finally:
                self.afterwards()

        setattr(self, name, called)
        return called


class OpenXRRuntime:
    """A runtime that answers, with a headset.

    Parameters
    ----------
    xr : module
        pyopenxr, of `openxr_library`.
    gaze : bool, optional
        Whether it may be asked where the eyes look.

    Raises
    ------
    InputError
        If there is no runtime, or it cannot do what is needed.
    InstrumentError
        If it has no headset.
    """

    def __init__(self, xr: Any, *, gaze: bool = False) -> None:
        self.xr = xr = Library(xr)
        with self._none_there():
            found = xr.enumerate_instance_extension_properties()
        self._offered = {one.extension_name.decode(errors="replace") for one in found}
        self._offered -= set() if gaze else {GAZE}
        clock = CLOCKS.get(sys.platform, TIMESPEC)
        for needed in (OPENGL, clock):
            if needed not in self._offered:
                raise InputError(f"the OpenXR runtime does not offer {needed}: choose another runtime")
        enabled = [OPENGL, clock, *(name for name in OPTIONAL if name in self._offered)]
        application = xr.ApplicationInfo(application_name="Evenlight", engine_name="Evenlight")
        info = xr.InstanceCreateInfo(application_info=application, enabled_extension_names=enabled)
        with self._none_there(), quiet_terminal():
            self.instance = xr.create_instance(info)
        try:
            with self._none_there():
                properties = xr.get_instance_properties(self.instance)
            self.name = f"{properties.runtime_name.decode(errors='replace')} ({properties.runtime_version})"
            form = xr.SystemGetInfo(form_factor=xr.FormFactor.HEAD_MOUNTED_DISPLAY)
            with self.talking(), quiet_terminal():
                try:
                    self.system_id = xr.get_system(self.instance, form)
                except xr.exception.XrException as error:
                    raise InstrumentError(
                        f"the OpenXR runtime {self.name} has no headset ({one_line(error)}): plug it in and "
                        "switch it on",
                        Fault.NOT_FOUND,
                    ) from None
                self.system = xr.get_system_properties(self.instance, self.system_id)
        except BaseException:
            self.close()
            raise

    def offers(self, extension: str) -> bool:
        """Return whether the runtime has an extension."""
        return extension in self._offered

    def now(self) -> float:
        """Return the time on the runtime's clock [s]: the system's, as the runtime converts it."""
        xr = self.xr
        with self.talking():
            if sys.platform == "win32":
                counter = ctypes.c_int64()
                ctypes.windll.kernel32.QueryPerformanceCounter(ctypes.byref(counter))
                ticks = xr.convert_win32_performance_counter_to_time_khr(self.instance, counter)
            else:
                system = xr.timespec(*divmod(time.clock_gettime_ns(time.CLOCK_MONOTONIC), 1_000_000_000))
                ticks = xr.convert_timespec_time_to_time_khr(self.instance, system)
        return float(ticks.value * NANOSECOND)

    @contextmanager
    def talking(self) -> Iterator[None]:
        """Say in one line what the runtime could not do.

        Raises
        ------
        InstrumentError
            If it does not do what is asked, or went away.
        """
        try:
            yield
        except self.xr.exception.XrException as error:
            raise InstrumentError(
                f"the OpenXR runtime {self.name} went away or failed ({one_line(error)}): start it again",
                Fault.DISCONNECTED,
            ) from None

    def close(self) -> None:
        """Let go of the runtime; more than once does nothing."""
        instance, self.instance = self.instance, None
        if instance is not None:
            # suppressed: it went away before
            with quiet_terminal(), suppress(self.xr.exception.XrException):
                self.xr.destroy_instance(instance)

    @contextmanager
    def _none_there(self) -> Iterator[None]:
        try:
            yield
        except self.xr.exception.XrException as error:
            raise InputError(
                f"no OpenXR runtime answers ({one_line(error)}): install and start the headset's own "
                "program (SteamVR, Varjo Base) or Monado (on Debian 13 the package monado-service), make it "
                "the active runtime or name its file in XR_RUNTIME_JSON; the rig simulated-headset needs none"
            ) from None
