"""Presses keys over a real window under several keyboard layouts, and prints what was heard, as JSON.

A process of its own, for PsychoPy warns. Keys are pressed by the XTEST extension, as a keyboard's driver
would, by their places: codes of X for a keyboard with a numeric pad (8 more than those of Linux).
"""

import ctypes
import dataclasses
import json
import resource
import subprocess
import sys
import time

from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.rig_windows import open_keyboard, open_window

MISSING = 77  # exit code: no XTEST here
PLACES = {
    "third row, 1st": 52, "first row, 6th": 29,  # Z and Y of an American keyboard
    "first row, 1st": 24, "second row, 1st": 38, "first row, 2nd": 25,  # Q, A, W
    "digits, 1st": 10, "digits, 2nd": 11, "first row, 11th": 34,
    "second row, 10th": 47, "second row, 11th": 48, "third row, 10th": 61,
    "space": 65, "escape": 9, "left": 113, "numeric pad, 7": 79, "F1": 67,
}  # fmt: skip
SHIFT = 50
CAP_SYS_NICE = 23  # linux/capability.h
READ_LATER = 0.05  # [s] three frames after a press
PATIENCE = 5.0  # [s] until a press that is not heard counts as lost


def be_an_ordinary_user() -> None:
    """Give up real-time priority, which PsychoPy's keyboard asks for and most users may not have."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    header, sets = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()  # capabilities, version 3
    libc = ctypes.CDLL(None)
    libc.capget(header, sets)
    sets[0] &= ~(1 << CAP_SYS_NICE)
    libc.capset(header, sets)


def main(layouts: list[str]) -> None:
    be_an_ordinary_user()
    try:
        xtest = ctypes.CDLL("libXtst.so.6")
    except OSError as error:
        print(error)
        sys.exit(MISSING)
    from pyglet.libs.x11 import xlib

    rig = dataclasses.replace(load_rig("simulated")[0], window_size=(320, 240))
    server = xlib.XOpenDisplay(None)

    def send(code: int, down: bool) -> None:
        xtest.XTestFakeKeyEvent(server, code, down, 0)
        xlib.XSync(server, 0)

    heard: dict[str, dict[str, list[str]]] = {}
    delays = []
    with open_window(rig, rehearsal=True) as window, open_keyboard(window) as keyboard:

        def pressed(code: int) -> list[str]:
            keyboard.clear()
            before = window.now()
            send(code, True)
            after = window.now()
            send(code, False)
            time.sleep(READ_LATER)
            presses = []
            while not presses and window.now() - before < PATIENCE:
                window.flip()
                presses = keyboard.pressed()
            window.flip()  # a press heard twice would come now
            presses += keyboard.pressed()
            delays.extend((press.time - before, press.time - after) for press in presses)
            return [press.name for press in presses]

        for layout in layouts:
            subprocess.run(["setxkbmap", layout], check=True)
            heard[layout] = {place: pressed(code) for place, code in PLACES.items()}
        send(SHIFT, True)
        pressed(PLACES["space"])
        keyboard.clear()
        shifted = pressed(PLACES["first row, 6th"])
        send(SHIFT, False)
        apparatus = keyboard.apparatus()
    print(json.dumps({"heard": heard, "shifted": shifted, "delays": delays, "apparatus": apparatus}))


if __name__ == "__main__":
    main(sys.argv[1:])
