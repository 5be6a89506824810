"""A window of PsychoPy, whose back buffer is drawn with moderngl, and the keys and mouse over it.

PsychoPy opens the window and times the flips; nothing is drawn with it. PsychoPy, pyglet and moderngl are
imported when a window is opened: they need a display.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import math
import os
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware.presentation.key_names import characters_of_layout, printed_name
from evenlight.hardware.presentation.keyboard_start import safe_keyboard_start
from evenlight.hardware.presentation.psychopy_install import INSTALL, how_to_install
from evenlight.hardware.protocols import ContextDevice, KeyPress
from evenlight.hardware.simulated.clocks import RefreshClock, refresh_after

if TYPE_CHECKING:
    import moderngl


class PsychoPyWindow(ContextDevice):
    """A window on one of the computer's screens.

    Parameters
    ----------
    rig : Rig
        Which screen, how large, how many bits.
    refresh_clock : RefreshClock, optional
        A clock that goes with the flips, for a rehearsal; else time is the computer's, and a flip waits for
        the display.

    Raises
    ------
    InputError
        If there is no such window: PsychoPy, display, screen, OpenGL or bits are missing.
    """

    def __init__(self, rig: Rig, refresh_clock: RefreshClock | None = None) -> None:
        self._rig, self._refresh_clock = rig, refresh_clock
        self._measured_rate: float | None = None
        self._last_flip: float | None = None
        visual, logging = _import_psychopy()
        self._clock = logging.defaultClock
        self._window = self._opened(visual)
        self._gl = sys.modules["pyglet.gl"]
        try:
            self._bits = self._checked_bits()
            self._context = _create_context()
        except InputError:
            self._window.close()
            raise
        self._framebuffer = self._context.detect_framebuffer()

    def _opened(self, visual: Any) -> Any:
        rig = self._rig
        rehearsal = self._refresh_clock is not None
        _require_screen(rig)
        try:
            window = visual.Window(
                size=rig.window_size,
                fullscr=rig.full_screen,
                screen=int(rig.screen),
                bpc=(rig.bits,) * 3,
                winType="pyglet",
                units="pix",
                color=(-1, -1, -1),
                allowGUI=False,
                multiSample=False,
                waitBlanking=not rehearsal,
                checkTiming=False,  # the refresh rate is measured once, by measure_refresh_rate
                gammaErrorPolicy="ignore",  # the display's own gamma is calibrated, and left as it is
            )
        except RuntimeError as error:
            if "configuration is not supported" in str(error) and rig.bits != 8:
                raise InputError(_too_few_bits(rig, "8")) from None
            raise InputError(f"no window could be opened: {_first_line(error)}") from None
        except Exception as error:  # drivers raise what they like
            raise InputError(f"no window could be opened: {_first_line(error)}") from error
        window.mouseVisible = False
        if rehearsal:
            window.winHandle.set_vsync(False)
        return window

    def _checked_bits(self) -> int:
        channels = []
        for name in (self._gl.GL_RED_BITS, self._gl.GL_GREEN_BITS, self._gl.GL_BLUE_BITS):
            number = ctypes.c_int()
            self._gl.glGetIntegerv(name, number)
            channels.append(number.value)
        if min(channels) < self._rig.bits:
            raise InputError(_too_few_bits(self._rig, str(min(channels))))
        if set(channels) != {self._rig.bits}:
            raise InputError(
                f"the window has {channels[0]} bits per colour, and the rig {self._rig.name!r} says "
                f"{self._rig.bits}: set `bits` to what the display shows, or the screen's depth to `bits`"
            )
        return channels[0]

    def size(self) -> tuple[int, int]:
        """Return width and height of the drawable area [pixels]."""
        width, height = self._window.frameBufferSize
        return int(width), int(height)

    def bits(self) -> int:
        """Return the bits of each colour channel of what is shown."""
        return self._bits

    def now(self) -> float:
        """Return the time on the window's clock [s]."""
        return self._refresh_clock.now() if self._refresh_clock else float(self._clock.getTime())

    def context(self) -> moderngl.Context:
        """Return the graphics context."""
        return self._context

    def handle(self) -> Any:
        """Return pyglet's window, for devices that are tied to it."""
        return self._window.winHandle

    def framebuffer(self) -> moderngl.Framebuffer:
        """Return the back buffer, ready to be drawn to."""
        self._framebuffer.viewport = (0, 0, *self.size())
        self._framebuffer.use()
        return self._framebuffer

    def flip(self) -> float:
        """Show the back buffer, and return when it appeared [s]."""
        # PsychoPy's flip draws in the old way of OpenGL, and expects none of what moderngl has bound.
        gl = self._gl
        gl.glUseProgram(0)
        gl.glBindVertexArray(0)
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, 0)
        gl.glActiveTexture(gl.GL_TEXTURE0)
        gl.glEnable(gl.GL_BLEND)
        self._window.flip(clearBuffer=False)
        counted = self._refresh_clock
        self._last_flip = counted.advance() if counted else float(self._clock.getTime())
        return self._last_flip

    def due(self, period: float) -> float:
        """Return when what is drawn now will appear: whole refresh periods [s] after the last flip [s]."""
        return refresh_after(self._last_flip, self.now(), period)

    def eyes(self) -> None:
        """Return None: a screen has no eyes' views."""

    def read_codes(self, size: tuple[int, int] | None = None) -> NDArray[np.int64]:
        """Return the codes drawn to the back buffer before the next flip, (height, width, 3), row 0 on top.

        `size` takes a centred part of that width and height instead of the whole.
        """
        # Framebuffer 0 is read with pyglet: moderngl's read() leaves an error that ends PsychoPy's next call.
        whole = self.size()
        width, height = (min(a, b) for a, b in zip(size or whole, whole, strict=True))
        left = (whole[0] - width) // 2
        bottom = whole[1] - height - (whole[1] - height) // 2
        shares = np.empty((height, width, 3), dtype=np.float32)
        gl = self._gl
        gl.glReadBuffer(gl.GL_BACK)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)
        gl.glReadPixels(left, bottom, width, height, gl.GL_RGB, gl.GL_FLOAT, shares.ctypes.data)
        return np.rint(shares[::-1] * ((1 << self._bits) - 1)).astype(np.int64)

    def measure_refresh_rate(self, flips: int = 90) -> float:
        """Return the refresh rate: that of the median time between flips of a black window [Hz]."""
        times = []
        for _ in range(flips + 1):
            self.framebuffer().clear()
            times.append(self.flip())
        self._measured_rate = float(1 / np.median(np.diff(times[len(times) // 3 :])))
        return self._measured_rate

    def apparatus(self) -> dict[str, str]:
        """Return what window and driver say of themselves: versions, renderer, measured refresh rate."""
        info = self._context.info
        said = {name: importlib.metadata.version(name) for name in ("psychopy", "pyglet", "moderngl")}
        said |= {"renderer": info["GL_RENDERER"], "opengl": info["GL_VERSION"]}
        said |= {"window": "{} x {} pixels".format(*self.size()), "bits": str(self._bits)}
        said["clock"] = "refreshes drawn" if self._refresh_clock else "computer"
        if self._measured_rate is not None:
            said["measured_refresh_rate_hz"] = f"{self._measured_rate:.3f}"
        return said

    def close(self) -> None:
        """Close the window."""
        self._window.close()


def _import_psychopy() -> tuple[Any, Any]:
    os.environ["PSYCHOPYNOPACKAGES"] = "1"  # else it takes user site-packages for its own
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise InputError(
            "no display: the environment variable DISPLAY is not set; run on the computer's desktop, or "
            "under `xvfb-run` for a rehearsal"
        )
    try:
        from psychopy import logging, visual
    except ModuleNotFoundError as error:
        raise InputError(f"{error.name} is not installed; {how_to_install(sys.version_info[:2])}") from None
    except Exception as error:  # pyglet raises what it likes where a display or a library is missing
        display = f" on DISPLAY {os.environ['DISPLAY']}" if "DISPLAY" in os.environ else ""
        raise InputError(f"no window can be opened{display}: {_first_line(error)}") from None
    logging.console.setLevel(logging.ERROR)  # its warnings are of monitors that it has no calibration of
    return visual, logging


def require_display(rig: Rig) -> None:
    """Raise `InputError` if PsychoPy, a display or the rig's screen are missing."""
    _import_psychopy()
    _require_screen(rig)


def _require_screen(rig: Rig) -> None:
    """Refuse a screen that is not there; PsychoPy would take the first."""
    import pyglet

    screens = len(pyglet.canvas.get_display().get_screens())
    if int(rig.screen) >= screens:
        raise InputError(
            f"the rig {rig.name!r} asks for screen {rig.screen}, and the last one is {screens - 1}: set "
            "`screen`, counted from 0"
        )


def _create_context() -> moderngl.Context:
    try:
        import moderngl

        return moderngl.create_context(require=330)
    except ModuleNotFoundError as error:
        raise InputError(f"{error.name} is not installed; {INSTALL}") from None
    except Exception as error:  # moderngl raises a bare Exception
        raise InputError(f"the graphics driver has no OpenGL 3.3: {_first_line(error)}") from None


def _too_few_bits(rig: Rig, got: str) -> str:
    return (
        f"the rig {rig.name!r} asks for {rig.bits} bits per colour, and the window has {got}: set "
        f"`bits = {got}`, or the screen to a depth of 30 bits"
    )


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


class PsychoPyKeyboard(ContextDevice):
    """All keyboards of the computer as one, on the clock of `PsychoPyWindow`.

    A key has the name of what is printed on it under the layout in use, and the time at which the driver
    heard of it, not that of the next frame. Open the window first: it knows the layout. `psychopy.event` is
    not used: it polls with the frames, and hangs on some systems.
    """

    def __init__(self) -> None:
        from psychopy import logging
        from psychopy.hardware import keyboard

        self._clock = logging.defaultClock
        self._characters = characters_of_layout(next(iter(sys.modules["pyglet.app"].windows), None))
        with safe_keyboard_start():
            self._keyboard = keyboard.Keyboard(clock=self._clock)
        self._taken_until = -math.inf

    def pressed(self) -> list[KeyPress]:
        """Return the keys pressed since the last call, in order; return at once."""
        # A press counts when the key goes down. PsychoPy gives it once more when the key is let go; a key let
        # go before it was asked for, within a long frame, is among those only.
        held = self._keyboard.getKeys(waitRelease=False, clear=True)
        keys = [*held, *self._keyboard.getKeys(waitRelease=True, clear=True)]
        times = {(key.name, key.code, float(key.rt)) for key in keys}
        presses = [
            KeyPress(self._printed(place, code), time)
            for place, code, time in times
            if time > self._taken_until
        ]
        self._taken_until = max([self._taken_until, *(press.time for press in presses)])
        return sorted(presses, key=lambda press: press.time)

    def clear(self) -> None:
        """Forget what was pressed until now."""
        self._keyboard.clearEvents()
        self._taken_until = float(self._clock.getTime())

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""
        named = "as printed, under the layout in use"
        return {
            "keyboard": f"psychopy.hardware.keyboard, backend {self._keyboard.getBackend()}",
            "key_names": named if self._characters else "by their places on an American keyboard",
        }

    def close(self) -> None:
        """Let go of the device."""
        self._keyboard.stop()

    def _printed(self, place: str, code: int | None) -> str:
        """Return the name of a key; without PsychoPy's driver it has no code, and is named as it types."""
        if self._characters is None or code is None:
            return place
        return printed_name(place, self._characters(code))


class PsychoPyHeldKeys(ContextDevice):
    """The keys over a window of PsychoPy.

    News of them arrives with the flips, which is when pyglet asks the system for what happened. Times of
    single presses come from `PsychoPyKeyboard`, which is more exact.

    Parameters
    ----------
    window : PsychoPyWindow
        The window, open.
    """

    def __init__(self, window: PsychoPyWindow) -> None:
        self._handle: Any = window.handle()
        self._name: Any = sys.modules["pyglet.window"].key.symbol_string
        self._down: set[str] = set()
        self._handlers = {
            "on_key_press": self._on_press,
            "on_key_release": self._on_release,
            "on_deactivate": self._down.clear,  # what is released elsewhere is not heard of
        }
        self._handle.push_handlers(**self._handlers)

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are down now."""
        return frozenset(self._down)

    def close(self) -> None:
        """Listen no longer."""
        if self._handle.context is not None:  # pyglet has none of a window that is closed
            self._handle.remove_handlers(**self._handlers)

    def _on_press(self, symbol: int, _: int) -> None:
        """Take a key that goes down; those who listened before hear of it too."""
        self._down.add(self._name(symbol).lower())

    def _on_release(self, symbol: int, _: int) -> None:
        self._down.discard(self._name(symbol).lower())


class PsychoPyPointer(ContextDevice):
    """The mouse over a window of PsychoPy.

    The window takes the mouse for itself: its arrow is hidden and held in the middle, so that it can be moved
    without end. Where the system refuses that, movements count up to the window's edge. They arrive with the
    flips, which is when pyglet asks the system for what happened.

    Parameters
    ----------
    window : PsychoPyWindow
        The window, open.
    """

    def __init__(self, window: PsychoPyWindow) -> None:
        self._handle: Any = window.handle()
        self._right = self._up = 0.0
        self._handle.push_handlers(on_mouse_motion=self._on_motion, on_mouse_drag=self._on_drag)
        self._handle.set_exclusive_mouse(True)

    def moved(self) -> tuple[float, float]:
        """Return how far it moved since the last call, to the right and up [pixels]; return at once."""
        movement = self._right, self._up
        self._right = self._up = 0.0
        return movement

    def close(self) -> None:
        """Give the mouse back to the system."""
        if self._handle.context is not None:  # pyglet has none of a window that is closed
            self._handle.set_exclusive_mouse(False)
            self._handle.remove_handlers(on_mouse_motion=self._on_motion, on_mouse_drag=self._on_drag)

    def _on_motion(self, x: int, y: int, right: float, up: float) -> None:
        """Take a movement; pyglet counts upwards. Those who listened before hear of it too."""
        self._right += right
        self._up += up

    def _on_drag(self, x: int, y: int, right: float, up: float, *_: object) -> None:
        self._on_motion(x, y, right, up)
