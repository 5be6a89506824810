"""The contrast that pixels lose beyond what a backlight loses: they show nothing below the display's black.

Decision (docs/decisions/dimmed-playback.md): the curves of one pass, which scale all light, stay as they are;
to those of a frame that has channel values which fall below black, the difference is added that the floor
makes. It is computed at a few knots, from the picture that is drawn, and interpolated between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.contrast_loss import loss_of
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.luminance import unit_pixel_values
from evenlight.method.contrast.one_factor import OneFactorLoss

MANY_PIXELS = 65536  # of a frame; a smaller one is computed at every knot: single pixels make it unsteady
TOLERANCE = 5e-4  # of the loss that the floor adds, halfway between two knots that are computed


class PixelFloor:
    """The loss that the pixels' floor of black adds to frames of one size.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display whose pixels dim.
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.
    """

    def __init__(
        self, shape: tuple[int, int], display: Display, model: ContrastModel, factors: Array
    ) -> None:
        self._display, self._factors, self._form = display, factors, model.loss
        self._light = FrameLight(display, model.pixel_to_luminance)
        self._exact = OneFactorLoss(shape, display, model, float(factors[0]))
        self._backlight = FrameAnalysis(shape, display, model, factors)

    def onset(self, pixel_values: NDArray[Any]) -> float:
        """Return the factor from which down a frame has channel values below black; 0 if it never has."""
        display = self._display
        darkest = float(unit_pixel_values(np.asarray(pixel_values.min()))) ** display.gamma
        emitted = display.black_level + (display.peak_luminance - display.black_level) * darkest
        return display.black_level / emitted if emitted > 0 else 0.0

    def added_at(self, pixel_values: NDArray[Any], factor: float) -> float:
        """Return the loss 𝓛_c of a frame, (height, width, 3), dimmed by pixels, less that by a backlight."""
        if factor >= self.onset(pixel_values):
            return 0.0
        dimmed, full = self._exact.visible_contrast(self._light.luminance(pixel_values), factor)
        return self._drawn_loss(pixel_values, factor, full) - loss_of(dimmed, full, self._form)

    def added(self, pixel_values: NDArray[Any]) -> Array:
        """Return the same at each knot, (K,), computed at as many as it takes; of small frames at all."""
        factors, added = self._factors, np.zeros(len(self._factors))
        last = min(int(np.searchsorted(factors, self.onset(pixel_values))), len(factors) - 1)
        if last == 0:
            return added
        full, _ = self._exact.visible_contrast(self._light.luminance(pixel_values), 1.0)
        dimmed = self._backlight.of(pixel_values).loss

        def missing(k: int) -> float:
            return self._drawn_loss(pixel_values, float(factors[k]), full) - float(dimmed[k])

        if pixel_values[..., 0].size <= MANY_PIXELS:
            added[:last] = [missing(k) for k in range(last)]
            return added
        known = {0: missing(0), last // 2: missing(last // 2), last: 0.0}  # nothing from the onset on
        parts = list(pairwise(sorted(known)))
        while parts:
            expected, further = _smooth(known), list[tuple[int, int]]()
            for begin, end in parts:
                middle = (begin + end) // 2
                if middle > begin:
                    known[middle] = missing(middle)
                    if abs(known[middle] - expected(middle)) > TOLERANCE:
                        further += [(begin, middle), (middle, end)]
            parts = further
        added[:last] = _smooth(known)(np.arange(last))
        return added

    def _drawn_loss(self, pixel_values: NDArray[Any], factor: float, full: float) -> float:
        """Return the loss of a frame as it is drawn; `full` is its visible contrast at full brightness."""
        drawn, _ = self._exact.visible_contrast(self._light.drawn(pixel_values, factor), 1.0)
        return loss_of(drawn, full, self._form)


def _smooth(known: dict[int, float]) -> scipy.interpolate.PchipInterpolator:
    """Return what runs through known values without overshooting them (Fritsch & Butland 1984)."""
    at = sorted(known)
    return scipy.interpolate.PchipInterpolator(at, [known[k] for k in at])


@dataclass(slots=True)
class FlooredFrames:
    """The loss that the pixels' floor adds to each frame of a video, computed while the video streams past.

    Attributes
    ----------
    display, model, factors : Display, ContrastModel, array (K,)
        As of the loss curves that are to be completed.
    threads : int
        How many frames are worked on at a time.
    earlier : array (n, K) or None
        What it adds to the frames before, where an interrupted analysis goes on.
    """

    display: Display
    model: ContrastModel
    factors: Array
    threads: int = 1
    earlier: Array | None = None
    _added: list[Future[Array]] = field(default_factory=list)  # of each frame

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield the frames unchanged."""
        floor, before = None, None
        with ThreadPoolExecutor(self.threads, thread_name_prefix="floor") as pool:
            for frame in frames:
                yield frame  # whoever takes it refuses what cannot be analysed
                pixels = frame.pixel_values
                if before is not None and before.dtype == pixels.dtype and np.array_equal(before, pixels):
                    self._added.append(self._added[-1])
                    continue
                if floor is None:
                    floor = PixelFloor(pixels.shape[:2], self.display, self.model, self.factors)
                before = pixels.copy()  # its source may fill it again
                self._added.append(pool.submit(floor.added, before))
                for earlier in self._added[-self.threads - 1 : -self.threads]:
                    earlier.result()  # no more frames than that are held

    def added(self, first: int, end: int) -> Array:
        """Return what the floor adds to some of the frames that went past, or before them, (n, K)."""
        known = np.empty((0, len(self.factors))) if self.earlier is None else self.earlier
        skip = len(known)
        found = [task.result() for task in self._added[max(first - skip, 0) : max(end - skip, 0)]]
        return np.concatenate([known[first:end], np.reshape(found, (-1, len(self.factors)))])

    def complete(self, curves: LossCurves) -> LossCurves:
        """Return the curves of the frames that went past, made for a backlight, as those of pixels."""
        added = self.added(0, curves.n_frames)
        loss = np.clip(curves.loss + added, 0.0, 1.0)
        # Knots between those computed, and rounding, may let loss rise with the factor where it hardly falls.
        falling = np.maximum.accumulate(loss[:, ::-1], axis=1)[:, ::-1]
        touched = np.abs(added).max(axis=1, keepdims=True) > 0
        loss = np.where(touched, falling, curves.loss)
        bends = None if touched.any() else curves.bends
        return replace(curves, loss=loss, bends=bends, actuator=Actuator.PIXELS)


def floor_in_samples(
    samples: Sequence[tuple[int, NDArray[Any]]], factors: Array, display: Display, model: ContrastModel
) -> float | None:
    """Return the largest loss that the floor adds to some frames of a backlight's track; None without any.

    To a frame that is no sample it may add more.

    Parameters
    ----------
    samples : sequence of (int, array (height, width, 3))
        Numbers of the frames, and their pixel values.
    factors, display, model : array (N,), Display, ContrastModel
        Brightness factors of the track; as of its loss curves.
    """
    if not samples:
        return None
    knots = np.array([factors.min(), 1.0])
    floor = PixelFloor(samples[0][1].shape[:2], display, model, knots)
    return max(0.0, *(floor.added_at(pixels, float(factors[k])) for k, pixels in samples))
