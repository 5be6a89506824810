"""Draws on a real window and prints what was drawn, as JSON: run in a process of its own, for PsychoPy warns.

Usage: draw_on_window.py BITS
"""

import dataclasses
import json
import sys

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Dither, Rig
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import RampInterval
from evenlight.hardware.presentation.psychopy_window import PsychoPyWindow
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.rig_windows import open_window
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.stimuli.dithering import neighbouring_codes, thresholds_of
from evenlight.stimuli.field_renderer import Field, FieldRenderer
from evenlight.stimuli.page_image import page_image

LAB = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
SLOW = RampInterval(100.0, 99.0, 1.0, 0.0, 5.0, 0.2, noise_seed=20260731)  # 0.2 cd/m^2/s
SIZE = (321, 243)  # odd, so that rows and columns are no multiples of anything
RATE = 30.0  # [Hz]


class ReadBack:
    """A window that reads back the whole of every frame before it is shown."""

    def __init__(self, window: PsychoPyWindow) -> None:
        self._window = window
        self.frames: list[np.ndarray] = []

    def __getattr__(self, name: str) -> object:
        return getattr(self._window, name)

    def flip(self) -> float:
        self.frames.append(self._window.read_codes())
        return self._window.flip()


def mean_luminance(codes: np.ndarray, bits: int) -> float:
    """Eq. 1 for a display of 100 cd/m^2, no black level and gamma 2.2, by its own count of the codes."""
    counts = np.bincount(codes.ravel(), minlength=2**bits)
    return float((100 * (np.arange(2**bits) / (2**bits - 1)) ** 2.2 * counts).sum() / counts.sum())


def slow_ramp(window: PsychoPyWindow, rig: Rig, dither: Dither) -> dict[str, object]:
    """Show the slow ramp, and compare every frame with what it was to be."""
    read_back = ReadBack(window)
    stage = WindowStage(
        read_back, SimulatedKeyboard(window.now), dataclasses.replace(rig, dither=dither), LAB, 20.0
    )
    shown = stage.show_ramp(SLOW)
    differing = []
    for frame in (0, 1, 150, len(read_back.frames) - 1):
        thresholds = thresholds_of(dither, SIZE[::-1], frame, SLOW.noise_seed)
        lower, share = neighbouring_codes(shown.intended_luminance[frame], LAB, rig.bits)
        expected = lower + (thresholds < share)
        differing.append(int((read_back.frames[frame] != expected[..., np.newaxis]).sum()))
    return {
        "means": [mean_luminance(codes, rig.bits) for codes in read_back.frames],
        "intended": shown.intended_luminance,
        "flip_times": shown.flip_times,
        "probe_frames": shown.probe_frames,
        "probes": shown.probe_luminance,
        "differing": differing,
    }


def page(window: PsychoPyWindow, rig: Rig) -> int:
    """Return how many pixels of a page differ from the numpy reference."""
    coverage = page_image("# Title\n\nA page of **text**.", SIZE, "Space: go on")
    renderer = FieldRenderer(window.context(), LAB, rig.bits, Dither.NOISY_BIT)
    renderer.draw(window.framebuffer(), Field(40.0, 3.0, coverage), 5, 2**32 - 1)
    wanted = 40.0 + coverage / 255 * (3.0 - 40.0)
    thresholds = thresholds_of(Dither.NOISY_BIT, SIZE[::-1], 5, 2**32 - 1)
    lower, share = neighbouring_codes(wanted, LAB, rig.bits)
    expected = lower + (thresholds < share)
    differing = int((window.read_codes() != expected[..., np.newaxis]).sum())
    middle = window.read_codes((101, 51))
    assert (middle == window.read_codes()[96:147, 110:211]).all()
    return differing


def refusal(rig: Rig, **changes: object) -> str:
    """Return what is said of a rig that the computer has not."""
    try:
        open_window(dataclasses.replace(rig, **changes), RefreshClock(RATE))
    except InputError as error:
        return str(error)
    return ""


def main(bits: int) -> None:
    rig = dataclasses.replace(load_rig("simulated")[0], window_size=SIZE, bits=bits, refresh_rate=RATE)
    said = {
        "bits": refusal(rig, bits=18 - bits),
        "screen": refusal(rig, screen=7),
    }
    with open_window(rig, RefreshClock(RATE)) as window:
        ramps = {dither.value: slow_ramp(window, rig, dither) for dither in Dither}
        result = {
            "size": window.size(),
            "window_bits": window.bits(),
            "page_differing": page(window, rig),
            "ramps": ramps,
            "said": said,
            "measured": window.measure_refresh_rate(),
            "apparatus": window.apparatus(),
        }
    with open_window(rig, rehearsal=True) as window:
        times = [window.now(), window.flip(), window.flip(), window.now()]
        result |= {"real_times": times, "real_clock": window.apparatus()["clock"]}
        from evenlight.hardware.rig_windows import open_keyboard

        with open_keyboard(window) as keyboard:
            result |= {"pressed": len(keyboard.pressed()), "keyboard": keyboard.apparatus()["keyboard"]}
    print(json.dumps(result))


if __name__ == "__main__":
    main(int(sys.argv[1]))
