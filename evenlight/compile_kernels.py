"""Compile the loops of analysis, optimizer and fits, once per machine: `python -m evenlight.compile_kernels`.

Set-up does that, so that the first command need not. What is compiled lies beside the source, or where
NUMBA_CACHE_DIR says; where neither can be written, in the user's cache.
"""

from __future__ import annotations

import numpy as np

import evenlight
from evenlight.analysis.calibration.joint.marginal_likelihood import spline_sums
from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.frame import LumaChroma
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.optimizer.factor_grid import grid_starts
from evenlight.method.optimizer.optimize import pose
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_power_model

SIZE = (288, 232)  # [pixels] width and height
FRAMES = 20


def compile_kernels() -> None:
    """Analyse and optimize a little of everything: types of pixels, actuators, measures, a calm track."""
    width, height = SIZE
    noise = np.random.default_rng(1).random((FRAMES, height, width, 1), dtype=np.float32) / 8
    grays = np.repeat(noise + np.linspace(0, 0.8, FRAMES, dtype=np.float32)[:, None, None, None], 3, axis=3)
    evenlight.frame_loss(grays[0], 0.5)
    few = grays[::9]
    for frames in (
        few,
        few.astype(np.float64),
        (few * 255).astype(np.uint8),
        (few * 65535).astype(np.uint16),
    ):
        evenlight.loss_curves(frames, actuator="pixels")
    for measure in MEASURES.values():
        evenlight.loss_curves(few[:1], contrast_model=measure)
        evenlight.frame_loss(grays[0], 0.5, contrast_model=measure)
    luma = (few[0, ..., 0] * 255).astype(np.uint8)
    planes = LumaChroma(
        (luma, luma[::2, ::2], luma[::2, ::2]), (0.2126, 0.0722), False, (True, True), luma.copy
    )
    light = FrameLight(evenlight.load_display("varjo-xr3"), PixelToLuminance.LINEAR_FIRST)
    for pixels in (planes, frames[0], luma[..., None].repeat(3, axis=2)):
        for halvings in (1, 2):
            light.luminance_and_mean(pixels, halvings)
    for count in (3, FRAMES):
        track = evenlight.optimize(grays[:count], 0.5, calm=0.1)
    limit, power = evenlight.load_rate_limit("surace2025"), load_power_model("surace2025")
    grid_starts(pose(track.curves, Request(0.5, BudgetUnit.FACTOR, power, limit)))
    splines, weights = np.zeros((2, 2, 2, 2)), np.zeros((2, 1, 3, 4))
    for people in (splines, splines[:, :1]):  # all of them, and a group
        spline_sums(people, np.zeros((2, 1), np.intp), 1, weights, np.ones(3))


if __name__ == "__main__":
    compile_kernels()
