"""What is printed on a key, under the keyboard layout in use.

PsychoPy names the keys of Linux and macOS by their places on an American keyboard: its "y" is the key that a
German keyboard prints Z on. The code of a key is translated by the system's own table of the layout, so that
the press keeps the driver's time.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from typing import Any

# Keys that print a character, by PsychoPy's names, beside letters and digits; all others (arrows, numeric
# pad) are the same on any layout.
PRINTING = {
    "unknown", "minus", "equal", "bracketleft", "bracketright", "semicolon", "apostrophe", "quoteleft",
    "grave", "backslash", "comma", "period", "slash", "less", "pound",
}  # fmt: skip
NAMED = {",": "comma", ".": "period", "-": "minus", "=": "equal"}  # characters that have a name in rigs
SHIFT = 1  # of the state of a key event of X
GROUP_SHIFT = 13  # bits before the group of a layout in that state (X Keyboard Extension, section 2.2.2)
CORE_KEYBOARD = 0x100  # all keyboards as one, for the same extension
VIRTUAL_KEY_TO_CHARACTER = 2  # of MapVirtualKey, Windows
Characters = Callable[[int], tuple[str, str]]  # of a key's code: without shift, and with it; empty for none


def printed_name(place: str, characters: tuple[str, str]) -> str:
    """Return the name of a key: what is printed on it, in lower case; a digit wherever one is printed.

    Parameters
    ----------
    place : str
        PsychoPy's name of it.
    characters : (str, str)
        What it types, without and with the shift key.

    >>> printed_name("y", ("z", "Z")), printed_name("1", ("&", "1")), printed_name("slash", ("-", "_"))
    ('z', '1', 'minus')
    >>> printed_name("left", ("", "")), printed_name("num_7", ("7", "7")), printed_name("equal", ("", ""))
    ('left', 'num_7', 'dead key at equal')
    """
    if len(place) > 1 and place not in PRINTING:
        return place
    digits = [character for character in characters if character.isascii() and character.isdigit()]
    plain = (digits or [characters[0].lower()])[0].strip()
    return NAMED.get(plain, plain) or (place if place == "unknown" else f"dead key at {place}")


def characters_of_layout(handle: Any) -> Characters | None:
    """Return what the keys type under the layout in use; None where it is not known how to ask.

    Parameters
    ----------
    handle : pyglet's window
        It must be open as long as is asked.
    """
    if getattr(handle, "_x_ic", None):
        return lambda code: _characters_of_x(handle, code - 1)  # PsychoPy counts codes of X from 1
    if sys.platform == "win32":
        return _characters_of_windows
    return None


def _characters_of_x(handle: Any, code: int) -> tuple[str, str]:
    from pyglet.libs.x11 import xlib

    state = (ctypes.c_ubyte * 18)()  # XkbStateRec, whose first byte is the group in use
    xlib._lib.XkbGetState(handle._x_display, CORE_KEYBOARD, state)
    group = state[0] << GROUP_SHIFT

    def typed(shift: int) -> str:
        event = xlib.XKeyPressedEvent(
            type=xlib.KeyPress, display=handle._x_display, window=handle._window, keycode=code
        )
        event.state = group | shift
        text, symbol, status = ctypes.create_string_buffer(16), xlib.KeySym(), ctypes.c_int()
        length = xlib.Xutf8LookupString(handle._x_ic, event, text, 15, symbol, status)
        return text.raw[:length].decode("utf-8", "replace")

    return typed(0), typed(SHIFT)


def _characters_of_windows(code: int) -> tuple[str, str]:
    """Return what a key types under Windows, where PsychoPy's codes are virtual keys of the layout in use."""
    # Digits and letters are their own virtual keys; the others' have the character without shift.
    character = ctypes.windll.user32.MapVirtualKeyW(code, VIRTUAL_KEY_TO_CHARACTER)  # type: ignore[attr-defined,unused-ignore] # not on other systems
    dead = character >> 31
    return ("" if dead or not character else chr(character & 0xFFFF)), chr(code)
