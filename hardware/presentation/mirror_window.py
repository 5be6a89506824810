"""The operator's window: one eye's picture, a strip of text under it, and the keyboard.

It owns the OpenGL context that a headset is drawn with.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.hardware.presentation.headset_views import FRAMEBUFFER_SRGB, Part
from evenlight.hardware.presentation.key_names import printed_name
from evenlight.hardware.presentation.openxr_runtime import INSTALL, one_line
from evenlight.hardware.protocols import ContextDevice, KeyPress

if TYPE_CHECKING:
    import moderngl
    import numpy as np
    from numpy.typing import NDArray

WIDTH, HIGHEST = 960, 720  # of the picture: with strip and title the window fits a laptop [pixels]
STRIP_SIZE = (WIDTH, 96)  # width and height of the text under the picture [pixels]
LONGEST_INTERVAL = 1 / 30  # between two pictures: the operator needs no more of them [s]
VERSIONS = (4, 5), (3, 3)  # of OpenGL, the first there is; the graphics card counts loss from 4.3
READ, DRAW, COLOUR, LINEAR = 0x8CA8, 0x8CA9, 0x4000, 0x2601  # of OpenGL
GROUND, TEXT = 0.1, 0.9  # pixel values
# Keys that print nothing, by their names in glfw and in rigs.
PLACES = {
    "SPACE": "space", "ESCAPE": "escape", "ENTER": "return", "TAB": "tab", "BACKSPACE": "backspace",
    "DELETE": "delete", "INSERT": "insert", "HOME": "home", "END": "end", "PAGE_UP": "pageup",
    "PAGE_DOWN": "pagedown", "LEFT": "left", "RIGHT": "right", "UP": "up", "DOWN": "down",
    "LEFT_SHIFT": "lshift", "RIGHT_SHIFT": "rshift", "LEFT_CONTROL": "lctrl", "RIGHT_CONTROL": "rctrl",
    "LEFT_ALT": "lalt", "RIGHT_ALT": "ralt", "KP_ENTER": "num_enter", "KP_ADD": "num_add",
    "KP_SUBTRACT": "num_subtract",
    **{f"F{number}": f"f{number}" for number in range(1, 13)},
    **{f"KP_{digit}": f"num_{digit}" for digit in range(10)},
}  # fmt: skip


def glfw_library(*, egl: bool) -> Any:
    """Return glfw, ready to open windows; without EGL, on Linux, by X, whose contexts runtimes take.

    Raises
    ------
    InputError
        If it is not installed, or there is no display.
    """
    try:
        import glfw
    except ImportError as error:
        raise InputError(f"the mirror window needs the package glfw ({one_line(error)}): {INSTALL}") from None
    glfw.ERROR_REPORTING = "ignore"
    if not egl and sys.platform == "linux":
        glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_X11)
    if not glfw.init():
        raise InputError(
            "there is no display for the operator's mirror window: start it in a graphical session, or set "
            "DISPLAY"
        )
    return glfw


class MirrorWindow(ContextDevice):
    """A window of a fixed size, open.

    Parameters
    ----------
    eye_size : (int, int)
        Width and height of an eye's picture, which say how high the window is [pixels].
    clock : callable
        Of the presses' times [s].
    egl : bool, optional
        Whether its context is made by EGL, on Linux; else the system's own way.

    Raises
    ------
    InputError
        If there is no glfw, no display or no OpenGL 3.3.
    """

    def __init__(self, eye_size: tuple[int, int], clock: Callable[[], float], *, egl: bool = False) -> None:
        self._name, self._clock = "mirror window", clock
        self._glfw = glfw_library(egl=egl)
        height = round(WIDTH * eye_size[1] / eye_size[0])
        self._window = self._opened((WIDTH, min(height, HIGHEST) + STRIP_SIZE[1]), egl)
        self._context = self._created()
        self._shown, self._due = -LONGEST_INTERVAL, False  # when a picture was taken last [s]; if it waits
        self._taken: moderngl.Framebuffer | None = None  # as large as it is shown
        self._place = (0, 0, 0, 0)  # where: left, bottom, right, top [pixels]
        self._pressed: list[KeyPress] = []
        self._held: dict[int, str] = {}  # names of keys that are down, by their place
        self._strip: moderngl.Framebuffer | None = None
        self._places = {getattr(self._glfw, f"KEY_{key}"): place for key, place in PLACES.items()}
        self._glfw.set_key_callback(self._window, self._take)  # glfw's module keeps hold of it

    def context(self) -> moderngl.Context:
        """Return the graphics context."""
        return self._context

    def make_current(self) -> None:
        """Make the graphics context the thread's own again; once the window is closed there is none."""
        if not self._closed:
            self._glfw.make_context_current(self._window)

    def take(self, framebuffer: moderngl.Framebuffer, part: Part) -> None:
        """Copy a view out of what was drawn, at most 30 times a second; the graphics card does it later.

        Parameters
        ----------
        framebuffer : moderngl.Framebuffer
            What was drawn, before it is handed to the runtime, whose it is then; bound afterwards.
        part : (int, int, int, int)
            Where in it the view is.
        """
        now = time.perf_counter()
        if now - self._shown < LONGEST_INTERVAL:
            return
        self._shown, self._due = now, True
        left, bottom, width, height = part
        source = (left, bottom, left + width, bottom + height)
        x, y, right, top = self._place = _fitted(source, *self._room())
        if self._taken is None or self._taken.size != (right - x, top - y):
            self._taken = self._context.framebuffer([self._context.texture((right - x, top - y), 4)])
        self._context.disable_direct(FRAMEBUFFER_SRGB)  # the codes are shown as they are
        self._bind(DRAW, self._taken.glo)
        self._copy(framebuffer, source, (0, 0, right - x, top - y))
        framebuffer.use()

    def show(self) -> None:
        """Show what was taken, once, and without waiting."""
        self._glfw.poll_events()
        if not self._due or self._taken is None:
            return
        self._due = False
        (width, height), strip = self._room()
        screen = self._context.detect_framebuffer(0)
        screen.viewport = (0, 0, width, height)
        screen.use()
        screen.clear(GROUND, GROUND, GROUND, 1.0)
        self._bind(DRAW, screen.glo)
        self._copy(self._taken, (0, 0, *self._taken.size), self._place)
        if self._strip is not None:
            wide, tall = self._strip.size
            right, foot = wide * width // STRIP_SIZE[0], strip - tall * strip // STRIP_SIZE[1]
            self._copy(self._strip, (0, 0, wide, tall), (0, foot, right, strip))
        self._glfw.swap_buffers(self._window)

    def _room(self) -> tuple[tuple[int, int], int]:
        """Return width and height of the window, and the height of its strip [pixels]."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        return (width, height), height * STRIP_SIZE[1] // self._glfw.get_window_size(self._window)[1]

    def say(self, coverage: NDArray[np.uint8] | None) -> None:
        """Show a text in the strip under the picture.

        Parameters
        ----------
        coverage : array of uint8, (height, width), optional
            How much of each pixel the text covers, row 0 on top, at most as large as `STRIP_SIZE`; none for
            no text.
        """
        if self._strip is not None:
            self._strip.color_attachments[0].release()
            self._strip.release()
        self._strip = None
        if coverage is not None:
            height, width = coverage.shape
            codes = (255 * GROUND + (TEXT - GROUND) * coverage[::-1]).round().astype("uint8")
            picture = self._context.texture((width, height), 4, codes.repeat(4, axis=1).tobytes())
            self._strip = self._context.framebuffer([picture])

    def pressed(self) -> list[KeyPress]:
        """Return the keys pressed since the last call, in order; return at once."""
        self._glfw.poll_events()
        self._glfw.set_window_should_close(self._window, False)  # sessions end by a key, with their data kept
        pressed, self._pressed = self._pressed, []
        return pressed

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are down now."""
        self._glfw.poll_events()
        return frozenset(self._held.values())

    def close(self) -> None:
        """Close the window; more than once does nothing."""
        if not self._closed:
            super().close()
            self._context.release()
            self._glfw.destroy_window(self._window)

    def _opened(self, size: tuple[int, int], egl: bool) -> Any:
        glfw = self._glfw
        for version in VERSIONS:
            glfw.default_window_hints()
            if egl:
                glfw.window_hint(glfw.CONTEXT_CREATION_API, glfw.EGL_CONTEXT_API)
            glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, version[0])
            glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, version[1])
            glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
            glfw.window_hint(glfw.RESIZABLE, False)
            window = glfw.create_window(*size, "Evenlight", None, None)
            if window:
                glfw.make_context_current(window)
                glfw.swap_interval(0)  # frames wait for the headset, never for the operator's screen
                return window
        raise InputError("the mirror window needs OpenGL 3.3: install the graphics card's driver")

    def _created(self) -> moderngl.Context:
        import moderngl

        kind: Any = getattr(ctypes, "WINFUNCTYPE" if sys.platform == "win32" else "CFUNCTYPE")
        self._bind = kind(None, ctypes.c_uint, ctypes.c_uint)(_address(self._glfw, "glBindFramebuffer"))
        blit = kind(None, *[ctypes.c_int] * 8, ctypes.c_uint, ctypes.c_uint)
        self._blit = blit(_address(self._glfw, "glBlitFramebuffer"))
        loader: Any = _Loader(self._glfw)  # moderngl's own types know its loaders only
        return moderngl.create_context(context=loader, require=330)

    def _copy(
        self, source: moderngl.Framebuffer, part: tuple[int, int, int, int], place: tuple[int, int, int, int]
    ) -> None:
        """Copy a part of a picture to a place in the window: left, bottom, right, top [pixels]."""
        self._bind(READ, source.glo)
        self._blit(*part, *place, COLOUR, LINEAR)

    def _take(self, _: Any, key: int, code: int, action: int, __: int) -> None:
        """Note a key that went down or up; those that stay down repeat, which is no press."""
        if action == self._glfw.RELEASE:
            self._held.pop(code, None)
        elif action == self._glfw.PRESS:
            name = self._named(key, code)
            self._held[code] = name
            self._pressed.append(KeyPress(name, self._clock()))

    def _named(self, key: int, code: int) -> str:
        if key in self._places:
            return self._places[key]
        glfw = self._glfw
        digit = chr(key) if glfw.KEY_0 <= key <= glfw.KEY_9 else ""  # glfw's codes of keys are ASCII
        return printed_name("unknown", (glfw.get_key_name(key, code) or "", digit))


def _fitted(
    source: tuple[int, int, int, int], size: tuple[int, int], strip: int
) -> tuple[int, int, int, int]:
    """Return where a picture goes in a window: over the strip, as large as it fits, in its own shape.

    >>> _fitted((640, 0, 1280, 480), (960, 816), 96), _fitted((0, 0, 100, 200), (960, 1056), 96)
    ((0, 96, 960, 816), (240, 96, 720, 1056))
    """
    wide, tall = source[2] - source[0], source[3] - source[1]
    scale = min(size[0] / wide, (size[1] - strip) / tall)
    width, height = round(wide * scale), round(tall * scale)
    left = (size[0] - width) // 2
    return left, strip, left + width, strip + height


def _address(glfw: Any, name: str) -> int:
    return ctypes.cast(glfw.get_proc_address(name), ctypes.c_void_p).value or 0


class _Loader:
    """The current context, as moderngl takes it."""

    def __init__(self, glfw: Any) -> None:
        self._glfw = glfw

    def load_opengl_function(self, name: str) -> int:
        """Return where a function of OpenGL is."""
        return _address(self._glfw, name)

    load = load_opengl_function

    def __enter__(self) -> _Loader:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the context current: nothing else is drawn."""

    def release(self) -> None:
        """Leave the context to its window."""
