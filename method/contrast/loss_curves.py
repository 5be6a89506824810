"""Contrast loss at every brightness factor at once, for the frames of a video.

Decision (docs/decisions/one-pass-curves.md): each pixel has one critical brightness factor
(`contrast.critical_factor`), and the share of pixels whose factor is below b is the visible contrast at b,
for all b. The definition, `contrast.contrast_loss`, dims and compares instead; it is the oracle of this form.
`analyze_frames` is what a program calls; `make_frame_analysis` chooses between the processor and the graphics
processor (docs/decisions/one-pass-curves.md).
"""

from __future__ import annotations

import itertools
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array, Integers
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame, LumaChroma, Pixels, same_pixels
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.tracks.loss_bends import LossBends
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import ONE_CORE, AnalysisEffort, Device
from evenlight.method.contrast.checkpoints import AnalysedFrames, Checkpoints
from evenlight.method.contrast.frame_analysis import (
    FrameAnalysis,
    FrameAnalyzer,
    FrameLoss,
    SpareArrays,
    frame_losses,
)
from evenlight.method.gpu.context import is_software

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
    effort: AnalysisEffort = ONE_CORE,
    checkpoints: Checkpoints | None = None,
) -> LossCurves:
    """Return the contrast-loss curves of a video, few frames in memory at a time.

    A frame equal to the one before it is not analysed again.

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
    effort : AnalysisEffort
        Where frames are analysed, and how many at a time.
    checkpoints : Checkpoints, optional
        Gets what is done, a minute at a time; with frames that were analysed before, `frames` are the rest.
    """
    knots = _checked_knots(brightness_factors() if factors is None else factors)
    begun = None if checkpoints is None else checkpoints.begun
    timeline = _Timeline(video) if begun is None else _timeline_after(begun, video)
    contents = timeline.contents(frames)
    first = next(contents, None)
    if first is None:
        raise InputError(f"{video}: holds no frame; at least one is needed")
    chosen = make_frame_analysis(first.shape[:2], display, model, knots, effort.device)
    rows, bends = _gathered(
        frame_losses(chosen.analysis, itertools.chain([first], contents), effort.threads, timeline.spare),
        timeline,
        checkpoints,
    )
    known = _loss_bends(bends, rows[:, _BESIDE - 1].astype(np.int64), timeline.shown)
    if timeline.shown[-1] + 1 < len(timeline.shown):
        rows = rows[timeline.shown]
    return LossCurves(
        video=video,
        display=display,
        times=np.array(timeline.times),
        durations=np.array(timeline.durations),
        factors=knots,
        loss=rows[:, _BESIDE:],
        visible_contrast=rows[:, 0],
        mean_luminance=rows[:, 1],
        channel_means=rows[:, 2:5],
        provenance=provenance or provenance_now(),
        computed_on=chosen.name,
        bends=known,
    )


_BESIDE = 6  # columns before the loss: contrast, luminance, three channels, and how many bends


def _gathered(
    results: Iterable[FrameLoss], timeline: _Timeline, checkpoints: Checkpoints | None
) -> tuple[Array, Array]:
    """Return a row for each content, and the bends of all: nothing else is kept of a frame."""
    begun = None if checkpoints is None else checkpoints.begun
    numbers = array("d", () if begun is None else begun.rows.ravel())
    bends = array("f", () if begun is None else begun.bends.ravel())
    for found in results:
        row = [found.visible_contrast, found.mean_luminance, *found.channel_means, len(found.bends)]
        row.extend(found.loss)
        numbers.extend(row)
        bends.extend(found.bends.ravel())
        if checkpoints is not None:
            frames = timeline.times, timeline.durations, timeline.shown
            checkpoints.at(numbers, bends, len(row), frames)
    return np.asarray(numbers).reshape(-1, len(row)), np.asarray(bends).reshape(-1, 2)


def _loss_bends(bends: Array, counts: Integers, shown: Sequence[int]) -> LossBends | None:
    if not counts.all():
        return None
    return LossBends(np.array(shown), np.append(0, np.cumsum(counts)), bends[:, 0], bends[:, 1])


@dataclass(slots=True)
class _Timeline:
    """When the frames of a video appear, and which of its contents each shows."""

    video: str  # its name, for messages
    times: list[float] = field(default_factory=list)  # of each frame [s]
    durations: list[float] = field(default_factory=list)  # of each frame [s]
    # for each frame, the number of its content: that of the frame before it, if they are equal
    shown: list[int] = field(default_factory=list)
    # where contents go when they have been analysed, to be filled again
    spare: SpareArrays = field(default_factory=SpareArrays)

    def contents(self, frames: Iterable[Frame]) -> Iterator[Pixels]:
        """Yield the pixels of each frame that differs from the one before, as arrays of their own."""
        before: Pixels | None = None
        contents = self.shown[-1] if self.shown else -1
        for number, frame in enumerate(frames, start=len(self.shown)):
            height, width = frame.shape
            if before is None:
                _require_bands(frame.shape, self.video)
            elif frame.shape != before.shape[:2]:
                raise InputError(
                    f"{self.video}: frame {number} has {width} x {height} pixels, the one before "
                    f"{before.shape[1]} x {before.shape[0]}; need frames of one size"
                )
            differs = before is None or not same_pixels(before, frame.pixels)
            contents += differs
            self.times.append(frame.time)
            self.durations.append(frame.duration)
            self.shown.append(contents)
            if differs:
                before = self._own(frame.pixels)
                yield before

    def _own(self, pixels: Pixels) -> Pixels:
        """Return pixels that nothing else writes to: a source may fill its array again, but not planes."""
        if isinstance(pixels, LumaChroma):
            return pixels
        own = self.spare.take(pixels.shape, pixels.dtype)  # may be the frame before, which has been compared
        np.copyto(own, pixels)
        return own


def _timeline_after(begun: AnalysedFrames, video: str) -> _Timeline:
    """Return the timeline of a video whose first frames were analysed before; another content follows."""
    return _Timeline(video, begun.times.tolist(), begun.durations.tolist(), begun.shown.tolist())


def _checked_knots(factors: ArrayLike) -> Array:
    """Return the knots, or refuse ones that `LossCurves` would refuse after all the work."""
    knots = np.asarray(factors, dtype=np.float64)
    rising = knots.ndim == 1 and len(knots) >= 2 and bool((np.diff(knots) > 0).all())
    if not rising or knots[0] <= 0 or knots[-1] != 1:
        raise ValueError(f"factors must rise from above 0 to 1, got {knots}")
    return knots


def _require_bands(shape: tuple[int, ...], video: str) -> None:
    height, width = shape[:2]
    if min(height, width) < SMALLEST_SIDE:
        raise InputError(
            f"{video}: frames are {width} x {height} pixels; "
            f"need at least {SMALLEST_SIDE} x {SMALLEST_SIDE} for two frequency bands"
        )


@dataclass(frozen=True, slots=True)
class ChosenAnalysis:
    """An analysis, and where it runs."""

    analysis: FrameAnalyzer
    device: Device  # CPU or GPU
    reason: str  # why, in words for the user; the renderer's name if it is the graphics processor

    @property
    def name(self) -> str:
        """What computes: "cpu", or "gpu" and the renderer's name."""
        return f"gpu: {self.reason}" if self.device is Device.GPU else "cpu"


def make_frame_analysis(
    shape: tuple[int, int],
    display: Display,
    model: ContrastModel,
    factors: Array,
    device: Device = Device.CPU,
) -> ChosenAnalysis:
    """Return the analysis of frames of one size on a device.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.
    device : Device
        Where.

    Raises
    ------
    InputError
        If the graphics processor is asked for, and there is none that can.
    """

    def on_cpu(reason: str) -> ChosenAnalysis:
        return ChosenAnalysis(FrameAnalysis(shape, display, model, factors), Device.CPU, reason)

    if device is Device.CPU:
        return on_cpu("as asked")
    from evenlight.method.gpu.frame_loss import GpuFrameAnalysis  # only where it is wanted

    try:
        on_gpu = GpuFrameAnalysis(shape, display, model, factors)
    except InputError as error:
        if device is Device.GPU:
            raise
        return on_cpu(str(error))
    if device is Device.AUTO and is_software(on_gpu.renderer):
        return on_cpu(f"OpenGL runs on the processor here ({on_gpu.renderer}), which is faster without")
    return ChosenAnalysis(on_gpu, Device.GPU, on_gpu.renderer)
