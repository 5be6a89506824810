"""What a process of its own does to measure the memory that the curves of a video take."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from evenlight.data_schema.contrast_model import ContrastModel, PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.loss_curves import analyze_frames

RATE = 12.5  # [Hz]
SIZE = (384, 270)
DISPLAY = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)


def analyze_minutes(minutes: str, jobs: str, order: str) -> LossCurves:
    """Analyse a video of so many minutes that is made as it is asked for."""
    n = round(float(minutes) * 60 * RATE)
    model = ContrastModel(pixel_to_luminance=PixelToLuminance(order))
    return analyze_frames(_frames(n), "made", DISPLAY, model, effort=AnalysisEffort(int(jobs)))


def curves_size(minutes: float, order: PixelToLuminance) -> float:
    """Return the memory of the curves [MiB], from a few seconds of them: at knots twice, their bends once."""
    some = analyze_minutes("0.2", "1", order.value)
    size = 2 * len(pickle.dumps(replace(some, bends=None))) + len(pickle.dumps(some.bends))
    return size / 2**20 * minutes / 0.2


def _frames(n: int) -> Iterator[Frame]:
    """Yield noise that moves, in an array that is filled again."""
    width, height = SIZE
    noise = np.random.default_rng(1).integers(0, 255, (height, 2 * width, 3), dtype=np.uint8)
    pixels = np.empty((height, width, 3), np.uint8)
    for k in range(n):
        pixels[:] = noise[:, k % width : k % width + width]
        yield Frame(k / RATE, 1 / RATE, pixels)
