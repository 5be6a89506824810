"""How OpenGL and an OpenXR runtime share pictures: the context that is handed over, and the swapchain.

The structures are written out after the specification: pyopenxr makes its own of PyOpenGL's types of
pointers, which no other library has.
"""

from __future__ import annotations

import ctypes
import sys
from typing import TYPE_CHECKING, Any

from evenlight.hardware.presentation.headset_views import FRAMEBUFFER_SRGB, SRGB8_ALPHA8, Part, Triangle
from evenlight.hardware.presentation.openxr_runtime import HIDDEN_AREA
from evenlight.hardware.protocols import Fault, InstrumentError

if TYPE_CHECKING:
    import moderngl

    from evenlight.hardware.presentation.openxr_runtime import OpenXRRuntime

# Structure types of the OpenXR registry.
WIN32_TYPE, XLIB_TYPE, EGL_TYPE = 1000023000, 1000023001, 1000048004
LONGEST_WAIT = 1_000_000_000  # for a picture that the runtime still shows [ns]
_HEAD = (("type", ctypes.c_int), ("next", ctypes.c_void_p))


class Win32Binding(ctypes.Structure):
    """XrGraphicsBindingOpenGLWin32KHR."""

    _fields_ = (*_HEAD, ("device", ctypes.c_void_p), ("context", ctypes.c_void_p))


class XlibBinding(ctypes.Structure):
    """XrGraphicsBindingOpenGLXlibKHR."""

    _fields_ = (
        *_HEAD, ("display", ctypes.c_void_p), ("visual", ctypes.c_uint32), ("config", ctypes.c_void_p),
        ("drawable", ctypes.c_ulong), ("context", ctypes.c_void_p),
    )  # fmt: skip


class EglBinding(ctypes.Structure):
    """XrGraphicsBindingEGLMNDX."""

    _fields_ = (
        *_HEAD, ("get_proc_address", ctypes.c_void_p), ("display", ctypes.c_void_p),
        ("config", ctypes.c_void_p), ("context", ctypes.c_void_p),
    )  # fmt: skip


def graphics_binding(egl: bool) -> ctypes.Structure:
    """Return how the runtime reaches the OpenGL context that is current, made by EGL or the system's own way.

    That of Windows follows the specification and was never tried.
    """
    if sys.platform == "win32":
        gl = ctypes.windll.opengl32
        return Win32Binding(WIN32_TYPE, None, _called(gl.wglGetCurrentDC), _called(gl.wglGetCurrentContext))
    return _egl_binding(ctypes.CDLL("libEGL.so.1")) if egl else _xlib_binding(ctypes.CDLL("libGL.so.1"))


def _called(function: Any, *arguments: Any) -> int | None:
    function.restype = ctypes.c_void_p
    result: int | None = function(*arguments)
    return result


def _xlib_binding(gl: Any) -> XlibBinding:
    display, context = _called(gl.glXGetCurrentDisplay), _called(gl.glXGetCurrentContext)
    number, count, one = ctypes.c_int(), ctypes.c_int(), (ctypes.c_int * 3)(0x8013, 0, 0)  # GLX_FBCONFIG_ID
    gl.glXQueryContext(ctypes.c_void_p(display), ctypes.c_void_p(context), 0x8013, ctypes.byref(number))
    one[1] = number.value
    gl.glXChooseFBConfig.restype = ctypes.POINTER(ctypes.c_void_p)
    configs = gl.glXChooseFBConfig(ctypes.c_void_p(display), 0, one, ctypes.byref(count))
    config = configs[0] if count.value else None
    visual = ctypes.c_int()
    gl.glXGetFBConfigAttrib(ctypes.c_void_p(display), ctypes.c_void_p(config), 0x800B, ctypes.byref(visual))
    drawable = _called(gl.glXGetCurrentDrawable) or 0
    return XlibBinding(XLIB_TYPE, None, display, visual.value, config, drawable, context)


def _egl_binding(egl: Any) -> EglBinding:
    """Return the current context of EGL, with the configuration that it was made with."""
    display, context = _called(egl.eglGetCurrentDisplay), _called(egl.eglGetCurrentContext)
    number, count, configs = ctypes.c_int(), ctypes.c_int(), (ctypes.c_void_p * 1)()
    egl.eglQueryContext(ctypes.c_void_p(display), ctypes.c_void_p(context), 0x3028, ctypes.byref(number))
    wanted = (ctypes.c_int * 3)(0x3028, number.value, 0x3038)  # EGL_CONFIG_ID, ..., EGL_NONE
    egl.eglChooseConfig(ctypes.c_void_p(display), wanted, configs, 1, ctypes.byref(count))
    address = ctypes.cast(egl.eglGetProcAddress, ctypes.c_void_p).value
    return EglBinding(EGL_TYPE, None, address, display, configs[0], context)


def hidden_area(runtime: OpenXRRuntime, session: Any, kind: Any, eye: int) -> tuple[Triangle, ...]:
    """Return what an eye's lens never shows, the left one being number 0; nothing if it is not said.

    The runtime is asked directly: pyopenxr's own function leaves no room for what it says.
    """
    xr, kinds = runtime.xr, runtime.xr.VisibilityMaskTypeKHR
    if not runtime.offers(HIDDEN_AREA):
        return ()
    function = xr.get_instance_proc_addr(runtime.instance, "xrGetVisibilityMaskKHR")
    ask, mask = ctypes.cast(function, xr.PFN_xrGetVisibilityMaskKHR), xr.VisibilityMaskKHR()
    views, hidden = kind.value, kinds.HIDDEN_TRIANGLE_MESH.value
    failed = ask(session, views, eye, hidden, ctypes.byref(mask))  # how much there is
    points, places = mask.vertex_count_output, mask.index_count_output
    vertices, indices = (xr.Vector2f * points)(), (ctypes.c_uint32 * places)()
    mask.vertex_capacity_input, mask.vertices = points, vertices
    mask.index_capacity_input, mask.indices = places, indices
    failed = failed or ask(session, views, eye, hidden, ctypes.byref(mask))
    xr.afterwards()
    if failed or any(place >= points for place in indices):
        return ()
    corners = [(vertices[place].x, vertices[place].y) for place in indices]
    return tuple(zip(corners[::3], corners[1::3], corners[2::3], strict=False))


class Swapchain:
    """The pictures that go to the runtime: all views side by side, so wide and so high [pixels].

    Raises
    ------
    InstrumentError
        If the runtime has no sRGB pictures of 8 bits, or none as large.
    """

    def __init__(
        self, runtime: OpenXRRuntime, session: Any, context: moderngl.Context, size: tuple[int, int]
    ) -> None:
        self._xr = xr = runtime.xr
        self.size, self._index = size, -1
        limits = runtime.system.graphics_properties
        most = limits.max_swapchain_image_width, limits.max_swapchain_image_height
        if SRGB8_ALPHA8 not in map(int, xr.enumerate_swapchain_formats(session)):  # it would encode once more
            raise InstrumentError(
                f"the OpenXR runtime {runtime.name} does not take pictures of the format SRGB8_ALPHA8: "
                "choose another runtime",
                Fault.REFUSED,
            )
        if size[0] > most[0] or size[1] > most[1]:
            raise InstrumentError(
                f"the views together have {size[0]} x {size[1]} pixels, and the runtime takes {most[0]} x "
                f"{most[1]}: give the rig full_screen = false and a smaller window_size",
                Fault.REFUSED,
            )
        usage = xr.SwapchainUsageFlags
        self.handle = xr.create_swapchain(
            session,
            xr.SwapchainCreateInfo(
                usage_flags=usage.COLOR_ATTACHMENT_BIT | usage.SAMPLED_BIT, format=SRGB8_ALPHA8,
                sample_count=1, width=size[0], height=size[1], face_count=1, array_size=1, mip_count=1,
            ),
        )  # fmt: skip
        images = xr.enumerate_swapchain_images(self.handle, xr.SwapchainImageOpenGLKHR)
        textures = [context.external_texture(int(one.image), size, 4, 0, "f1") for one in images]
        self._framebuffers = [context.framebuffer([texture]) for texture in textures]
        context.disable_direct(FRAMEBUFFER_SRGB)

    def acquired(self) -> moderngl.Framebuffer:
        """Return the picture to draw to: the same until it is released."""
        if self._index < 0:
            self._index = self._xr.acquire_swapchain_image(self.handle)
            self._xr.wait_swapchain_image(self.handle, self._xr.SwapchainImageWaitInfo(timeout=LONGEST_WAIT))
        return self._framebuffers[self._index]

    def release(self) -> bool:
        """Hand the picture over, and return whether there was one."""
        drawn = self._index >= 0
        if drawn:
            self._index = -1
            self._xr.release_swapchain_image(self.handle)
        return drawn

    def part(self, part: Part) -> Any:
        """Return where a view is, as the runtime takes it: with OpenGL from the lower left corner."""
        rectangle = self._xr.Rect2Di(self._xr.Offset2Di(*part[:2]), self._xr.Extent2Di(*part[2:]))
        return self._xr.SwapchainSubImage(swapchain=self.handle, image_rect=rectangle)
