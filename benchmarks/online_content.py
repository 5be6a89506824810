"""What the online controller is measured on: pictures, the walk through the house, steps and extremes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.stimuli.sequences import built_in_sequence


def picture(height: int, width: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return a picture with detail at every scale, as photographs have it, and areas of one colour."""
    side = 256
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None, :])
    spectrum = np.fft.rfft2(rng.standard_normal((side, side))) / np.maximum(frequency, 1 / side)
    tile = np.fft.irfft2(spectrum, (side, side))
    rows, columns = -(-height // side), -(-width // side)
    detail = np.tile(tile / tile.std(), (rows, columns))[:height, :width]
    level = np.linspace(0.1, 0.8, width)[None, :]  # from dark to bright
    gray = np.clip(level + 0.35 * level * detail, 0, 1)
    gray[: height // 4, : width // 4] = 0.5
    colours = np.stack([gray, gray**1.1, 0.9 * gray], axis=2)
    return np.asarray((255 * colours).round(), dtype=np.uint8)


def layered_pictures(height: int, width: int, rng: np.random.Generator) -> dict[str, NDArray[np.uint8]]:
    """Return pictures that differ from row to row as few do: what counts only some rows errs most there."""
    rows = np.arange(height)
    grain = 0.15 * rng.standard_normal((height, width))
    ramp = np.broadcast_to(np.linspace(0.1, 0.7, width), (height, width))
    pictures = {
        f"grain in every other {thick} rows": 0.4 + grain * (rows // thick % 2 == 0)[:, None]
        for thick in (4, 8, 16, 32)
    }
    pictures["grain in 16 of each 64 rows"] = 0.4 + grain * (abs(rows % 64 - 32) < 8)[:, None]
    letters = np.where(rng.random((height, width)) < 0.5, 0.95, 0.1)
    line = (abs(rows - 0.9 * height) < 0.02 * height)[:, None] & (abs(np.arange(width) / width - 0.5) < 0.25)
    pictures["a ramp with a line of text"] = np.where(line, letters, ramp)
    return {
        name: np.repeat((255 * np.clip(gray, 0, 1)).round().astype(np.uint8)[..., None], 3, axis=2)
        for name, gray in pictures.items()
    }


def house_curves(display: Display, quick: bool) -> LossCurves:
    """Return the loss curves of the walk through the house, rendered small; when quick, of its beginning."""
    size, seconds = ((96, 54), 12.0) if quick else ((640, 360), None)
    walk = built_in_sequence("house", size, seconds, 5.0)
    return analyze_frames(walk.frames(), "house", display)


def content(strength: Array, luminance: Array, display: Display, frames_per_second: float) -> LossCurves:
    """Return curves whose loss is strength · (1 - b): content that can be told beforehand.

    Parameters
    ----------
    strength, luminance : array, (N,)
        What is lost as b goes to 0; mean luminance at factor 1 [cd/m^2].
    display : Display
        What it is shown on.
    frames_per_second : float
        [Hz].
    """
    n, factors = len(strength), brightness_factors()
    return LossCurves(
        video="made",
        display=display,
        times=np.arange(n) / frames_per_second,
        durations=np.full(n, 1 / frames_per_second),
        factors=factors,
        loss=np.clip(np.outer(strength, 1 - factors), 0.0, 1.0),
        visible_contrast=np.full(n, 0.5),
        mean_luminance=luminance,
        channel_means=np.repeat((luminance / display.peak_luminance)[:, None], 3, axis=1),
        provenance=Provenance(),
    )


def step_content(display: Display, strong: float, rate: float) -> LossCurves:
    """Return 20 s of bright content with little to lose, 40 s of dark with much, and 40 s of the first."""
    seconds = np.array([20.0, 40.0, 40.0])
    frames = np.rint(seconds * rate).astype(int)
    return content(
        np.repeat([0.12, strong, 0.12], frames), np.repeat([60.0, 15.0, 60.0], frames), display, rate
    )


def bound_content(display: Display, strong: float, rate: float) -> LossCurves:
    """Return 10 s of content with next to nothing to lose, and 60 s of content with much."""
    frames = np.rint(np.array([10.0, 60.0]) * rate).astype(int)
    strength = np.repeat([0.01, strong], frames)
    return content(strength, np.full(len(strength), 50.0), display, rate)


def extreme_content(display: Display, rng: np.random.Generator) -> LossCurves:
    """Return frames that cut at random between black, dark and white, with nothing or everything to lose."""
    strength = rng.choice([0.0, 0.02, 0.3, 1.0, 1.25], 200)
    luminance = rng.choice([0.0, 1e-4, 0.1, 5.0, 60.0, display.peak_luminance], 200)
    return content(strength, luminance, display, float(rng.choice([5.0, 24.0, 90.0])))
