"""Moves the mouse over a real window and prints what was heard of it, as JSON; in a process of its own."""

import dataclasses
import json

from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.rig_windows import open_pointer, open_window
from evenlight.hardware.simulated.clocks import RefreshClock


def main() -> None:
    from pyglet.libs.x11 import xlib

    rig = dataclasses.replace(load_rig("simulated")[0], window_size=(320, 240))
    server = xlib.XOpenDisplay(None)
    with open_window(rig, RefreshClock(60.0)) as window:
        heard = []

        def settled() -> tuple[float, float]:
            right = up = 0.0
            for _ in range(20):  # events take their way through the server
                window.flip()
                moved = pointer.moved()
                right, up = right + moved[0], up + moved[1]
            return right, up

        pointer = open_pointer(window)
        # X counts downwards, and a warp without a window is relative to where the pointer is. The first one
        # may bring it into the window, and is not asked about.
        for right, down in ((3, 3), (-12, 0), (0, -25), (7, 8), (150, 0), (150, 0), (150, 0)):
            xlib.XWarpPointer(server, 0, 0, 0, 0, 0, 0, right, down)
            xlib.XSync(server, 0)
            heard.append(settled())
        pointer.close()
        xlib.XWarpPointer(server, 0, 0, 0, 0, 0, 0, 5, 5)
        xlib.XSync(server, 0)
        after = settled()
    print(json.dumps({"heard": heard[1:], "after": after}))


if __name__ == "__main__":
    main()
