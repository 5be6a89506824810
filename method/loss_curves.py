"""Contrast loss at every brightness factor at once, for the frames of a video.

Decision (docs/decisions/one-pass-curves.md): each pixel has one critical brightness factor
(`method.critical_factor`), and the share of pixels whose factor is below b is the visible contrast at b, for
all b. `loss_curves_by_definition` dims and compares instead, and is what the fast form is measured against.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.frame import Frame
from data_schema.loss_curves import LossCurves
from data_schema.provenance import Provenance, provenance_now
from method.contrast_loss import loss_of, visible_contrast
from method.frame_analysis import FrameAnalysis
from method.luminance import dimmed_luminance

SMALLEST_SIDE = 8  # [pixels] leaves two bands with their adaptation luminance

Array = NDArray[np.float64]


def brightness_factors(lowest: float = 0.2, knots: int = 65) -> Array:
    """Return the knots of loss curves: brightness factors b from the lowest to 1, in equal ratios.

    Loss bends most where b is small; equal ratios follow it there whatever the lowest factor.

    Parameters
    ----------
    lowest : float
        The lowest factor, above 0; the paper's precomputation starts at 0.2.
    knots : int
        How many; between them loss is interpolated linearly.

    >>> brightness_factors(0.25, knots=3).tolist()
    [0.25, 0.5, 1.0]
    """
    return np.geomspace(lowest, 1.0, knots)


def analyze_frames(
    frames: Iterable[Frame],
    video: str,
    display: Display,
    model: ContrastModel = DEFAULT_MODEL,
    factors: ArrayLike | None = None,
    provenance: Provenance | None = None,
) -> LossCurves:
    """Return the contrast-loss curves of a video, one frame in memory at a time.

    A frame equal to the one before it is not analysed again.

    Parameters
    ----------
    frames : iterable of Frame
        In order of time, all of one size of at least 8 × 8 pixels.
    video : str
        Its name, for messages.
    display : Display
        The display that it is shown on, pixel by pixel.
    model : ContrastModel
        Choices of the contrast model.
    factors : array_like, (K,), optional
        Knots b, rising to 1; otherwise `brightness_factors()`.
    provenance : Provenance, optional
        Otherwise made here.
    """
    knots = _checked_knots(brightness_factors() if factors is None else factors)
    times, durations, results = [], [], []
    analysis: FrameAnalysis | None = None
    before: NDArray[Any] | None = None
    for number, frame in enumerate(frames):
        shape = frame.pixel_values.shape[:2]
        if analysis is None:
            analysis = FrameAnalysis(_checked_shape(shape, video), display, model, knots)
        if before is not None and shape != before.shape[:2]:
            raise InputError(f"{video}: {_size_change(number, before.shape, shape)}")
        if before is None or not np.array_equal(before, frame.pixel_values):
            result = analysis.of(frame.pixel_values)
            before = frame.pixel_values.copy()  # a source may fill the same array again
        times.append(frame.time)
        durations.append(frame.duration)
        results.append(result)
    if not results:
        raise InputError(f"{video}: holds no frame; at least one is needed")
    return LossCurves(
        video=video,
        display=display,
        times=np.array(times),
        durations=np.array(durations),
        factors=knots,
        loss=np.array([result.loss for result in results]),
        visible_contrast=np.array([result.visible_contrast for result in results]),
        mean_luminance=np.array([result.mean_luminance for result in results]),
        channel_means=np.array([result.channel_means for result in results]),
        provenance=provenance or provenance_now(),
    )


def _checked_knots(factors: ArrayLike) -> Array:
    """Return the knots, or refuse ones that `LossCurves` would refuse after all the work."""
    knots = np.asarray(factors, dtype=np.float64)
    rising = knots.ndim == 1 and len(knots) >= 2 and bool((np.diff(knots) > 0).all())
    if not rising or knots[0] <= 0 or knots[-1] != 1:
        raise ValueError(f"factors must rise from above 0 to 1, got {knots}")
    return knots


def _checked_shape(shape: tuple[int, ...], video: str) -> tuple[int, int]:
    """Return a frame's height and width, or refuse a frame without two bands."""
    height, width = shape
    if min(height, width) < SMALLEST_SIDE:
        raise InputError(
            f"{video}: frames are {width} x {height} pixels; "
            f"need at least {SMALLEST_SIDE} x {SMALLEST_SIDE} for two frequency bands"
        )
    return height, width


def _size_change(number: int, before: tuple[int, ...], now: tuple[int, ...]) -> str:
    """Return what to say of a frame whose size differs."""
    return (
        f"frame {number} has {now[1]} x {now[0]} pixels, the one before {before[1]} x {before[0]}; "
        f"need frames of one size"
    )


def loss_curves_by_definition(
    emitted: Array, factors: ArrayLike, display: Display, model: ContrastModel = DEFAULT_MODEL
) -> Array:
    """Return the contrast loss of one frame at each factor: dim, rebuild, compare (Eqs. 1 to 5), in float64.

    Parameters
    ----------
    emitted : array, (height, width)
        I, luminance that the display emits at b = 1 [cd/m^2].
    factors : array_like, (K,)
        Brightness factors b.
    display : Display
        The display that shows it.
    model : ContrastModel
        Choices of the contrast model.

    Returns
    -------
    array, (K,)
        𝓛_c, in [0, 1].
    """
    reference = visible_contrast(dimmed_luminance(emitted, 1.0, display), display, model)
    dimmed = (dimmed_luminance(emitted, b, display) for b in np.asarray(factors, dtype=np.float64))
    return np.array([loss_of(visible_contrast(D, display, model), reference) for D in dimmed])
