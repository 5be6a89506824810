"""The window under a virtual screen: what it draws is what was meant, read back from its back buffer."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from warm_evenlight import said_by

import evenlight
from evenlight.hardware.presentation.psychopy_install import how_to_install

ROOT = Path(evenlight.__file__).parents[1]
Drawn = dict[str, Any]


def python(*arguments: str, display: str | None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python from the project's folder with a display, or without one."""
    variables = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    variables |= {"PYTHONPATH": str(ROOT), **environment, **({"DISPLAY": display} if display else {})}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=variables,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


def drawn_on(screen: str, bits: int) -> Drawn:
    return said_by(
        Path(__file__).with_name("draw_on_window.py"), [str(bits)], os.environ | {"DISPLAY": screen}
    )


@pytest.fixture(scope="module")
def drawn_8(virtual_screen: Callable[[int], str]) -> Drawn:
    return drawn_on(virtual_screen(24), 8)


@pytest.fixture(scope="module")
def drawn_10(virtual_screen: Callable[[int], str]) -> Drawn:
    return drawn_on(virtual_screen(30), 10)


def errors(drawn: Drawn, dither: str) -> np.ndarray:
    """Return drawn minus intended mean luminance of every frame of the slow ramp [cd/m^2]."""
    ramp = drawn["ramps"][dither]
    times = np.array(ramp["flip_times"])
    wanted = 100.0 - 0.2 * np.minimum(times, 5.0)
    np.testing.assert_allclose(ramp["intended"], wanted, atol=1e-9)
    assert len(ramp["means"]) == 156  # 5.2 s at 30 Hz
    return np.asarray(ramp["means"]) - wanted


@pytest.mark.parametrize("dither", ["noisy_bit", "ordered"])
def test_every_frame_of_a_slow_ramp_has_the_luminance_meant(drawn_8: Drawn, dither: str) -> None:
    assert np.abs(errors(drawn_8, dither)).max() < 0.02


def test_rounding_would_miss_it_by_up_to_half_a_step(drawn_8: Drawn) -> None:
    """Steps below 100 cd/m^2 are 0.861 and 0.855 wide; the ramp meets the middle of the first."""
    assert 0.28 < np.abs(errors(drawn_8, "none")).max() < 0.44


def test_a_ramp_of_10_bits_is_closer_still(drawn_10: Drawn) -> None:
    """A step is a quarter as wide, and the noise too: 0.215 / 2 / sqrt(78003 pixels) = 0.0004 a frame."""
    assert drawn_10["window_bits"] == 10
    for dither in ("noisy_bit", "ordered"):
        assert np.abs(errors(drawn_10, dither)).max() < 0.005
    assert np.abs(errors(drawn_10, "none")).max() < 0.11


def test_the_shader_draws_the_very_codes_of_the_reference(drawn_8: Drawn, drawn_10: Drawn) -> None:
    for drawn in (drawn_8, drawn_10):
        assert [ramp["differing"] for ramp in drawn["ramps"].values()] == [[0] * 4] * 3
        assert drawn["page_differing"] == 0


def test_the_noise_is_fresh_in_each_frame(drawn_8: Drawn) -> None:
    """The frames after the ramp all have 99 cd/m^2, and other means: their noise is not the same."""
    means = drawn_8["ramps"]["noisy_bit"]["means"][-5:]
    assert len(set(means)) > 1
    assert len(set(drawn_8["ramps"]["ordered"]["means"][-5:])) == 1


def test_a_dozen_frames_are_read_back_by_the_stage_itself(drawn_8: Drawn) -> None:
    ramp = drawn_8["ramps"]["noisy_bit"]
    assert len(ramp["probe_frames"]) == 12
    assert (ramp["probe_frames"][0], ramp["probe_frames"][-1]) == (0, 155)
    intended = np.array(ramp["intended"])[ramp["probe_frames"]]
    # 256 x 243 pixels: 0.43 / sqrt(n) = 0.0017
    assert np.abs(np.array(ramp["probes"]) - intended).max() < 0.01


def test_the_virtual_clock_goes_by_one_refresh_a_flip(drawn_8: Drawn) -> None:
    times = drawn_8["ramps"]["noisy_bit"]["flip_times"]
    np.testing.assert_allclose(times, np.arange(156) / 30, atol=1e-9)
    assert drawn_8["measured"] == pytest.approx(30.0)
    assert drawn_8["apparatus"]["clock"] == "refreshes drawn"


def test_the_real_clock_is_that_of_the_keyboard_and_rises(drawn_8: Drawn) -> None:
    times = drawn_8["real_times"]
    assert times == sorted(times)
    assert drawn_8["real_clock"] == "computer"
    assert drawn_8["keyboard"] == "psychopy.hardware.keyboard, backend ptb"
    assert drawn_8["pressed"] == 0


def test_the_window_says_what_it_is(drawn_8: Drawn) -> None:
    assert drawn_8["size"] == [321, 243]
    said = drawn_8["apparatus"]
    assert {"psychopy", "pyglet", "moderngl", "renderer", "opengl", "measured_refresh_rate_hz"} <= set(said)


def test_bits_and_screens_that_are_not_there_are_refused(drawn_8: Drawn, drawn_10: Drawn) -> None:
    assert "'simulated' asks for 10 bits per colour, and the window has 8" in drawn_8["said"]["bits"]
    assert "has 10 bits per colour, and the rig 'simulated' says 8" in drawn_10["said"]["bits"]
    assert "asks for screen 7, and the last one is 0" in drawn_8["said"]["screen"]


OPEN = """
from evenlight.data_schema.errors import InputError
from evenlight.hardware.rig_windows import open_window
from evenlight.hardware.rig_files import load_rig
{before}
try:
    open_window(load_rig("simulated")[0])
except InputError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("display", "before", "says"),
    [
        (None, "", "no display: the environment variable DISPLAY is not set"),
        (":7654", "import sys; sys.modules['psychopy'] = None", "psychopy is not installed; "),
    ],
    ids=["no display", "no PsychoPy"],
)
def test_what_is_missing_is_said_in_one_line(display: str | None, before: str, says: str) -> None:
    done = python("-c", OPEN.format(before=before), display=display)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(says)
    assert done.stdout.count("\n") == 1


def test_a_screen_without_opengl_is_refused_in_one_line(virtual_screen: Callable[[int], str]) -> None:
    """OpenGL 2.1 is what Mesa is told to give: below the 3.3 that is needed."""
    done = python("-c", OPEN.format(before=""), display=virtual_screen(24), MESA_GL_VERSION_OVERRIDE="2.1")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("the graphics driver has no OpenGL 3.3")
    assert done.stdout.count("\n") == 1


def test_who_lacks_psychopy_is_told_which_python_it_needs() -> None:
    assert how_to_install((3, 12)).startswith("install it with `make lab`")
    newer = how_to_install((3, 14))
    assert "PsychoPy needs Python 3.11 or 3.12, and this is 3.14" in newer
    assert "make lab PYTHON=/path/to/python3.12" in newer


@pytest.mark.usefixtures("psychopy_is_here")
def test_a_display_that_is_not_there_is_said_in_one_line() -> None:
    test_what_is_missing_is_said_in_one_line(":7654", "", "no window can be opened on DISPLAY :7654")
