"""The analysis of frames: contrast loss at all brightness factors, in one pass over a frame's pixels.

Frames are asked for in the calling thread, because a source may be tied to it (graphics are) and because an
interruption arrives there. Decoding runs ahead of the analysis by a bounded number of frames; the loops of
the analysis run outside Python's lock. What a frame gives does not depend on the thread or on the moment, so
that the result is the same for any number of threads. Frames are large, and fresh memory can cost more than
the work done on it, so `SpareArrays` are filled again and again.
"""

from __future__ import annotations

import threading
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import LumaChroma, Pixels
from evenlight.method.contrast.band_shares import BandShares
from evenlight.method.contrast.bends import NO_BENDS, bends_of
from evenlight.method.contrast.contrast_loss import losses_of, visible_contrast
from evenlight.method.contrast.critical_factor import TABLE_STEPS, band_tables, tables_hold
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.one_pass import reduced

_AHEAD = 2  # frames decoded beyond those that are being analysed
_Kind = tuple[tuple[int, ...], np.dtype[Any]]  # shape and type of an array


@dataclass(frozen=True, slots=True)
class FrameLoss:
    """What the analysis of a frame gives: a row of `LossCurves`."""

    loss: Array  # (K,): 𝓛_c at each knot
    visible_contrast: float  # C_v of the undimmed frame
    mean_luminance: float  # Ī, mean luminance emitted at b = 1 [cd/m^2]
    channel_means: Array  # (3,): means of the linear R, G, B channels
    bends: Array  # (M, 2): factors b and 𝓛_c between which it is linear; none if only knots are known


class FrameAnalyzer(Protocol):
    """Gives the contrast loss of frames of one size."""

    def of(self, pixels: Pixels) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""


def frame_losses(
    analysis: FrameAnalyzer, frames: Iterable[Pixels], threads: int, spare: SpareArrays
) -> Iterator[FrameLoss]:
    """Yield what the analysis of each frame gives, in order.

    Parameters
    ----------
    analysis : FrameAnalyzer
        For frames of their size.
    frames : iterable of array, (height, width, 3), or of LumaChroma
        Gamma-encoded; arrays that nothing else writes to. Their errors are passed on, at once.
    threads : int
        That analyse frames.
    spare : SpareArrays
        Gets each array that has been analysed.
    """

    def counted(pixels: Pixels) -> FrameLoss:
        found = analysis.of(pixels)
        if not isinstance(pixels, LumaChroma):  # planes are the decoder's
            spare.give_back(pixels)
        return found

    pool = ThreadPoolExecutor(threads, thread_name_prefix="frames")
    try:
        under_way: deque[Future[FrameLoss]] = deque()
        for pixels in frames:
            under_way.append(pool.submit(counted, pixels))
            if len(under_way) > threads + _AHEAD:
                yield under_way.popleft().result()
        while under_way:
            yield under_way.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


class FrameAnalysis:
    """Tables for frames of one size on one display, and the analysis of a frame with them.

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
    table_steps : int
        Of the tables of each band's sensitivity.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel,
        factors: Array,
        table_steps: int = TABLE_STEPS,
    ) -> None:
        self._display, self._model, self._factors = display, model, factors
        self._bands = band_tables(shape, float(factors[0]), display, model, table_steps)
        self._band_shares = BandShares(model, factors, self._bands)
        self._counted_at = np.exp2(self._band_shares.log_factors)
        below = np.searchsorted(factors, self._counted_at, side="right") - 1
        self._knot_below = np.clip(below, 0, len(factors) - 2)
        self._spare = SpareArrays()
        self._light = FrameLight(display, model.pixel_to_luminance, self._spare.take)

    @property
    def in_one_pass(self) -> bool:
        """Whether one pass gives the curve; otherwise each knot is computed by definition.

        It does not where reflected light meets a sensitivity taken at another luminance than the pixel's.
        """
        return tables_hold(self._display, self._model)

    def of(self, pixels: Pixels) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""
        luminance, mean, means = self._light.luminance_and_mean(pixels)
        counted, visible = (self._in_one_pass if self.in_one_pass else self._by_definition)(luminance)
        self._spare.give_back(luminance)
        reference = float(visible[-1])
        loss = losses_of(visible, reference, self._model.loss)
        if len(counted) == len(visible):
            return FrameLoss(loss, reference, mean, means, NO_BENDS)
        between = losses_of(counted, reference, self._model.loss)
        between = np.clip(between, loss[self._knot_below + 1], loss[self._knot_below])
        return FrameLoss(loss, reference, mean, means, bends_of(self._counted_at, between))

    def _by_definition(self, emitted: NDArray[np.float32]) -> tuple[Array, Array]:
        dimmed = (dimmed_luminance(emitted, b, self._display) for b in self._factors)
        visible = np.array([visible_contrast(D, self._display, self._model) for D in dimmed])
        return visible, visible

    def _in_one_pass(self, emitted: NDArray[np.float32]) -> tuple[Array, Array]:
        """Return the visible contrast at each factor, (F,), and at the knots: means of the bands' shares."""
        counted, visible = np.zeros(len(self._counted_at)), np.zeros(len(self._factors))
        level, coarser = emitted, reduced(emitted)
        for band in range(len(self._bands)):
            coarsest = reduced(coarser)
            seen = self._band_shares.of(level, coarser, coarsest, band)
            counted += seen
            visible += self._band_shares.at_knots(seen, band)
            level, coarser = coarser, coarsest
        return counted / len(self._bands), visible / len(self._bands)


class SpareArrays:
    """Arrays that were given back, to be filled again; any thread may take and give.

    The system hands out memory page by page, at its first touch: for the luminance of a 1080p frame that can
    take milliseconds. So there are as many arrays as were ever in use at a time, and no more: one that comes
    back when all that were handed out are back is not kept.

    >>> spare = SpareArrays()
    >>> first = spare.take((2, 3), np.float32)
    >>> spare.give_back(first)
    >>> spare.take((2, 3), np.float32) is first
    True
    """

    def __init__(self) -> None:
        self._held: defaultdict[_Kind, list[NDArray[Any]]] = defaultdict(list)
        self._out: Counter[_Kind] = Counter()
        self._one_at_a_time = threading.Lock()

    def take(self, shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
        """Return an array of a shape and type, whatever it holds."""
        asked = shape, np.dtype(kind)
        with self._one_at_a_time:
            self._out[asked] += 1
            held = self._held[asked]
            if held:
                return held.pop()
        return np.empty(shape, kind)

    def give_back(self, array: NDArray[Any]) -> None:
        """Give back an array, for the next `take`."""
        given = array.shape, array.dtype
        with self._one_at_a_time:
            if self._out[given] > 0:
                self._out[given] -= 1
                self._held[given].append(array)

    @property
    def held(self) -> int:
        """How many arrays wait to be filled again."""
        with self._one_at_a_time:
            return sum(map(len, self._held.values()))
