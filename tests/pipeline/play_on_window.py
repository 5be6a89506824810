"""Plays on a real window and prints how it went, as JSON: run in a process of its own, for PsychoPy warns.

Usage: play_on_window.py FOLDER ARGUMENTS, the latter a JSON list of the arguments of each command
"""

import contextlib
import dataclasses
import io
import json
import sys
import time
from pathlib import Path

import numpy as np

from evenlight import command as command_line
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import Clip
from evenlight.hardware.presentation.psychopy_window import PsychoPyWindow
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.rig_windows import open_held_keys, open_window
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.stimuli.dithering import neighbouring_codes, thresholds_of
from evenlight.stimuli.sequences import open_video

LAB = Display("lab", 100.0, 0.2, 2.2, pixels_per_degree=60.0, reflected_luminance=0.5)
SIZE = (161, 123)
FACTORS = np.linspace(1.0, 0.3, 30)


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


def wanted_codes(pixels: np.ndarray, factor: float, refresh: int, dither: Dither) -> np.ndarray:
    """The window, by the definition: D = b (L'^gamma (peak - black) + black) + reflected, not below black."""
    shares = pixels / np.iinfo(pixels.dtype).max
    if pixels.dtype == np.uint16:
        shares = np.rint(1023 * shares) / 1023  # as the file of 10 bits has them
    emitted = shares**2.2 * 99.8 + 0.2
    luminance = np.full((SIZE[1], SIZE[0], 3), 0.7)
    height, width, _ = pixels.shape
    top, left = (SIZE[1] - height) // 2, (SIZE[0] - width) // 2
    luminance[top : top + height, left : left + width] = np.maximum(factor * emitted + 0.5, 0.7)
    thresholds = thresholds_of(dither, SIZE[::-1], refresh, 77)[..., np.newaxis]
    lower, share = neighbouring_codes(luminance, LAB, 8)
    return lower + (thresholds < share)


def stage_played(video: str) -> dict[str, object]:
    """Play a video on a stage, and compare every refresh with what it was to be."""
    rig = dataclasses.replace(load_rig("simulated")[0], window_size=SIZE)
    source = open_video(video)
    pixels = [frame.pixel_values.copy() for frame in source.frames()]
    clip = Clip(source, np.arange(30) / 25, 1.2, FACTORS, 77)
    with open_window(rig, RefreshClock(60.0)) as window:
        read_back = ReadBack(window)
        with WindowStage(read_back, SimulatedKeyboard(window.now), rig, LAB, 20.0) as stage:
            stage.wait(0.05, 20.0)
            read_back.frames.clear()
            shown = stage.play(clip)
            # What is drawn afterwards is drawn right: the player leaves the graphics as it found them.
            stage.wait(0.05, 20.0)
    differing = [
        int((codes != wanted_codes(pixels[frame], factor, refresh, rig.dither)).sum())
        for refresh, (codes, frame, factor) in enumerate(
            zip(read_back.frames, shown.video_frames, shown.factors, strict=False)
        )
    ]
    after = read_back.frames[len(shown.flip_times) :]
    return {
        "differing": differing,
        "video_frames": shown.video_frames,
        "errors": (np.array(shown.probe_luminance) - shown.probe_intended).tolist(),
        "after": [float(codes.mean()) for codes in after],
    }


def keys_held() -> list[list[str]]:
    """Press and release keys as pyglet would, and return which were held in between."""
    rig = dataclasses.replace(load_rig("simulated")[0], window_size=SIZE)
    with open_window(rig, RefreshClock(60.0)) as window:
        held = open_held_keys(window)
        assert held is not None
        from pyglet.window import key

        handle, seen = window.handle(), []
        for event in ("on_key_press", "on_key_release"):
            for symbol in (key.W, key.LSHIFT, key.LEFT):
                handle.dispatch_event(event, symbol, 0)
                window.flip()  # events are heard of then
                seen.append(sorted(held.held()))
        held.close()
        handle.dispatch_event("on_key_press", key.W, 0)
        window.flip()
        return [*seen, sorted(held.held())]


def commanded(arguments: list[str]) -> dict[str, object]:
    """Run a command, and return its exit code, what it said, and how long it took."""
    out, err, code, begun = io.StringIO(), io.StringIO(), None, time.monotonic()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            command_line.main(arguments)
        except SystemExit as ended:
            code = ended.code
    return {"code": code, "out": out.getvalue(), "err": err.getvalue(), "seconds": time.monotonic() - begun}


if __name__ == "__main__":
    folder, commands = Path(sys.argv[1]), json.loads(sys.argv[2])
    result = {
        "stage": {name: stage_played(str(folder / name)) for name in ("8.mkv", "10.mkv")},
        "held": keys_held(),
        "commands": [commanded(arguments) for arguments in commands],
    }
    print(json.dumps(result))
