"""Contrast loss at every brightness factor at once, for the frames of a video.

Decision (docs/decisions/one-pass-curves.md): each pixel has one critical brightness factor
(`method.critical_factor`), and the share of pixels whose factor is below b is the visible contrast at b, for
all b. `loss_curves_by_definition` dims and compares instead, and is what the fast form is measured against.
"""

from __future__ import annotations

import itertools
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.loss_curves import LossCurves
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.method.analysis_device import make_frame_analysis
from evenlight.method.contrast_loss import loss_of, visible_contrast
from evenlight.method.frame_analysis import FrameLoss
from evenlight.method.frame_crew import frame_losses
from evenlight.method.luminance import dimmed_luminance
from evenlight.method.spare_arrays import SpareArrays
from evenlight.method.thrift import EVERYTHING, Thrift

SMALLEST_SIDE = 8  # [pixels] leaves two bands with their adaptation luminance


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
    thrift: Thrift = EVERYTHING,
) -> LossCurves:
    """Return the contrast-loss curves of a video, few frames in memory at a time.

    A frame equal to the one before it is not analysed again. Mean luminance and channel means are those of
    every frame, whatever the thrift.

    Parameters
    ----------
    frames : iterable of Frame
        In order of time, all of one size of at least 8 × 8 pixels; asked for in this thread.
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
    thrift : Thrift
        How much is counted, and where.
    """
    knots = _checked_knots(brightness_factors() if factors is None else factors)
    timeline = _Timeline(video)
    contents = timeline.contents(frames)
    first = next(contents, None)
    if first is None:
        raise InputError(f"{video}: holds no frame; at least one is needed")
    chosen = make_frame_analysis(first.shape[:2], display, model, knots, thrift.device)
    rows = _gathered(
        frame_losses(chosen.analysis, itertools.chain([first], contents), thrift, timeline.spare)
    )
    shown = np.array(timeline.shown)
    again = np.concatenate([[False], np.diff(shown) == 0])
    if again.any():
        rows = rows[shown]
        rows[again, _COUNTED] = 0.0
    return LossCurves(
        video=video,
        display=display,
        times=np.array(timeline.times),
        durations=np.array(timeline.durations),
        factors=knots,
        loss=rows[:, _BESIDE:],
        visible_contrast=rows[:, 0],
        mean_luminance=rows[:, 1],
        channel_means=rows[:, 2:_COUNTED],
        provenance=provenance or provenance_now(),
        tolerance=thrift.tolerance,
        counted=rows[:, _COUNTED],
        computed_on=chosen.name,
    )


_COUNTED = 5  # column of a row, after contrast, luminance and three channels
_BESIDE = 6  # columns before the loss


def _gathered(results: Iterable[FrameLoss]) -> Array:
    """Return a row for each frame: nothing is kept of a frame but these numbers."""
    numbers = array("d")
    for found in results:
        means, loss = found.channel_means, found.loss
        row = [found.visible_contrast, found.mean_luminance, *means, found.counted, *loss]
        numbers.extend(row)
    return np.frombuffer(numbers).reshape(-1, len(row))


@dataclass(slots=True)
class _Timeline:
    """When the frames of a video appear, and which of its contents each shows.

    Attributes
    ----------
    video : str
        Its name, for messages.
    times, durations : list of float
        Of each frame [s].
    shown : list of int
        For each frame, the number of its content: that of the frame before it, if they are equal.
    spare : SpareArrays
        Where contents go when they have been analysed, to be filled anew.
    """

    video: str
    times: list[float] = field(default_factory=list)
    durations: list[float] = field(default_factory=list)
    shown: list[int] = field(default_factory=list)
    spare: SpareArrays = field(default_factory=SpareArrays)

    def contents(self, frames: Iterable[Frame]) -> Iterator[NDArray[Any]]:
        """Yield the pixel values of each frame that differs from the one before, as an array of its own."""
        before: NDArray[Any] | None = None
        contents = -1
        for number, frame in enumerate(frames):
            shape = frame.pixel_values.shape
            if before is None:
                _require_bands(shape, self.video)
            elif shape[:2] != before.shape[:2]:
                raise InputError(f"{self.video}: {_size_change(number, before.shape, shape)}")
            differs = before is None or not _shows_the_same(before, frame.pixel_values)
            contents += differs
            self.times.append(frame.time)
            self.durations.append(frame.duration)
            self.shown.append(contents)
            if differs:
                # A source may fill the same array again. This may be `before`, which has been compared.
                before = self.spare.take(shape, frame.pixel_values.dtype)
                np.copyto(before, frame.pixel_values)
                yield before


def _shows_the_same(before: NDArray[Any], now: NDArray[Any]) -> bool:
    """Return whether two frames are equal: 1 is white as a float, and all but black as an integer."""
    return before.dtype == now.dtype and np.array_equal(before, now)


def _checked_knots(factors: ArrayLike) -> Array:
    """Return the knots, or refuse ones that `LossCurves` would refuse after all the work."""
    knots = np.asarray(factors, dtype=np.float64)
    rising = knots.ndim == 1 and len(knots) >= 2 and bool((np.diff(knots) > 0).all())
    if not rising or knots[0] <= 0 or knots[-1] != 1:
        raise ValueError(f"factors must rise from above 0 to 1, got {knots}")
    return knots


def _require_bands(shape: tuple[int, ...], video: str) -> None:
    """Refuse frames that are too small for two bands."""
    height, width = shape[:2]
    if min(height, width) < SMALLEST_SIDE:
        raise InputError(
            f"{video}: frames are {width} x {height} pixels; "
            f"need at least {SMALLEST_SIDE} x {SMALLEST_SIDE} for two frequency bands"
        )


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
