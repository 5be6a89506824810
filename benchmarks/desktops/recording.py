"""Records desktops: what each look at them would have lost at every factor, and no picture.

`python -m benchmarks.desktops.recording FOLDER 600 terminal browser film slides` takes ten minutes for each.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.desktops.made_desktops import DESKTOPS, Event, virtual_screen
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.experiments.desktop.live_loop import LOOKS
from evenlight.experiments.desktop.screens import opened_screens
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.preset_files import load_display


def recorded(name: str, events: list[Event], seconds: float) -> LossCurves:
    """Return the loss curves of this process's screen, look by look."""
    display, knots, rows, before = load_display("laptop-lcd"), brightness_factors(0.05), [], b""
    with opened_screens() as grabber:
        shot = grabber.grab(name := grabber.names()[0])
        analysis = FrameAnalysis((shot.height, shot.width), display, DEFAULT_MODEL, knots)
        begun = time.monotonic()
        for k in range(round(seconds / LOOKS)):
            time.sleep(max(begun + k * LOOKS - time.monotonic(), 0.0))
            while events and events[0][0] <= k * LOOKS:
                events.pop(0)[1]()
            shot = grabber.grab(name)
            if shot.raw != before:
                before = shot.raw
                pixels = np.frombuffer(before, np.uint8).reshape(shot.height, shot.width, 4)[..., 2::-1]
                found = analysis.of(np.ascontiguousarray(pixels))
            rows.append(found)
    return LossCurves(
        name, display, LOOKS * np.arange(float(len(rows))), np.full(len(rows), LOOKS), knots,
        loss=np.array([one.loss for one in rows]),
        visible_contrast=np.array([one.visible_contrast for one in rows]),
        mean_luminance=np.array([one.mean_luminance for one in rows]),
        channel_means=np.array([one.channel_means for one in rows]),
        provenance=Provenance(),
    )  # fmt: skip


def main(folder: str, seconds: str, *names: str) -> None:
    """Record desktops, one after the other."""
    for name in names:
        with virtual_screen(Path(folder).resolve() / name) as screen:
            rng = np.random.default_rng([*DESKTOPS].index(name))
            events = DESKTOPS[name](screen, rng, float(seconds))
            time.sleep(8.0)  # until the first window is there
            curves = recorded(name, events, float(seconds))
        write_loss_curves(Path(folder) / f"{name}.npz", curves)


if __name__ == "__main__":
    main(*sys.argv[1:])
