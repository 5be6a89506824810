"""The mouse over a window under a virtual screen."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import evenlight
from evenlight.hardware.rig import open_pointer

pytestmark = pytest.mark.slow

ROOT = Path(evenlight.__file__).parents[1]


def test_movements_are_heard_upwards_and_without_end_until_it_is_let_go(
    virtual_screen: Callable[[int], str],
) -> None:
    """The window is 320 pixels wide; 3 x 150 to the right arrive all the same."""
    done = subprocess.run(
        [sys.executable, str(Path(__file__).parent / "move_pointer.py")],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "DISPLAY": virtual_screen(24)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["heard"] == [[-12, 0], [0, 25], [7, -8], [150, 0], [150, 0], [150, 0]]
    assert said["after"] == [0, 0]


def test_a_window_that_is_none_of_the_computers_has_no_mouse() -> None:
    assert open_pointer(object()) is None
