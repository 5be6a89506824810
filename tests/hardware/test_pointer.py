"""The mouse over a window under a virtual screen."""

import os
from collections.abc import Callable
from pathlib import Path

from warm_evenlight import said_by

from evenlight.hardware.rig_windows import open_pointer


def test_movements_are_heard_upwards_and_without_end_until_it_is_let_go(
    virtual_screen: Callable[[int], str],
) -> None:
    """The window is 320 pixels wide; 3 x 150 to the right arrive all the same."""
    script = Path(__file__).with_name("move_pointer.py")
    said = said_by(script, [], os.environ | {"DISPLAY": virtual_screen(24)})
    assert said["heard"] == [[-12, 0], [0, 25], [7, -8], [150, 0], [150, 0], [150, 0]]
    assert said["after"] == [0, 0]


def test_a_window_that_is_none_of_the_computers_has_no_mouse() -> None:
    assert open_pointer(object()) is None
